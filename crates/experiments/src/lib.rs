//! Experiments: the comparisons of the papers, measured again by one command each.
//!
//! An [`Experiment`] renders embedded scenes with several variants of the integrators. It turns the measurements into a
//! report: JSON, CSV, OpenEXR images and a page with figures. The program around it provides a [`Host`], which shows
//! progress, writes files and passes renders on to a farm.
//!
//! - `scenes`, `variant`: the scenes, and the integrators with their settings;
//! - `reference`, `region`: images without bias, and parts of an image whose errors are stated apart;
//! - `measure`, `farm`, `snapshot`: renders for a time or a number of samples, here or on a farm;
//! - `comparison`: variants at equal time;
//! - `core_time`, `ratio`: renders for a time of one core, and ratios of their errors with intervals;
//! - [`pairs`]: scenes and lights on which `auto` is compared with single methods;
//! - `report`, `table`, `figure`, `page`, `files`: the report and its files.

mod adaptive;
mod basin_figure;
mod basins;
mod comparison;
mod core_time;
mod error;
mod experiment;
mod farm;
mod figure;
mod files;
mod fine_detail;
mod flicker;
mod host;
mod machine;
mod manifold;
mod measure;
mod page;
pub mod pairs;
mod panes;
mod pool;
pub mod ratio;
mod reference;
mod region;
mod regret;
mod report;
mod scenes;
mod selection;
mod session;
mod snapshot;
mod solvers;
mod table;
mod table1;
mod text;
mod triangles;
mod variant;

pub use error::{ExperimentError, HostError};
pub use experiment::{Defaults, Experiment};
pub use host::{Amount, Farm, FarmOrder, FarmRender, FarmView, Host};
pub use machine::Machine;
pub use session::{BuildScene, Session, Settings, Surroundings};

/// All experiments, in the order of the list.
pub const ALL: [&Experiment; 12] = [
    &solvers::EXPERIMENT,
    &table1::EXPERIMENT,
    &panes::EXPERIMENT,
    &selection::EXPERIMENT,
    &fine_detail::EXPERIMENT,
    &basins::EXPERIMENT,
    &manifold::EXPERIMENT,
    &pool::EXPERIMENT,
    &triangles::EXPERIMENT,
    &flicker::EXPERIMENT,
    &adaptive::EXPERIMENT,
    &regret::EXPERIMENT,
];

/// Finds an experiment by its name.
///
/// # Errors
///
/// The names that there are.
pub fn find(name: &str) -> Result<&'static Experiment, String> {
    ALL.into_iter().find(|experiment| experiment.name == name).ok_or_else(|| {
        let names: Vec<&str> = ALL.iter().map(|experiment| experiment.name).collect();
        format!("expected one of {}", names.join(", "))
    })
}
