//! `clerestory cancel`: stop a job; what is complete is kept.

use crate::failure::Failure;
use crate::job_argument::OneJob;
use crate::output::{print_json, print_line};

pub(crate) async fn run(arguments: OneJob) -> Result<(), Failure> {
    let connection = arguments.connection.open()?;
    // The job is fetched before, because a second cancellation has the same answer as the first.
    let before = connection.client.job(arguments.job).await.map_err(|error| connection.failure(error))?;
    let job = connection.client.cancel_job(arguments.job).await.map_err(|error| connection.failure(error))?;
    if arguments.json {
        return print_json(&job);
    }
    let verb = if before.state.is_final() { "was already" } else { "is" };
    print_line(&format!("{} {verb} {}", job.id, job.state.name()))
}
