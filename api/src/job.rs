//! Jobs as they are shown.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::{ContentHash, ConvergencePoint, Counters, JobId, NodeAddress, WorkerId};

/// Where a job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// No work has been given out yet.
    Queued,
    /// Being rendered.
    Running,
    /// Rendered; `stopped_by` says to what.
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

/// What ended a job that is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// All its samples are rendered.
    Samples,
    /// Its time limit has passed.
    Time,
    /// Its `target_mse` is reached.
    Mse,
    /// Its `target_estimated_mse` is reached.
    EstimatedMse,
}

impl StopReason {
    /// Its spelling on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Samples => "samples",
            Self::Time => "time",
            Self::Mse => "mse",
            Self::EstimatedMse => "estimated_mse",
        }
    }
}

/// A worker, and the name by which people know its machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct NamedWorker {
    /// Its identity.
    pub id: WorkerId,
    /// Its name.
    pub name: String,
}

/// The node that ended a job, since no machine could render it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct FailedNode {
    /// The node.
    pub node: NodeAddress,
    /// One worker of each machine that failed on it, the last one last.
    pub workers: Vec<NamedWorker>,
    /// What was wrong the last time.
    pub message: String,
}

/// Why a job is held: it gets no leases until it is released.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct JobHold {
    /// Since when.
    pub since_ms: i64,
    /// Why, in words.
    pub reason: String,
    /// The node with which workers died, if that is why.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<NodeAddress>,
    /// The workers that died, the last one last.
    #[serde(default)]
    pub workers: Vec<NamedWorker>,
    /// The content that is lost, if that is why: the job goes on when it is uploaded again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asset: Option<ContentHash>,
}

/// Why a job gets no leases though workers are there: none of them computes the bits that it began with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct BuildWait {
    /// Why, in words, with the two ways out.
    pub reason: String,
    /// The build of the last worker that computed these bits, if one is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub build: Option<String>,
    /// The name of that worker.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub machine: Option<String>,
}

/// A machine that could not build the job's scene. Another one tries it, and the job fails if that one cannot either.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct SceneRefusal {
    /// The worker.
    pub worker: NamedWorker,
    /// Its build.
    pub build: String,
    /// The place in the scene, its value, and what would be right.
    pub reason: String,
}

/// The present state of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobView {
    /// Its identity.
    pub id: JobId,
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub state: JobState,
    /// What ended it; absent unless it is done.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stopped_by: Option<StopReason>,
    /// Why it failed; absent unless it did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// The node that it failed on, and the workers; absent unless a node ended it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed_node: Option<FailedNode>,
    /// Why it is held; absent unless it is. A held job is `queued` or `running`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold: Option<JobHold>,
    /// Why it waits for a worker of another build; absent unless it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub waits_for_build: Option<BuildWait>,
    /// The machine that could not build its scene; absent unless one could not and no other has tried yet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_refusal: Option<SceneRefusal>,
    /// Its priority.
    pub priority: i32,
    /// Name of the integrator.
    pub integrator: String,
    /// Hash of the canonical scene.
    pub scene_hash: String,
    /// What light the chosen integrator cannot bring, in words; empty when nothing is missing.
    pub missing_light: Vec<String>,
    /// What light of small lights the chosen integrator leaves to chance, in words: it comes rarely, as single bright
    /// samples. Absent until a worker has built the scene and said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_to_chance: Option<Vec<String>>,
    /// Which method `auto` has chosen for which light, in words; empty for other integrators. Absent until a worker has
    /// built the scene and said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chosen_methods: Option<Vec<String>>,
    /// What is in imported files and not in the scene, or differs, in words. Absent until a worker has built the scene
    /// and said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub import_notes: Option<Vec<String>>,
    /// What the submitter assumed for a file of another program, in words.
    #[serde(default)]
    pub assumptions: Vec<String>,
    /// Number of frames.
    pub frames: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// Tiles in a frame, without the light plane.
    pub tiles: u32,
    /// Whether the film has a light plane, with as many samples as the pixels of the frame have.
    #[serde(default)]
    pub light_plane: bool,
    /// Whether its image has the layer `caustic`: light that glass or water sends to a surface.
    #[serde(default)]
    pub caustic: bool,
    /// Samples per pixel in a pass.
    pub samples_per_pass: u32,
    /// Passes that each tile gets at most.
    pub passes: u32,
    /// Passes up to which every tile has what it gets, and the error has been recorded.
    pub complete_passes: u32,
    /// Rounds recorded so far.
    pub rounds: u32,
    /// Workers that build its scene at the moment: they bring nothing until it is built.
    #[serde(default)]
    pub building_workers: u32,
    /// How far it is, 0 to 1: the fraction of its samples that is accepted, or of its time limit that has passed where
    /// that is more, but no more than the fraction of the first pass while that is not complete; 1 when it is done.
    /// With a target, its samples are those at which the error of the last round, falling as their inverse, would be
    /// there.
    pub progress: f64,
    /// Samples accepted so far, over all pixels and planes; those of an adaptive job's pilot are among them.
    pub samples: u64,
    /// Samples after which all of it is rendered, over all pixels and planes, counted like `samples`. Of an adaptive
    /// job these are the most that it can have, until its passes are shared out.
    #[serde(default)]
    pub total_samples: u64,
    /// Samples accepted each second, lately; absent while unknown or idle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples_per_second: Option<f64>,
    /// Estimated time until the job is done; absent while unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remaining_ms: Option<i64>,
    /// Time spent rendering what was accepted, summed over cores.
    pub core_ms: i64,
    /// Accepted nodes that were rendered again, because a worker that may have rendered them was found to be wrong, or
    /// because their stored bytes were lost or damaged.
    #[serde(default)]
    pub redone_nodes: u64,
    /// What was counted while rendering what was accepted.
    pub counters: Counters,
    /// Time limit, counted from `started_ms`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_limit_ms: Option<i64>,
    /// Mean squared error against the reference at which it ends, in squared units of radiance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_mse: Option<f64>,
    /// Mean squared standard error of the image at which it ends, in squared units of radiance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_estimated_mse: Option<f64>,
    /// Whether the passes of a round are shared out among the tiles by their noise.
    #[serde(default)]
    pub adaptive: bool,
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
