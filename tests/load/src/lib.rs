//! Load on a coordinator: how many nodes a second it leases, accepts and merges, and at what cost.
//!
//! A coordinator runs as a process of its own (`coordinator`). Simulated workers in this process (`worker`) call it as
//! real workers do, but upload noise (`partials`). `supply` submits jobs so that there is always work. After the
//! measured time it waits until every round is recorded. An accepted node counts as uploaded and not yet as merged;
//! `merging` measures the time between. `viewer` fetches previews. `measurement` makes a column of the report for each
//! number of workers. `ceilings` and `echo` measure the machine without a farm.

mod ceilings;
mod coordinator;
mod echo;
mod error;
mod file_system;
mod machine;
mod measurement;
mod merging;
mod partials;
mod process;
mod report;
mod run;
mod settings;
mod statistics;
mod supply;
mod tally;
mod viewer;
mod worker;

pub use error::{LoadError, report};
pub use report::Report;
pub use run::{clerestory, run};
pub use settings::Settings;
