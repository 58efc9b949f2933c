//! What load is put on which coordinator.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

/// The build that simulated workers report.
pub(crate) const BUILD: &str = concat!("load-generator-", env!("CARGO_PKG_VERSION"));

/// Fraction of the nodes that the coordinator has rendered twice to compare them: each is brought once, so that what is brought and what is merged is
/// the same.
pub(crate) const CHECKED_FRACTION: f64 = 0.0;

/// What load is put on which coordinator.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The program `clerestory`.
    pub clerestory: PathBuf,
    /// Numbers of workers.
    pub workers: Vec<u32>,
    /// How long each is measured.
    pub time: Duration,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// Nodes in a lease.
    pub nodes_per_lease: u32,
    /// Nodes a second that all workers together offer; none for as many as the coordinator takes.
    pub rate: Option<NonZeroU32>,
    /// Whether the image is looked at all the while.
    pub watch: bool,
    /// Empty folder for the coordinator's data; none for a temporary one.
    pub data: Option<PathBuf>,
    /// Address of a PostgreSQL database for the coordinator.
    pub database: Option<String>,
    /// A bucket for the coordinator.
    pub object_store: Option<String>,
}
