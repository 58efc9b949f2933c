//! Summaries of measured times.

use std::time::Duration;

use serde::Serialize;

/// Summary of latencies, milliseconds. All are 0 where nothing was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Latency {
    /// Number of measurements.
    pub(crate) count: u64,
    /// The time that half of them do not exceed.
    pub(crate) p50_ms: f64,
    /// The time that 99 of 100 do not exceed.
    pub(crate) p99_ms: f64,
    /// The longest.
    pub(crate) max_ms: f64,
}

impl Latency {
    /// The summary of these times, in any order.
    pub(crate) fn of(mut times: Vec<Duration>) -> Self {
        times.sort_unstable();
        let at = |fraction| percentile(&times, fraction).map_or(0.0, |time| time.as_secs_f64() * 1000.0);
        Self { count: times.len() as u64, p50_ms: at(0.5), p99_ms: at(0.99), max_ms: at(1.0) }
    }
}

/// The nearest rank: the smallest value that at least this fraction of all does not exceed.
fn percentile(sorted: &[Duration], fraction: f64) -> Option<Duration> {
    let rank = (fraction * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn latency(milliseconds: impl Iterator<Item = u64>) -> Latency {
        Latency::of(milliseconds.map(Duration::from_millis).collect())
    }

    #[test]
    fn percentiles_are_nearest_ranks() {
        let hundred = Latency { count: 100, p50_ms: 50.0, p99_ms: 99.0, max_ms: 100.0 };
        assert_eq!(latency(1..=100), hundred);
        assert_eq!(latency((1..=100).rev()), hundred);
        assert_eq!(latency(1..=3), Latency { count: 3, p50_ms: 2.0, p99_ms: 3.0, max_ms: 3.0 });
        assert_eq!(latency(std::iter::once(7)), Latency { count: 1, p50_ms: 7.0, p99_ms: 7.0, max_ms: 7.0 });
        assert_eq!(latency(std::iter::empty()), Latency::default());
    }
}
