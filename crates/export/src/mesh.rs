//! The meshes of a scene as PLY files.

use clerestory_render_core::scene::Scene;
use glam::DVec3;

use crate::ply::{Corner, PlyMesh};

/// Mesh `index` of a scene, seen from an origin, with one of two sets of texture coordinates.
pub(crate) fn mesh(scene: &Scene, index: usize, set: usize, origin: DVec3) -> PlyMesh {
    let surface = &scene.meshes()[index];
    let first = surface.triangle_range().start;
    let has_normals = has_normals(scene, index);
    let mut mesh = PlyMesh::new(has_normals, surface.corner_texture_coordinates(first, set).is_some());
    for triangle in surface.triangle_range() {
        let positions = scene.accelerator().corners(triangle);
        let normals = surface.corner_normals(triangle);
        let texture = surface.corner_texture_coordinates(triangle, set);
        mesh.add([0, 1, 2].map(|corner| Corner {
            position: positions[corner] - origin,
            normal: normals.map(|normals| normals[corner]),
            texture: texture.map(|texture| texture[corner]),
        }));
    }
    mesh
}

/// Whether the corners of a mesh have normals. Without them its triangles are flat.
pub(crate) fn has_normals(scene: &Scene, index: usize) -> bool {
    let surface = &scene.meshes()[index];
    surface.corner_normals(surface.triangle_range().start).is_some()
}
