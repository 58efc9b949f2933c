//! `clerestory jobs`: the jobs of a farm, newest first.

use clap::Args;
use clerestory_api::JobView;

use crate::connection::ConnectionArguments;
use crate::failure::Failure;
use crate::terminal::{print_json, print_line};

/// Options of `clerestory jobs`.
#[derive(Debug, Args)]
pub(crate) struct JobsArguments {
    #[command(flatten)]
    connection: ConnectionArguments,
    /// Write the list as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) async fn run(arguments: JobsArguments) -> Result<(), Failure> {
    let connection = arguments.connection.open()?;
    let jobs = connection.client.jobs().await.map_err(|error| connection.failure(error))?;
    if arguments.json {
        return print_json(&jobs);
    }
    print_line(&format!("{:<36}  {:<9}  {:>6}  {:>10}  {:<6}  {}", "JOB", "STATE", "DONE", "MSE", "METHOD", "NAME"))?;
    jobs.iter().try_for_each(|job| print_line(&row(job)))
}

fn row(job: &JobView) -> String {
    let mse = job.latest.as_ref().and_then(|point| point.mse.or(point.estimated_mse));
    let mse = mse.map_or_else(|| "-".to_owned(), |mse| format!("{mse:.3e}"));
    let (id, state, done) = (job.id.to_string(), job.state.name(), job.progress * 100.0);
    format!("{id:<36}  {state:<9}  {done:>5.1}%  {mse:>10}  {:<6}  {}", job.integrator, job.name)
}
