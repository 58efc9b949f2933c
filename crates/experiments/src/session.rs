//! What an experiment works with: its settings, threads and folder, and the host.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use clerestory_local_render::Control;
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::SceneError;
use rayon::ThreadPool;
use serde::Serialize;
use serde_json::Value;

use crate::error::ExperimentError;
use crate::host::Host;

/// What the user can decide about an experiment.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Render times, seconds, ascending; empty where the experiment has none.
    pub times: Vec<f64>,
    /// Independent renders of each variant.
    pub seeds: u32,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Samples in each pixel of the references.
    pub reference_samples: u32,
    /// Threads that render in this process.
    pub threads: NonZeroUsize,
}

/// A running experiment.
pub struct Session {
    pub(crate) settings: Settings,
    /// Where its files go.
    pub(crate) folder: PathBuf,
    /// Where the references of pairs are.
    pub(crate) references: PathBuf,
    /// The threads that render.
    pub(crate) pool: ThreadPool,
    /// Stops a render.
    pub(crate) control: Arc<Control>,
    /// Builds a scene, unless this machine lacks the memory for it.
    pub(crate) build_scene: BuildScene,
    /// The program that measures.
    pub(crate) build: &'static str,
    pub(crate) host: Box<dyn Host>,
    /// The convergence series of the jobs on a farm.
    pub(crate) series: Vec<Value>,
    /// Steps of the whole experiment, and those done.
    steps: [u32; 2],
    /// The current step.
    activity: String,
}

/// Builds a scene.
pub type BuildScene = fn(&SceneBundle) -> Result<PreparedScene, SceneError>;

/// The program around an experiment: what a [`Session`] is made of besides its settings.
pub struct Surroundings {
    /// Where files go.
    pub folder: PathBuf,
    /// Where the references of [`pairs`](crate::pairs) are.
    pub references: PathBuf,
    /// The threads that render.
    pub pool: ThreadPool,
    /// Stops a render.
    pub control: Arc<Control>,
    /// Builds a scene, unless this machine lacks the memory for it.
    pub build_scene: BuildScene,
    /// The program that measures, as images and reports name it.
    pub build: &'static str,
    /// Terminal, files and farm.
    pub host: Box<dyn Host>,
}

impl Session {
    /// Begins an experiment.
    pub fn new(settings: Settings, surroundings: Surroundings) -> Self {
        let Surroundings { folder, references, pool, control, build_scene, build, host } = surroundings;
        let (series, steps, activity) = (Vec::new(), [1, 0], String::new());
        Self { settings, folder, references, pool, control, build_scene, build, host, series, steps, activity }
    }

    /// Sets the number of steps of the experiment.
    pub(crate) fn plan(&mut self, steps: usize) {
        self.steps = [u32::try_from(steps).unwrap_or(u32::MAX).max(1), 0];
    }

    /// Begins a step.
    pub(crate) fn begin(&mut self, activity: String) {
        self.activity = activity;
        self.advance(0.0);
    }

    /// Shows how far the current step is, 0 to 1.
    pub(crate) fn advance(&mut self, fraction: f64) {
        let [steps, done] = self.steps;
        let fraction = (f64::from(done) + fraction.clamp(0.0, 1.0)) / f64::from(steps);
        self.host.show(fraction.min(1.0), &self.activity);
    }

    /// Ends the current step with a line that stays.
    pub(crate) fn end(&mut self, line: &str) {
        self.steps[1] += 1;
        self.host.note(line);
    }

    /// Writes a line that stays.
    pub(crate) fn note(&self, line: &str) {
        self.host.note(line);
    }

    /// The current step.
    pub(crate) fn activity(&self) -> &str {
        &self.activity
    }

    /// Fails if the user has interrupted.
    pub(crate) fn check(&self) -> Result<(), ExperimentError> {
        if self.control.cancelled.load(Ordering::Relaxed) { Err(self.interrupted()) } else { Ok(()) }
    }

    /// The failure of an interrupted experiment.
    pub(crate) fn interrupted(&self) -> ExperimentError {
        ExperimentError::Interrupted { folder: self.folder.clone() }
    }
}
