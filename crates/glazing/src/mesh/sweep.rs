//! Prisms along polylines.

use glam::{DVec2, DVec3};

use super::triangles::Triangles;

/// Largest lengthening of a section in a corner; beyond it the outer side is cut off.
const LARGEST_MITRE: f64 = 2.5;

/// Adds a prism with a convex section along a path in the plane of the window. A section has its first coordinate to
/// the left of the path and its second along z, and runs clockwise.
pub(super) fn add_sweep(triangles: &mut Triangles, path: &[DVec2], is_closed: bool, section: &[DVec2]) {
    let count = path.len();
    if count < 2 || section.len() < 3 {
        return;
    }
    let direction = |from: usize, to: usize| (path[to] - path[from]).normalize_or_zero();
    let size = section.len() as u32;
    let mut first = 0;
    for (index, &point) in path.iter().enumerate() {
        let before = if index > 0 { Some(index - 1) } else { is_closed.then_some(count - 1) };
        let after = if index + 1 < count { Some(index + 1) } else { is_closed.then_some(0) };
        let arriving = before.map(|before| direction(before, index));
        let leaving = after.map(|after| direction(index, after));
        let (arriving, leaving) = match (arriving, leaving) {
            (Some(arriving), Some(leaving)) => (arriving, leaving),
            (Some(only), None) | (None, Some(only)) => (only, only),
            (None, None) => return,
        };
        // The mitre: as far from the lines of both segments.
        let along = (arriving + leaving).normalize_or_zero();
        let left = along.perp() * (1.0 / along.dot(leaving)).clamp(1.0, LARGEST_MITRE);
        let ring = section.iter().map(|corner| (point + left * corner.x).extend(corner.y));
        let start = triangles.add_vertices(ring);
        if index == 0 {
            first = start;
        } else {
            add_ring(triangles, start - size, start, size);
        }
    }
    let last = first + size * (count as u32 - 1);
    if is_closed {
        add_ring(triangles, last, first, size);
    } else {
        for corner in 1..size - 1 {
            triangles.add([first, first + corner, first + corner + 1]);
            triangles.add([last, last + corner + 1, last + corner]);
        }
    }
}

/// Adds the sides between two sections.
fn add_ring(triangles: &mut Triangles, from: u32, to: u32, size: u32) {
    for corner in 0..size {
        let next = (corner + 1) % size;
        triangles.add_quadrilateral([from + corner, to + corner, to + next, from + next]);
    }
}

/// Adds a straight prism. Its section lies around the line between two points, at a distance from the glass.
pub(super) fn add_prism(triangles: &mut Triangles, [from, to]: [DVec2; 2], z: f64, section: &[DVec2]) {
    let moved: Vec<DVec2> = section.iter().map(|corner| *corner + DVec2::new(0.0, z)).collect();
    add_sweep(triangles, &[from, to], false, &moved);
}

/// A rectangle about a height, clockwise.
pub(super) fn rectangle(width: f64, [low, high]: [f64; 2]) -> Vec<DVec2> {
    let half = 0.5 * width;
    [[-half, low], [-half, high], [half, high], [half, low]].map(DVec2::from).to_vec()
}

/// A point of the window, at a distance from the middle of the glass.
pub(super) fn at(point: DVec2, z: f64) -> DVec3 {
    point.extend(z)
}
