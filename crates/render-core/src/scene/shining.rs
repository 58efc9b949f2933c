//! Meshes of the scene that are lights.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;

use super::mesh_surface::MeshSurface;
use super::parts::SceneParts;
use crate::geometry::Coverage;
use crate::light::{Light, ShiningPicture, ShiningSurface};
use crate::settings::check::Quoted;
use crate::settings::limits::MAX_SHINING_TRIANGLES;
use crate::settings::{JsonPath, SceneError};
use crate::texture::Bitmaps;

/// The surfaces of all meshes that are lights, by the names of the meshes.
///
/// # Errors
///
/// When more triangles shine than a tree is built over.
pub(super) fn shining_surfaces(
    parts: SceneParts<'_>,
    bitmaps: &Bitmaps<'_>,
    meshes: &[MeshSurface],
    corners: &dyn Fn(u32) -> [DVec3; 3],
    coverage: Option<&Arc<dyn Coverage>>,
) -> Result<BTreeMap<String, Arc<ShiningSurface>>, SceneError> {
    let mut surfaces = BTreeMap::new();
    let shining = parts.shining();
    let named = meshes.iter().filter(|mesh| shining.contains_key(mesh.name()));
    let named: BTreeMap<&str, &MeshSurface> = named.map(|mesh| (mesh.name(), mesh)).collect();
    let mut triangles = 0;
    for (index, light) in parts.lights.iter().enumerate() {
        let Some(name) = light.mesh() else { continue };
        let mesh = named.get(name).expect("validation knows every mesh that is a light");
        if mesh.triangles == 0 {
            let root = JsonPath::Root;
            let lights = root.member("lights");
            let found = format!("mesh {}, none of whose triangles has an area", Quoted(name));
            let place = lights.element(index);
            let place = place.member(light.kind());
            return Err(SceneError::value(&place.member("mesh"), found, "a mesh with an area"));
        }
        triangles += mesh.triangles as usize;
        if triangles > MAX_SHINING_TRIANGLES {
            let root = JsonPath::Root;
            let lights = root.member("lights");
            let place = lights.element(index);
            let found = format!("mesh {}, with which {triangles} triangles shine", Quoted(name));
            let expected = format!(
                "at most {MAX_SHINING_TRIANGLES} triangles that shine; an import has none with \"lights\": false"
            );
            return Err(SceneError::value(&place.member(light.kind()).member("mesh"), found, expected));
        }
        let picture = light.texture().map(|texture| ShiningPicture {
            picture: texture.texture.build(texture.encoding, bitmaps),
            coordinates: mesh.texture_corners(texture.texture.coordinates).to_vec(),
        });
        let corners = mesh.triangle_range().map(corners).collect();
        let surface = ShiningSurface {
            first_triangle: mesh.first_triangle,
            corners,
            picture,
            coverage: coverage.filter(|_| mesh.surface.opacity.is_some()).cloned(),
        };
        surfaces.insert(name.to_owned(), Arc::new(surface));
    }
    Ok(surfaces)
}

/// For each mesh, the light that it is; empty where no mesh is one.
pub(super) fn lights_of_meshes(lights: &[Light], meshes: &[MeshSurface]) -> Vec<Option<u32>> {
    let mut of_meshes = Vec::new();
    for (index, light) in (0..).zip(lights) {
        let Some(triangles) = light.triangles() else { continue };
        of_meshes.resize(meshes.len(), None);
        // Of meshes that begin there the last: those before it have no triangles.
        let mesh = meshes.partition_point(|mesh| mesh.first_triangle <= triangles.start) - 1;
        of_meshes[mesh] = Some(index);
    }
    of_meshes
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::json;

    use super::*;
    use crate::document::malformed_scenes::valid_scene;
    use crate::document::{SceneBundle, SceneDescription};

    #[test]
    fn more_triangles_than_may_shine_are_refused_with_the_light_that_has_them() {
        let mut scene = valid_scene();
        scene["lights"][1] = json!({"mesh": {"name": "glow", "mesh": "floor", "radiance": [1, 1, 1]}});
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        let bundle = SceneBundle::from_parts(description, BTreeMap::new()).unwrap();
        let mut meshes = bundle.build_scene().unwrap().meshes().to_vec();
        meshes[0].triangles = MAX_SHINING_TRIANGLES as u32 + 1;
        let parts = bundle.description().parts();
        let error = shining_surfaces(parts, &Bitmaps::new(), &meshes, &|_| [DVec3::ZERO; 3], None).unwrap_err();
        assert_eq!(error.path(), "lights[1].mesh.mesh", "{error}");
        assert!(error.to_string().contains("1048577 triangles shine, must be at most 1048576"), "{error}");
    }
}
