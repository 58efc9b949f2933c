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
    /// Passes that each tile gets.
    pub passes: u32,
}
