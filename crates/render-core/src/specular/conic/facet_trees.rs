//! What `conic` looks meshes up in. The method makes it for the meshes of its scope, before the first sample.

use std::sync::OnceLock;

use super::{facet::Facet, facet_tree::FacetTree, neighbours::Neighbours};
use crate::math::simd::singles::prefetch;
use crate::scene::Scene;

/// For each mesh of a scene, its triangles by place and normal, and which of them share edges.
#[derive(Debug)]
pub(super) struct FacetTrees {
    meshes: Vec<OfMesh>,
}

#[derive(Debug, Default)]
struct OfMesh {
    tree: OnceLock<Option<FacetTree>>,
    neighbours: OnceLock<Neighbours>,
}

impl FacetTrees {
    /// Those of a scene, none of which are made yet.
    pub(super) fn new(scene: &Scene) -> Self {
        Self { meshes: scene.meshes().iter().map(|_| OfMesh::default()).collect() }
    }

    /// The triangles of a specular mesh by place and normal; `None` when it has none.
    pub(super) fn tree(&self, scene: &Scene, mesh: u32) -> Option<&FacetTree> {
        let range = scene.meshes()[mesh as usize].triangle_range();
        let build = || FacetTree::over(range, |triangle| facet(scene, mesh, triangle));
        self.meshes[mesh as usize].tree.get_or_init(build).as_ref()
    }

    /// Which triangles of a mesh share edges.
    pub(super) fn neighbours(&self, scene: &Scene, mesh: u32) -> &Neighbours {
        let range = scene.meshes()[mesh as usize].triangle_range();
        let find = || Neighbours::of(range, |triangle| facet(scene, mesh, triangle));
        self.meshes[mesh as usize].neighbours.get_or_init(find)
    }
}

/// A triangle of a mesh with the normals at its corners.
pub(super) fn facet(scene: &Scene, mesh: u32, triangle: u32) -> Facet {
    let interpolated = scene.meshes()[mesh as usize].corner_normals(triangle).copied();
    let normals = interpolated.unwrap_or_else(|| [scene.triangle_normal(triangle); 3]);
    Facet { corners: *scene.accelerator().corners(triangle), normals }
}

/// Tells the processor that a triangle of a mesh with its normals will be looked at soon.
pub(super) fn prefetch_facet(scene: &Scene, mesh: u32, triangle: u32) {
    let normals = scene.meshes()[mesh as usize].corner_normals(triangle);
    for corners in [Some(scene.accelerator().corners(triangle)), normals].into_iter().flatten() {
        prefetch(&corners[0].x);
        prefetch(&corners[2].z);
    }
}
