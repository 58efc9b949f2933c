//! The scene of a job, for workers.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::{ContentHash, JobId};

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
    /// Whether the film has a light plane, whose tiles come after the others.
    #[serde(default)]
    pub light_plane: bool,
    /// Whether nodes have the layer `caustic`.
    #[serde(default)]
    pub caustic: bool,
    /// Passes that each tile gets.
    pub passes: u32,
}

/// A worker reports how building the scene of its lease's job ended, when the lease wants a report. The first built
/// scene of a job counts. Where the scene is refused, the coordinator takes the lease back.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneReport {
    /// The lease's fencing token.
    pub token: u64,
    /// How building ended.
    pub outcome: BuildOutcome,
}

/// Most characters of the reason of [`BuildOutcome::Refused`]. A coordinator refuses a longer one.
pub const LONGEST_REFUSAL: usize = 2000;

/// How building a scene ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BuildOutcome {
    /// The scene can be rendered.
    Built(BuiltScene),
    /// The scene cannot be built, for a reason that lies in the scene. The job fails when a second machine confirms it,
    /// or at once when no other machine could try. Of a job with accepted nodes it is a failure of the lease.
    Refused {
        /// What is wrong: the place in the scene, its value and what would be right. At most 2000 characters.
        reason: String,
    },
}

/// What is known of a scene once it is built.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BuiltScene {
    /// What light of small lights the integrator leaves to chance, in words. At most 1000 lines.
    pub left_to_chance: Vec<String>,
    /// Which method `auto` has chosen for which light, in words. At most 1000 lines.
    pub chosen_methods: Vec<String>,
    /// What is in imported files and not in the scene, or differs, in words. At most 100 lines of 300 characters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub import_notes: Vec<String>,
}
