//! Load on a coordinator: how many nodes a second it leases, takes and merges, and what that costs.
//!
//! A coordinator runs as a process of its own, as for any farm. Simulated workers in this process ([`worker`]) speak to it as real ones do,
//! but bring noise ([`partials`]) instead of rendering. [`supply`] submits jobs so that there is always work, and afterwards waits until
//! every round of them is recorded: what is only accepted counts as uploaded, and not yet as merged; [`merging`] measures how long that takes. [`viewer`]
//! looks at the image meanwhile, if it is to. [`measurement`] makes a line of the report for each number of workers; beside them stands what the
//! machine does without a farm ([`ceilings`], [`echo`]).

mod ceilings;
mod echo;
mod file_system;
mod measurement;
mod merging;
mod partials;
mod process;
mod report;
mod statistics;
mod supply;
mod tally;
mod viewer;
mod worker;

use std::fs;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use crate::failure::Failure;
use ceilings::Ceilings;
use report::Report;

/// Fraction of the nodes that the coordinator has rendered twice to compare them: each is brought once, so that what is brought and what is merged is
/// the same.
const CHECKED_FRACTION: f64 = 0.0;

/// What load is put on which coordinator.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// Numbers of workers.
    pub(crate) workers: Vec<u32>,
    /// How long each is measured.
    pub(crate) time: Duration,
    /// Edge of a tile in pixels.
    pub(crate) tile_size: u32,
    /// Nodes in a lease.
    pub(crate) nodes_per_lease: u32,
    /// Nodes a second that all workers together offer; none for as many as the coordinator takes.
    pub(crate) rate: Option<NonZeroU32>,
    /// Whether the image is looked at all the while.
    pub(crate) watch: bool,
    /// Empty folder for the coordinator's data; none for a temporary one.
    pub(crate) data: Option<PathBuf>,
    /// Address of a PostgreSQL database for the coordinator.
    pub(crate) database: Option<String>,
    /// A bucket for the coordinator.
    pub(crate) object_store: Option<String>,
}

/// Measures all lines, one after the other, on one farm whose coordinator is started anew for each. When one fails, the report has those before
/// it, and the failure comes with it.
pub(crate) async fn run(settings: &Settings) -> Result<(Report, Result<(), Failure>), Failure> {
    let most = settings.workers.iter().copied().max().unwrap_or(0);
    process::allow_workers(most)?;
    let (folder, _temporary) = match &settings.data {
        Some(folder) => {
            check_empty(folder)?;
            (folder.clone(), None)
        }
        None => {
            let failure = |source| Failure::Write { file: std::env::temp_dir(), source };
            let made = tempfile::Builder::new().prefix("clerestory-bench-").tempdir().map_err(failure)?;
            (made.path().to_owned(), Some(made))
        }
    };
    let bare = folder.join("bare");
    fs::create_dir_all(&bare).map_err(|source| Failure::Write { file: bare.clone(), source })?;
    let ceilings = Ceilings::measure(&bare, settings.database.as_deref()).await?;
    fs::remove_dir_all(&bare).map_err(|source| Failure::Write { file: bare, source })?;
    let (mut lines, mut outcome) = (Vec::new(), Ok(()));
    for &workers in &settings.workers {
        match measurement::measure(settings, &folder, workers).await {
            Ok(line) => lines.push(line),
            Err(failure) => {
                outcome = Err(failure);
                break;
            }
        }
    }
    Ok((Report::new(settings, file_system::of(&folder), ceilings, lines), outcome))
}

/// The sizes of what is there would be taken for those of the load.
fn check_empty(folder: &PathBuf) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|source| Failure::Write { file: folder.clone(), source })?;
    let mut entries = fs::read_dir(folder).map_err(|source| Failure::Read { file: folder.clone(), source })?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(Failure::Usage(format!("--data {} is not empty: expected an empty folder", folder.display()))),
    }
}
