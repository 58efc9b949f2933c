//! How fast jobs advance: samples accepted over the last minute.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};

use clerestory_api::JobId;

/// What counts as lately.
const WINDOW_MS: i64 = 60_000;

/// Shortest time over which a rate means anything.
const SHORTEST_MS: i64 = 500;

/// Accepted samples by job and time. A cache, empty after a restart.
#[derive(Debug)]
pub(crate) struct Rates {
    since_ms: i64,
    jobs: Mutex<BTreeMap<JobId, VecDeque<(i64, u64)>>>,
}

impl Rates {
    /// Nothing has been accepted yet.
    pub(crate) fn new(since_ms: i64) -> Self {
        Self { since_ms, jobs: Mutex::default() }
    }

    /// Notes accepted samples.
    pub(crate) fn add(&self, job: JobId, samples: u64, now_ms: i64) {
        let mut jobs = self.jobs();
        let entries = jobs.entry(job).or_default();
        entries.push_back((now_ms, samples));
        forget_old(entries, now_ms);
    }

    /// Forgets a job.
    pub(crate) fn remove(&self, job: JobId) {
        self.jobs().remove(&job);
    }

    /// Samples a second of a job that started at `started_ms`. `None` while there is nothing to measure.
    pub(crate) fn rate(&self, job: JobId, started_ms: i64, now_ms: i64) -> Option<f64> {
        let mut jobs = self.jobs();
        let entries = jobs.get_mut(&job)?;
        forget_old(entries, now_ms);
        let samples: u64 = entries.iter().map(|(_, samples)| samples).sum();
        let elapsed_ms = now_ms - started_ms.max(self.since_ms).max(now_ms - WINDOW_MS);
        (samples > 0 && elapsed_ms >= SHORTEST_MS).then(|| samples as f64 * 1000.0 / elapsed_ms as f64)
    }

    fn jobs(&self) -> MutexGuard<'_, BTreeMap<JobId, VecDeque<(i64, u64)>>> {
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn forget_old(entries: &mut VecDeque<(i64, u64)>, now_ms: i64) {
    while entries.front().is_some_and(|(time_ms, _)| *time_ms < now_ms - WINDOW_MS) {
        entries.pop_front();
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    #[test]
    fn the_rate_is_over_the_last_minute_or_since_the_start() {
        let job = JobId::from(Uuid::now_v7());
        let rates = Rates::new(0);
        assert_eq!(rates.rate(job, 0, 1000), None);
        rates.add(job, 4000, 1000);
        assert_eq!(rates.rate(job, 0, 2000), Some(2000.0));
        assert_eq!(rates.rate(job, 1900, 2000), None, "too early to tell");
        rates.add(job, 6000, 61_500);
        assert_eq!(rates.rate(job, 0, 61_500), Some(100.0), "what is older than a minute does not count");
        assert_eq!(rates.rate(job, 0, 200_000), None);
    }
}
