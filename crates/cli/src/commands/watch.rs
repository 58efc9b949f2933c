//! `clerestory watch`: progress and rounds of a job until it ends.

use clap::Args;
use clerestory_api::{JobId, JobState, JobView};

use crate::connection::ConnectionArguments;
use crate::failure::Failure;
use crate::follow::follow;
use crate::terminal::{Progress, print_json, print_line};

/// Options of `clerestory watch`.
#[derive(Debug, Args)]
pub(crate) struct WatchArguments {
    /// The job.
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
        print_line(&format!("{} is {}", job.id, job.state.name()))?;
    }
    check_not_failed(&job)
}

/// Turns a failed job into a failure.
pub(crate) fn check_not_failed(job: &JobView) -> Result<(), Failure> {
    match job.state {
        JobState::Failed => {
            let reason = job.failure.as_deref().unwrap_or("the coordinator gives no reason");
            Err(Failure::Job(format!("job {} failed: {reason}", job.id)))
        }
        _ => Ok(()),
    }
}
