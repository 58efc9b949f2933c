//! What is measured with: the machine and its clocks.

use std::fs;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::commands::worker::{BUILD, cores};

/// What a reader must know of the machine to judge times.
#[derive(Debug, Serialize)]
pub(crate) struct Machine {
    /// The program.
    build: &'static str,
    /// Operating system and instruction set.
    system: String,
    /// Model of the processor, where the system says.
    processor: Option<String>,
    /// Cores that this process may use.
    cores: usize,
}

impl Machine {
    /// The machine that this process runs on.
    pub(crate) fn this() -> Self {
        let system = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
        Self { build: BUILD, system, processor: processor(), cores: cores().get() }
    }
}

/// The model of the processor, on systems that have a file which says so.
fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Wall-clock time and the time that all cores together spent on this process.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Spent {
    pub(super) wall: Duration,
    pub(super) core: Duration,
}

/// The clocks at a moment.
pub(super) struct Clocks {
    wall: Instant,
    core: Option<Duration>,
}

impl Clocks {
    pub(super) fn now() -> Self {
        Self { wall: Instant::now(), core: processor_time() }
    }

    /// What has been spent since. Where the system does not count the time of its cores, all `threads` count as busy.
    pub(super) fn spent(&self, threads: usize) -> Spent {
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
