//! `clerestory farm`: runs a coordinator and workers on this machine.

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::Args;

use crate::child::Environment;
use crate::connection::DEFAULT_LISTEN;
use crate::failure::Failure;
use crate::local_farm::{FarmPlan, LocalFarm, share_of_cores, share_of_memory};
use crate::numbers::{positive, whole};
use crate::output::print_line;
use crate::settings::DEFAULT_DATA;
use crate::shutdown::{self, Parent};
use crate::threads::ThreadCount;

/// Most workers of a farm on one machine; each is a process.
const MOST_WORKERS: usize = 256;

/// Most threads of all workers together.
const MOST_THREADS: usize = 4096;

/// Options of `clerestory farm`.
#[derive(Debug, Args)]
pub(crate) struct FarmArguments {
    /// Number of workers.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1..=MOST_WORKERS))]
    workers: usize,
    /// Threads of each worker [default: the cores, shared evenly].
    #[arg(long, value_name = "N")]
    threads: Option<ThreadCount>,
    /// Most memory of the scenes of each worker together, MiB [default: an even share of the machine's].
    #[arg(long, value_name = "N", env = "CLERESTORY_MEMORY_MIB", value_parser = positive)]
    memory_mib: Option<NonZeroU32>,
    /// Address on which the coordinator listens.
    #[arg(long, value_name = "HOST:PORT", default_value = DEFAULT_LISTEN, env = "CLERESTORY_LISTEN")]
    listen: String,
    /// Folder for the data of the coordinator.
    #[arg(long, value_name = "FOLDER", default_value = DEFAULT_DATA, env = "CLERESTORY_DATA")]
    data: PathBuf,
    /// File with the farm's token [env: CLERESTORY_TOKEN_FILE]; the token itself can be in CLERESTORY_TOKEN.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
}

pub(crate) async fn run(arguments: FarmArguments) -> Result<(), Failure> {
    let (workers, threads) = (arguments.workers, threads(&arguments)?);
    let stop = shutdown::token(Parent::None);
    let plan = FarmPlan {
        listen: arguments.listen,
        data: arguments.data,
        token_file: arguments.token_file,
        workers,
        threads,
        memory_mib: arguments.memory_mib.map(|mib| mib.get().into()).or_else(|| share_of_memory(workers)),
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

/// Threads of each worker.
fn threads(arguments: &FarmArguments) -> Result<usize, Failure> {
    let workers = arguments.workers;
    let Some(threads) = arguments.threads else { return Ok(share_of_cores(workers)) };
    let threads = threads.get().get();
    if workers * threads > MOST_THREADS {
        return Err(Failure::Usage(format!(
            "--workers {workers} with --threads {threads} each are {} threads: expected at most {MOST_THREADS} on \
             this machine",
            workers * threads
        )));
    }
    Ok(threads)
}
