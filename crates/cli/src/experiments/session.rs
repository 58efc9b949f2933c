//! What an experiment works with: its settings, threads, the folder that it writes into, and the user who watches.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use rayon::ThreadPool;
use serde::Serialize;

use super::farm::Farm;
use crate::failure::Failure;
use crate::local_render::Control;
use crate::terminal::{Advance, Progress};

/// What the user can decide about an experiment.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Settings {
    /// Render times, seconds, ascending; empty where the experiment has none.
    pub(crate) times: Vec<f64>,
    /// Independent renders of each variant.
    pub(crate) seeds: u32,
    /// Pixels across and down.
    pub(crate) size: [u32; 2],
    /// Samples in each pixel of the references.
    pub(crate) reference_samples: u32,
    /// Threads that render in this process.
    pub(crate) threads: NonZeroUsize,
}

/// A running experiment.
pub(crate) struct Session {
    pub(crate) settings: Settings,
    /// Where its files go.
    pub(crate) folder: PathBuf,
    /// The threads that render.
    pub(crate) pool: ThreadPool,
    /// How it is stopped.
    pub(crate) control: Arc<Control>,
    /// The farm that renders instead.
    pub(crate) farm: Option<Farm>,
    progress: Progress,
    /// Steps of the whole experiment, and those done.
    steps: [u32; 2],
    /// What is being done.
    activity: String,
}

impl Session {
    pub(crate) fn new(
        settings: Settings,
        folder: PathBuf,
        pool: ThreadPool,
        control: Arc<Control>,
        farm: Option<Farm>,
    ) -> Self {
        let progress = Progress::new();
        Self { settings, folder, pool, control, farm, progress, steps: [1, 0], activity: String::new() }
    }

    /// Says of how many steps the experiment consists.
    pub(crate) fn plan(&mut self, steps: usize) {
        self.steps = [u32::try_from(steps).unwrap_or(u32::MAX).max(1), 0];
    }

    /// Says what begins.
    pub(crate) fn begin(&mut self, activity: String) {
        self.activity = activity;
        self.advance(0.0);
    }

    /// Shows how far the current step is, 0 to 1.
    pub(crate) fn advance(&mut self, fraction: f64) {
        let [steps, done] = self.steps;
        let fraction = (f64::from(done) + fraction.clamp(0.0, 1.0)) / f64::from(steps);
        let activity = Some(self.activity.clone());
        self.progress.show(&Advance { fraction: fraction.min(1.0), activity, ..Advance::default() });
    }

    /// Ends the current step with a line that stays.
    pub(crate) fn end(&mut self, line: &str) {
        self.steps[1] += 1;
        self.progress.note(line);
    }

    /// Writes a line that stays.
    pub(crate) fn note(&self, line: &str) {
        self.progress.note(line);
    }

    /// What is being done.
    pub(crate) fn activity(&self) -> &str {
        &self.activity
    }

    /// Where the user sees how far it is.
    pub(crate) fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Takes the progress bar away.
    pub(crate) fn finish(&self) {
        self.progress.finish();
    }

    /// A failure if the user has interrupted.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        if self.control.cancelled.load(Ordering::Relaxed) { Err(self.interrupted()) } else { Ok(()) }
    }

    /// The failure that an interruption is.
    pub(crate) fn interrupted(&self) -> Failure {
        let folder = self.folder.display();
        Failure::Job(format!("interrupted; references that were complete are kept in {folder} for the next time"))
    }
}
