//! What the triangles of a scene do to light.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::Scene;
use crate::bsdf::{Bsdf, DeltaBsdf, Normals, SurfacePoint};
use crate::geometry::SurfaceDifferential;
use crate::lanes::singles::prefetch;
use crate::specular::conic::{Facet, FacetTree, Neighbours};

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
    /// Normals at the corners of each triangle, on the side of the triangle's own; none where that is all there is.
    pub(super) normals: Option<Vec<[DVec3; 3]>>,
    /// For each triangle, the area of all triangles up to it, square metres; for delta BSDFs, on which seeds are drawn.
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

    /// Whether its triangles refract or mirror light.
    pub fn is_smooth(&self) -> bool {
        self.surface.bsdf.is_delta()
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
    fn corner_normals(&self, triangle: u32) -> Option<&[DVec3; 3]> {
        Some(&self.surface.normals.as_ref()?[(triangle - self.first_triangle) as usize])
    }

    /// The texture coordinate at a point of a triangle of the scene; zero where there is no texture.
    fn texture_coordinate(&self, triangle: u32, [u, v]: [f64; 2]) -> DVec2 {
        let Some(corners) = &self.surface.texture else { return DVec2::ZERO };
        let [a, b, c] = corners[(triangle - self.first_triangle) as usize];
        a * (1.0 - u - v) + b * u + c * v
    }
}

impl Scene {
    /// The mesh to which a triangle belongs.
    pub fn mesh_of(&self, triangle: u32) -> u32 {
        self.meshes().partition_point(|mesh| mesh.first_triangle <= triangle) as u32 - 1
    }

    fn surface_of(&self, triangle: u32) -> &MeshSurface {
        &self.meshes()[self.mesh_of(triangle) as usize]
    }

    /// What a triangle does to light.
    pub fn bsdf(&self, triangle: u32) -> &dyn Bsdf {
        &*self.surface_of(triangle).surface.bsdf
    }

    /// What a triangle does to light that scatters into single directions.
    pub fn delta_bsdf(&self, triangle: u32) -> Option<&dyn DeltaBsdf> {
        self.bsdf(triangle).as_delta()
    }

    /// A point of a triangle. The weights of its second and third corner are `barycentric`.
    pub fn surface_point(&self, triangle: u32, barycentric: [f64; 2]) -> SurfacePoint {
        let mesh = self.surface_of(triangle);
        SurfacePoint {
            normals: self.normals_on(mesh, triangle, barycentric),
            texture: mesh.texture_coordinate(triangle, barycentric),
        }
    }

    /// The normals at a point of a triangle. The weights of its second and third corner are `barycentric`.
    pub fn normals(&self, triangle: u32, barycentric: [f64; 2]) -> Normals {
        self.normals_on(self.surface_of(triangle), triangle, barycentric)
    }

    fn normals_on(&self, mesh: &MeshSurface, triangle: u32, barycentric: [f64; 2]) -> Normals {
        let geometric = self.triangle_normal(triangle);
        let shading = mesh.corner_normals(triangle).map_or(geometric, |[a, b, c]| {
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
        let interpolated = self.meshes()[mesh as usize].corner_normals(triangle).copied();
        let normals = interpolated.unwrap_or_else(|| [self.triangle_normal(triangle); 3]);
        Facet { corners: *self.accelerator().corners(triangle), normals }
    }

    /// Tells the processor that a triangle of a mesh with its normals will be looked at soon.
    pub(crate) fn prefetch_facet(&self, mesh: u32, triangle: u32) {
        let normals = self.meshes()[mesh as usize].corner_normals(triangle);
        for corners in [Some(self.accelerator().corners(triangle)), normals].into_iter().flatten() {
            prefetch(&corners[0].x);
            prefetch(&corners[2].z);
        }
    }

    /// The triangles of a smooth mesh by place and normal, sorted when they are asked for first; `None` when it has
    /// none.
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
        let normals = self.surface_of(triangle).corner_normals(triangle).unwrap_or(&flat);
        SurfaceDifferential::of_triangle(self.accelerator().corners(triangle), normals, position, barycentric)
    }

    /// A point on a smooth mesh, uniform over its area.
    pub fn sample_mesh(&self, mesh: u32, random: [f64; 3]) -> Option<DVec3> {
        let surface = &self.meshes()[mesh as usize];
        let areas = surface.surface.areas.as_ref()?;
        let target = areas.last()? * random[0];
        let index = areas.partition_point(|area| *area <= target).min(areas.len() - 1);
        let [a, b, c] = self.accelerator().corners(surface.first_triangle + index as u32);
        let root = random[1].sqrt();
        Some(*a * (1.0 - root) + *b * (root * (1.0 - random[2])) + *c * (root * random[2]))
    }
}
