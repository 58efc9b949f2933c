//! Wall-clock time and core time.

use std::time::{Duration, Instant};

/// Wall-clock time and core time that has passed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Wall-clock time.
    pub wall: Duration,
    /// Core time of the whole process.
    pub core: Duration,
}

/// The clocks at a moment.
#[derive(Clone, Copy, Debug)]
pub struct Clocks {
    wall: Instant,
    core: Option<Duration>,
}

impl Clocks {
    /// Reads the clocks.
    pub fn now() -> Self {
        Self { wall: Instant::now(), core: processor_time() }
    }

    /// The time since. Where the system does not count core time, all `threads` count as busy.
    pub fn spent(&self, threads: usize) -> Spent {
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
