//! Wall-clock time and core time.

use std::time::{Duration, Instant};

/// Wall-clock time and core time that has passed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Wall-clock time.
    pub wall: Duration,
    /// Core time, of the whole process or of a thread.
    pub core: Duration,
}

/// The clocks at a moment.
#[derive(Clone, Copy, Debug)]
pub struct Clocks {
    wall: Instant,
    core: Option<Duration>,
    counted: Counted,
}

/// Whose core time counts.
#[derive(Clone, Copy, Debug)]
enum Counted {
    Process,
    Thread,
}

impl Clocks {
    /// Reads the clocks.
    pub fn now() -> Self {
        Self::of(Counted::Process)
    }

    /// Reads the clocks. Core time is that of this thread alone.
    pub fn of_this_thread() -> Self {
        Self::of(Counted::Thread)
    }

    fn of(counted: Counted) -> Self {
        Self { wall: Instant::now(), core: processor_time(counted), counted }
    }

    /// The time since. Where the system does not count core time, all `threads` count as busy.
    pub fn spent(&self, threads: usize) -> Spent {
        let wall = self.wall.elapsed();
        let core = match (self.core, processor_time(self.counted)) {
            (Some(before), Some(now)) => now.saturating_sub(before),
            _ => wall.saturating_mul(u32::try_from(threads).unwrap_or(u32::MAX)),
        };
        Spent { wall, core }
    }
}

#[cfg(unix)]
fn processor_time(counted: Counted) -> Option<Duration> {
    use nix::time::{ClockId, clock_gettime};

    let clock = match counted {
        Counted::Process => ClockId::CLOCK_PROCESS_CPUTIME_ID,
        Counted::Thread => ClockId::CLOCK_THREAD_CPUTIME_ID,
    };
    clock_gettime(clock).ok().map(Duration::from)
}

#[cfg(not(unix))]
fn processor_time(_: Counted) -> Option<Duration> {
    None
}
