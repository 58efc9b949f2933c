//! `clerestory watch`: shows progress and rounds of a job until it ends.

use clap::Args;
use clerestory_api::JobId;

use crate::connection::ConnectionArguments;
use crate::failure::Failure;
use crate::follow::follow;
use crate::job_argument::parse_job;
use crate::job_end::{check_done, reason_text};
use crate::output::{print_json, print_line};
use crate::progress::Progress;

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
    let mut progress = Progress::new();
    let job = follow(&connection, arguments.job, &mut progress).await?;
    progress.assumptions(&job.assumptions);
    progress.import_notes(job.import_notes.as_deref().unwrap_or_default());
    if arguments.json {
        print_json(&job)?;
    } else {
        let reason = job.stopped_by.map(|reason| format!(": {}", reason_text(reason))).unwrap_or_default();
        print_line(&format!("{} is {}{reason}", job.id, job.state.name()))?;
    }
    check_done(&job)
}
