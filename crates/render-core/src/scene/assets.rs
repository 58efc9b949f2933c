//! The files that a scene names: which they are, and what they may be called.

use std::collections::BTreeSet;

use super::description::{MeshSource, ProfileDescription, SceneDescription};

/// Names of all files that must be supplied with the scene.
pub fn asset_names(description: &SceneDescription) -> BTreeSet<&str> {
    asset_uses(description).into_iter().map(|(_, name)| name).collect()
}

/// All members that name a file, with their places, in the order of the scene file.
pub(super) fn asset_uses(description: &SceneDescription) -> Vec<(String, &str)> {
    let meshes = description.meshes.iter().enumerate().filter_map(|(index, mesh)| match &mesh.source {
        MeshSource::Ply { file } => Some((format!("meshes[{index}].source.ply.file"), file.as_str())),
        MeshSource::Obj { file } => Some((format!("meshes[{index}].source.obj.file"), file.as_str())),
        MeshSource::Inline { .. } | MeshSource::Waves(_) => None,
    });
    let profiles = description.panes.iter().enumerate().flat_map(|(index, pane)| {
        [("front", &pane.front), ("back", &pane.back)].into_iter().filter_map(move |(face, profile)| match profile {
            ProfileDescription::HeightMap { file, .. } => {
                Some((format!("panes[{index}].{face}.height_map.file"), file.as_str()))
            }
            _ => None,
        })
    });
    texture_uses(description).chain(meshes).chain(profiles).collect()
}

/// The files of all textures, with their places.
pub(super) fn texture_uses(description: &SceneDescription) -> impl Iterator<Item = (String, &str)> {
    description.materials.iter().filter_map(|(name, material)| {
        let (path, file) = material.texture()?;
        Some((format!("materials.{name}.{}.{path}", material.kind()), file))
    })
}
