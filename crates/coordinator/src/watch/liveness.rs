//! Which workers count as alive, and since when this coordinator receives heartbeats without a gap.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::clock::Clock;

/// Longest silence of a worker that others wait for: three heartbeats.
const LONGEST_SILENCE: Duration = Duration::from_secs(15);

/// The clock by which silent workers are told from live ones.
#[derive(Debug)]
pub(crate) struct Liveness {
    clock: Clock,
    lease_ttl: Duration,
    /// Start of the time without a gap.
    listening: Mutex<Instant>,
}

impl Liveness {
    /// Begins to listen now.
    pub(crate) fn new(clock: Clock, lease_ttl: Duration) -> Self {
        Self { clock, lease_ttl, listening: Mutex::new(Instant::now()) }
    }

    /// Last heartbeat of a worker that is shown as silent, milliseconds since 1970.
    pub(crate) fn silent_before_ms(&self) -> i64 {
        self.clock.now_ms().saturating_sub(milliseconds(self.lease_ttl))
    }

    /// Last heartbeat of a worker that nobody waits for, milliseconds since 1970. While this coordinator has listened
    /// for less than [`LONGEST_SILENCE`], every worker is waited for.
    pub(crate) fn alive_ms(&self) -> i64 {
        if self.listening_time() < LONGEST_SILENCE {
            return i64::MIN;
        }
        self.clock.now_ms().saturating_sub(milliseconds(LONGEST_SILENCE))
    }

    /// Start of the time in which this coordinator listened without a gap, milliseconds since 1970.
    pub(crate) fn listening_ms(&self) -> i64 {
        self.clock.now_ms().saturating_sub(milliseconds(self.listening_time()))
    }

    /// Begins to listen anew: heartbeats before now may have been missed.
    pub(crate) fn restart(&self) {
        self.restart_at(Instant::now());
    }

    fn restart_at(&self, start: Instant) {
        *self.listening.lock().unwrap_or_else(PoisonError::into_inner) = start;
    }

    fn listening_time(&self) -> Duration {
        self.listening.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
    }
}

fn milliseconds(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coordinator_that_has_not_listened_waits_for_every_worker() {
        let clock = Clock::default();
        let liveness = Liveness::new(clock.clone(), Duration::from_secs(60));
        assert_eq!(liveness.alive_ms(), i64::MIN);
        liveness.restart_at(Instant::now().checked_sub(LONGEST_SILENCE).unwrap());
        let silent_ms = clock.now_ms() - liveness.alive_ms();
        assert!((15_000..20_000).contains(&silent_ms), "{silent_ms}");
        liveness.restart();
        assert_eq!(liveness.alive_ms(), i64::MIN);
    }
}
