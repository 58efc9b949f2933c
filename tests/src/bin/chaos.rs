//! The long version of the farm's tests: jobs of all kinds on a farm under attack. Every image has to have the bits of
//! a render in one process.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use clerestory_tests::siege::{Durations, Plan, Siege};

/// Renders jobs on a farm whose processes are killed, stopped and suspended at random, whose disks fill up and fail,
/// whose clocks are stepped and whose connections are cut, and compares every image, bit for bit, with that of one
/// process.
#[derive(Parser)]
struct Arguments {
    /// How long, minutes, and at least until 200 processes have been killed or suspended and some job has shared out
    /// its passes and another had a target; the jobs that then run are waited for.
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
    /// Seed of the jobs, and of the blows and the pauses between them.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Two coordinators on PostgreSQL and S3, all of which are hit too, instead of one with its own files.
    #[arg(long)]
    servers: bool,
    /// Workers at the same time.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..))]
    workers: u8,
    /// Show the warnings and errors of all processes, of which there are many.
    #[arg(long)]
    log: bool,
}

/// Some sleeps are longer than a coordinator's claim of a film lasts, and than PostgreSQL lets a transaction wait.
const DURATIONS: Durations = Durations { pauses: [0.1, 1.2], away: 2.0, fault: 2.0, sleep: 12.0, long_sleeps: 8 };

/// Shortest and longest time between two blows where there are servers, seconds: when any of them is down, nothing goes
/// on.
const PAUSES_ON_SERVERS: [f64; 2] = [0.1, 4.0];

/// Fewest kills and suspensions.
const SUDDEN_BLOWS: u32 = 200;

/// Most passes of a job: with servers, there is hardly a second in which nobody is down.
const PASSES: usize = 21;
const PASSES_ON_SERVERS: usize = 6;

/// Longest time that a job may take, however often its farm is hit.
const PATIENCE: Duration = Duration::from_secs(600);

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
        patience: PATIENCE,
        log,
    };
    let start = Instant::now();
    let mut siege = Siege::lay(plan);
    let is_over = |siege: &Siege| {
        let is_late = start.elapsed().as_secs_f64() >= minutes * 60.0;
        is_late && siege.sudden() >= SUDDEN_BLOWS && siege.missing_rules().is_empty()
    };
    while !is_over(&siege) && siege.wrong().is_empty() {
        siege.wave();
        println!("{:.0} s: {}", start.elapsed().as_secs_f64(), siege.told());
    }
    siege.lift();
    println!("{:.0} s in all: {}", start.elapsed().as_secs_f64(), siege.told());
    for wrong in siege.wrong() {
        println!("WRONG: {wrong}");
    }
    let missing = siege.missing();
    for kind in &missing {
        println!("never happened, so that nothing is shown; give it more --minutes: {kind}");
    }
    if siege.wrong().is_empty() && missing.is_empty() {
        println!("every job is done, and every image has the bits that one process makes");
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
