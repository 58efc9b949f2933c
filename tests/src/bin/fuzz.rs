//! Files as strangers could have made them, read as a user's file is: glTF, OBJ with MTL, PLY and pictures.
//!
//! The files of a case that panics, hangs or takes too much memory are kept. They belong into `tests/data/fuzz/found`,
//! where the tests of each commit read them.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use clerestory_tests::fuzz::supervisor::{Plan, Plant, run, work};

/// Reads changed files until the time is over, and fails when one panics, hangs or takes too much memory.
#[derive(Parser)]
struct Arguments {
    /// How long.
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
    /// Seed of the cases.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Seconds for one case.
    #[arg(long, default_value_t = 30.0)]
    case_seconds: f64,
    /// Memory of a process, MiB.
    #[arg(long, default_value_t = 1024)]
    memory: u64,
    /// Where the files of cases with a fault go.
    #[arg(long, value_name = "FOLDER", default_value = "target/fuzz")]
    found: PathBuf,
    /// Plants a fault that has to be noticed.
    #[arg(long, value_enum)]
    plant: Option<Plant>,
    /// Runs the cases from this number on in this process.
    #[arg(long, hide = true)]
    first: Option<u64>,
}

/// Time between two lines of progress.
const PERIOD: Duration = Duration::from_secs(30);

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if let Some(first) = arguments.first {
        work(arguments.seed, first, arguments.plant);
        return ExitCode::SUCCESS;
    }
    let plan = Plan {
        seed: arguments.seed,
        time: Duration::from_secs_f64(60.0 * arguments.minutes),
        case_time: Duration::from_secs_f64(arguments.case_seconds),
        memory: arguments.memory << 20,
        found: arguments.found,
        plant: arguments.plant,
    };
    let own = std::env::current_exe().expect("this program has a place");
    let program = |first: u64| {
        let mut words = vec![own.display().to_string(), format!("--seed={}", plan.seed), format!("--first={first}")];
        words.extend(plan.plant.map(|plant| format!("--plant={plant:?}").to_lowercase()));
        words
    };
    let (start, mut told) = (Instant::now(), Instant::now());
    let tally = run(&plan, &program, &mut |tally| {
        if told.elapsed() >= PERIOD {
            told = Instant::now();
            println!("{:.0} s: {} cases, {} refused", start.elapsed().as_secs_f64(), tally.cases, tally.refused);
        }
    });
    println!("{} cases of seed {}, of which {} are refused", tally.cases, plan.seed, tally.refused);
    for finding in &tally.findings {
        println!("WRONG: case {} {}; its files: {}", finding.case, finding.what, finding.files.display());
    }
    if tally.findings.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
