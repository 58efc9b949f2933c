//! How long a worker keeps complete nodes before it uploads them in one batch.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use crate::model::SHORTEST_LINGER_SECONDS;

/// Partials that all leases together bring in a second. Each costs some milliseconds, however small it is.
const PARTIALS_PER_SECOND: u32 = 100;

/// Longest linger, unless the lease ends before.
const LONGEST: Duration = Duration::from_secs(30);

/// The linger of long leases, by the number of active leases at all coordinators.
#[derive(Debug, Default)]
pub(crate) struct UploadLinger {
    active_leases: AtomicU32,
}

impl UploadLinger {
    /// Sets the number of active leases.
    pub(crate) fn set_active_leases(&self, count: u32) {
        self.active_leases.store(count, Ordering::Relaxed);
    }

    /// How long a complete node of a long lease waits for others. A thousand workers that upload every second would
    /// take all of a coordinator's time.
    pub(crate) fn duration(&self) -> Duration {
        let shared = Duration::from_secs(1) * self.active_leases.load(Ordering::Relaxed) / PARTIALS_PER_SECOND;
        shared.clamp(Duration::from_secs_f64(SHORTEST_LINGER_SECONDS), LONGEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_wait_for_others_the_longer_the_more_leases_there_are() {
        let linger = UploadLinger::default();
        let linger_ms = |leases| {
            linger.set_active_leases(leases);
            linger.duration().as_millis()
        };
        assert_eq!(
            [0, 1, 100, 400, 1000, 5000, u32::MAX].map(linger_ms),
            [1000, 1000, 1000, 4000, 10_000, 30_000, 30_000]
        );
    }
}
