//! Rounds of a film: complete, recorded, and leased to one coordinator.

use clerestory_api::StopReason;

use crate::model::node::Removed;

/// A round whose work is complete and that is to be recorded next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CompleteRound {
    /// The round.
    pub(crate) round: u32,
    /// Passes in every tile.
    pub(crate) passes: u32,
    /// Time spent up to here, summed over cores and frames.
    pub(crate) core_ms: i64,
    /// When the last node up to here was accepted.
    pub(crate) completed_ms: i64,
}

/// What recording a round has changed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct RecordedRound {
    /// Why the job has ended with it, if it has.
    pub(crate) stopped_by: Option<StopReason>,
    /// What lay beyond the job's last round.
    pub(crate) discarded: Removed,
}

/// What became of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FilmLease {
    /// The film is the claimant's.
    Held,
    /// Another coordinator holds it, and has to renew its lease until then.
    HeldElsewhere {
        /// When that lease ends.
        until_ms: i64,
    },
}
