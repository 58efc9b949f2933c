//! Experiments: the comparisons of the papers, measured again by one command each.
//!
//! An [`Experiment`] renders scenes that are part of the program with several variants of the integrators and turns what
//! comes out into a [`report::Report`]: JSON, CSV, OpenEXR and a page with figures. What all of them need is in the modules
//! beside it: scenes ([`scenes`]), settings of the integrators ([`variant`]), references ([`mod@reference`]), parts of the
//! picture ([`region`]), rendering for a time or a number of samples ([`measure`]), and the comparison of variants at equal
//! time ([`comparison`]).

mod adaptive;
mod basin_figure;
mod basins;
mod comparison;
pub(crate) mod farm;
mod figure;
mod fine_detail;
mod flicker;
pub(crate) mod machine;
mod manifold;
mod measure;
mod page;
mod panes;
mod pool;
mod reference;
mod region;
mod report;
mod scenes;
mod selection;
pub(crate) mod session;
mod solvers;
mod table;
mod table1;
mod triangles;
mod variant;

use crate::failure::Failure;

pub(crate) use report::Report;
use session::Session;

/// A comparison that can be measured.
#[derive(Debug)]
pub(crate) struct Experiment {
    /// What it is called on the command line.
    pub(crate) name: &'static str,
    /// What it is, in a line.
    pub(crate) title: &'static str,
    /// What is measured, and how the paper measured it.
    pub(crate) question: &'static str,
    /// Its settings where the user gives none.
    pub(crate) defaults: Defaults,
    /// Measures it.
    pub(crate) run: fn(&mut Session) -> Result<Report, Failure>,
}

/// Settings of an experiment; those that it does not have are `None`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Defaults {
    /// Render times, seconds.
    pub(crate) times: Option<&'static [f64]>,
    /// Independent renders of each variant.
    pub(crate) seeds: Option<u32>,
    /// Pixels across and down.
    pub(crate) size: [u32; 2],
    /// Samples in each pixel of the references.
    pub(crate) reference_samples: Option<u32>,
    /// Whether it renders pictures, which a farm can do.
    pub(crate) renders: bool,
}

/// All experiments, in the order of the list.
pub(crate) const ALL: [&Experiment; 11] = [
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
];

/// Finds an experiment by its name; the error lists the names that there are.
pub(crate) fn find(name: &str) -> Result<&'static Experiment, String> {
    ALL.into_iter().find(|experiment| experiment.name == name).ok_or_else(|| {
        let names: Vec<&str> = ALL.iter().map(|experiment| experiment.name).collect();
        format!("expected one of {}", names.join(", "))
    })
}
