//! A render at a moment.

use clerestory_film::FrameImage;
use clerestory_film::counters::Counters;

/// A render at a moment: its image and its cost.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot {
    /// Samples in each pixel.
    pub(crate) samples: u64,
    pub(crate) wall_seconds: f64,
    pub(crate) core_seconds: f64,
    pub(crate) counters: Counters,
    pub(crate) image: FrameImage,
}
