//! The long version of the farm's tests: jobs of all kinds on a farm under attack. Every image has to have the bits of
//! a render in one process.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use clerestory_tests::chaos::{Chaos, Durations, Plan};

/// Renders jobs on a farm under attack, and compares every image, bit for bit, with that of one process. Processes are
/// killed, stopped and suspended at random. Disks fill up and fail, clocks are stepped, and connections are cut.
#[derive(Parser)]
struct Arguments {
    /// Minutes of attack. It lasts at least until 200 processes were killed or suspended, one job was adaptive, and
    /// another had a target. It then waits for the running jobs.
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
    /// Seed of the jobs, and of the faults and the pauses between them.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Two coordinators on PostgreSQL and S3, instead of one with its own files. The servers are targets too.
    #[arg(long)]
    servers: bool,
    /// Workers at the same time.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..))]
    workers: u8,
    /// Show the many warnings and errors of all processes.
    #[arg(long)]
    log: bool,
}

/// Some suspensions are longer than a film lease, and than PostgreSQL lets a transaction wait.
const DURATIONS: Durations = Durations { pauses: [0.1, 1.2], away: 2.0, fault: 2.0, sleep: 12.0, long_sleeps: 8 };

/// Shortest and longest time between two faults where there are servers, seconds. While one of them is down, the farm
/// waits.
const PAUSES_ON_SERVERS: [f64; 2] = [0.1, 4.0];

/// Fewest kills and suspensions.
const SUDDEN_FAULTS: u32 = 200;

/// Most passes of a job. With servers, there is hardly a second without a fault.
const PASSES: usize = 21;
const PASSES_ON_SERVERS: usize = 6;

/// Longest time for a job.
const TIMEOUT: Duration = Duration::from_secs(600);

fn main() -> ExitCode {
    let Arguments { minutes, seed, servers, workers, log } = Arguments::parse();
    let log = if log { "warn" } else { "off" };
    let pauses = if servers { PAUSES_ON_SERVERS } else { DURATIONS.pauses };
    let plan = Plan {
        seed,
        servers,
        workers: workers.into(),
        durations: Durations { pauses, ..DURATIONS },
        is_long: true,
        roughness: 1.0,
        passes: if servers { PASSES_ON_SERVERS } else { PASSES },
        timeout: TIMEOUT,
        log,
    };
    let start = Instant::now();
    let mut chaos = Chaos::start(plan);
    let is_over = |chaos: &Chaos| {
        let is_late = start.elapsed().as_secs_f64() >= minutes * 60.0;
        is_late && chaos.sudden_faults() >= SUDDEN_FAULTS && chaos.missing_rules().is_empty()
    };
    while !is_over(&chaos) && chaos.wrong().is_empty() {
        chaos.render_jobs();
        println!("{:.0} s: {}", start.elapsed().as_secs_f64(), chaos.summary());
    }
    chaos.recover_all();
    println!("{:.0} s in all: {}", start.elapsed().as_secs_f64(), chaos.summary());
    for wrong in chaos.wrong() {
        println!("WRONG: {wrong}");
    }
    let missing = chaos.missing();
    for kind in &missing {
        println!("never happened, so that nothing is shown; give it more --minutes: {kind}");
    }
    if chaos.wrong().is_empty() && missing.is_empty() {
        println!("every job is done, and every image has the bits that one process makes");
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
