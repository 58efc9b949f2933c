//! What workers report.

use clerestory_api::{WorkerActivity, WorkerId};

/// A heartbeat: the worker, the time, and what the worker does.
#[derive(Clone, Debug)]
pub(crate) struct Heartbeat {
    /// The worker.
    pub(crate) worker: WorkerId,
    /// Now.
    pub(crate) now_ms: i64,
    /// What it does.
    pub(crate) activity: WorkerActivity,
}
