//! `clerestory cancel`: stop a job; what is complete is kept.

use clap::Args;
use clerestory_api::JobId;

use crate::commands::jobs::parse_job;
use crate::connection::ConnectionArguments;
use crate::failure::Failure;
use crate::terminal::{print_json, print_line};

/// Options of `clerestory cancel`.
#[derive(Debug, Args)]
pub(crate) struct CancelArguments {
    /// The job.
    #[arg(value_parser = parse_job)]
    job: JobId,
    #[command(flatten)]
    connection: ConnectionArguments,
    /// Write the job as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) async fn run(arguments: CancelArguments) -> Result<(), Failure> {
    let connection = arguments.connection.open()?;
    let job = connection.client.cancel_job(arguments.job).await.map_err(|error| connection.failure(error))?;
    if arguments.json {
        return print_json(&job);
    }
    print_line(&format!("{} is {}", job.id, job.state.name()))
}
