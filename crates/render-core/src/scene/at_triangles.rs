//! What the scene is at its triangles.

use glam::DVec3;

use super::build::Scene;
use super::mesh_surface::MeshSurface;
use crate::bsdf::{Bsdf, DeltaBsdf, Normals, SurfacePoint};
use crate::geometry::SurfaceDifferential;

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
            texture: mesh.texture_coordinates(triangle, barycentric),
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
            (*a * (1.0 - v - w) + *b * v + *c * w).normalize_or(geometric)
        });
        Normals { geometric, shading }
    }

    /// The surface around a point of a triangle.
    pub fn differential(&self, triangle: u32, position: DVec3, barycentric: [f64; 2]) -> SurfaceDifferential {
        let flat = [self.triangle_normal(triangle); 3];
        let normals = self.surface_of(triangle).corner_normals(triangle).unwrap_or(&flat);
        SurfaceDifferential::of_triangle(self.accelerator().corners(triangle), normals, position, barycentric)
    }

    /// A point on a specular mesh, uniform over its area.
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
