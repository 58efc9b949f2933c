//! Options of commands for one job.

use clap::Args;
use clerestory_api::JobId;

use crate::connection::ConnectionArguments;

/// Options of commands that change one job.
#[derive(Debug, Args)]
pub(crate) struct OneJob {
    /// The job.
    #[arg(value_parser = parse_job)]
    pub(crate) job: JobId,
    #[command(flatten)]
    pub(crate) connection: ConnectionArguments,
    /// Write the job as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Parses the identity of a job.
pub(crate) fn parse_job(text: &str) -> Result<JobId, String> {
    text.parse().map_err(|_| "expected the UUID of a job, as `clerestory jobs` lists them".to_owned())
}
