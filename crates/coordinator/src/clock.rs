//! The coordinator's clock. Leases, claims, time limits and series read this one, so that tests can move it.
//!
//! It is not simply the machine's clock. Somebody may set that back, and then the leases of dead workers would last
//! longer. The clock of a single coordinator goes on when the machine's is set back. Several coordinators follow the
//! clock of their database, so that a deadline means the same to all.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// A clock. Clones show the same time.
#[derive(Clone, Debug)]
pub enum Clock {
    /// A clock that runs.
    Running(Arc<Running>),
    /// A clock that stands still until it is moved.
    Manual(Arc<AtomicI64>),
}

/// A clock that runs with the machine's, but never back, or that follows another.
#[derive(Debug)]
pub struct Running {
    /// Its start, by a clock that nobody can set.
    started: Instant,
    /// Its time at the start, milliseconds since the Unix epoch.
    then_ms: AtomicI64,
    /// Whether it follows another clock.
    is_led: AtomicBool,
}

impl Default for Clock {
    fn default() -> Self {
        let then_ms = AtomicI64::new(machine_ms());
        Self::Running(Arc::new(Running { started: Instant::now(), then_ms, is_led: AtomicBool::new(false) }))
    }
}

impl Clock {
    /// Milliseconds since the Unix epoch.
    pub fn now_ms(&self) -> i64 {
        match self {
            Self::Running(clock) => clock.at(Instant::now(), machine_ms()),
            Self::Manual(now_ms) => now_ms.load(Ordering::SeqCst),
        }
    }

    /// Moves a manual clock forward. A running clock ignores it.
    pub fn advance(&self, milliseconds: i64) {
        if let Self::Manual(now_ms) = self {
            now_ms.fetch_add(milliseconds, Ordering::SeqCst);
        }
    }

    /// Follows another clock from now on, which shows `now_ms`. A manual clock follows none.
    pub(crate) fn follow(&self, now_ms: i64) {
        if let Self::Running(clock) = self {
            clock.then_ms.store(now_ms.saturating_sub(milliseconds(clock.started.elapsed())), Ordering::SeqCst);
            clock.is_led.store(true, Ordering::SeqCst);
        }
    }

    /// Whether it follows another clock.
    pub(crate) fn follows(&self) -> bool {
        matches!(self, Self::Running(clock) if clock.is_led.load(Ordering::SeqCst))
    }
}

impl Running {
    /// Its time at some moment, when the machine's clock shows `machine_ms`.
    fn at(&self, moment: Instant, machine_ms: i64) -> i64 {
        let elapsed_ms = milliseconds(moment.saturating_duration_since(self.started));
        if !self.is_led.load(Ordering::SeqCst) {
            self.then_ms.fetch_max(machine_ms.saturating_sub(elapsed_ms), Ordering::SeqCst);
        }
        self.then_ms.load(Ordering::SeqCst).saturating_add(elapsed_ms)
    }
}

fn machine_ms() -> i64 {
    milliseconds(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default())
}

fn milliseconds(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINUTE: Duration = Duration::from_secs(60);
    const MINUTE_MS: i64 = 60_000;

    /// A clock that started at zero at some moment, and the moment.
    fn started() -> (Running, Instant) {
        let started = Instant::now();
        (Running { started, then_ms: AtomicI64::new(0), is_led: AtomicBool::new(false) }, started)
    }

    #[test]
    fn a_machine_whose_clock_is_set_back_does_not_set_it_back() {
        let (clock, start) = started();
        assert_eq!(clock.at(start + MINUTE, MINUTE_MS), MINUTE_MS);
        // An hour fast, and right again.
        assert_eq!(clock.at(start + 2 * MINUTE, 62 * MINUTE_MS), 62 * MINUTE_MS);
        assert_eq!(clock.at(start + 3 * MINUTE, 3 * MINUTE_MS), 63 * MINUTE_MS);
    }

    #[test]
    fn it_goes_by_the_clock_that_it_follows() {
        let clock = Clock::default();
        let machine = clock.now_ms();
        let other = machine - 5 * MINUTE_MS;
        clock.follow(other);
        let shown = clock.now_ms();
        assert!((other..machine - 4 * MINUTE_MS).contains(&shown), "{shown} where the other shows {other}");
        // Clones are the same clock, and it can be set again.
        clock.clone().follow(machine + MINUTE_MS);
        assert!(clock.now_ms() >= machine + MINUTE_MS);
    }
}
