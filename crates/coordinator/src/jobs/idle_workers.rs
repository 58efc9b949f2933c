//! Idle workers: those whose last query for work found none.
//!
//! Each query costs the database some milliseconds, whether there is work or not. A worker that found none waits for a
//! notification. When its request ends and it asks again, it goes on waiting. Otherwise thousands of idle workers, each
//! back after some seconds, would leave no time to those with work. No notification knows which worker a job suits, so
//! an idle worker also queries from time to time without one. The more idle workers there are, the less often each
//! queries.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clerestory_api::WorkerId;

/// Least time between two queries of different workers without a notification.
const INTERVAL: Duration = Duration::from_millis(20);

/// Longest time from when a worker may query to its request, if it still exists.
const ABSENCE: Duration = Duration::from_secs(60);

/// The idle workers of this coordinator.
#[derive(Debug)]
pub(crate) struct IdleWorkers {
    queries: Mutex<Queries>,
}

#[derive(Debug)]
struct Queries {
    /// The last query of each worker.
    last: BTreeMap<WorkerId, Instant>,
    /// Time of the next query without a notification.
    next: Instant,
}

impl Default for IdleWorkers {
    fn default() -> Self {
        Self { queries: Mutex::new(Queries { last: BTreeMap::new(), next: Instant::now() }) }
    }
}

impl IdleWorkers {
    /// Whether a worker that asks may query without a notification. A positive answer counts as its query.
    pub(crate) fn may_query(&self, worker: WorkerId, now: Instant) -> bool {
        let mut queries = self.queries();
        let Some(last) = queries.last.get(&worker) else { return true };
        let may_query = *last + pause(queries.last.len()) <= now && queries.next <= now;
        if may_query {
            queries.next = now + INTERVAL;
        }
        may_query
    }

    /// Marks that its query found no work.
    pub(crate) fn found_nothing(&self, worker: WorkerId, now: Instant) {
        self.queries().last.insert(worker, now);
    }

    /// Marks that it has work.
    pub(crate) fn found_work(&self, worker: WorkerId) {
        self.queries().last.remove(&worker);
    }

    /// Forgets workers that have not asked again.
    pub(crate) fn forget_absent(&self, now: Instant) {
        let mut queries = self.queries();
        let longest = pause(queries.last.len()) + ABSENCE;
        queries.last.retain(|_, last| *last + longest > now);
    }

    fn queries(&self) -> MutexGuard<'_, Queries> {
        self.queries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Time between two queries of one worker.
fn pause(workers: usize) -> Duration {
    INTERVAL * u32::try_from(workers).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    #[test]
    fn each_idle_worker_waits_longer_for_its_next_query_the_more_of_them_there_are() {
        let (idle, start) = (IdleWorkers::default(), Instant::now());
        let workers: Vec<WorkerId> = (0..5000).map(|_| WorkerId::from(Uuid::now_v7())).collect();
        assert!(idle.may_query(workers[0], start), "nobody knows whether there is work for it");
        idle.found_nothing(workers[0], start);
        assert!(!idle.may_query(workers[0], start));
        assert!(idle.may_query(workers[0], start + INTERVAL), "it is alone");
        for worker in &workers {
            idle.found_nothing(*worker, start);
        }
        assert!(!idle.may_query(workers[0], start + Duration::from_secs(99)));
        let again = start + Duration::from_secs(100);
        assert!(idle.may_query(workers[0], again));
        assert!(!idle.may_query(workers[1], again), "one after the other");
        assert!(idle.may_query(workers[1], again + INTERVAL));
        idle.found_work(workers[0]);
        assert!(idle.may_query(workers[0], start), "it has worked since");
    }

    #[test]
    fn a_worker_that_does_not_ask_again_is_forgotten() {
        let (idle, start) = (IdleWorkers::default(), Instant::now());
        let [gone, here] = [(); 2].map(|()| WorkerId::from(Uuid::now_v7()));
        idle.found_nothing(gone, start);
        let later = start + ABSENCE;
        idle.found_nothing(here, later);
        idle.forget_absent(later);
        assert_eq!(idle.queries().last.len(), 2, "it may still be on its way");
        idle.forget_absent(later + 2 * INTERVAL);
        assert_eq!(idle.queries().last.keys().copied().collect::<Vec<_>>(), [here]);
    }
}
