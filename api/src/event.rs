//! Events: what a page that watches the farm is told, as server-sent events.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::{ConvergencePoint, JobId, JobView, WorkerView};

/// One server-sent event. Its `event:` line is the `type` of the body, its `data:` line the body as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Event {
    /// Sequence number, sent back as `Last-Event-ID` to resume after it: of a stored event its own, of a snapshot that
    /// of the last stored event before it. Absent for progress and workers, which are only true now.
    pub id: Option<i64>,
    /// What happened.
    pub body: EventBody,
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum EventBody {
    /// The present state of everything: the first event of a stream, and the next one of a listener that fell too far
    /// behind.
    Snapshot {
        /// All jobs, or the one that is watched.
        jobs: Vec<JobView>,
        /// All workers.
        workers: Vec<WorkerView>,
    },
    /// A job was submitted, or changed its state. Stored.
    Job {
        /// The job.
        job: Box<JobView>,
    },
    /// A round is complete. Stored.
    Round {
        /// The job.
        job: JobId,
        /// The point of its convergence series.
        point: ConvergencePoint,
    },
    /// A job has advanced. At most a few each second for a job.
    Progress {
        /// The job.
        job: Box<JobView>,
    },
    /// A worker registered, or what is known of it changed.
    Worker {
        /// The worker.
        worker: WorkerView,
    },
}

impl EventBody {
    /// The name in the `event:` line.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Snapshot { .. } => "snapshot",
            Self::Job { .. } => "job",
            Self::Round { .. } => "round",
            Self::Progress { .. } => "progress",
            Self::Worker { .. } => "worker",
        }
    }

    /// The job that it is about, if it is about one.
    pub fn job(&self) -> Option<JobId> {
        match self {
            Self::Job { job } | Self::Progress { job } => Some(job.id),
            Self::Round { job, .. } => Some(*job),
            Self::Snapshot { .. } | Self::Worker { .. } => None,
        }
    }
}
