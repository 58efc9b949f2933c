//! The bytes of the files that a scene names.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::hash::ContentHash;
use crate::settings::AssetProblem;

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

/// The bytes of a file that another refers to by its place beside it.
pub(super) fn beside<'a>(assets: &'a Assets, file: &str, uri: &str) -> Option<&'a [u8]> {
    let folder = file.rfind('/').map_or("", |end| &file[..=end]);
    assets.get(&format!("{folder}{uri}")).map(|asset| &asset.bytes()[..])
}
