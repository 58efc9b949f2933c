//! `clerestory release`: get a held job going again.

use crate::failure::Failure;
use crate::job_argument::OneJob;
use crate::output::{print_json, print_line};

pub(crate) async fn run(arguments: OneJob) -> Result<(), Failure> {
    let connection = arguments.connection.open()?;
    // The job is fetched before, because the answer does not say whether it was held.
    let before = connection.client.job(arguments.job).await.map_err(|error| connection.failure(error))?;
    let job = connection.client.release_job(arguments.job).await.map_err(|error| connection.failure(error))?;
    if arguments.json {
        return print_json(&job);
    }
    let verb = if before.hold.is_some() { "is released and" } else { "was not held; it is" };
    print_line(&format!("{} {verb} {}", job.id, job.state.name()))
}
