//! What a worker reports of a job's scene.

use clerestory_api::{BuildOutcome, LeaseId};

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
}
