//! What the triangles of a scene reflect.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::texture::Texture;

/// The triangles of one mesh, which follow one another in the scene.
#[derive(Clone, Debug)]
pub struct MeshSurface {
    pub(super) name: String,
    pub(super) first_triangle: u32,
    pub(super) triangles: u32,
    pub(super) omitted_triangles: u32,
    pub(super) reflectance: Reflectance,
}

/// Diffuse reflectance over a mesh.
#[derive(Clone, Debug)]
pub(super) enum Reflectance {
    /// The same everywhere.
    Uniform(DVec3),
    /// A texture.
    Textured {
        /// The texture.
        texture: Arc<Texture>,
        /// Texture coordinates of the corners of each triangle.
        corners: Vec<[DVec2; 3]>,
    },
}

impl MeshSurface {
    /// The name of the mesh in the scene file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How many of its triangles are in the scene.
    pub fn triangles(&self) -> u32 {
        self.triangles
    }

    /// How many triangles of its file are not in the scene, because their corners lie on one line: no ray can meet them.
    pub fn omitted_triangles(&self) -> u32 {
        self.omitted_triangles
    }

    /// The reflectance at a point of a triangle of the scene.
    pub(super) fn reflectance(&self, triangle: u32, barycentric: [f64; 2]) -> DVec3 {
        match &self.reflectance {
            Reflectance::Uniform(colour) => *colour,
            Reflectance::Textured { texture, corners } => {
                let [a, b, c] = corners[(triangle - self.first_triangle) as usize];
                let [u, v] = barycentric;
                texture.lookup(a * (1.0 - u - v) + b * u + c * v)
            }
        }
    }
}
