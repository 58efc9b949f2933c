//! Collects the triangles of a mesh.

use glam::DVec3;

/// Collects triangles.
#[derive(Default)]
pub(super) struct Triangles {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Triangles {
    /// Adds vertices, and returns the number of the first.
    pub(super) fn add_vertices(&mut self, vertices: impl IntoIterator<Item = DVec3>) -> u32 {
        let first = self.positions.len() as u32;
        self.positions.extend(vertices.into_iter().map(|vertex| vertex.to_array()));
        first
    }

    /// Adds a triangle.
    pub(super) fn add(&mut self, corners: [u32; 3]) {
        self.triangles.push(corners);
    }

    /// Adds two triangles between two edges that run side by side, the first on the left.
    pub(super) fn add_quadrilateral(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }
}
