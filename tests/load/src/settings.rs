//! The settings of a load.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

/// The build that simulated workers report.
pub(crate) const BUILD: &str = concat!("load-generator-", env!("CARGO_PKG_VERSION"));

/// Fraction of checked nodes: none, so that each node is uploaded once.
pub(crate) const CHECKED_FRACTION: f64 = 0.0;

/// What load is put on which coordinator.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The program `clerestory`.
    pub clerestory: PathBuf,
    /// Numbers of workers.
    pub workers: Vec<u32>,
    /// Measured time for each number.
    pub time: Duration,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// Nodes in a lease.
    pub nodes_per_lease: u32,
    /// Nodes a second that all workers together offer; `None` for as many as the coordinator takes.
    pub rate: Option<NonZeroU32>,
    /// Whether previews are fetched.
    pub watch: bool,
    /// Empty folder for the coordinator's data; `None` for a temporary one.
    pub data: Option<PathBuf>,
    /// Address of a PostgreSQL database for the coordinator.
    pub database: Option<String>,
    /// A bucket for the coordinator.
    pub object_store: Option<String>,
}
