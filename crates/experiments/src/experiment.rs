//! A comparison that can be measured.

use std::path::PathBuf;

use crate::error::ExperimentError;
use crate::files;
use crate::page::Heading;
use crate::report::Report;
use crate::session::Session;

/// A comparison that can be measured.
#[derive(Debug)]
pub struct Experiment {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, in a line.
    pub title: &'static str,
    /// What is measured, and how the paper measured it.
    pub(crate) question: &'static str,
    /// Its settings where the user gives none.
    pub defaults: Defaults,
    /// Measures it.
    pub(crate) run: fn(&mut Session) -> Result<Report, ExperimentError>,
}

/// Default settings of an experiment; a setting that the experiment does not have is `None`.
#[derive(Clone, Copy, Debug)]
pub struct Defaults {
    /// Render times, seconds.
    pub times: Option<&'static [f64]>,
    /// Independent renders of each variant.
    pub seeds: Option<u32>,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Samples in each pixel of the references.
    pub reference_samples: Option<u32>,
    /// Whether it renders images, which a farm can do.
    pub renders: bool,
}

impl Experiment {
    /// Measures it and writes the report. Returns the page and the JSON file.
    ///
    /// # Errors
    ///
    /// When a render fails, when a file cannot be written, or when the user interrupts.
    pub fn run(&self, session: &mut Session) -> Result<[PathBuf; 2], ExperimentError> {
        let report = (self.run)(session)?;
        let heading = Heading { name: self.name, title: self.title, question: self.question };
        files::write(&report, &heading, session)
    }
}
