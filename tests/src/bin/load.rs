//! How much a coordinator takes: the loads of docs/results/farm.md, one after the other, each on a SQLite file or a
//! PostgreSQL server of its own. Fails when a load fails or a figure misses its goal.
//!
//! ```text
//! tests/run build && target/release/load
//! ```

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use clerestory_test_servers::Postgres;
use clerestory_tests::farm::program;
use clerestory_tests::load_page;
use serde_json::Value;

/// Options of `load-generator`, and the goals of the load. A load with a goal for a p99 or a rate is measured for
/// longer. Then one short pause of the machine does not decide.
type Load = (&'static str, &'static [Goal]);

const ON_SQLITE: &[Load] = &[
    ("10,100,1000,5000 --seconds 8", &[SUSTAINED_ON_SQLITE, MEMORY]),
    ("1000 --rate 1000 --seconds 30", &[LEASE, uploaded(1000.0), merged(1000.0), LATE]),
    ("1000 --rate 2000 --seconds 30", &[LEASE, uploaded(2000.0), merged(2000.0), LATE]),
    ("5000 --rate 1500 --seconds 30", &[MEMORY, uploaded(1500.0), merged(1500.0), LATE]),
    ("10,100 --tile 64 --seconds 8", &[]),
    ("10 --watch --seconds 8", &[PREVIEW_AGE, REPLACED_AGE, FAILED_PREVIEWS]),
];

const ON_POSTGRES: &[Load] = &[
    ("10,100,1000,5000 --seconds 8", &[SUSTAINED_ON_POSTGRES, MEMORY]),
    ("1000 --rate 1000 --seconds 30", &[LEASE, uploaded(1000.0), merged(1000.0), LATE]),
    ("1000 --rate 1500 --seconds 30", &[LEASE, uploaded(1500.0), merged(1500.0), LATE]),
    ("5000 --rate 1000 --seconds 30", &[MEMORY, uploaded(1000.0), merged(1000.0), LATE]),
    ("10 --watch --seconds 8", &[PREVIEW_AGE, REPLACED_AGE, FAILED_PREVIEWS]),
];

/// A figure in a line of the report, by the names of its fields, and what it should be.
type Goal = (&'static str, Wanted);

enum Wanted {
    AtLeast(f64),
    Below(f64),
}

/// Nodes a second that are leased, uploaded and merged, over load and drain.
const SUSTAINED_ON_SQLITE: Goal = ("sustained_per_second", Wanted::AtLeast(2000.0));

/// The same with PostgreSQL, which commits more slowly.
const SUSTAINED_ON_POSTGRES: Goal = ("sustained_per_second", Wanted::AtLeast(1500.0));

/// How long a worker waits for a lease while the coordinator can follow the load.
const LEASE: Goal = ("claim/p99_ms", Wanted::Below(50.0));

/// Uploaded nodes a second: nine tenths of the offered rate, since a worker that waits for an answer offers less.
const fn uploaded(offered: f64) -> Goal {
    ("uploaded_per_second", Wanted::AtLeast(0.9 * offered))
}

/// Nodes a second that are merged during the load.
const fn merged(offered: f64) -> Goal {
    ("merged_per_second", Wanted::AtLeast(0.9 * offered))
}

/// Nodes whose lease ran out before they were answered, while the coordinator can follow the load.
const LATE: Goal = ("late_nodes_under_load", Wanted::Below(1.0));

/// Under any load, every acknowledged node is in a round in the end, and no leased node is refused.
const WHOLE: [Goal; 2] = [("lost_nodes", Wanted::Below(1.0)), ("refused_nodes", Wanted::Below(1.0))];

/// Most memory of the coordinator, so that a small machine is enough for it.
const MEMORY: Goal = ("coordinator_peak_megabytes", Wanted::Below(512.0));

/// How old a preview is when it arrives.
const PREVIEW_AGE: Goal = ("preview_age/p99_ms", Wanted::Below(1000.0));

/// How old a preview gets before the next replaces it.
const REPLACED_AGE: Goal = ("preview_replaced_age/p99_ms", Wanted::Below(1000.0));

/// Previews that fail have no age, so none may fail.
const FAILED_PREVIEWS: Goal = ("failed_previews", Wanted::Below(1.0));

/// Measures how much a coordinator takes, on SQLite and on PostgreSQL, and compares it with what it should.
#[derive(Parser)]
struct Arguments {
    /// Write the page of results to this file.
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
}

fn main() -> ExitCode {
    let Arguments { page } = Arguments::parse();
    match run(page.as_deref()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("the loads cannot be measured: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether all loads succeed and all goals are reached.
fn run(page: Option<&Path>) -> io::Result<bool> {
    let on_sqlite = ON_SQLITE.iter().map(|load| (load, false));
    let on_postgres = ON_POSTGRES.iter().map(|load| (load, true));
    let (mut figures, mut failed, mut reports) = (Vec::new(), Vec::new(), Vec::new());
    for ((load, goals), is_on_postgres) in on_sqlite.chain(on_postgres) {
        let title = format!("{load}{}", if is_on_postgres { ", PostgreSQL" } else { "" });
        println!("\n== {title}");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("report.json");
        let mut command = program("load-generator");
        command.arg("--output").arg(&file);
        command.arg("--workers").args(load.split(' '));
        // A server of earlier loads would vacuum their tables during the measurement.
        let postgres = is_on_postgres.then(Postgres::start).transpose()?;
        if let Some(postgres) = &postgres {
            postgres.settle()?;
            command.args(["--database", &postgres.new_database()]);
        }
        let has_succeeded = command.status().is_ok_and(|status| status.success());
        // A load that fails may leave no report: its goals are missed.
        let report = fs::read(&file).ok().and_then(|json| serde_json::from_slice(&json).ok()).unwrap_or(Value::Null);
        figures.extend(WHOLE.iter().chain(*goals).map(|goal| (title.clone(), goal, greatest(&report, goal.0))));
        if !has_succeeded {
            failed.push(format!("{title}: the load failed"));
        } else if report["file_system"] == "tmpfs" {
            failed.push(format!(
                "{title}: temporary files are in memory, where a sync costs nothing: set TMPDIR to a folder on a disk"
            ));
        }
        reports.push(report);
    }
    if let Some(page) = page {
        fs::write(page, load_page::page(&reports))?;
    }
    println!("\n== goals");
    let mut is_good = failed.is_empty();
    for (title, (field, wanted), figure) in figures {
        let (is_reached, wanted) = match *wanted {
            Wanted::AtLeast(least) => (figure.is_some_and(|figure| figure >= least), format!("at least {least}")),
            Wanted::Below(limit) => (figure.is_some_and(|figure| figure < limit), format!("below {limit}")),
        };
        is_good &= is_reached;
        let figure = figure.map_or_else(|| "not measured".to_owned(), |figure| format!("{figure:.1}"));
        let verdict = if is_reached { "reached" } else { "missed" };
        println!("{title}: {field} {figure}, wanted: {wanted}: {verdict}");
    }
    for failure in failed {
        println!("{failure}");
    }
    Ok(is_good)
}

/// The greatest figure of all lines: the best of a rate and the worst of a latency. `None` where a line lacks it.
fn greatest(report: &Value, field: &str) -> Option<f64> {
    let pointer = format!("/{field}");
    let figure = |line: &Value| {
        // Latencies are 0 where none was measured, which is not short.
        let is_measured = field.split_once('/').is_none_or(|(latency, _)| line[latency]["count"].as_u64() > Some(0));
        line.pointer(&pointer).filter(|_| is_measured)?.as_f64()
    };
    let figures: Option<Vec<f64>> = report["lines"].as_array()?.iter().map(figure).collect();
    figures?.into_iter().max_by(f64::total_cmp)
}
