//! The files that a scene names: which they are, and their bytes.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::description::{MeshSource, ProfileDescription};
use super::hash::ContentHash;
use super::parts::SceneParts;
use crate::settings::{AssetProblem, JsonPath};

/// The bytes of a file that a scene names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asset {
    hash: ContentHash,
    bytes: Arc<[u8]>,
}

impl Asset {
    /// An asset of these bytes.
    pub fn new(bytes: impl Into<Arc<[u8]>>) -> Self {
        let bytes = bytes.into();
        Self { hash: ContentHash::of(&bytes), bytes }
    }

    /// The hash of its bytes.
    pub fn hash(&self) -> ContentHash {
        self.hash
    }

    /// Its bytes.
    pub fn bytes(&self) -> &Arc<[u8]> {
        &self.bytes
    }
}

/// The files that a scene names, by their names.
pub type Assets = BTreeMap<String, Asset>;

/// The bytes of a file that the scene names.
pub(super) fn asset_bytes<'a>(assets: &'a Assets, name: &str) -> Result<&'a [u8], AssetProblem> {
    assets.get(name).map(|asset| &asset.bytes()[..]).ok_or(AssetProblem::Missing)
}

/// All members that name a file, with their places, in the order of the scene file.
pub(crate) fn asset_uses(parts: SceneParts<'_>) -> Vec<(String, &str)> {
    let meshes = parts.meshes.iter().enumerate().filter_map(|(index, mesh)| match &mesh.source {
        MeshSource::Ply { file } => Some((format!("meshes[{index}].source.ply.file"), file.as_str())),
        MeshSource::Obj { file } => Some((format!("meshes[{index}].source.obj.file"), file.as_str())),
        MeshSource::Inline { .. } | MeshSource::Waves(_) => None,
    });
    let profiles = parts.panes.iter().enumerate().flat_map(|(index, pane)| {
        [("front", &pane.front), ("back", &pane.back)].into_iter().filter_map(move |(face, profile)| match profile {
            ProfileDescription::HeightMap { file, .. } => {
                Some((format!("panes[{index}].{face}.height_map.file"), file.as_str()))
            }
            _ => None,
        })
    });
    texture_uses(parts).chain(meshes).chain(profiles).collect()
}

/// The files of all textures, with their places.
pub(super) fn texture_uses(parts: SceneParts<'_>) -> impl Iterator<Item = (String, &str)> {
    parts.materials.iter().filter_map(|(name, material)| {
        let (path, file) = material.texture()?;
        let root = JsonPath::Root;
        let materials = root.member("materials");
        let place = materials.member(name);
        Some((format!("{}.{path}", place.member(material.kind())), file))
    })
}
