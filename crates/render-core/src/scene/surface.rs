//! What the triangles of a scene do to light.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::Scene;
use super::texture::Texture;
use crate::geometry::SurfaceDifferential;
use crate::lanes::singles::prefetch;
use crate::optics::{Interface, interface::Normals};
use crate::specular::conic::{Facet, FacetTree, Neighbours};

/// The triangles of one mesh, which follow one another in the scene.
#[derive(Clone, Debug)]
pub struct MeshSurface {
    pub(super) name: String,
    pub(super) first_triangle: u32,
    pub(super) triangles: u32,
    pub(super) omitted_triangles: u32,
    pub(super) material: Material,
}

/// What a mesh does to light.
#[derive(Clone, Debug)]
pub(super) enum Material {
    /// It scatters light.
    Diffuse(Reflectance),
    /// It refracts or mirrors light.
    Smooth(SmoothMesh),
}

/// A smooth boundary.
#[derive(Clone, Debug)]
pub(super) struct SmoothMesh {
    pub(super) interface: Interface,
    /// Normals at the corners of each triangle, on the side of the triangle's own; none where that is all there is.
    pub(super) normals: Option<Vec<[DVec3; 3]>>,
    /// For each triangle, the area of all triangles up to it, square metres.
    pub(super) areas: Vec<f64>,
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

    /// Whether its triangles refract or mirror light.
    pub fn is_smooth(&self) -> bool {
        matches!(self.material, Material::Smooth(_))
    }

    /// Whether light goes through its triangles.
    pub(super) fn is_dielectric(&self) -> bool {
        matches!(&self.material, Material::Smooth(smooth) if matches!(smooth.interface, Interface::Dielectric { .. }))
    }

    /// The numbers of its triangles in the scene.
    pub fn triangle_range(&self) -> std::ops::Range<u32> {
        self.first_triangle..self.first_triangle + self.triangles
    }

    /// The reflectance at a point of a triangle of the scene; zero for what does not scatter light.
    pub(super) fn reflectance(&self, triangle: u32, barycentric: [f64; 2]) -> DVec3 {
        let Material::Diffuse(reflectance) = &self.material else { return DVec3::ZERO };
        match reflectance {
            Reflectance::Uniform(colour) => *colour,
            Reflectance::Textured { texture, corners } => {
                let [a, b, c] = corners[(triangle - self.first_triangle) as usize];
                let [u, v] = barycentric;
                texture.lookup(a * (1.0 - u - v) + b * u + c * v)
            }
        }
    }
}

impl SmoothMesh {
    fn normals(&self, triangle: u32) -> Option<&[DVec3; 3]> {
        self.normals.as_ref().map(|normals| &normals[triangle as usize])
    }
}

impl Scene {
    /// The mesh to which a triangle belongs.
    pub fn mesh_of(&self, triangle: u32) -> u32 {
        self.meshes().partition_point(|mesh| mesh.first_triangle <= triangle) as u32 - 1
    }

    /// What a triangle does to light if it is smooth.
    pub fn interface(&self, triangle: u32) -> Option<&Interface> {
        self.smooth(triangle).map(|(mesh, _)| &mesh.interface)
    }

    fn smooth(&self, triangle: u32) -> Option<(&SmoothMesh, u32)> {
        self.smooth_of(self.mesh_of(triangle), triangle)
    }

    fn smooth_of(&self, mesh: u32, triangle: u32) -> Option<(&SmoothMesh, u32)> {
        let mesh = &self.meshes()[mesh as usize];
        match &mesh.material {
            Material::Smooth(smooth) => Some((smooth, triangle - mesh.first_triangle)),
            Material::Diffuse(_) => None,
        }
    }

    /// The normals at a point of a triangle. The weights of its second and third corner are `barycentric`.
    pub fn normals(&self, triangle: u32, barycentric: [f64; 2]) -> Normals {
        let geometric = self.triangle_normal(triangle);
        let corners = self.smooth(triangle).and_then(|(mesh, index)| mesh.normals(index));
        let shading = corners.map_or(geometric, |[a, b, c]| {
            let [v, w] = barycentric;
            (*a * (1.0 - v - w) + *b * v + *c * w).normalize()
        });
        Normals { geometric, shading }
    }

    /// A triangle with the normals at its corners.
    pub(crate) fn facet(&self, triangle: u32) -> Facet {
        self.facet_of(self.mesh_of(triangle), triangle)
    }

    /// A triangle of a mesh with the normals at its corners.
    pub(crate) fn facet_of(&self, mesh: u32, triangle: u32) -> Facet {
        let interpolated = self.smooth_of(mesh, triangle).and_then(|(mesh, index)| mesh.normals(index)).copied();
        let normals = interpolated.unwrap_or_else(|| [self.triangle_normal(triangle); 3]);
        Facet { corners: *self.accelerator().corners(triangle), normals }
    }

    /// Tells the processor that a triangle of a mesh with its normals will be looked at soon.
    pub(crate) fn prefetch_facet(&self, mesh: u32, triangle: u32) {
        let normals = self.smooth_of(mesh, triangle).and_then(|(mesh, index)| mesh.normals(index));
        for corners in [Some(self.accelerator().corners(triangle)), normals].into_iter().flatten() {
            prefetch(&corners[0].x);
            prefetch(&corners[2].z);
        }
    }

    /// The triangles of a smooth mesh by place and normal, sorted when they are asked for first; `None` when it has none.
    pub(crate) fn facets(&self, mesh: u32) -> Option<&FacetTree> {
        let range = self.meshes()[mesh as usize].triangle_range();
        self.facet_trees[mesh as usize]
            .get_or_init(|| FacetTree::over(range, |triangle| self.facet_of(mesh, triangle)))
            .as_ref()
    }

    /// Which triangles of a mesh share edges, found when it is asked for first.
    pub(crate) fn neighbours(&self, mesh: u32) -> &Neighbours {
        let range = self.meshes()[mesh as usize].triangle_range();
        self.neighbours[mesh as usize].get_or_init(|| Neighbours::of(range, |triangle| self.facet_of(mesh, triangle)))
    }

    /// The surface around a point of a triangle.
    pub fn differential(&self, triangle: u32, position: DVec3, barycentric: [f64; 2]) -> SurfaceDifferential {
        let flat = [self.triangle_normal(triangle); 3];
        let normals = self.smooth(triangle).and_then(|(mesh, index)| mesh.normals(index)).unwrap_or(&flat);
        SurfaceDifferential::of_triangle(self.accelerator().corners(triangle), normals, position, barycentric)
    }

    /// A point on a smooth mesh, uniform over its area.
    pub fn sample_mesh(&self, mesh: u32, random: [f64; 3]) -> Option<DVec3> {
        let surface = &self.meshes()[mesh as usize];
        let Material::Smooth(smooth) = &surface.material else { return None };
        let target = smooth.areas.last()? * random[0];
        let index = smooth.areas.partition_point(|area| *area <= target).min(smooth.areas.len() - 1);
        let [a, b, c] = self.accelerator().corners(surface.first_triangle + index as u32);
        let root = random[1].sqrt();
        Some(*a * (1.0 - root) + *b * (root * (1.0 - random[2])) + *c * (root * random[2]))
    }
}
