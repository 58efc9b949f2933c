//! `clerestory watch`: progress and rounds of a job until it ends.

use clap::Args;
use clerestory_api::{JobId, JobState, JobView};

use crate::commands::jobs::{parse_job, reason_text};
use crate::connection::ConnectionArguments;
use crate::failure::Failure;
use crate::follow::follow;
use crate::terminal::{Progress, print_json, print_line, printable};

/// Options of `clerestory watch`.
#[derive(Debug, Args)]
pub(crate) struct WatchArguments {
    /// The job.
    #[arg(value_parser = parse_job)]
    job: JobId,
    #[command(flatten)]
    connection: ConnectionArguments,
    /// Write the job as JSON when it ends.
    #[arg(long)]
    json: bool,
}

pub(crate) async fn run(arguments: WatchArguments) -> Result<(), Failure> {
    let connection = arguments.connection.open()?;
    let job = follow(&connection, arguments.job, &mut Progress::new()).await?;
    if arguments.json {
        print_json(&job)?;
    } else {
        let reason = job.stopped_by.map(|reason| format!(": {}", reason_text(reason))).unwrap_or_default();
        print_line(&format!("{} is {}{reason}", job.id, job.state.name()))?;
    }
    check_done(&job)
}

/// Turns a job that ended without an image into a failure.
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

/// Turns a job that ended before it was done into a failure.
pub(crate) fn check_done(job: &JobView) -> Result<(), Failure> {
    check_image(job)?;
    match job.state {
        JobState::Cancelled => {
            Err(Failure::Job(format!("job {} was cancelled; its image is what was complete then", job.id)))
        }
        _ => Ok(()),
    }
}
