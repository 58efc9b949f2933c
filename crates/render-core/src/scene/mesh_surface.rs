//! What the triangles of a scene do to light.

use std::sync::Arc;

use glam::{DVec2, DVec3, DVec4, Vec4};

use crate::bsdf::{Bsdf, Interior, Opacity};
use crate::geometry::Tangent;
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
    /// How much of it is there, where that is not all.
    pub(super) opacity: Option<Opacity>,
    /// Texture coordinates at the corners of each triangle, where there is a texture.
    pub(super) texture: Option<Vec<[DVec2; 3]>>,
    /// The second set of texture coordinates there, where a texture uses it.
    pub(super) second_texture: Option<Vec<[DVec2; 3]>>,
    /// Normals at the corners of each triangle, on the side of the triangle's own; none where that is all there is, or
    /// all that the BSDF uses.
    pub(super) normals: Option<Vec<[DVec3; 3]>>,
    /// The tangents at the corners of each triangle, where there is a normal map.
    pub(super) tangents: Option<Vec<[Tangent; 3]>>,
    /// Linear red, green, blue and opacity at the corners of each triangle; none where the mesh has none, or the BSDF
    /// does not use them.
    pub(super) colours: Option<Vec<[Vec4; 3]>>,
    /// For each triangle, the area of all triangles up to it, square metres; for meshes that methods search, on which
    /// seeds are drawn.
    pub(super) areas: Option<Vec<f64>>,
}

/// The mesh to which a triangle of the scene belongs.
pub(super) fn mesh_of(meshes: &[MeshSurface], triangle: u32) -> u32 {
    meshes.partition_point(|mesh| mesh.first_triangle <= triangle) as u32 - 1
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

    /// The body that its triangles bound, if they have an inside.
    pub fn interior(&self) -> Option<Interior> {
        self.surface.bsdf.interior()
    }

    /// Whether light goes straight through its triangles, and shadow rays with it.
    pub(super) fn is_straight(&self) -> bool {
        self.surface.bsdf.as_straight().is_some()
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
        self.surface.normals.as_ref()?.get((triangle - self.first_triangle) as usize)
    }

    /// One of the two sets of texture coordinates at the corners of a triangle of the scene, where a texture needs it.
    pub fn corner_texture_coordinates(&self, triangle: u32, set: usize) -> Option<&[DVec2; 3]> {
        let corners = if set == 0 { &self.surface.texture } else { &self.surface.second_texture };
        corners.as_ref()?.get((triangle - self.first_triangle) as usize)
    }

    /// The tangents at the corners of a triangle of the scene, where there is a normal map.
    pub(super) fn tangents(&self, triangle: u32) -> Option<&[Tangent; 3]> {
        Some(&self.surface.tangents.as_ref()?[(triangle - self.first_triangle) as usize])
    }

    /// Whether its vertices have colours, by which its material is multiplied.
    pub fn has_colours(&self) -> bool {
        self.surface.colours.is_some()
    }

    /// Linear red, green, blue and opacity that are interpolated at a point of a triangle of the scene; ones where the
    /// mesh has no colours.
    pub(super) fn colour(&self, triangle: u32, [v, w]: [f64; 2]) -> DVec4 {
        let Some(colours) = &self.surface.colours else { return DVec4::ONE };
        let [a, b, c] = colours[(triangle - self.first_triangle) as usize].map(|colour| colour.as_dvec4());
        a * (1.0 - v - w) + b * v + c * w
    }

    /// One set of texture coordinates at the corners of all triangles; none where no texture uses it.
    pub(super) fn texture_corners(&self, set: u32) -> &[[DVec2; 3]] {
        let sets = [&self.surface.texture, &self.surface.second_texture];
        sets[set as usize].as_deref().unwrap_or_default()
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
