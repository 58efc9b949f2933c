//! Event streams: stored events in their order, and the progress of jobs and workers between them.
//!
//! One task sends everything, so that stored events go out in the order of their numbers and none is skipped, whichever
//! transaction committed first. Stored events go out within milliseconds, because clients wait for the end of a job.
//! Progress is batched: however many nodes arrive, a job is sent a few times a second at most, and workers once.

use std::collections::{BTreeSet, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use clerestory_api::{Event, EventBody, JobId};
use futures::stream::{self, Stream};
use tokio::sync::{Notify, broadcast};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use super::views::Views;
use crate::model::{StoredEvent, StoredKind};
use crate::store::{Store, StoreError};

/// Events by which a slow listener may fall behind before it gets a snapshot instead. It exceeds the number of workers,
/// since those go out together.
const BACKLOG: usize = 8192;

/// Stored events in one read, and the most that a reconnecting listener gets one by one.
const BATCH: u32 = 500;

/// Shortest time between two reads of stored events: every lease stores one.
const STORED_INTERVAL: Duration = Duration::from_millis(50);

/// Shortest time between two rounds of progress.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(200);

/// Pause after the database could not be read.
const FAILURE_PAUSE: Duration = Duration::from_secs(1);

/// Shortest time between two rounds of workers: a farm has thousands, and at any moment one of them changes.
const WORKERS_INTERVAL: Duration = Duration::from_millis(900);

/// What changed since the last time, and the channel on which events go out.
#[derive(Debug)]
pub(crate) struct Events {
    channel: broadcast::Sender<Event>,
    changes: Notify,
    changed: Mutex<Changed>,
}

/// Changes that no event has told yet.
#[derive(Debug, Default)]
struct Changed {
    /// Whether events have been stored.
    stored: bool,
    /// Jobs that have advanced.
    jobs: BTreeSet<JobId>,
    /// Whether a worker has changed.
    workers: bool,
}

impl Default for Events {
    fn default() -> Self {
        Self { channel: broadcast::Sender::new(BACKLOG), changes: Notify::new(), changed: Mutex::default() }
    }
}

impl Events {
    /// Marks that events have been stored.
    pub(crate) fn stored(&self) {
        self.changed().stored = true;
        self.changes.notify_one();
    }

    /// Marks that a job has advanced.
    pub(crate) fn progressed(&self, job: JobId) {
        self.changed().jobs.insert(job);
        self.changes.notify_one();
    }

    /// Marks that a worker has changed.
    pub(crate) fn workers_changed(&self) {
        self.changed().workers = true;
        self.changes.notify_one();
    }

    /// Moves the changes since the last call into `pending`.
    fn move_to(&self, pending: &mut Changed) {
        let Changed { stored, jobs, workers } = std::mem::take(&mut *self.changed());
        pending.stored |= stored;
        pending.jobs.extend(jobs);
        pending.workers |= workers;
    }

    fn send(&self, event: Event) {
        // An error means that there is no listener.
        let _ = self.channel.send(event);
    }

    fn changed(&self) -> MutexGuard<'_, Changed> {
        self.changed.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The last stored event that was sent, and the earliest times of the next events.
#[derive(Debug)]
struct Sent {
    last_id: i64,
    stored: Instant,
    progress: Instant,
    workers: Instant,
    /// Jobs that waited for a build when workers were sent.
    waiting: BTreeSet<JobId>,
}

impl Sent {
    fn new(last_id: i64) -> Self {
        let now = Instant::now();
        Self { last_id, stored: now, progress: now, workers: now, waiting: BTreeSet::new() }
    }

    /// When the first of the pending changes may be sent.
    fn due(&self, pending: &Changed) -> Option<Instant> {
        let stored = pending.stored.then_some(self.stored);
        let progress = (!pending.jobs.is_empty()).then_some(self.progress);
        let workers = pending.workers.then_some(self.workers);
        [stored, progress, workers].into_iter().flatten().min()
    }

    /// Sends nothing before this time.
    fn postpone(&mut self, until: Instant) {
        [self.stored, self.progress, self.workers] = [until; 3];
    }
}

/// Turns changes into events, and gives each listener its stream.
#[derive(Debug)]
pub(crate) struct EventFeed {
    store: Store,
    views: Arc<Views>,
    events: Arc<Events>,
    stopping: CancellationToken,
}

impl EventFeed {
    /// A feed of these changes.
    pub(crate) fn new(store: Store, views: Arc<Views>, events: Arc<Events>, stopping: CancellationToken) -> Self {
        Self { store, views, events, stopping }
    }

    /// Sends events until the coordinator stops, beginning after the stored event `last_id`.
    pub(crate) async fn run(self: Arc<Self>, last_id: i64) {
        let (mut sent, mut pending) = (Sent::new(last_id), Changed::default());
        loop {
            let due = sent.due(&pending);
            tokio::select! {
                () = self.stopping.cancelled() => return,
                () = self.events.changes.notified() => self.events.move_to(&mut pending),
                () = tokio::time::sleep_until(due.unwrap_or_else(Instant::now)), if due.is_some() => {
                    if let Err(error) = self.send_pending(&mut sent, &mut pending).await {
                        tracing::error!(%error, "events could not be read, trying again");
                        sent.postpone(Instant::now() + FAILURE_PAUSE);
                    }
                }
            }
        }
    }

    /// Sends the stored events that have not been sent, and those other pending changes that are due. The rest stays
    /// pending.
    async fn send_pending(&self, sent: &mut Sent, pending: &mut Changed) -> Result<(), StoreError> {
        let now = Instant::now();
        loop {
            let stored = self.store.events_after(sent.last_id, BATCH).await?;
            for event in &stored {
                let body = self.readable_body_of(event).await?;
                sent.last_id = event.id;
                if let Some(body) = body {
                    self.events.send(Event { id: Some(event.id), body });
                }
            }
            if stored.len() < BATCH as usize {
                break;
            }
        }
        (pending.stored, sent.stored) = (false, now + STORED_INTERVAL);
        if self.events.channel.receiver_count() == 0 {
            *pending = Changed::default();
            return Ok(());
        }
        if pending.workers && sent.workers <= now {
            for worker in self.views.workers_and_ended().await? {
                self.events.send(Event { id: None, body: EventBody::Worker { worker } });
            }
            // Workers that come and go change which jobs wait for a build.
            let waiting = self.views.jobs_that_wait_for_a_build().await?;
            pending.jobs.extend(waiting.symmetric_difference(&sent.waiting));
            sent.waiting = waiting;
            (pending.workers, sent.workers) = (false, now + WORKERS_INTERVAL);
        }
        if !pending.jobs.is_empty() && sent.progress <= now {
            while let Some(&id) = pending.jobs.first() {
                if let Some(record) = self.store.job(id).await? {
                    let job = Box::new(self.views.job(record).await?);
                    self.events.send(Event { id: None, body: EventBody::Progress { job } });
                }
                pending.jobs.remove(&id);
            }
            sent.progress = now + PROGRESS_INTERVAL;
        }
        Ok(())
    }

    /// The body of a stored event. An event that cannot be read is skipped, because no later read would succeed either.
    async fn readable_body_of(&self, event: &StoredEvent) -> Result<Option<EventBody>, StoreError> {
        match self.body_of(event).await {
            Err(error @ StoreError::Corrupt { .. }) => {
                tracing::error!(%error, id = event.id, "an event cannot be read and is left out");
                Ok(None)
            }
            body => body,
        }
    }

    /// The current state of what a stored event points at, or `None` when that is gone.
    async fn body_of(&self, event: &StoredEvent) -> Result<Option<EventBody>, StoreError> {
        match event.kind {
            StoredKind::Job => {
                let Some(record) = self.store.job(event.job).await? else { return Ok(None) };
                Ok(Some(EventBody::Job { job: Box::new(self.views.job(record).await?) }))
            }
            StoredKind::Round { frame, round } => {
                let point = self.store.convergence_point(event.job, frame, round).await?;
                Ok(point.map(|point| EventBody::Round { job: event.job, point }))
            }
        }
    }

    /// The stream of one listener: the events that it missed since `last_id`, a snapshot, and then every event, of one
    /// job or of all. The stream ends when the coordinator stops.
    pub(crate) async fn listen(
        self: Arc<Self>,
        job: Option<JobId>,
        last_id: Option<i64>,
    ) -> Result<impl Stream<Item = Event> + Send + use<>, StoreError> {
        // It subscribes before it reads the database, so that no event falls between.
        let channel = self.events.channel.subscribe();
        let mut listener = Listener { feed: self, job, channel, queue: VecDeque::new(), last_id: 0 };
        if let Some(last_id) = last_id {
            listener.catch_up(last_id).await?;
        }
        listener.snapshot().await?;
        Ok(stream::unfold(listener, |mut listener| async { listener.next().await.map(|event| (event, listener)) }))
    }
}

struct Listener {
    feed: Arc<EventFeed>,
    job: Option<JobId>,
    channel: broadcast::Receiver<Event>,
    queue: VecDeque<Event>,
    last_id: i64,
}

impl Listener {
    async fn catch_up(&mut self, last_id: i64) -> Result<(), StoreError> {
        for event in self.feed.store.missed_events(self.job, last_id, BATCH).await? {
            if let Some(body) = self.feed.readable_body_of(&event).await? {
                self.queue.push_back(Event { id: Some(event.id), body });
            }
        }
        Ok(())
    }

    async fn snapshot(&mut self) -> Result<(), StoreError> {
        self.last_id = self.feed.store.last_event_id().await?;
        let jobs = match self.job {
            None => self.feed.views.jobs().await?,
            Some(job) => match self.feed.store.job(job).await? {
                Some(record) => vec![self.feed.views.job(record).await?],
                None => Vec::new(),
            },
        };
        let workers = self.feed.views.workers().await?;
        self.queue.push_back(Event { id: Some(self.last_id), body: EventBody::Snapshot { jobs, workers } });
        Ok(())
    }

    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.queue.pop_front() {
                return Some(event);
            }
            match self.feed.stopping.run_until_cancelled(self.channel.recv()).await? {
                Ok(event) if self.is_wanted(&event) => {
                    self.last_id = event.id.unwrap_or(self.last_id);
                    return Some(event);
                }
                Ok(_) => {}
                Err(broadcast::error::RecvError::Lagged(_)) => {
                    // The events that are still in the channel are older than the snapshot.
                    self.channel = self.channel.resubscribe();
                    self.snapshot().await.ok()?;
                }
                Err(broadcast::error::RecvError::Closed) => return None,
            }
        }
    }

    fn is_wanted(&self, event: &Event) -> bool {
        let is_of_job = self.job.is_none() || event.body.job().is_none_or(|job| Some(job) == self.job);
        is_of_job && event.id.is_none_or(|id| id > self.last_id)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::pin::pin;

    use futures::StreamExt;

    use super::*;
    use crate::clock::Clock;
    use crate::store::Source;
    use crate::store::tests::farm::some_job;
    use crate::watch::liveness::Liveness;
    use crate::watch::rates::Rates;

    /// A feed of a new farm in a directory.
    async fn feed(directory: &Path) -> Arc<EventFeed> {
        let store = Store::open(Source::file(&directory.join("farm.sqlite"))).await.unwrap();
        let (clock, rates) = (Clock::default(), Arc::new(Rates::new(0)));
        let liveness = Arc::new(Liveness::new(clock.clone(), Duration::from_secs(60)));
        let views = Arc::new(Views::new(store.clone(), clock, rates, liveness));
        Arc::new(EventFeed::new(store, views, Arc::default(), CancellationToken::new()))
    }

    fn alter(directory: &Path, statement: &str) {
        let database = rusqlite::Connection::open(directory.join("farm.sqlite")).unwrap();
        database.execute_batch(statement).unwrap();
    }

    #[tokio::test]
    async fn a_listener_of_one_job_that_comes_back_misses_nothing_of_it_however_much_happens_to_others() {
        let directory = tempfile::tempdir().unwrap();
        let feed = feed(directory.path()).await;
        let (watched, busy) = (some_job(), some_job());
        let ids = [watched.id, busy.id];
        feed.store.insert_job(watched).await.unwrap();
        feed.store.insert_job(busy).await.unwrap();
        let [watched, busy] = ids;
        // Events 1 and 2 are the submissions.
        let rows = (3..=700).map(|id| {
            let job = if matches!(id, 3 | 650) { watched } else { busy };
            format!("insert into events (id, kind, job, created_ms) values ({id}, 'job', '{job}', 0);")
        });
        alter(directory.path(), &rows.collect::<String>());
        alter(directory.path(), "update sequences set value = 700 where name = 'event'");
        let missed = async |job, last_id| {
            let mut events = pin!(Arc::clone(&feed).listen(job, Some(last_id)).await.unwrap());
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
        // An event that is too old, and one that a restored database does not have yet.
        assert_eq!(missed(Some(watched), -5).await, [1, 3, 650]);
        assert_eq!(missed(Some(watched), i64::MAX).await, [0; 0]);
        assert_eq!(missed(None, 0).await, (201..=700).collect::<Vec<_>>(), "the newest come where all are too many");
    }

    #[tokio::test]
    async fn an_event_that_could_not_be_read_is_sent_later() {
        let directory = tempfile::tempdir().unwrap();
        let feed = feed(directory.path()).await;
        let mut events = pin!(Arc::clone(&feed).listen(None, None).await.unwrap());
        assert!(matches!(events.next().await.unwrap().body, EventBody::Snapshot { .. }));
        let job = some_job();
        let mut sent = Sent::new(0);
        let mut pending = Changed { stored: true, jobs: [job.id].into(), workers: true };
        feed.store.insert_job(job).await.unwrap();
        alter(directory.path(), "alter table jobs rename to jobs_away");
        feed.send_pending(&mut sent, &mut pending).await.unwrap_err();
        alter(directory.path(), "alter table jobs_away rename to jobs");
        feed.send_pending(&mut sent, &mut pending).await.unwrap();
        assert!(matches!(events.next().await.unwrap(), Event { id: Some(_), body: EventBody::Job { .. } }));
        assert!(matches!(events.next().await.unwrap(), Event { id: None, body: EventBody::Progress { .. } }));
        assert!(sent.due(&pending).is_none(), "{pending:?}");
    }
}
