//! How much a coordinator takes: the loads of docs/results/farm.md, one after the other, each on a SQLite file or a PostgreSQL server of its own.
//! It fails when a load fails, or a figure is not what it should be.
//!
//! ```text
//! tests/run build && target/release/load
//! ```

use std::fs;
use std::io;
use std::process::ExitCode;

use clap::Parser;
use clerestory_test_servers::Postgres;
use clerestory_tests::farm::clerestory;
use serde_json::Value;

/// What is asked of `clerestory bench farm`, numbers of workers and what else, and what should come of it. The hundredth part of some hundred leases would
/// be those of one short pause of the machine, and some seconds those in which a round more or less is merged: whose p99 or pace is judged is measured for longer.
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

/// Nodes that are leased, uploaded and merged, over load and drain.
const SUSTAINED_ON_SQLITE: Goal = ("sustained_per_second", Wanted::AtLeast(2000.0));

/// The same with PostgreSQL, which commits more slowly.
const SUSTAINED_ON_POSTGRES: Goal = ("sustained_per_second", Wanted::AtLeast(1500.0));

/// How long a worker waits for a lease while no more is asked of the coordinator than it can do.
const LEASE: Goal = ("claim/p99_ms", Wanted::Below(50.0));

/// That it does get so much of what is offered, nodes a second: whoever waits for an answer offers less. A tenth may be on its way, since partials
/// of a lease come while it is held.
const fn uploaded(offered: f64) -> Goal {
    ("uploaded_per_second", Wanted::AtLeast(0.9 * offered))
}

/// That it merges as much in the same time, and not when the load is over.
const fn merged(offered: f64) -> Goal {
    ("merged_per_second", Wanted::AtLeast(0.9 * offered))
}

/// Nodes whose lease ran out before they were answered, while there is work for all and no more is offered than it can do.
const LATE: Goal = ("late_nodes_under_load", Wanted::Below(1.0));

/// Whatever the load, every node that was acknowledged is in a round in the end, and none that was leased is refused.
const WHOLE: [Goal; 2] = [("lost_nodes", Wanted::Below(1.0)), ("refused_nodes", Wanted::Below(1.0))];

/// Most memory of the coordinator, so that a small machine is enough for it.
const MEMORY: Goal = ("coordinator_peak_megabytes", Wanted::Below(512.0));

/// How old an image is when it comes, also where it has been seen before.
const PREVIEW_AGE: Goal = ("preview_age/p99_ms", Wanted::Below(1000.0));

/// How old it gets before whoever looks at it sees the next.
const REPLACED_AGE: Goal = ("preview_replaced_age/p99_ms", Wanted::Below(1000.0));

/// None may fail: the age is that of those which came.
const FAILED_PREVIEWS: Goal = ("failed_previews", Wanted::Below(1.0));

/// Measures how much a coordinator takes, on SQLite and on PostgreSQL, and compares it with what it should.
#[derive(Parser)]
struct Arguments {}

fn main() -> ExitCode {
    let Arguments {} = Arguments::parse();
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("PostgreSQL is not ready: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether all loads succeed and all goals are reached.
fn run() -> io::Result<bool> {
    let on_sqlite = ON_SQLITE.iter().map(|load| (load, false));
    let on_postgres = ON_POSTGRES.iter().map(|load| (load, true));
    let (mut figures, mut failed) = (Vec::new(), Vec::new());
    for ((load, goals), is_on_postgres) in on_sqlite.chain(on_postgres) {
        let title = format!("{load}{}", if is_on_postgres { ", PostgreSQL" } else { "" });
        println!("\n== {title}");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("report.json");
        let mut command = clerestory();
        command.args(["bench", "farm", "--output"]).arg(&file);
        command.arg("--workers").args(load.split(' '));
        // One that those before had used would vacuum their tables meanwhile.
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

/// The greatest figure of all lines: of what should be large the best, since the goal is what the coordinator can sustain, and of what should be small
/// the worst. None where one is missing.
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
