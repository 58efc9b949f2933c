//! The wall: a slab with one hole.

use glam::DVec2;

use super::stone::add_band;
use super::sweep::at;
use super::triangles::Triangles;
use super::triangulate::triangulate;
use crate::plan::WindowPlan;

/// Adds the wall of a window.
pub(super) fn add_wall(plan: &WindowPlan, triangles: &mut Triangles) {
    let Some(wall) = &plan.wall else { return };
    let [Some((inner_z, inner)), Some((outer_z, outer))] = [wall.hole.first(), wall.hole.last()] else { return };
    let mut faces = [0; 2];
    for (face, (z, hole)) in faces.iter_mut().zip([(*inner_z, inner), (*outer_z, outer)]) {
        let corners = wall.outline.iter().chain(hole);
        *face = triangles.add_vertices(corners.map(|&corner: &DVec2| at(corner, z)));
        for [a, b, c] in triangulate(&wall.outline, &[hole]) {
            let corners = if z > *outer_z { [a, b, c] } else { [a, c, b] };
            triangles.add(corners.map(|corner| *face + corner));
        }
    }
    let [front, back] = faces;
    let sides = wall.outline.len() as u32;
    add_band(triangles, front, back, sides);
    let count = inner.len() as u32;
    let mut rings = vec![front + sides];
    for (z, ring) in &wall.hole[1..wall.hole.len() - 1] {
        rings.push(triangles.add_vertices(ring.iter().map(|&corner| at(corner, *z))));
    }
    rings.push(back + sides);
    rings.windows(2).for_each(|pair| add_band(triangles, pair[1], pair[0], count));
}
