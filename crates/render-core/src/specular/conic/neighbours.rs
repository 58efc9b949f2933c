//! Which triangles of a mesh share an edge.

use std::ops::Range;

use glam::DVec3;

use super::facet::Facet;

/// No triangle.
const NONE: u32 = u32::MAX;

/// The neighbours of the triangles of a mesh.
#[derive(Clone, Debug)]
pub(crate) struct Neighbours {
    first: u32,
    /// Across the edges from the first corner to the second, the second to the third, and the third to the first.
    across: Vec<[u32; 3]>,
}

/// The ends of an edge, so that two triangles that share it have the same.
type Edge = [[u64; 3]; 2];

impl Neighbours {
    /// The neighbours of triangles by their numbers. Corners belong together where they are at the same place; of more
    /// than two triangles at an edge, the first two do.
    pub(crate) fn of(triangles: Range<u32>, facet: impl Fn(u32) -> Facet) -> Self {
        let first = triangles.start;
        let mut edges: Vec<(Edge, u32, u8)> = Vec::with_capacity(3 * triangles.len());
        for triangle in triangles.clone() {
            let corners = facet(triangle).corners.map(bits);
            for edge in 0..3u8 {
                let [from, to] = [corners[usize::from(edge)], corners[(usize::from(edge) + 1) % 3]];
                edges.push((if from < to { [from, to] } else { [to, from] }, triangle, edge));
            }
        }
        edges.sort_unstable();
        let mut across = vec![[NONE; 3]; triangles.len()];
        let mut rest = &edges[..];
        while let [(edge, triangle, side), behind @ ..] = rest {
            rest = behind;
            if let Some((_, other, others_side)) = behind.first().filter(|(next, ..)| next == edge) {
                across[(triangle - first) as usize][usize::from(*side)] = *other;
                across[(other - first) as usize][usize::from(*others_side)] = *triangle;
                let further = behind.iter().take_while(|(next, ..)| next == edge).count();
                rest = &behind[further..];
            }
        }
        Self { first, across }
    }

    /// The triangle across an edge, counted from that between the first two corners.
    pub(super) fn across(&self, triangle: u32, edge: usize) -> Option<u32> {
        Some(self.across[(triangle - self.first) as usize][edge]).filter(|&other| other != NONE)
    }
}

/// A place as numbers that can be compared; the two zeros are one.
fn bits(place: DVec3) -> [u64; 3] {
    (place + DVec3::ZERO).to_array().map(f64::to_bits)
}
