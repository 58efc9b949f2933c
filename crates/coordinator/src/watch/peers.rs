//! The other coordinators of a farm: notifications travel by the database's own `NOTIFY`.

use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::notifications::{Notification, Notifications};
use crate::store::{Listener, Store, StoreError};

/// How long notifications are batched before they are sent.
const LINGER: Duration = Duration::from_millis(10);

/// Notifications in one message. PostgreSQL takes less than 8000 bytes, and a notification has less than 100.
const MOST: usize = 64;

/// Pause before the next connection after one was lost.
const RECONNECT_PAUSE: Duration = Duration::from_secs(1);

/// A message to the other coordinators.
#[derive(Debug, Serialize, Deserialize)]
struct Message {
    /// The sender.
    from: Uuid,
    #[serde(rename = "news")]
    notifications: Vec<Notification>,
}

/// Exchanges notifications with the other coordinators.
#[derive(Debug)]
pub(crate) struct Peers {
    store: Store,
    /// Which of the farm's coordinators this is.
    coordinator: Uuid,
    notifications: Arc<Notifications>,
    stopping: CancellationToken,
}

impl Peers {
    /// The peers of a coordinator.
    pub(crate) fn new(
        store: Store,
        coordinator: Uuid,
        notifications: Arc<Notifications>,
        stopping: CancellationToken,
    ) -> Self {
        Self { store, coordinator, notifications, stopping }
    }

    /// Sends published notifications until the coordinator stops.
    pub(crate) async fn send(self: Arc<Self>, mut published: mpsc::UnboundedReceiver<Notification>) {
        let mut batch = Vec::with_capacity(MOST);
        while self.stopping.run_until_cancelled(published.recv_many(&mut batch, MOST)).await.is_some_and(|n| n > 0) {
            let message = Message { from: self.coordinator, notifications: deduplicated(batch.drain(..)) };
            let sent = match serde_json::to_string(&message) {
                Ok(text) => self.store.notify(text).await.map_err(|error| error.to_string()),
                Err(error) => Err(error.to_string()),
            };
            if let Err(error) = sent {
                tracing::debug!(error, "the other coordinators could not be notified");
            }
            tokio::time::sleep(LINGER).await;
        }
    }

    /// Delivers the notifications of other coordinators until this one stops.
    pub(crate) async fn receive(self: Arc<Self>) {
        while !self.stopping.is_cancelled() {
            match self.store.listener().await {
                // A SQLite file has one coordinator.
                Ok(None) => return,
                Ok(Some(listener)) => {
                    // Notifications were lost while nobody listened.
                    self.notifications.resync();
                    if let Some(error) = self.stopping.run_until_cancelled(self.receive_from(listener)).await {
                        tracing::warn!(%error, "the notifications of other coordinators are not received for now");
                    }
                }
                Err(error) => {
                    tracing::warn!(%error, "the notifications of other coordinators are not received for now");
                }
            }
            self.stopping.run_until_cancelled(tokio::time::sleep(RECONNECT_PAUSE)).await;
        }
    }

    async fn receive_from(&self, mut listener: Listener) -> StoreError {
        loop {
            let text = match listener.next().await {
                Ok(text) => text,
                Err(error) => return error,
            };
            match serde_json::from_str::<Message>(&text) {
                Ok(message) if message.from != self.coordinator => {
                    message.notifications.into_iter().for_each(|notification| self.notifications.deliver(notification));
                }
                Ok(_) => {}
                Err(error) => tracing::warn!(%error, "another coordinator sends what this build does not understand"),
            }
        }
    }
}

/// Each notification once, with the samples of a job added up.
fn deduplicated(notifications: impl Iterator<Item = Notification>) -> Vec<Notification> {
    let mut all: Vec<Notification> = Vec::new();
    for one in notifications {
        let known = all.iter_mut().find(|known| match (&one, &**known) {
            (Notification::Film { job, .. }, Notification::Film { job: known, .. }) => job == known,
            (one, known) => one == known,
        });
        match (known, one) {
            (Some(Notification::Film { samples, .. }), Notification::Film { samples: more, .. }) => {
                *samples = samples.saturating_add(more);
            }
            (Some(_), _) => {}
            (None, one) => all.push(one),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use clerestory_api::JobId;
    use clerestory_test_servers::postgres;

    use super::*;
    use crate::clock::Clock;
    use crate::store::Source;
    use crate::watch::rates::Rates;

    #[test]
    fn equal_notifications_are_sent_once_and_samples_add_up() {
        use Notification::{Job, Work};
        let [one, other] = [(); 2].map(|()| JobId::from(Uuid::now_v7()));
        let film = |job, samples| Notification::Film { job, samples };
        let published = [Work, film(one, 3), Job(one), film(other, 1), Work, film(one, 4), Job(one)];
        assert_eq!(deduplicated(published.into_iter()), [Work, film(one, 7), Job(one), film(other, 1)]);
    }

    #[test]
    fn a_full_message_fits_into_a_notification_of_the_database() {
        let job = JobId::from(Uuid::now_v7());
        let notifications = vec![Notification::Film { job, samples: u64::MAX }; MOST];
        let message = Message { from: Uuid::now_v7(), notifications };
        assert!(serde_json::to_string(&message).unwrap().len() < 8000);
    }

    #[test]
    fn a_message_has_the_names_that_older_builds_know() {
        let job = JobId::from(Uuid::nil());
        let message = Message { from: Uuid::nil(), notifications: vec![Notification::Round(job), Notification::Work] };
        let expected = format!(r#"{{"from":"{0}","news":[{{"wave":"{0}"}},"work"]}}"#, Uuid::nil());
        assert_eq!(serde_json::to_string(&message).unwrap(), expected);
    }

    #[tokio::test]
    async fn a_claimant_at_one_coordinator_is_woken_by_another() {
        let database = postgres().new_database();
        let peers = async || {
            let store = Store::open(Source::postgres(&database.parse().unwrap()).unwrap()).await.unwrap();
            let rates = Arc::new(Rates::new(0));
            let (notifications, subscriptions) = Notifications::new(Clock::default(), Arc::default(), rates);
            let stopping = CancellationToken::new();
            let peers = Peers::new(store, Uuid::now_v7(), Arc::clone(&notifications), stopping);
            (Arc::new(peers), notifications, subscriptions)
        };
        let (one, publishing, subscriptions) = peers().await;
        let (other, receiving, _subscriptions) = peers().await;
        tokio::spawn(one.send(subscriptions.peers));
        tokio::spawn(other.receive());
        // It wakes claimants itself when it begins to listen, and never again: nothing here reads the database once a
        // second.
        receiving.work().await;
        while tokio::time::timeout(Duration::from_millis(300), receiving.work()).await.is_ok() {}
        for notification in [Notification::Work, Notification::Job(JobId::from(Uuid::now_v7()))] {
            publishing.publish(notification);
            tokio::time::timeout(Duration::from_secs(20), receiving.work()).await.unwrap();
            while tokio::time::timeout(Duration::from_millis(300), receiving.work()).await.is_ok() {}
        }
    }
}
