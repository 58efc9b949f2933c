//! The state of a film from one visit of the round finalizer to the next.

use std::time::{Duration, Instant};

use crate::films::convergence::Reference;
use crate::model::{FilmLease, JobRecord};

/// Pause before the next visit after a failure that may pass, such as a full disk. It doubles with each failure.
const BACKOFF: Duration = Duration::from_millis(250);

/// Longest such pause.
const LONGEST_BACKOFF: Duration = Duration::from_secs(5);

/// The state of a film between two visits.
#[derive(Debug, Default)]
pub(super) struct FilmState {
    /// The last answer about the film's lease, and until when it holds.
    pub(super) lease: Option<(FilmLease, i64)>,
    /// The job's reference, once measured.
    pub(super) reference: Option<Reference>,
    /// Failures since the last success.
    pub(super) failures: u32,
    /// Time of the first visit after a failure.
    pub(super) backoff_until: Option<Instant>,
}

impl FilmState {
    /// Whether the pause after the last failure goes on.
    pub(super) fn is_backing_off(&self) -> bool {
        self.backoff_until.is_some_and(|until| Instant::now() < until)
    }

    /// Counts a failure, and answers the pause after it.
    pub(super) fn back_off(&mut self) -> Duration {
        let pause = BACKOFF.saturating_mul(1 << self.failures.min(5)).min(LONGEST_BACKOFF);
        self.failures = self.failures.saturating_add(1);
        self.backoff_until = Some(Instant::now() + pause);
        pause
    }
}

/// The version of a film. Everything that is read of one version belongs together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FilmVersion {
    pub(super) rounds: u32,
    pub(super) redone_nodes: u64,
    pub(super) shared_samples: Option<u64>,
}

impl FilmVersion {
    pub(super) fn of(job: &JobRecord) -> Self {
        Self { rounds: job.rounds, redone_nodes: job.redone_nodes, shared_samples: job.shared_samples }
    }
}
