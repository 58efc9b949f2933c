//! Errors of calls under a lease and of calls of a worker.

use clerestory_api::{LeaseId, WorkerId};

use crate::store::engine::error::StoreError;

/// A call under a lease failed, and changed nothing.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum LeaseError {
    /// There is no such lease.
    #[error("there is no lease {0}")]
    Unknown(LeaseId),
    /// The fencing token is not the lease's.
    #[error("the fencing token {0} is not that of the lease")]
    StaleToken(u64),
    /// It ran out.
    #[error("the lease has run out; its nodes went back to the queue")]
    Expired,
    /// It was given or taken back.
    #[error(
        "the lease was given back, or taken back because its work could not be used; its nodes went back to the queue"
    )]
    Returned,
    /// The job has ended.
    #[error("the job is not being rendered any more")]
    JobNotRunning,
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// A call of a worker failed.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum WorkerError {
    /// It never registered here, or has ended.
    #[error("there is no worker {0}")]
    Unknown(WorkerId),
    /// What it renders is wrong.
    #[error("the worker {worker} is quarantined: {reason}")]
    Quarantined {
        /// The worker.
        worker: WorkerId,
        /// Why.
        reason: String,
    },
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}
