//! `clerestory farm`: a coordinator and workers on this machine.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;

use crate::arguments::positive;
use crate::child::Environment;
use crate::commands::coordinator::DEFAULT_DATA;
use crate::commands::worker::cores;
use crate::connection::DEFAULT_LISTEN;
use crate::failure::Failure;
use crate::local_farm::{FarmPlan, LocalFarm};
use crate::shutdown::{self, Parent};
use crate::terminal::print_line;

/// Options of `clerestory farm`.
#[derive(Debug, Args)]
pub(crate) struct FarmArguments {
    /// Number of workers.
    #[arg(long, value_name = "N", default_value = "1", value_parser = positive::<NonZeroUsize>)]
    workers: NonZeroUsize,
    /// Threads of each worker [default: the cores, shared evenly].
    #[arg(long, value_name = "N", value_parser = positive::<NonZeroUsize>)]
    threads: Option<NonZeroUsize>,
    /// Address on which the coordinator listens.
    #[arg(long, value_name = "HOST:PORT", default_value = DEFAULT_LISTEN, env = "CLERESTORY_LISTEN")]
    listen: String,
    /// Where the coordinator keeps its data.
    #[arg(long, value_name = "FOLDER", default_value = DEFAULT_DATA, env = "CLERESTORY_DATA")]
    data: PathBuf,
    /// File with the farm's token [env: CLERESTORY_TOKEN_FILE]; the token itself can be in CLERESTORY_TOKEN.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
}

pub(crate) async fn run(arguments: FarmArguments) -> Result<(), Failure> {
    let stop = shutdown::token(Parent::None);
    let workers = arguments.workers.get();
    let plan = FarmPlan {
        listen: arguments.listen,
        data: arguments.data,
        token_file: arguments.token_file,
        workers,
        threads: arguments.threads.map_or_else(|| share_of_cores(workers), NonZeroUsize::get),
        logs: None,
        environment: Environment::Inherited,
    };
    let mut farm = LocalFarm::start(&plan).await?;
    print_line(farm.address())?;
    let broken = tokio::select! {
        failure = farm.broken() => Err(failure),
        () = stop.cancelled() => Ok(()),
    };
    farm.stop().await;
    broken
}

/// Threads for each of `workers` workers, so that together they use every core.
pub(crate) fn share_of_cores(workers: usize) -> usize {
    (cores().get() / workers).max(1)
}
