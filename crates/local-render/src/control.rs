//! How a render is stopped and watched from another thread.

use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::{Duration, Instant};

/// Stops a render early and tells its progress. The threads that render share it with the thread that watches.
#[derive(Default)]
pub struct Control {
    /// When to stop. The first pass of every tile is rendered in any case, because an image has at least one.
    pub deadline: Option<Instant>,
    /// Whether to stop now.
    pub cancelled: AtomicBool,
    /// Samples rendered so far, of all planes.
    pub samples: AtomicU64,
    /// Samples of the whole render, once that is known.
    pub planned: AtomicU64,
}

impl Control {
    /// Whether the deadline has passed.
    pub(crate) fn is_late(&self) -> bool {
        self.is_late_after(Duration::ZERO)
    }

    /// Whether it will have passed after some time.
    pub(crate) fn is_late_after(&self, time: Duration) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() + time >= deadline)
    }
}
