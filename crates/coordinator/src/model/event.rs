//! Stored events: each points at what has changed.

use clerestory_api::JobId;
use serde::{Deserialize, Serialize};

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum StoredKind {
    /// The job was submitted or changed its state.
    Job,
    /// A round was recorded.
    Round {
        /// The frame.
        frame: u32,
        /// The round.
        round: u32,
    },
}

/// An event as stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StoredEvent {
    /// Its sequence number.
    pub(crate) id: i64,
    /// The job.
    pub(crate) job: JobId,
    /// What happened.
    pub(crate) kind: StoredKind,
}
