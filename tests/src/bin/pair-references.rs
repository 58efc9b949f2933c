//! Renders the references of the experiment `regret`. Each pair of a scene and its light has two halves by two methods,
//! which the bias test compares.
//!
//! ```text
//! tests/run build && target/release/pair-references
//! ```

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use clerestory_experiments::pairs::{ALL, Pair, SIZE, find, stored};
use clerestory_tests::pair_references::{Failure, store};
use indicatif::{ProgressBar, ProgressStyle};

/// Renders the references of the experiment `regret`, with their standard error.
#[derive(Parser)]
struct Arguments {
    /// The pairs; all of them, if none is given.
    #[arg(value_parser = pair)]
    pairs: Vec<&'static Pair>,
    /// Where they go.
    #[arg(long, default_value = "scenes/pairs")]
    folder: PathBuf,
    /// Core seconds of the first and of the second half.
    #[arg(long, value_delimiter = ',', default_value = "140,60")]
    seconds: Vec<f64>,
    /// Only those that the folder does not have for the scene as it is.
    #[arg(long)]
    missing: bool,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether the halves of all references agree.
fn run(arguments: &Arguments) -> Result<bool, Failure> {
    let Arguments { pairs, folder, seconds, missing } = arguments;
    let [first, second] = seconds[..] else { return Err("--seconds takes FIRST,SECOND".into()) };
    let chosen: Vec<&Pair> = if pairs.is_empty() { ALL.iter().collect() } else { pairs.clone() };
    let style = ProgressStyle::with_template("{msg} {wide_bar} {percent} % {elapsed} (about {eta} left)")?;
    let progress = ProgressBar::new(1000 * chosen.len() as u64).with_style(style);
    let mut all_agree = true;
    for (number, pair) in chosen.iter().enumerate() {
        progress.set_message(pair.name);
        let before = 1000 * number as u64;
        let is_there = *missing && stored::find(folder, &stored::index(folder)?, pair, &pair.bundle(SIZE)?)?.is_some();
        if !is_there {
            let told = |part: f64| progress.set_position(before + (part * 1000.0) as u64);
            let record = store(folder, pair, SIZE, [first, second], told)?;
            all_agree &= record.agrees;
            progress.suspend(|| println!("{}: noise {:.2e}; {}", pair.name, record.noise, record.verdict));
        }
        progress.set_position(before + 1000);
    }
    progress.finish_and_clear();
    Ok(all_agree)
}

/// A pair by its name.
fn pair(name: &str) -> Result<&'static Pair, String> {
    let names = || ALL.iter().map(|pair| format!("\"{}\"", pair.name)).collect::<Vec<_>>().join(", ");
    find(name).ok_or_else(|| format!("expected one of {}", names()))
}
