//! What coordinators of one farm tell one another, so that nobody who waits at one of them sleeps through what another did.
//!
//! Whoever changes something tells it here ([`Farm::tell`](crate::farm::Farm::tell)): it is heard in this process at once, and sent to the
//! other coordinators by the database's own notifications, gathered for a moment. Nothing depends on their arrival: what was
//! changed is in the database, and everybody looks there once a second as well.

use std::sync::Arc;
use std::time::Duration;

use clerestory_api::JobId;
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;
use uuid::Uuid;

use crate::farm::Farm;
use crate::store::Listener;

/// How long news are gathered before they are sent.
const GATHERED: Duration = Duration::from_millis(10);

/// News in one message: PostgreSQL takes less than 8000 bytes, and one is less than 100.
const MOST: usize = 64;

/// How long to wait before listening again after the connection was lost.
const PAUSE: Duration = Duration::from_secs(1);

/// Something that others may wait for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum News {
    /// A job was submitted or has changed its state, or a round of it was recorded.
    Job(JobId),
    /// Nodes of a job were accepted.
    Film {
        /// The job.
        job: JobId,
        /// Their camera samples.
        samples: u64,
    },
    /// A wave of a job has become complete.
    Wave(JobId),
    /// A lease was granted.
    Lease(JobId),
    /// Work went back to the queue.
    Work,
    /// Something is new about a worker.
    Workers,
}

/// A message to the other coordinators.
#[derive(Debug, Serialize, Deserialize)]
struct Message {
    /// Who sends it.
    from: Uuid,
    news: Vec<News>,
}

/// Sends what was told to the other coordinators, until this one stops.
pub(crate) async fn send(farm: Arc<Farm>, mut told: mpsc::UnboundedReceiver<News>) {
    let mut news = Vec::with_capacity(MOST);
    while farm.stopping.run_until_cancelled(told.recv_many(&mut news, MOST)).await.is_some_and(|count| count > 0) {
        // The same news many times over are the same once; samples add up.
        let message = Message { from: farm.coordinator, news: gathered(news.drain(..)) };
        let sent = match serde_json::to_string(&message) {
            Ok(text) => farm.store.notify(text).await.map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        if let Err(error) = sent {
            tracing::debug!(error, "the other coordinators could not be told");
        }
        tokio::time::sleep(GATHERED).await;
    }
}

/// Each once, the samples of a job added up.
fn gathered(news: impl Iterator<Item = News>) -> Vec<News> {
    let mut all: Vec<News> = Vec::new();
    for one in news {
        let known = all.iter_mut().find(|known| match (&one, &**known) {
            (News::Film { job, .. }, News::Film { job: known, .. }) => job == known,
            (one, known) => one == known,
        });
        match (known, one) {
            (Some(News::Film { samples, .. }), News::Film { samples: more, .. }) => {
                *samples = samples.saturating_add(more);
            }
            (Some(_), _) => {}
            (None, one) => all.push(one),
        }
    }
    all
}

/// Hears what other coordinators tell, until this one stops.
pub(crate) async fn hear(farm: Arc<Farm>) {
    while !farm.stopping.is_cancelled() {
        match farm.store.listener().await {
            // A SQLite file has one coordinator.
            Ok(None) => return,
            Ok(Some(listener)) => {
                // What was told while nobody listened.
                farm.look_around();
                let heard = farm.stopping.run_until_cancelled(mark_all_seen(&farm, listener)).await;
                if let Some(error) = heard {
                    tracing::warn!(%error, "other coordinators are not heard for now");
                }
            }
            Err(error) => tracing::warn!(%error, "other coordinators are not heard for now"),
        }
        farm.stopping.run_until_cancelled(tokio::time::sleep(PAUSE)).await;
    }
}

async fn mark_all_seen(farm: &Farm, mut listener: Listener) -> crate::store::StoreError {
    loop {
        let text = match listener.next().await {
            Ok(text) => text,
            Err(error) => return error,
        };
        match serde_json::from_str::<Message>(&text) {
            Ok(message) if message.from != farm.coordinator => {
                for news in message.news {
                    farm.hear(news);
                }
            }
            Ok(_) => {}
            Err(error) => tracing::warn!(%error, "another coordinator tells what this build does not understand"),
        }
    }
}

#[cfg(test)]
mod tests {
    use clerestory_test_servers::postgres;

    use super::*;
    use crate::config::Config;
    use crate::server::open;

    #[test]
    fn the_same_news_are_sent_once_and_samples_add_up() {
        let [one, other] = [(); 2].map(|()| JobId::from(Uuid::now_v7()));
        let film = |job, samples| News::Film { job, samples };
        let told = [News::Work, film(one, 3), News::Job(one), film(other, 1), News::Work, film(one, 4), News::Job(one)];
        assert_eq!(gathered(told.into_iter()), [News::Work, film(one, 7), News::Job(one), film(other, 1)]);
    }

    #[tokio::test]
    async fn who_waits_for_work_at_one_coordinator_is_rung_by_another() {
        let (directory, database) = (tempfile::tempdir().unwrap(), postgres().new_database());
        let config = || Config { database: Some(database.parse().unwrap()), ..Config::new(directory.path()) };
        let (one, bells) = open(config()).await.unwrap();
        let (other, _bells) = open(config()).await.unwrap();
        tokio::spawn(send(Arc::clone(&one), bells.told));
        tokio::spawn(hear(Arc::clone(&other)));
        // It rings by itself when it begins to listen, and never again: nobody here looks once a second.
        other.work.notified().await;
        while tokio::time::timeout(Duration::from_millis(300), other.work.notified()).await.is_ok() {}
        for news in [News::Work, News::Job(JobId::from(Uuid::now_v7()))] {
            one.tell(news);
            tokio::time::timeout(Duration::from_secs(20), other.work.notified()).await.unwrap();
            while tokio::time::timeout(Duration::from_millis(300), other.work.notified()).await.is_ok() {}
        }
    }

    #[test]
    fn a_full_message_fits_into_a_notification() {
        let job = JobId::from(Uuid::now_v7());
        let message = Message { from: Uuid::now_v7(), news: vec![News::Film { job, samples: u64::MAX }; MOST] };
        assert!(serde_json::to_string(&message).unwrap().len() < 8000);
    }
}
