//! What the triangles of a scene do to light.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::bsdf::Bsdf;
use crate::texture::TextureCoordinates;

/// The triangles of one mesh, which follow one another in the scene.
#[derive(Clone, Debug)]
pub struct MeshSurface {
    pub(super) name: String,
    pub(super) first_triangle: u32,
    pub(super) triangles: u32,
    pub(super) omitted_triangles: u32,
    pub(super) surface: Surface,
}

/// What a mesh does to light, and what that takes at the corners of its triangles.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    pub(super) bsdf: Arc<dyn Bsdf>,
    /// Texture coordinates at the corners of each triangle, where there is a texture.
    pub(super) texture: Option<Vec<[DVec2; 3]>>,
    /// The second set of texture coordinates there, where a texture uses it.
    pub(super) second_texture: Option<Vec<[DVec2; 3]>>,
    /// Normals at the corners of each triangle, on the side of the triangle's own; none where that is all there is, or
    /// all that the BSDF uses.
    pub(super) normals: Option<Vec<[DVec3; 3]>>,
    /// For each triangle, the area of all triangles up to it, square metres; for meshes that methods search, on which
    /// seeds are drawn.
    pub(super) areas: Option<Vec<f64>>,
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

    /// How many triangles of its file are not in the scene, because their corners lie on one line: no ray can meet
    /// them.
    pub fn omitted_triangles(&self) -> u32 {
        self.omitted_triangles
    }

    /// Whether its triangles refract or mirror light, so that specular methods search them.
    pub fn is_specular(&self) -> bool {
        self.surface.bsdf.as_delta().is_some()
    }

    /// Whether light goes through its triangles.
    pub(crate) fn is_dielectric(&self) -> bool {
        self.surface.bsdf.as_delta().is_some_and(|delta| delta.index_of_refraction().is_some())
    }

    /// The numbers of its triangles in the scene.
    pub fn triangle_range(&self) -> std::ops::Range<u32> {
        self.first_triangle..self.first_triangle + self.triangles
    }

    /// The normals at the corners of a triangle of the scene, where they are not the triangle's own.
    pub fn corner_normals(&self, triangle: u32) -> Option<&[DVec3; 3]> {
        Some(&self.surface.normals.as_ref()?[(triangle - self.first_triangle) as usize])
    }

    /// The texture coordinates at the corners of a triangle of the scene, where there is a texture.
    pub fn corner_texture_coordinates(&self, triangle: u32) -> Option<&[DVec2; 3]> {
        Some(&self.surface.texture.as_ref()?[(triangle - self.first_triangle) as usize])
    }

    /// The texture coordinates at a point of a triangle of the scene; zero where there is no texture.
    pub(super) fn texture_coordinates(&self, triangle: u32, [u, v]: [f64; 2]) -> TextureCoordinates {
        TextureCoordinates([&self.surface.texture, &self.surface.second_texture].map(|corners| {
            let Some(corners) = corners else { return DVec2::ZERO };
            let [a, b, c] = corners[(triangle - self.first_triangle) as usize];
            a * (1.0 - u - v) + b * u + c * v
        }))
    }
}
