//! How many distinct paths of light each method finds in a second, over fixed problems.
//!
//! Prints a line for each method and glass: paths, seconds, paths a second, height evaluations, solver calls, and a
//! hash of the light. The seconds are the shortest of some repetitions. Two states of the code can be compared where
//! paths and hash agree.
//!
//! ```text
//! cargo run --release -p clerestory-tests --bin paths-per-second -- --method fnee-complete --glass crown
//! ```

use std::fs;
use std::path::PathBuf;

use clap::Parser;
use clerestory_tests::connections::{GLASS, METHODS, problems, write_list};

/// Measures how many distinct paths of light a method finds in a second.
#[derive(Parser)]
struct Arguments {
    /// Only this method: fnee-complete, fnee-published or sms.
    #[arg(long)]
    method: Option<String>,
    /// Only this glass: crown, bump, cathedral or fine.
    #[arg(long)]
    glass: Option<String>,
    /// Camera samples whose random numbers are used at each point.
    #[arg(long, default_value_t = 16)]
    samples: u32,
    /// Repetitions, of which the fastest counts.
    #[arg(long, default_value_t = 3)]
    repetitions: u32,
    /// Folder for the lists of all paths.
    #[arg(long)]
    lists: Option<PathBuf>,
}

fn main() -> std::io::Result<()> {
    let arguments = Arguments::parse();
    let wanted = |name: &str, only: &Option<String>| only.as_deref().is_none_or(|only| only == name);
    println!("{:>15} {:>9} {:>6} {:>9} {:>9} heights solves light", "method", "glass", "paths", "seconds", "paths/s");
    for glass in GLASS.into_iter().filter(|name| wanted(name, &arguments.glass)) {
        let problems = problems(glass);
        for name in METHODS.into_iter().filter(|name| wanted(name, &arguments.method)) {
            let method = problems.method(name);
            let found = problems.solve(&*method, arguments.samples);
            let again = (1..arguments.repetitions).map(|_| problems.solve(&*method, arguments.samples).time);
            let seconds = again.fold(found.time, |least, time| least.min(time)).as_secs_f64();
            let paths = found.paths.len();
            let rate = paths as f64 / seconds;
            let (heights, solves) = (found.counters.height_evaluations, found.counters.solver_calls);
            println!(
                "{name:>15} {glass:>9} {paths:>6} {seconds:>9.5} {rate:>9.0} {heights} {solves} {:016x}",
                found.light
            );
            if let Some(folder) = &arguments.lists {
                fs::write(folder.join(format!("{name}-{glass}.txt")), write_list(&found.paths))?;
            }
        }
    }
    Ok(())
}
