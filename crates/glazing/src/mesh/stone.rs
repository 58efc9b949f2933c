//! Tracery: a slab with chamfered holes.

use glam::DVec2;

use super::sweep::at;
use super::triangles::Triangles;
use super::triangulate::triangulate;
use crate::plan::WindowPlan;

/// Adds the tracery of a window.
pub(super) fn add_stone(plan: &WindowPlan, triangles: &mut Triangles) {
    let Some(stone) = &plan.stone else { return };
    let half = 0.5 * stone.depth;
    let arris = half - stone.chamfer_depth;
    let face_holes: Vec<&[DVec2]> = stone.holes.iter().map(|hole| hole.face_outline.as_slice()).collect();
    let face = triangulate(&stone.outline, &face_holes);
    let corners = || std::iter::once(stone.outline.as_slice()).chain(face_holes.iter().copied()).flatten();
    let [back, front] = [-half, half].map(|z| triangles.add_vertices(corners().map(|&corner| at(corner, z))));
    for [a, b, c] in face {
        triangles.add([front + a, front + b, front + c]);
        triangles.add([back + a, back + c, back + b]);
    }
    let count = stone.outline.len() as u32;
    add_band(triangles, front, back, count);
    let mut start = count;
    for hole in &stone.holes {
        let count = hole.outline.len() as u32;
        // From the front face through both edges of the straight part to the back face.
        let mut rings = vec![front + start];
        if stone.chamfer_depth > 0.0 {
            for z in [arris, -arris] {
                rings.push(triangles.add_vertices(hole.outline.iter().map(|&corner| at(corner, z))));
            }
        }
        rings.push(back + start);
        rings.windows(2).for_each(|pair| add_band(triangles, pair[1], pair[0], count));
        start += count;
    }
}

/// Adds the band between two closed rings that run counterclockwise, of which the first is the upper one where the
/// stone is inside of them.
pub(super) fn add_band(triangles: &mut Triangles, upper: u32, lower: u32, count: u32) {
    for corner in 0..count {
        let next = (corner + 1) % count;
        triangles.add_quadrilateral([upper + corner, lower + corner, lower + next, upper + next]);
    }
}
