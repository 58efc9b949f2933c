//! The files that a scene names: which they are, and what they may be called.

use std::collections::BTreeSet;

use super::description::{
    MaterialDescription, MeshSource, ProfileDescription, ReflectanceDescription, SceneDescription,
};
use crate::settings::JsonPath;
use crate::settings::SceneError;
use crate::settings::limits::MAX_NAME_BYTES;

/// Names of all files that must be supplied with the scene.
pub fn asset_names(description: &SceneDescription) -> BTreeSet<&str> {
    asset_uses(description).into_iter().map(|(_, name)| name).collect()
}

/// All members that name a file, with their places, in the order of the scene file.
pub(super) fn asset_uses(description: &SceneDescription) -> Vec<(String, &str)> {
    let materials = description.materials.iter().filter_map(|(name, material)| match material {
        MaterialDescription::Diffuse { reflectance: ReflectanceDescription::Texture { file } } => {
            Some((texture_path(name), file.as_str()))
        }
        _ => None,
    });
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
    materials.chain(meshes).chain(profiles).collect()
}

/// The place of a material's texture.
pub(super) fn texture_path(material: &str) -> String {
    format!("materials.{material}.diffuse.reflectance.texture.file")
}

/// Checks that a file lies beside the scene file or below it and has one name on every system: the name is also that
/// of an uploaded asset.
pub(super) fn check_asset_name(name: &str, path: &JsonPath<'_>) -> Result<(), SceneError> {
    let is_part = |part: &str| !part.is_empty() && part != "." && part != "..";
    let is_forbidden = |character: char| character.is_control() || matches!(character, '\\' | ':');
    if name.len() <= MAX_NAME_BYTES && name.split('/').all(is_part) && !name.chars().any(is_forbidden) {
        return Ok(());
    }
    let expected = format!(
        "a path relative to the scene file of at most {MAX_NAME_BYTES} bytes, with \"/\" between folders and without \
         \".\", \"..\", \"\\\" and \":\""
    );
    Err(SceneError::value(path, format_args!("\"{name}\""), expected))
}
