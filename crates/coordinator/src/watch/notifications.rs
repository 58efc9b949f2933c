//! Notifications: what changed, for the tasks and requests of this coordinator and for the other coordinators of the
//! farm.
//!
//! A part that changes something publishes a notification. It wakes whoever waits in this process at once, and
//! [peers](super::peers) send it to the other coordinators. Nothing depends on its arrival: the database holds every
//! change, and each coordinator reads it once a second as well.

use std::sync::Arc;

use clerestory_api::JobId;
use serde::{Deserialize, Serialize};
use tokio::sync::futures::Notified;
use tokio::sync::{Notify, mpsc};

use super::events::Events;
use super::rates::Rates;
use crate::clock::Clock;

/// Claimants that one notification wakes. Each that gets work wakes more, so that enough work soon reaches all of them.
/// Without work, a thousand waiting claimants cost no more than these.
const WOKEN: u32 = 2;

/// Something that changed. The names on the wire are those that older builds send.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Notification {
    /// A job was submitted or has changed its state, or a round of it was recorded.
    Job(JobId),
    /// Nodes of a job were accepted.
    Film {
        /// The job.
        job: JobId,
        /// Their samples.
        samples: u64,
    },
    /// The work of a round of a job may be complete.
    #[serde(rename = "wave")]
    Round(JobId),
    /// A lease was granted.
    Lease(JobId),
    /// Work went back to the queue.
    Work,
    /// A worker has changed.
    Workers,
}

/// Publishes notifications.
#[derive(Debug)]
pub(crate) struct Notifications {
    clock: Clock,
    events: Arc<Events>,
    rates: Arc<Rates>,
    /// Wakes requests that wait for work.
    work: Notify,
    /// Jobs for the round finalizer.
    films: mpsc::UnboundedSender<JobId>,
    /// Notifications for the other coordinators.
    peers: mpsc::UnboundedSender<Notification>,
}

/// The receiving ends of [`Notifications`], one for each task that reads them.
#[derive(Debug)]
pub(crate) struct Subscriptions {
    /// Jobs of which a round may be complete, for the round finalizer.
    pub(crate) films: mpsc::UnboundedReceiver<JobId>,
    /// Notifications for the other coordinators.
    pub(crate) peers: mpsc::UnboundedReceiver<Notification>,
}

impl Notifications {
    /// Notifications that go to these event streams and rates.
    pub(crate) fn new(clock: Clock, events: Arc<Events>, rates: Arc<Rates>) -> (Arc<Self>, Subscriptions) {
        let (films, films_receiver) = mpsc::unbounded_channel();
        let (peers, peers_receiver) = mpsc::unbounded_channel();
        let subscriptions = Subscriptions { films: films_receiver, peers: peers_receiver };
        (Arc::new(Self { clock, events, rates, work: Notify::new(), films, peers }), subscriptions)
    }

    /// Notifies this coordinator and the others.
    pub(crate) fn publish(&self, notification: Notification) {
        self.deliver(notification);
        // The receiver is gone only when the coordinator stops.
        let _ = self.peers.send(notification);
    }

    /// Notifies this coordinator alone.
    pub(crate) fn deliver(&self, notification: Notification) {
        match notification {
            Notification::Job(job) => {
                self.events.stored();
                self.events.progressed(job);
                self.wake_claimants();
                self.wake_finalizer(job);
            }
            Notification::Film { job, samples } => {
                self.rates.add(job, samples, self.clock.now_ms());
                self.events.progressed(job);
                self.events.workers_changed();
            }
            Notification::Round(job) => self.wake_finalizer(job),
            Notification::Lease(job) => {
                self.events.stored();
                self.events.progressed(job);
                self.events.workers_changed();
            }
            Notification::Work => {
                self.events.workers_changed();
                self.wake_claimants();
            }
            Notification::Workers => self.events.workers_changed(),
        }
    }

    /// Makes every subscriber read the database: notifications of other coordinators may have been lost.
    pub(crate) fn resync(&self) {
        self.events.workers_changed();
        self.resync_stored();
    }

    /// Makes event streams and claimants read the database.
    pub(crate) fn resync_stored(&self) {
        self.events.stored();
        self.wake_claimants();
    }

    /// Resolves when work may have become available.
    pub(crate) fn work(&self) -> Notified<'_> {
        self.work.notified()
    }

    /// Wakes some of the requests that wait for work.
    pub(crate) fn wake_claimants(&self) {
        for _ in 0..WOKEN {
            self.work.notify_one();
        }
    }

    /// Wakes the round finalizer for a job.
    pub(crate) fn wake_finalizer(&self, job: JobId) {
        // The receiver is gone only when the coordinator stops. It reads all open jobs when it starts again.
        let _ = self.films.send(job);
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Notifications that nobody subscribes to.
    pub(crate) fn unheard() -> Arc<Notifications> {
        let clock = Clock::default();
        let rates = Arc::new(Rates::new(clock.now_ms()));
        Notifications::new(clock, Arc::default(), rates).0
    }
}
