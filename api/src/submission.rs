//! What is submitted: a scene and how it is to be rendered.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::ContentHash;

/// A request to render a scene. Every asset and the reference must have been uploaded before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JobSubmission {
    /// A short name, shown in lists; default: the scene's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The scene description, with all overrides applied.
    #[schema(value_type = Object)]
    pub scene: Value,
    /// Content hash of every asset that the scene names, by the path as the scene writes it.
    #[serde(default)]
    pub assets: BTreeMap<String, ContentHash>,
    /// Samples to render for each pixel, at most; rounded up to whole passes.
    pub samples_per_pixel: u32,
    /// Edge of a tile in pixels, 1 to 1024.
    #[serde(default = "default_tile_size")]
    pub tile_size: u32,
    /// Jobs of higher priority are served first; among equals, the older.
    #[serde(default)]
    pub priority: i32,
    /// An OpenEXR image of the same size that the error is measured against. It may have a standard-error layer, whose
    /// noise is then taken out of the error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<ContentHash>,
    /// Milliseconds after the first lease at which no more work is given out, at most ten years; what is complete then
    /// is kept. The first pass is rendered in any case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_limit_ms: Option<i64>,
    /// Mean squared error against the reference, in squared units of radiance, at which the job ends: at the first
    /// complete round at which that of every frame is no more. Where the reference has a standard-error layer, the
    /// error is `corrected_mse`, and the target must be above the mean square of that layer. Needs a reference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_mse: Option<f64>,
    /// Mean squared standard error of the image, `estimated_mse`, in squared units of radiance, at which the job ends:
    /// at the first complete round at which that of every frame is no more, from four blocks of samples in each pixel
    /// on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_estimated_mse: Option<f64>,
    /// Whether the passes of a round are shared out among the tiles by their noise, which a few more passes tell that
    /// are in no image. Only the noisiest tile then has `samples_per_pixel` samples, and no tile less than two blocks
    /// of them, or four with `target_estimated_mse`; so it must be more than that.
    #[serde(default)]
    pub adaptive: bool,
    /// What was assumed to make the scene of a file of another program, in words, for the job and its images. At most
    /// 100 lines of 300 characters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub assumptions: Vec<String>,
}

fn default_tile_size() -> u32 {
    64
}
