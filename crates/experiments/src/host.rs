//! What an experiment needs of the program around it.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use clerestory_api::{ConvergencePoint, WorkerView};
use clerestory_film::FrameImage;
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::scene::Asset;

use crate::error::HostError;

/// The program around an experiment. It owns the terminal, the file system and the connection to a farm.
pub trait Host: Send {
    /// Shows how far the experiment is, 0 to 1, and what it does.
    fn show(&mut self, fraction: f64, activity: &str);

    /// Writes a line that stays.
    fn note(&self, line: &str);

    /// Writes a file whole or not at all.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    fn write(&self, file: &Path, content: &[u8]) -> Result<(), HostError>;

    /// The farm that renders instead of this process, if there is one.
    fn farm(&mut self) -> Option<&mut dyn Farm>;
}

/// A farm that renders for an experiment, as ordinary jobs.
pub trait Farm {
    /// Renders a scene; `None` when the user interrupted.
    ///
    /// # Errors
    ///
    /// When the farm refuses the job, fails it, or does not answer.
    fn render(&mut self, order: &FarmOrder<'_>) -> Result<Option<FarmRender>, HostError>;

    /// The farm as a report describes it.
    ///
    /// # Errors
    ///
    /// When the farm does not answer.
    fn view(&self) -> Result<FarmView, HostError>;
}

/// How much a job renders.
#[derive(Clone, Copy, Debug)]
pub enum Amount {
    /// Samples in each pixel.
    Samples(u32),
    /// Seconds of rendering.
    Seconds(f64),
}

/// A job for a farm.
pub struct FarmOrder<'a> {
    /// The name of the job.
    pub name: &'a str,
    /// The scene.
    pub bundle: &'a SceneBundle,
    /// How much is rendered.
    pub amount: Amount,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// The image that the farm measures the error against at each round.
    pub reference: Option<&'a Asset>,
    /// Whether the user has interrupted.
    pub cancelled: &'a AtomicBool,
}

/// A job that a farm has rendered.
pub struct FarmRender {
    /// Its image.
    pub image: FrameImage,
    /// Seconds from the first lease to the end.
    pub wall_seconds: f64,
    /// Core seconds of all workers.
    pub core_seconds: f64,
    /// Its errors at each round.
    pub points: Vec<ConvergencePoint>,
}

/// A farm as a report describes it.
#[derive(Default)]
pub struct FarmView {
    /// Its address.
    pub address: String,
    /// Its workers.
    pub workers: Vec<WorkerView>,
}
