//! The clock on the wall, and those of the cores.

use std::time::{Duration, Instant};

/// Wall-clock time and the time that all cores together spent on this process.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spent {
    pub(crate) wall: Duration,
    pub(crate) core: Duration,
}

/// The clocks at a moment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clocks {
    wall: Instant,
    core: Option<Duration>,
}

impl Clocks {
    pub(crate) fn now() -> Self {
        Self { wall: Instant::now(), core: processor_time() }
    }

    /// What has been spent since. Where the system does not count the time of its cores, all `threads` count as busy.
    pub(crate) fn spent(&self, threads: usize) -> Spent {
        let wall = self.wall.elapsed();
        let core = match (self.core, processor_time()) {
            (Some(before), Some(now)) => now.saturating_sub(before),
            _ => wall.saturating_mul(u32::try_from(threads).unwrap_or(u32::MAX)),
        };
        Spent { wall, core }
    }
}

#[cfg(unix)]
fn processor_time() -> Option<Duration> {
    use nix::time::{ClockId, clock_gettime};

    clock_gettime(ClockId::CLOCK_PROCESS_CPUTIME_ID).ok().map(Duration::from)
}

#[cfg(not(unix))]
fn processor_time() -> Option<Duration> {
    None
}
