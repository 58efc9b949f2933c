//! Rounds of a film: complete, recorded, and by which coordinator.

use clerestory_api::StopReason;

use crate::model::node::Removed;

/// The wave whose completion is to be recorded as the next round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CompleteRound {
    /// The round.
    pub(crate) round: u32,
    /// Passes in every tile.
    pub(crate) passes: u32,
    /// Time spent on everything up to here, summed over cores and frames.
    pub(crate) core_ms: i64,
    /// When the last node up to here was accepted.
    pub(crate) completed_ms: i64,
}

/// What recording a round has changed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct RecordedRound {
    /// Why it was the job's last, if it was.
    pub(crate) stopped_by: Option<StopReason>,
    /// What lay beyond the job's last round.
    pub(crate) discarded: Removed,
}

/// What became of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FilmLease {
    /// The film is the claimant's.
    Held,
    /// It is another coordinator's, which has to renew its claim until then.
    HeldElsewhere {
        /// When the claim of the other ends.
        until_ms: i64,
    },
}
