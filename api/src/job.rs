//! Jobs: what is submitted, and what is shown.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};

use crate::{ContentHash, ConvergencePoint, JobId};

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
    /// Samples to render for each pixel; rounded up to whole passes.
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
    /// Milliseconds after the first lease at which no more work is given out, at most ten years; what is complete then is
    /// kept. The first pass is rendered in any case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_limit_ms: Option<i64>,
}

fn default_tile_size() -> u32 {
    64
}

/// Where a job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// No work has been given out yet.
    Queued,
    /// Being rendered.
    Running,
    /// Rendered, to its last pass or to its time limit.
    Done,
    /// Stopped by a user; what was complete is kept.
    Cancelled,
    /// Given up; `failure` says why.
    Failed,
}

impl JobState {
    /// Its spelling on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Done => "done",
            Self::Cancelled => "cancelled",
            Self::Failed => "failed",
        }
    }

    /// Whether nothing more will happen to the job.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Done | Self::Cancelled | Self::Failed)
    }
}

/// A job as it is now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobView {
    /// Its identity.
    pub id: JobId,
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub state: JobState,
    /// Why it failed; absent unless it did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// Its priority.
    pub priority: i32,
    /// Name of the integrator.
    pub integrator: String,
    /// Hash of the canonical scene.
    pub scene_hash: String,
    /// What light the chosen integrator cannot bring, in words; empty when nothing is missing.
    pub missing_light: Vec<String>,
    /// Number of frames.
    pub frames: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// Tiles in a frame.
    pub tiles: u32,
    /// Samples per pixel in a pass.
    pub samples_per_pass: u32,
    /// Passes that each tile gets.
    pub passes: u32,
    /// Passes up to which every tile is complete and the error has been recorded.
    pub complete_passes: u32,
    /// Rounds recorded so far.
    pub rounds: u32,
    /// How far it is, 0 to 1: the fraction of its samples that is accepted, or of its time limit that has passed where
    /// that is more, but no more than the fraction of the first pass while that is not complete; 1 when it is done.
    pub progress: f64,
    /// Camera samples accepted so far, over all pixels.
    pub samples: u64,
    /// Camera samples accepted each second, lately; absent while unknown or idle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples_per_second: Option<f64>,
    /// Estimated time until the job is done; absent while unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remaining_ms: Option<i64>,
    /// Time spent rendering what was accepted, summed over cores.
    pub core_ms: i64,
    /// What was counted while rendering what was accepted.
    pub counters: Counters,
    /// Time limit, counted from `started_ms`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_limit_ms: Option<i64>,
    /// The reference image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<ContentHash>,
    /// The last recorded point of the convergence series.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latest: Option<ConvergencePoint>,
    /// When it was submitted.
    pub created_ms: i64,
    /// When its first lease was given out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub started_ms: Option<i64>,
    /// When it reached its final state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finished_ms: Option<i64>,
}

/// Work counted while rendering. Every method counts the same way, so that their figures can be compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Counters {
    /// Evaluations of a height field (with or without derivatives) at one point.
    pub height_evaluations: u64,
    /// Starts of an iterative solver from one seed.
    pub solver_calls: u64,
    /// Solver calls that converged to an admissible path.
    pub converged: u64,
    /// Distinct solutions that entered an estimate.
    pub unique_solutions: u64,
    /// Trials spent on estimating inverse probabilities.
    pub trials: u64,
    /// Inverse-probability estimates cut off at the largest number of trials.
    pub truncated: u64,
    /// Rays traced against the scene.
    pub rays: u64,
    /// Camera samples rendered.
    pub samples: u64,
}

/// What a worker needs to render nodes of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobScene {
    /// The job.
    pub job: JobId,
    /// The canonical scene description.
    #[schema(value_type = Object)]
    pub scene: Value,
    /// Hash of the canonical scene and its assets; the worker's own must agree.
    pub scene_hash: String,
    /// Content hash of every asset, by the path as the scene writes it.
    pub assets: BTreeMap<String, ContentHash>,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// Passes that each tile gets.
    pub passes: u32,
}

/// How a preview is made from the film; by default as `clerestory render --png` makes it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema, IntoParams)]
#[serde(deny_unknown_fields, default)]
#[into_params(parameter_in = Query)]
pub struct PreviewQuery {
    /// `auto` (the default), or a number of stops between -32 and 32: radiance is multiplied by 2 to this power.
    #[schema(value_type = String)]
    #[param(value_type = String)]
    pub exposure: PreviewExposure,
    /// Curve from linear light to the display; `filmic` is the default.
    pub curve: ToneCurve,
}

/// How bright a preview is, written `auto` or as a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum PreviewExposure {
    /// As bright as a photograph of the same light would be.
    #[default]
    Auto,
    /// Radiance is multiplied by 2 to this power.
    Stops(f64),
}

impl TryFrom<String> for PreviewExposure {
    type Error = &'static str;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        match text.as_str() {
            "auto" => Ok(Self::Auto),
            text => text
                .parse()
                .map(Self::Stops)
                .map_err(|_| "neither `auto` nor a number, expected `auto` or a number of stops"),
        }
    }
}

impl From<PreviewExposure> for String {
    fn from(exposure: PreviewExposure) -> Self {
        match exposure {
            PreviewExposure::Auto => "auto".to_owned(),
            PreviewExposure::Stops(stops) => stops.to_string(),
        }
    }
}

/// Curve from linear light to the display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ToneCurve {
    /// The sRGB transfer function; brighter than 1 is clipped.
    Srgb,
    /// A filmic curve that rolls highlights off.
    #[default]
    Filmic,
}

/// Opens a browser session: the answer sets a cookie that stands for the token.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SessionRequest {
    /// The farm's token.
    pub token: String,
}
