//! References of pairs: a picture with its standard error for each, and an index that says how each was made.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use clerestory_film::{DecodeBudget, FrameImage};
use clerestory_render_core::document::SceneBundle;
use serde::{Deserialize, Serialize};

use super::Pair;
use crate::error::ExperimentError;
use crate::variant::file_name;

/// The file of the index in a folder of references.
pub const INDEX: &str = "references.json";

/// Memory that a reference may take when it is decoded.
const BUDGET: DecodeBudget = DecodeBudget { pixel_bytes: 1024 * 1024 * 3 * 4 };

/// All references of a folder, by the names of their pairs.
pub type Index = BTreeMap<String, StoredReference>;

/// How a reference was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredReference {
    /// Its picture, in the folder.
    pub file: String,
    /// The hash of the pair's scene, in the size of the picture.
    pub scene: String,
    /// The methods that rendered its halves.
    pub methods: [String; 2],
    /// Core seconds that each half took.
    pub core_seconds: [f64; 2],
    /// The weight of each half.
    pub weights: [f64; 2],
    /// Mean square of the standard error over the square of the mean.
    pub noise: f64,
    /// Standard error of the ratio of the means of both halves.
    pub mean_error: f64,
    /// The bias test of one half against the other.
    pub verdict: String,
    /// Whether the halves agree.
    pub agrees: bool,
}

/// The picture of a pair, and how it was made.
#[derive(Debug)]
pub struct Found {
    /// The picture with its standard error.
    pub image: FrameImage,
    /// How it was made.
    pub record: StoredReference,
}

/// The name of the picture of a pair.
pub fn picture_name(pair: &Pair) -> String {
    format!("{}.exr", file_name(pair.name))
}

/// The index of a folder; empty where there is none yet.
///
/// # Errors
///
/// When there is an index that cannot be read.
pub fn index(folder: &Path) -> Result<Index, ExperimentError> {
    let file = folder.join(INDEX);
    if !file.exists() {
        return Ok(Index::new());
    }
    let text = fs::read(&file).map_err(|source| ExperimentError::Read { file: file.clone(), source })?;
    serde_json::from_slice(&text).map_err(|source| ExperimentError::Index { file, source })
}

/// The reference of a pair, whose scene is `bundle`. `None` where the folder has none of this very scene.
///
/// # Errors
///
/// When the picture cannot be read, or is of another size.
pub fn find(folder: &Path, index: &Index, pair: &Pair, bundle: &SceneBundle) -> Result<Option<Found>, ExperimentError> {
    let is_of_scene = |record: &&StoredReference| record.scene == bundle.scene_hash().to_string();
    let Some(record) = index.get(pair.name).filter(is_of_scene) else { return Ok(None) };
    let file: PathBuf = folder.join(&record.file);
    let bytes = fs::read(&file).map_err(|source| ExperimentError::Read { file: file.clone(), source })?;
    let image = FrameImage::decode(&bytes, BUDGET).map_err(|source| ExperimentError::Image { file, source })?;
    Ok(Some(Found { image, record: record.clone() }))
}
