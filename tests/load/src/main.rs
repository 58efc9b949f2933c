//! Puts a coordinator on this machine under load. Simulated workers lease nodes and upload noise. Prints rates, times
//! and sizes beside the speed of the bare machine.
//!
//! ```text
//! tests/run build && target/release/load-generator --workers 10,100,1000 -o load.json
//! ```

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use clap::builder::RangedU64ValueParser;
use clerestory_load::{LoadError, Settings, clerestory, report, run};

/// Most simulated workers: each has ports of its own, of which a machine has 65 536.
const MOST_WORKERS: u64 = 20_000;

/// Exit code for settings that cannot be used.
const USAGE: u8 = 2;

/// Puts a coordinator on this machine under load: simulated workers lease nodes and upload noise. Prints rates, times
/// and sizes beside the speed of the bare machine.
#[derive(Parser)]
struct Arguments {
    /// Connected workers, such as 10,1000: a column of the report for each.
    #[arg(
        long, value_name = "N", value_delimiter = ',', default_value = "10,100,1000,5000",
        value_parser = RangedU64ValueParser::<u32>::new().range(1..=MOST_WORKERS)
    )]
    workers: Vec<u32>,
    /// Measured time for each number of workers, seconds. A ramp comes before it, and the rest of the work after it.
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = seconds)]
    seconds: Duration,
    /// Edge of a tile in pixels.
    #[arg(
        long, value_name = "N", default_value_t = 16,
        value_parser = RangedU64ValueParser::<u32>::new().range(1..=256)
    )]
    tile: u32,
    /// Nodes in a lease.
    #[arg(
        long, value_name = "N", default_value_t = 16,
        value_parser = RangedU64ValueParser::<u32>::new().range(1..=256)
    )]
    nodes_per_lease: u32,
    /// Nodes a second that all workers together offer; each holds its leases as if it rendered [default: as many as the
    /// coordinator takes].
    #[arg(long, value_name = "NODES")]
    rate: Option<NonZeroU32>,
    /// Fetch the preview again and again, as the page of a job does; jobs are 1920 pixels wide and 1080 high.
    #[arg(long)]
    watch: bool,
    /// Empty folder for the data of the coordinator, on the disk to measure [default: a temporary one].
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
    /// Empty PostgreSQL database for the coordinator.
    #[arg(long, value_name = "URL")]
    database: Option<String>,
    /// Empty bucket, or prefix in one, for the coordinator.
    #[arg(long, value_name = "URL")]
    object_store: Option<String>,
    /// Write the report as JSON.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[tokio::main]
async fn main() -> ExitCode {
    let measured = tokio::select! {
        measured = measure(Arguments::parse()) => measured,
        () = interrupted() => Err(LoadError::Ended("interrupted".to_owned())),
    };
    match measured {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", report(&error));
            if matches!(error, LoadError::Usage(_)) { ExitCode::from(USAGE) } else { ExitCode::FAILURE }
        }
    }
}

/// Completes at a signal to end, so that its coordinator ends with it.
async fn interrupted() {
    use tokio::signal::unix::{SignalKind, signal};

    let Ok(mut terminate) = signal(SignalKind::terminate()) else { return std::future::pending().await };
    tokio::select! {
        _ = tokio::signal::ctrl_c() => {}
        _ = terminate.recv() => {}
    }
}

async fn measure(arguments: Arguments) -> Result<(), LoadError> {
    if let Some(file) = &arguments.output
        && let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir())
    {
        let problem = format!("--output {}: the folder {} does not exist", file.display(), folder.display());
        return Err(LoadError::Usage(problem));
    }
    let settings = Settings {
        clerestory: clerestory(),
        workers: arguments.workers,
        time: arguments.seconds,
        tile_size: arguments.tile,
        nodes_per_lease: arguments.nodes_per_lease,
        rate: arguments.rate,
        watch: arguments.watch,
        data: arguments.data,
        database: arguments.database,
        object_store: arguments.object_store,
    };
    let (report, outcome) = run(&settings).await?;
    println!("{}", report.table());
    arguments.output.map_or(Ok(()), |file| report.write(&file))?;
    outcome
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| *seconds > 0.0);
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    time.ok_or_else(|| "expected a positive number of seconds".to_owned())
}
