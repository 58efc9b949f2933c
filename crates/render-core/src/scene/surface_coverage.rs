//! How much of the triangles of a scene is there.

use std::sync::Arc;

use super::mesh_surface::{MeshSurface, mesh_of};
use crate::geometry::Coverage;

/// The opacity of meshes.
#[derive(Debug)]
pub(super) struct SurfaceCoverage {
    meshes: Arc<[MeshSurface]>,
}

impl SurfaceCoverage {
    /// `None` where all of all meshes is there.
    pub(super) fn of(meshes: &Arc<[MeshSurface]>) -> Option<Self> {
        let is_partial = meshes.iter().any(|mesh| mesh.surface.opacity.is_some());
        is_partial.then(|| Self { meshes: meshes.clone() })
    }
}

impl Coverage for SurfaceCoverage {
    fn opacity(&self, triangle: u32, barycentric: [f64; 2]) -> f64 {
        let mesh = &self.meshes[mesh_of(&self.meshes, triangle) as usize];
        let opacity = mesh.surface.opacity.as_ref();
        opacity.map_or(1.0, |opacity| {
            opacity.at(mesh.texture_coordinates(triangle, barycentric), mesh.colour(triangle, barycentric).w)
        })
    }
}
