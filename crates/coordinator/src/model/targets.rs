//! Stop rules: what a complete round means for the end of its job.
//!
//! A job ends with its last round, at its time limit or at a target, whichever comes first. The store's clock decides
//! on the time limit. Targets are compared with the errors of complete rounds.

use clerestory_api::{ConvergencePoint, StopReason};
use clerestory_film::targets::{RoundError, Target};

/// The errors of a round that targets are compared with.
pub(crate) fn round_error(point: &ConvergencePoint) -> RoundError {
    let ConvergencePoint { samples_per_pixel, mse, corrected_mse, estimated_mse, .. } = *point;
    RoundError { samples_per_pixel, mse, corrected_mse, estimated_mse }
}

/// Why a job ends that has reached a target.
pub(crate) fn stop_reason(target: Target) -> StopReason {
    match target {
        Target::Mse => StopReason::Mse,
        Target::EstimatedMse => StopReason::EstimatedMse,
    }
}
