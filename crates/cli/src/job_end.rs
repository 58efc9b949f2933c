//! How a job ended.

use clerestory_api::{JobState, JobView, StopReason};

use crate::failure::Failure;
use crate::text::printable;

/// Why a job ended, in words that follow "done".
pub(crate) fn reason_text(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Samples => "all its samples are rendered",
        StopReason::Time => "its time is up",
        StopReason::Mse => "its target MSE is reached",
        StopReason::EstimatedMse => "its target estimated MSE is reached",
    }
}

/// Fails when a job ended without an image.
pub(crate) fn check_image(job: &JobView) -> Result<(), Failure> {
    match job.state {
        JobState::Failed => {
            let reason = job.failure.as_deref().unwrap_or("the coordinator gives no reason");
            Err(Failure::Job(format!("job {} failed: {}", job.id, printable(reason))))
        }
        JobState::Cancelled if job.samples == 0 => {
            Err(Failure::Job(format!("job {} was cancelled before anything was complete", job.id)))
        }
        _ => Ok(()),
    }
}

/// Fails when a job ended before it was done.
pub(crate) fn check_done(job: &JobView) -> Result<(), Failure> {
    check_image(job)?;
    match job.state {
        JobState::Cancelled => {
            Err(Failure::Job(format!("job {} was cancelled; its image is what was complete then", job.id)))
        }
        _ => Ok(()),
    }
}
