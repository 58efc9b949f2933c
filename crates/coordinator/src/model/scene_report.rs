//! What workers report of a job's scene.

use clerestory_api::{BuildOutcome, JobId, LeaseId, WorkerId};
use serde::{Deserialize, Serialize};

/// How building the scene of a lease's job ended.
#[derive(Clone, Debug)]
pub(crate) struct SceneReport {
    /// The lease.
    pub(crate) lease: LeaseId,
    /// Its fencing token.
    pub(crate) token: u64,
    /// How building ended.
    pub(crate) outcome: BuildOutcome,
    /// Now.
    pub(crate) now_ms: i64,
    /// Workers without a heartbeat since then are not alive.
    pub(crate) alive_ms: i64,
}

/// The word of one machine that a scene cannot be built.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SceneRefusal {
    /// The worker.
    pub(crate) worker: WorkerId,
    /// Its name, which is the name of its machine.
    pub(crate) name: String,
    /// Its build.
    pub(crate) build: String,
    /// The place in the scene and its value.
    pub(crate) reason: String,
}

/// What a report on a scene has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SceneChange {
    /// The job has its chosen methods and its light left to chance.
    Built(JobId),
    /// The nodes of the lease are free for other workers.
    Freed(JobId),
    /// The job has failed.
    Failed(JobId),
}
