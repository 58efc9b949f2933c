//! Measured rates: how fast a worker renders a job, and the size of its nodes and leases.

use clerestory_film::PassRange;

/// A lease is overdue after this many times the expected time of its work, without an accepted node.
const OVERDUE_FACTOR: f64 = 3.0;

/// Shortest time for which a complete node waits for others, in seconds.
pub(crate) const SHORTEST_LINGER_SECONDS: f64 = 1.0;

/// Longest time until a lease is overdue, in seconds: a week.
const LONGEST_OVERDUE_SECONDS: f64 = 7.0 * 24.0 * 3600.0;

/// The rate of a worker, for the size of its nodes and leases.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeasuredRate {
    /// Samples a second of the worker, for this job; `None` before its first partial.
    pub samples_per_second: Option<f64>,
    /// How long a lease should take, in seconds.
    pub target_seconds: f64,
    /// Workers on this job, including the one that asks.
    pub workers: u32,
}

impl MeasuredRate {
    /// Largest level at which a round is cut. Its nodes fit into a lease of the wanted length, and each worker gets at
    /// least two where there are enough passes.
    pub(crate) fn largest_level(&self, passes: PassRange, tiles: u32, samples_per_tile_pass: f64) -> u32 {
        let mut level = passes.count.max(1).ilog2();
        let too_long = |level: u32| {
            self.samples_per_second
                .is_some_and(|rate| samples_per_tile_pass * f64::from(1_u32 << level) > rate * self.target_seconds)
        };
        let too_few = |level: u32| u64::from(tiles) * u64::from(passes.count >> level) < 2 * u64::from(self.workers);
        while level > 0 && (too_long(level) || too_few(level)) {
            level -= 1;
        }
        level
    }

    /// Expected time for some samples, in seconds. It is that of a lease while the rate is unknown.
    pub(crate) fn seconds(&self, samples: f64) -> f64 {
        self.samples_per_second.map_or(self.target_seconds, |rate| samples / rate)
    }

    /// Time until a lease without an accepted node is overdue, in seconds. Its complete nodes wait `linger_seconds`
    /// for others. Each earlier lease on the same work makes it four times longer: work that takes longer than anybody
    /// expects is not taken from every worker that begins it.
    pub(crate) fn overdue_seconds(&self, samples: f64, repeats: u32, linger_seconds: f64) -> f64 {
        let needed = self.seconds(samples).max(self.target_seconds).max(linger_seconds);
        (OVERDUE_FACTOR * needed * f64::from(1_u32 << (2 * repeats.min(10)))).min(LONGEST_OVERDUE_SECONDS)
    }

    /// How long a complete node of a lease waits for others, in seconds: at most `longest_seconds`, and at most the
    /// expected time of the lease. Its nodes are uploaded at its end in any case, unless its worker has become slow,
    /// and then a waiting client should see the progress. A single node does not wait.
    pub(crate) fn linger_seconds(&self, nodes: usize, samples: f64, longest_seconds: f64) -> f64 {
        if nodes < 2 {
            return SHORTEST_LINGER_SECONDS;
        }
        let longest = self.samples_per_second.map_or(longest_seconds, |rate| longest_seconds.min(samples / rate));
        longest.max(SHORTEST_LINGER_SECONDS)
    }

    /// Samples in a lease, and at most in a node: the worker's rate times the wanted time. Towards the end of a job,
    /// at most half of an equal share of the rest, so that all workers finish together. None before the rate is known:
    /// one pass is enough to measure it.
    pub(crate) fn lease_samples(&self, samples_left: f64) -> f64 {
        let by_rate = self.samples_per_second.unwrap_or(0.0) * self.target_seconds;
        by_rate.min(samples_left / f64::from(2 * self.workers.max(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_wait_for_others_no_longer_than_their_lease_should_take() {
        let measured = |samples_per_second| MeasuredRate { samples_per_second, target_seconds: 10.0, workers: 1 };
        let linger = |rate, longest| measured(rate).linger_seconds(2, 1000.0, longest);
        assert_eq!([0.5, 4.0, 30.0].map(|longest| linger(Some(200.0), longest)), [1.0, 4.0, 5.0]);
        assert_eq!([0.5, 4.0, 30.0].map(|longest| linger(Some(10_000.0), longest)), [1.0; 3]);
        assert_eq!(linger(None, 30.0), 30.0, "nobody knows how long it takes");
        assert_eq!(measured(Some(200.0)).linger_seconds(1, 1000.0, 30.0), 1.0, "there are no others");
    }

    #[test]
    fn each_earlier_lease_on_the_same_work_makes_the_next_overdue_later() {
        let overdue = |samples_per_second, samples, repeats| {
            MeasuredRate { samples_per_second, target_seconds: 10.0, workers: 3 }.overdue_seconds(samples, repeats, 1.0)
        };
        assert_eq!(overdue(None, 1e9, 0), 30.0);
        assert_eq!(overdue(Some(100.0), 1.0, 0), 30.0, "as long as a lease should take, at least");
        assert_eq!(overdue(Some(100.0), 2000.0, 0), 60.0);
        assert_eq!(overdue(Some(100.0), 2000.0, 1), 240.0);
        assert_eq!(overdue(Some(100.0), 2000.0, 2), 960.0);
        assert_eq!(overdue(Some(1e-9), 2000.0, u32::MAX), LONGEST_OVERDUE_SECONDS);
    }

    #[test]
    fn slow_workers_and_few_tiles_get_finer_nodes() {
        let passes = PassRange { first: 16, count: 16 };
        let level = |samples_per_second, workers, tiles| {
            MeasuredRate { samples_per_second, target_seconds: 10.0, workers }.largest_level(passes, tiles, 1000.0)
        };
        assert_eq!(level(None, 1, 100), 4);
        assert_eq!(level(Some(400.0), 1, 100), 2);
        assert_eq!(level(Some(1e-3), 1, 100), 0);
        assert_eq!(level(None, 4, 1), 1);
        assert_eq!(level(None, 100, 1), 0);
    }
}
