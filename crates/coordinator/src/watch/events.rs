//! Events for whoever watches: stored ones in their order, and what is only true now.
//!
//! One task sends everything, so that stored events go out in the order of their numbers and none is skipped, whichever
//! transaction committed first. Stored events go out at once, or nearly: somebody waits for the end of a job. Progress is gathered:
//! however many nodes arrive, a job is sent a few times a second at most, and workers once.

use std::collections::{BTreeSet, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use clerestory_api::{Event, EventBody, JobId};
use futures::stream::{self, Stream};
use tokio::sync::{Notify, broadcast};
use tokio::time::Instant;

use crate::farm::Farm;
use crate::model::{StoredEvent, StoredKind};
use crate::store::StoreError;
use crate::watch::views;

/// Events that a slow listener may fall behind before it gets a snapshot instead: more than one for each worker, since those go out together.
const BACKLOG: usize = 8192;

/// Stored events that are read at once; also the most that a listener that comes back is sent one by one.
const BATCH: u32 = 500;

/// Shortest time between two looks for stored events: each lease rings for one.
const PAUSE: Duration = Duration::from_millis(50);

/// Shortest time between two rounds of sending how far jobs are.
const PROGRESS_PAUSE: Duration = Duration::from_millis(200);

/// Pause after the database could not be read.
const FAILURE_PAUSE: Duration = Duration::from_secs(1);

/// Shortest time between two rounds of sending all workers: there are thousands of them, and something is new about one at any moment.
const WORKERS_PAUSE: Duration = Duration::from_millis(900);

/// The bells and the line on which events go out.
#[derive(Debug)]
pub(crate) struct Events {
    line: broadcast::Sender<Event>,
    news: Notify,
    changed: Mutex<Changed>,
}

/// What there may be to send.
#[derive(Debug, Default)]
struct Changed {
    /// Whether events have been stored.
    stored: bool,
    /// Jobs that have advanced.
    jobs: BTreeSet<JobId>,
    /// Whether something is new about a worker.
    workers: bool,
}

impl Default for Events {
    fn default() -> Self {
        Self { line: broadcast::Sender::new(BACKLOG), news: Notify::new(), changed: Mutex::default() }
    }
}

impl Events {
    /// Says that events have been stored.
    pub(crate) fn stored(&self) {
        self.changed().stored = true;
        self.news.notify_one();
    }

    /// Says that a job has advanced.
    pub(crate) fn progressed(&self, job: JobId) {
        self.changed().jobs.insert(job);
        self.news.notify_one();
    }

    /// Says that something is new about a worker.
    pub(crate) fn workers_changed(&self) {
        self.changed().workers = true;
        self.news.notify_one();
    }

    /// Moves what has changed since the last time to what is to be sent.
    fn move_to(&self, pending: &mut Changed) {
        let Changed { stored, jobs, workers } = std::mem::take(&mut *self.changed());
        pending.stored |= stored;
        pending.jobs.extend(jobs);
        pending.workers |= workers;
    }

    fn changed(&self) -> MutexGuard<'_, Changed> {
        self.changed.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What has been sent, and when the next may be.
#[derive(Debug)]
struct Sent {
    /// The last stored event.
    last_id: i64,
    /// When to look for more of them.
    stored: Instant,
    /// When to say how far jobs are.
    progress: Instant,
    /// When to say what workers do.
    workers: Instant,
}

impl Sent {
    fn new(last_id: i64) -> Self {
        let now = Instant::now();
        Self { last_id, stored: now, progress: now, workers: now }
    }

    /// When the first of what is pending may be sent.
    fn due(&self, pending: &Changed) -> Option<Instant> {
        let stored = pending.stored.then_some(self.stored);
        let progress = (!pending.jobs.is_empty()).then_some(self.progress);
        let workers = pending.workers.then_some(self.workers);
        [stored, progress, workers].into_iter().flatten().min()
    }

    /// Nothing is sent before this time.
    fn put_off(&mut self, until: Instant) {
        [self.stored, self.progress, self.workers] = [until; 3];
    }
}

/// Sends events until the coordinator stops.
pub(crate) async fn run(farm: Arc<Farm>, last_id: i64) {
    let (mut sent, mut pending) = (Sent::new(last_id), Changed::default());
    loop {
        let due = sent.due(&pending);
        tokio::select! {
            () = farm.stopping.cancelled() => return,
            () = farm.events.news.notified() => farm.events.move_to(&mut pending),
            () = tokio::time::sleep_until(due.unwrap_or_else(Instant::now)), if due.is_some() => {
                if let Err(error) = send_news(&farm, &mut sent, &mut pending).await {
                    tracing::error!(%error, "events could not be read, trying again");
                    sent.put_off(Instant::now() + FAILURE_PAUSE);
                }
            }
        }
    }
}

/// Sends the stored events that have not been sent, and what else is pending as far as that is due; the rest stays pending.
async fn send_news(farm: &Farm, sent: &mut Sent, pending: &mut Changed) -> Result<(), StoreError> {
    let now = Instant::now();
    loop {
        let stored = farm.store.events_after(sent.last_id, BATCH).await?;
        for event in &stored {
            let body = readable_body_of(farm, event).await?;
            sent.last_id = event.id;
            if let Some(body) = body {
                send(farm, Event { id: Some(event.id), body });
            }
        }
        if stored.len() < BATCH as usize {
            break;
        }
    }
    (pending.stored, sent.stored) = (false, now + PAUSE);
    if farm.events.line.receiver_count() == 0 {
        *pending = Changed::default();
        return Ok(());
    }
    if !pending.jobs.is_empty() && sent.progress <= now {
        while let Some(&id) = pending.jobs.first() {
            if let Some(record) = farm.store.job(id).await? {
                let job = Box::new(views::job(farm, record).await?);
                send(farm, Event { id: None, body: EventBody::Progress { job } });
            }
            pending.jobs.remove(&id);
        }
        sent.progress = now + PROGRESS_PAUSE;
    }
    if pending.workers && sent.workers <= now {
        for worker in views::workers_and_ended(farm).await? {
            send(farm, Event { id: None, body: EventBody::Worker { worker } });
        }
        (pending.workers, sent.workers) = (false, now + WORKERS_PAUSE);
    }
    Ok(())
}

fn send(farm: &Farm, event: Event) {
    // An error means that nobody listens.
    let _ = farm.events.line.send(event);
}

/// What an event says, unless it says nothing any more or cannot be read, which would be no other the next time.
async fn readable_body_of(farm: &Farm, event: &StoredEvent) -> Result<Option<EventBody>, StoreError> {
    match body_of(farm, event).await {
        Err(error @ StoreError::Corrupt { .. }) => {
            tracing::error!(%error, id = event.id, "an event cannot be read and is left out");
            Ok(None)
        }
        body => body,
    }
}

/// The stored event with what is true now; `None` when what it is about is gone.
async fn body_of(farm: &Farm, event: &StoredEvent) -> Result<Option<EventBody>, StoreError> {
    match event.kind {
        StoredKind::Job => {
            let Some(record) = farm.store.job(event.job).await? else { return Ok(None) };
            Ok(Some(EventBody::Job { job: Box::new(views::job(farm, record).await?) }))
        }
        StoredKind::Round { frame, round } => {
            let point = farm.store.convergence_point(event.job, frame, round).await?;
            Ok(point.map(|point| EventBody::Round { job: event.job, point }))
        }
    }
}

/// Everything from `last_id` on, or from now on: the events that were missed, a snapshot, and then what happens. The
/// stream ends when the coordinator stops.
pub(crate) async fn listen(
    farm: Arc<Farm>,
    job: Option<JobId>,
    last_id: Option<i64>,
) -> Result<impl Stream<Item = Event> + Send + use<>, StoreError> {
    // Listening begins before the database is read, so that nothing falls between.
    let line = farm.events.line.subscribe();
    let mut listener = Listener { farm, job, line, queue: VecDeque::new(), last_id: 0 };
    if let Some(last_id) = last_id {
        listener.catch_up(last_id).await?;
    }
    listener.snapshot().await?;
    Ok(stream::unfold(listener, |mut listener| async { listener.next().await.map(|event| (event, listener)) }))
}

struct Listener {
    farm: Arc<Farm>,
    job: Option<JobId>,
    line: broadcast::Receiver<Event>,
    queue: VecDeque<Event>,
    last_id: i64,
}

impl Listener {
    async fn catch_up(&mut self, last_id: i64) -> Result<(), StoreError> {
        for event in self.farm.store.missed_events(self.job, last_id, BATCH).await? {
            if let Some(body) = readable_body_of(&self.farm, &event).await? {
                self.queue.push_back(Event { id: Some(event.id), body });
            }
        }
        Ok(())
    }

    async fn snapshot(&mut self) -> Result<(), StoreError> {
        self.last_id = self.farm.store.last_event_id().await?;
        let jobs = match self.job {
            None => views::jobs(&self.farm).await?,
            Some(job) => match self.farm.store.job(job).await? {
                Some(record) => vec![views::job(&self.farm, record).await?],
                None => Vec::new(),
            },
        };
        let workers = views::workers(&self.farm).await?;
        self.queue.push_back(Event { id: Some(self.last_id), body: EventBody::Snapshot { jobs, workers } });
        Ok(())
    }

    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.queue.pop_front() {
                return Some(event);
            }
            match self.farm.stopping.run_until_cancelled(self.line.recv()).await? {
                Ok(event) if self.is_news(&event) => {
                    self.last_id = event.id.unwrap_or(self.last_id);
                    return Some(event);
                }
                Ok(_) => {}
                Err(broadcast::error::RecvError::Lagged(_)) => {
                    // What the line still has is older than the snapshot.
                    self.line = self.line.resubscribe();
                    self.snapshot().await.ok()?;
                }
                Err(broadcast::error::RecvError::Closed) => return None,
            }
        }
    }

    fn is_news(&self, event: &Event) -> bool {
        let is_mine = self.job.is_none() || event.body.job().is_none_or(|job| Some(job) == self.job);
        is_mine && event.id.is_none_or(|id| id > self.last_id)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::pin::pin;

    use futures::StreamExt;

    use super::*;
    use crate::config::Config;
    use crate::server::open;
    use crate::store::tests::farm::some_job;

    fn alter(directory: &Path, statement: &str) {
        let database = rusqlite::Connection::open(directory.join("farm.sqlite")).unwrap();
        database.execute_batch(statement).unwrap();
    }

    #[tokio::test]
    async fn a_listener_of_one_job_that_comes_back_misses_nothing_of_it_however_much_happens_to_others() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = open(Config::new(directory.path())).await.unwrap();
        let (watched, busy) = (some_job(), some_job());
        let ids = [watched.id, busy.id];
        farm.store.insert_job(watched).await.unwrap();
        farm.store.insert_job(busy).await.unwrap();
        let [watched, busy] = ids;
        // Events 1 and 2 are the submissions.
        let rows = (3..=700).map(|id| {
            let job = if matches!(id, 3 | 650) { watched } else { busy };
            format!("insert into events (id, kind, job, created_ms) values ({id}, 'job', '{job}', 0);")
        });
        alter(directory.path(), &rows.collect::<String>());
        alter(directory.path(), "update sequences set value = 700 where name = 'event'");
        let missed = async |job, last_id| {
            let mut events = pin!(listen(Arc::clone(&farm), job, Some(last_id)).await.unwrap());
            let mut ids = Vec::new();
            loop {
                let Event { id, body } = events.next().await.unwrap();
                if matches!(body, EventBody::Snapshot { .. }) {
                    assert_eq!(id, Some(700));
                    return ids;
                }
                ids.extend(id);
            }
        };
        assert_eq!(missed(Some(watched), 1).await, [3, 650]);
        assert_eq!(missed(Some(watched), 3).await, [650]);
        assert_eq!(missed(Some(watched), 650).await, [0; 0]);
        // What is older than is kept, and what a database that was restored does not have yet.
        assert_eq!(missed(Some(watched), -5).await, [1, 3, 650]);
        assert_eq!(missed(Some(watched), i64::MAX).await, [0; 0]);
        assert_eq!(missed(None, 0).await, (201..=700).collect::<Vec<_>>(), "the newest come where all are too many");
    }

    #[tokio::test]
    async fn what_could_not_be_read_is_sent_later() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = open(Config::new(directory.path())).await.unwrap();
        let mut events = pin!(listen(Arc::clone(&farm), None, None).await.unwrap());
        assert!(matches!(events.next().await.unwrap().body, EventBody::Snapshot { .. }));
        let job = some_job();
        let mut sent = Sent::new(0);
        let mut pending = Changed { stored: true, jobs: [job.id].into(), workers: true };
        farm.store.insert_job(job).await.unwrap();
        alter(directory.path(), "alter table jobs rename to jobs_away");
        send_news(&farm, &mut sent, &mut pending).await.unwrap_err();
        alter(directory.path(), "alter table jobs_away rename to jobs");
        send_news(&farm, &mut sent, &mut pending).await.unwrap();
        assert!(matches!(events.next().await.unwrap(), Event { id: Some(_), body: EventBody::Job { .. } }));
        assert!(matches!(events.next().await.unwrap(), Event { id: None, body: EventBody::Progress { .. } }));
        assert!(sent.due(&pending).is_none(), "{pending:?}");
    }
}
