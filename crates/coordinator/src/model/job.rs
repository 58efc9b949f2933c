//! Jobs: what is submitted, where a job stands, and how it ends.

use std::collections::BTreeMap;

use clerestory_api::{BuiltScene, ContentHash, FailedNode, JobHold, JobId, JobState, StopReason};
use clerestory_film::counters::Counters;
use clerestory_film::{
    Adaptation, NodeAddress, PILOT_ROUND, PassRange, Rounds, Sampling, SamplingError, Targets, TileGrid,
};

use super::scene_report::SceneRefusal;

/// The methods that workers know which register a single digest. They read version 1 of the scene format.
const FIRST_METHODS: [&str; 6] = ["path", "cone", "fnee", "sms", "mnee", "conic"];

/// Whether workers that register a single digest can read a scene of this version with this method, and render all
/// layers of its film.
pub(crate) fn is_read_by_first(version: u32, method: &str, grid: &TileGrid) -> bool {
    version == 1 && FIRST_METHODS.contains(&method) && !grid.has_caustic
}

/// Builds that register a single digest ask all lights. Newer builds ask all of this number, and choose among more.
const MOST_ASKED: usize = 4;

/// Whether workers that register a single digest compute the same bits of a scene with this number of lights.
pub(crate) fn is_same_by_first(lights: usize) -> bool {
    lights <= MOST_ASKED
}

/// A job to be stored.
#[derive(Clone, Debug)]
pub(crate) struct NewJob {
    /// Its identity.
    pub(crate) id: JobId,
    /// Its name.
    pub(crate) name: String,
    /// Its priority.
    pub(crate) priority: i32,
    /// The canonical scene description.
    pub(crate) scene: String,
    /// Hash of the canonical scene.
    pub(crate) scene_hash: String,
    /// Name of the integrator.
    pub(crate) integrator: String,
    /// Whether workers of builds that register a single digest can read the scene.
    pub(crate) is_read_by_first: bool,
    /// Whether those compute the same bits as newer ones.
    pub(crate) is_same_by_first: bool,
    /// Light that the integrator cannot bring.
    pub(crate) missing_light: Vec<String>,
    /// What the submitter assumed for a file of another program.
    pub(crate) assumptions: Vec<String>,
    /// Size of the image and its tiles.
    pub(crate) grid: TileGrid,
    /// Samples per pixel in a pass.
    pub(crate) samples_per_pass: u32,
    /// Samples per pixel in a block.
    pub(crate) samples_per_block: u32,
    /// Passes that each tile gets at most.
    pub(crate) passes: u32,
    /// The reference image.
    pub(crate) reference: Option<ContentHash>,
    /// Time limit from the first lease on.
    pub(crate) time_limit_ms: Option<i64>,
    /// Errors at which it ends.
    pub(crate) targets: Targets,
    /// Whether its passes are shared out among the tiles by their noise.
    pub(crate) adaptive: bool,
    /// Assets by path.
    pub(crate) assets: BTreeMap<String, ContentHash>,
    /// When it was submitted.
    pub(crate) created_ms: i64,
}

/// A job as stored, without its scene.
#[derive(Clone, Debug)]
pub(crate) struct JobRecord {
    /// Its identity.
    pub(crate) id: JobId,
    /// Its name.
    pub(crate) name: String,
    /// Where it stands.
    pub(crate) state: JobState,
    /// What ended it.
    pub(crate) stopped_by: Option<StopReason>,
    /// Why it failed.
    pub(crate) failure: Option<String>,
    /// The node that it failed on.
    pub(crate) failed_node: Option<FailedNode>,
    /// Why it gets no leases.
    pub(crate) hold: Option<JobHold>,
    /// Its priority.
    pub(crate) priority: i32,
    /// Hash of the canonical scene.
    pub(crate) scene_hash: String,
    /// Name of the integrator.
    pub(crate) integrator: String,
    /// Light that the integrator cannot bring.
    pub(crate) missing_light: Vec<String>,
    /// What the submitter assumed for a file of another program.
    pub(crate) assumptions: Vec<String>,
    /// What a worker that built the scene has reported; `None` until then.
    pub(crate) built_scene: Option<BuiltScene>,
    /// The machine that refused to build the scene, while no other has confirmed it.
    pub(crate) scene_refusal: Option<SceneRefusal>,
    /// Number of frames.
    pub(crate) frames: u32,
    /// Size of the image and its tiles.
    pub(crate) grid: TileGrid,
    /// Samples per pixel in a pass.
    pub(crate) samples_per_pass: u32,
    /// Samples per pixel in a block.
    pub(crate) samples_per_block: u32,
    /// Passes that each tile gets.
    pub(crate) passes: u32,
    /// The reference image.
    pub(crate) reference: Option<ContentHash>,
    /// Build fingerprint that it is pinned to: a digest of the probe by the first worker that got a lease on it, empty
    /// if that worker sent none.
    pub(crate) probe_digest: Option<String>,
    /// Time limit from the first lease on.
    pub(crate) time_limit_ms: Option<i64>,
    /// Errors at which it ends.
    pub(crate) targets: Targets,
    /// Whether its passes are shared out among the tiles by their noise.
    pub(crate) adaptive: bool,
    /// Samples in its images, once passes have been shared out.
    pub(crate) shared_samples: Option<u64>,
    /// When it was submitted.
    pub(crate) created_ms: i64,
    /// When its first lease was granted.
    pub(crate) started_ms: Option<i64>,
    /// When it reached its final state.
    pub(crate) finished_ms: Option<i64>,
    /// When it had ended before it was reopened; it stays reopened until its lost nodes are back.
    pub(crate) reopened_ms: Option<i64>,
    /// Where the next pending rows are cut: round, frame, tile.
    pub(crate) cursor: [u32; 3],
    /// Recorded rounds.
    pub(crate) rounds: u32,
    /// Passes at the last recorded round.
    pub(crate) complete_passes: u32,
    /// Accepted nodes. The number rises with every change of the film.
    pub(crate) accepted_nodes: u64,
    /// Accepted nodes that were removed from the film, to be rendered again.
    pub(crate) redone_nodes: u64,
    /// Samples accepted.
    pub(crate) samples: u64,
    /// Time spent on them and on nodes that were rendered again, summed over cores.
    pub(crate) core_ms: i64,
    /// What was counted meanwhile.
    pub(crate) counters: Counters,
}

impl JobRecord {
    /// How its samples are grouped.
    pub(crate) fn sampling(&self) -> Result<Sampling, SamplingError> {
        Sampling::new(self.samples_per_pass, self.samples_per_block)
    }

    /// The round boundaries.
    pub(crate) fn boundaries(&self) -> Rounds {
        Rounds::new(self.passes)
    }

    /// How its passes are shared out among the tiles, or `None` when all get the same.
    pub(crate) fn adaptation(&self) -> Option<Adaptation> {
        let sampling = self.sampling().ok().filter(|_| self.adaptive)?;
        self.targets.adaptation(sampling, self.passes).ok()
    }

    /// Whether the work of a round cannot be cut yet, because its passes have to be shared out first.
    pub(crate) fn waits_for_shares(&self, round_passes: PassRange) -> bool {
        let fewest =
            self.adaptation().filter(|_| self.shared_samples.is_none()).map(|adaptation| adaptation.fewest_passes());
        fewest.is_some_and(|fewest| round_passes.first + round_passes.count > fewest)
    }

    /// Passes of the pilot that are work of a round.
    pub(crate) fn pilot_in(&self, round: u32) -> impl Iterator<Item = u32> + use<> {
        let adaptation = self.adaptation().filter(|_| round == PILOT_ROUND);
        adaptation.into_iter().flat_map(|adaptation| adaptation.pilot())
    }

    /// Samples in a pass over all tiles of all frames.
    pub(crate) fn pass_samples(&self) -> u64 {
        let planes = 1 + u64::from(self.grid.has_light_plane);
        planes * self.camera_pass_samples()
    }

    /// The same of the camera plane alone.
    fn camera_pass_samples(&self) -> u64 {
        u64::from(self.grid.width)
            * u64::from(self.grid.height)
            * u64::from(self.frames)
            * u64::from(self.samples_per_pass)
    }

    /// Samples in the whole job. Before passes are shared out, the most that it can have.
    pub(crate) fn total_samples(&self) -> u64 {
        let pilot_passes = self.adaptation().map_or(0, |adaptation| adaptation.pilot_passes());
        let in_images = self.shared_samples.unwrap_or(self.pass_samples() * u64::from(self.passes));
        in_images.saturating_add(self.camera_pass_samples() * u64::from(pilot_passes))
    }

    /// Samples in a node; 0 when there is no such tile.
    pub(crate) fn node_samples(&self, address: &NodeAddress) -> u64 {
        let pixels = self.grid.tile(address.tile).map_or(0, |tile| tile.pixels() as u64);
        (pixels * u64::from(self.samples_per_pass)) << address.level
    }

    /// Whether its time limit has passed and there is an image to end with. The first pass is rendered in any case.
    pub(crate) fn is_out_of_time(&self, now_ms: i64) -> bool {
        self.rounds > 0 && self.is_past_limit(now_ms)
    }

    /// Whether its time limit has passed.
    pub(crate) fn is_past_limit(&self, now_ms: i64) -> bool {
        match (self.started_ms, self.time_limit_ms) {
            // A reopened job passed its limit before, and its lost nodes are rendered however long that takes.
            _ if self.reopened_ms.is_some() => false,
            (Some(started_ms), Some(limit_ms)) => now_ms >= started_ms.saturating_add(limit_ms),
            _ => false,
        }
    }
}

/// How a job ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// Done, for this reason.
    Done(StopReason),
    /// Cancelled by a user.
    Cancelled,
    /// Given up, for this reason.
    Failed(String),
}

impl Ending {
    /// The state that a job has afterwards.
    pub(crate) fn state(&self) -> JobState {
        match self {
            Self::Done(_) => JobState::Done,
            Self::Cancelled => JobState::Cancelled,
            Self::Failed(_) => JobState::Failed,
        }
    }

    /// The stop rule that has ended it, if any.
    pub(crate) fn stopped_by(&self) -> Option<StopReason> {
        match self {
            Self::Done(reason) => Some(*reason),
            Self::Cancelled | Self::Failed(_) => None,
        }
    }

    /// Why it has failed.
    pub(crate) fn failure(&self) -> Option<&str> {
        match self {
            Self::Failed(reason) => Some(reason),
            Self::Done(_) | Self::Cancelled => None,
        }
    }
}
