//! Workers for whom there was nothing to do when they asked last.
//!
//! Each look for work costs the database some milliseconds, whether there is any or not. A worker that has looked in vain waits until it is rung; when the
//! coordinator has let it go without work and it asks again, it goes on waiting. Otherwise thousands of them, each back after some seconds, would leave no time
//! to those who have work. Without being rung it looks all the same when it asks again after some time, since nobody knows for whom there is work: the longer, the
//! more of them there are.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clerestory_api::WorkerId;

/// Least time from the look of one to that of another, of those who are not rung.
const EACH: Duration = Duration::from_millis(20);

/// Longest time from when a worker should look to when it asks, if it is still there.
const ABSENCE: Duration = Duration::from_secs(60);

/// The workers that wait for work at this coordinator.
#[derive(Debug)]
pub(crate) struct Idle {
    looks: Mutex<Looks>,
}

#[derive(Debug)]
struct Looks {
    /// When each has looked last.
    last: BTreeMap<WorkerId, Instant>,
    /// Until when no other looks that is not rung.
    next: Instant,
}

impl Default for Idle {
    fn default() -> Self {
        Self { looks: Mutex::new(Looks { last: BTreeMap::new(), next: Instant::now() }) }
    }
}

impl Idle {
    /// Whether a worker that asks is to look at once, though nobody has rung; it is taken to do so.
    pub(crate) fn is_to_look(&self, worker: WorkerId, now: Instant) -> bool {
        let mut looks = self.looks();
        let Some(last) = looks.last.get(&worker) else { return true };
        let is_to_look = *last + pause(looks.last.len()) <= now && looks.next <= now;
        if is_to_look {
            looks.next = now + EACH;
        }
        is_to_look
    }

    /// Notes that it has looked in vain.
    pub(crate) fn looked_in_vain(&self, worker: WorkerId, now: Instant) {
        self.looks().last.insert(worker, now);
    }

    /// Notes that it has found work.
    pub(crate) fn has_work(&self, worker: WorkerId) {
        self.looks().last.remove(&worker);
    }

    /// Forgets workers that have not come again.
    pub(crate) fn forget_those_who_have_gone(&self, now: Instant) {
        let mut looks = self.looks();
        let longest = pause(looks.last.len()) + ABSENCE;
        looks.last.retain(|_, last| *last + longest > now);
    }

    fn looks(&self) -> MutexGuard<'_, Looks> {
        self.looks.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Time between two looks of one of so many.
fn pause(workers: usize) -> Duration {
    EACH * u32::try_from(workers).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    #[test]
    fn the_more_wait_the_longer_each_waits_until_it_looks_again() {
        let (idle, start) = (Idle::default(), Instant::now());
        let workers: Vec<WorkerId> = (0..5000).map(|_| WorkerId::from(Uuid::now_v7())).collect();
        assert!(idle.is_to_look(workers[0], start), "nobody knows whether there is work for it");
        idle.looked_in_vain(workers[0], start);
        assert!(!idle.is_to_look(workers[0], start));
        assert!(idle.is_to_look(workers[0], start + EACH), "it is alone");
        for worker in &workers {
            idle.looked_in_vain(*worker, start);
        }
        assert!(!idle.is_to_look(workers[0], start + Duration::from_secs(99)));
        let again = start + Duration::from_secs(100);
        assert!(idle.is_to_look(workers[0], again));
        assert!(!idle.is_to_look(workers[1], again), "one after the other");
        assert!(idle.is_to_look(workers[1], again + EACH));
        idle.has_work(workers[0]);
        assert!(idle.is_to_look(workers[0], start), "it has worked since");
    }

    #[test]
    fn who_does_not_come_again_is_forgotten() {
        let (idle, start) = (Idle::default(), Instant::now());
        let [gone, here] = [(); 2].map(|()| WorkerId::from(Uuid::now_v7()));
        idle.looked_in_vain(gone, start);
        let later = start + ABSENCE;
        idle.looked_in_vain(here, later);
        idle.forget_those_who_have_gone(later);
        assert_eq!(idle.looks().last.len(), 2, "it may still be on its way");
        idle.forget_those_who_have_gone(later + 2 * EACH);
        assert_eq!(idle.looks().last.keys().copied().collect::<Vec<_>>(), [here]);
    }
}
