//! The summary that `clerestory render` prints.

use std::path::PathBuf;
use std::time::Duration;

use clerestory_api::StopReason;
use clerestory_film::FrameImage;
use clerestory_film::counters::Counters;
use serde::Serialize;

use crate::measures::Measures;
use crate::text::{counted, duration_text};

/// What `--json` prints.
#[derive(Serialize)]
pub(crate) struct Summary {
    pub(crate) frame: u32,
    pub(crate) output: PathBuf,
    pub(crate) png: Option<PathBuf>,
    pub(crate) scene_hash: String,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) samples: u64,
    pub(crate) passes: PassCounts,
    pub(crate) tiles: u32,
    /// Tiles whose standard error is known.
    pub(crate) standard_error_tiles: u32,
    /// Wall-clock time of rendering.
    pub(crate) seconds: f64,
    /// Time that all cores together spent on it.
    pub(crate) core_seconds: f64,
    pub(crate) samples_per_second: f64,
    pub(crate) threads: usize,
    pub(crate) stopped_by: Option<StopReason>,
    pub(crate) metrics: Option<Measures>,
    pub(crate) counters: Counters,
}

/// Fewest and most passes of any tile.
#[derive(Serialize)]
pub(crate) struct PassCounts {
    pub(crate) fewest: u32,
    pub(crate) most: u32,
}

impl PassCounts {
    pub(crate) fn of(image: &FrameImage) -> Self {
        let passes = image.metadata().map(|metadata| metadata.tile_passes.as_slice()).unwrap_or_default();
        let [fewest, most] = [passes.iter().min(), passes.iter().max()].map(|count| count.copied().unwrap_or(0));
        Self { fewest, most }
    }
}

impl Summary {
    pub(crate) fn text(&self) -> String {
        let mut text = format!(
            "Wrote {}{}: {}, {} in {} ({} of core time), {:.0} a second",
            self.output.display(),
            self.png.as_ref().map(|file| format!(" and {}", file.display())).unwrap_or_default(),
            match self.passes {
                PassCounts { fewest, most } if fewest == most => counted(most.into(), "pass", "passes"),
                PassCounts { fewest, most } => format!("{fewest} to {most} passes"),
            },
            counted(self.samples, "sample", "samples"),
            duration_text(Duration::from_secs_f64(self.seconds)),
            duration_text(Duration::from_secs_f64(self.core_seconds)),
            self.samples_per_second,
        );
        if let Some(Measures { metrics, .. }) = &self.metrics {
            text.push_str(&format!("; MSE {:.4e}", metrics.mse));
        }
        text
    }
}
