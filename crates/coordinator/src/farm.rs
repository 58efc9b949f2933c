//! What everything in the coordinator shares.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clerestory_api::{ContentHash, JobId};
use tokio::sync::{Notify, Semaphore, mpsc};
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use crate::blobs::Blobs;
use crate::config::Config;
use crate::films::FilmReader;
use crate::films::live::LiveValues;
use crate::films::previews::Previews;
use crate::http::problem::ApiError;
use crate::jobs::idle_workers::Idle;
use crate::jobs::submission_memory::Submissions;
use crate::memory::permits;
use crate::model::{CheckKey, Removed, SHORTEST_LINGER_SECONDS};
use crate::store::Store;
use crate::watch::events::Events;
use crate::watch::notifications::News;
use crate::watch::rates::Rates;
use crate::watch::readiness::Readiness;

/// Bytes of partials that are received at the same time, but for one that goes on beyond them.
pub(crate) const RECEIVED_BYTES: u64 = 32 << 20;

/// Memory for partials that are decoded at the same time, and for their nodes until they are accepted. One that takes more is decoded alone.
pub(crate) const DECODED_BYTES: u64 = 64 << 20;

/// Batches of tiles that are merged at the same time, of whichever jobs: while one is computed, another waits for the disk.
pub(crate) const MERGES: usize = 2;

/// Partials that all leases together are to bring in a second, when there are many: each costs some milliseconds, however little is in it.
const PARTIALS_PER_SECOND: u32 = 100;

/// How long a complete node waits for others at most, where a lease does not end before.
const LONGEST_GATHERING: Duration = Duration::from_secs(30);

/// How long a worker may be silent before others do without it: three signs of life.
const LONGEST_SILENCE: Duration = Duration::from_secs(15);

/// Who waits for work and is rung when there may be some.
const RUNG: u32 = 2;

/// The farm, as its coordinator holds it. All that must not be lost is in `store` and `blobs`; the rest is caches and
/// bells.
#[derive(Debug)]
pub(crate) struct Farm {
    /// How the coordinator is set up.
    pub(crate) config: Config,
    /// Which of the farm's coordinators this is.
    pub(crate) coordinator: Uuid,
    /// What decides which nodes are checked.
    pub(crate) check_key: CheckKey,
    /// The database.
    pub(crate) store: Store,
    /// Assets and nodes.
    pub(crate) blobs: Blobs,
    /// Reads accepted nodes.
    pub(crate) film: FilmReader,
    /// Permits for making images that are downloaded, one for each kibibyte.
    pub(crate) images: Semaphore,
    /// Previews that may be asked for again.
    pub(crate) previews: Previews,
    /// Errors between rounds that may be asked for again.
    pub(crate) live: LiveValues,
    /// Tells listeners what happens.
    pub(crate) events: Events,
    /// How fast jobs advance.
    pub(crate) rates: Rates,
    /// Rings when work may have become available.
    pub(crate) work: Notify,
    /// Who waits for it.
    pub(crate) idle: Idle,
    /// Permits for receiving partials, one for each kibibyte.
    pub(crate) receiving: Semaphore,
    /// Permit for receiving the rest of a partial without them: those that have begun to come could wait for each other.
    pub(crate) receiving_beyond: Semaphore,
    /// Permits for decoding partials, one for each kibibyte.
    pub(crate) decoding: Arc<Semaphore>,
    /// Permits for rows that are measured, one for each kibibyte.
    pub(crate) measuring: Semaphore,
    /// Permits for the rows of frames and references that are compared by eye, one for each kibibyte.
    pub(crate) comparing: Semaphore,
    /// Permits for batches of tiles that are merged.
    pub(crate) merging: Semaphore,
    /// Memory for submissions that are checked.
    pub(crate) submissions: Submissions,
    /// Leases that were active a moment ago, at whichever coordinator.
    active_leases: AtomicU32,
    /// Since when workers are heard without a gap.
    listening: Mutex<Instant>,
    /// Rings the keeper for a job of which a round may be complete.
    keeper: mpsc::UnboundedSender<JobId>,
    /// What the other coordinators are to be told.
    told: mpsc::UnboundedSender<News>,
    /// Whether it can do its work.
    pub(crate) readiness: Readiness,
    /// Says that the coordinator is stopping.
    pub(crate) stopping: CancellationToken,
}

/// What the tasks of a farm are rung by.
#[derive(Debug)]
pub(crate) struct Bells {
    /// Jobs of which a round may be complete, for the keeper.
    pub(crate) grown: mpsc::UnboundedReceiver<JobId>,
    /// What the other coordinators are to be told.
    pub(crate) told: mpsc::UnboundedReceiver<News>,
}

impl Farm {
    /// A farm on an open store.
    pub(crate) fn new(
        config: Config,
        coordinator: Uuid,
        check_key: CheckKey,
        store: Store,
        blobs: Blobs,
    ) -> (Arc<Self>, Bells) {
        let (keeper, grown) = mpsc::unbounded_channel();
        let (tell, told) = mpsc::unbounded_channel();
        let film = FilmReader::new(blobs.clone(), config.node_cache_bytes);
        let [images, measuring] = [(); 2].map(|()| Semaphore::new(permits(config.image_bytes / 2) as usize));
        let comparing = Semaphore::new(permits(config.image_bytes / 4) as usize);
        let previews = Previews::new(config.preview_bytes);
        let submissions = Submissions::new(config.submission_bytes);
        let rates = Rates::new(config.clock.now_ms());
        let farm = Self {
            config,
            coordinator,
            check_key,
            store,
            blobs,
            film,
            images,
            previews,
            live: LiveValues::default(),
            events: Events::default(),
            rates,
            work: Notify::new(),
            idle: Idle::default(),
            receiving: Semaphore::new(permits(RECEIVED_BYTES) as usize),
            receiving_beyond: Semaphore::new(1),
            decoding: Arc::new(Semaphore::new(permits(DECODED_BYTES) as usize)),
            measuring,
            comparing,
            merging: Semaphore::new(MERGES),
            submissions,
            active_leases: AtomicU32::new(0),
            listening: Mutex::new(Instant::now()),
            keeper,
            told: tell,
            readiness: Readiness::default(),
            stopping: CancellationToken::new(),
        };
        (Arc::new(farm), Bells { grown, told })
    }

    /// Most bytes of the rows of an image that are in memory at a time.
    pub(crate) fn strip_bytes(&self) -> u64 {
        self.config.image_bytes / 2
    }

    /// Tells everybody, at this coordinator and at the others.
    pub(crate) fn tell(&self, news: News) {
        self.hear(news);
        // The sender is gone only when the coordinator stops.
        let _ = self.told.send(news);
    }

    /// Tells everybody at this coordinator.
    pub(crate) fn hear(&self, news: News) {
        match news {
            News::Job(job) => {
                self.events.stored();
                self.events.progressed(job);
                self.ring_for_work();
                self.look_at_film(job);
            }
            News::Film { job, samples } => {
                self.rates.add(job, samples, self.config.clock.now_ms());
                self.events.progressed(job);
                self.events.workers_changed();
            }
            News::Wave(job) => self.look_at_film(job),
            News::Lease(job) => {
                self.events.stored();
                self.events.progressed(job);
                self.events.workers_changed();
            }
            News::Work => {
                self.events.workers_changed();
                self.ring_for_work();
            }
            News::Workers => self.events.workers_changed(),
        }
    }

    /// Lets go of what has been taken out of films.
    pub(crate) async fn let_go(&self, removed: Removed) {
        self.film.forget(&removed.blob_ranges);
        self.blobs.remove(removed.blobs).await;
    }

    /// Whether an asset has been uploaded and is still there: a blob store that was restored may lack what the database knows.
    pub(crate) async fn has_asset(&self, hash: ContentHash) -> Result<bool, ApiError> {
        Ok(self.store.has_asset(hash).await? && self.blobs.has_asset(hash).await?)
    }

    /// A worker that was last heard of before this is silent, milliseconds since 1970.
    pub(crate) fn silent_before_ms(&self) -> i64 {
        self.config.clock.now_ms().saturating_sub(milliseconds(self.config.lease_ttl))
    }

    /// A worker that was last heard of before this is not waited for, milliseconds since 1970: workers say every few seconds that they are there.
    /// All are waited for by a coordinator that has not listened for so long itself.
    pub(crate) fn alive_ms(&self) -> i64 {
        let listening = *self.listening.lock().unwrap_or_else(PoisonError::into_inner);
        if listening.elapsed() < LONGEST_SILENCE {
            return i64::MIN;
        }
        self.config.clock.now_ms().saturating_sub(milliseconds(LONGEST_SILENCE))
    }

    /// Since when this coordinator has listened without a gap, milliseconds since 1970.
    pub(crate) fn listening_ms(&self) -> i64 {
        let listening = *self.listening.lock().unwrap_or_else(PoisonError::into_inner);
        self.config.clock.now_ms().saturating_sub(milliseconds(listening.elapsed()))
    }

    /// Notes how many leases are active.
    pub(crate) fn has_active_leases(&self, count: u32) {
        self.active_leases.store(count, Ordering::Relaxed);
    }

    /// How long a complete node of a long lease is to wait for others that travel with it: a thousand workers who each brought what they have every second would take
    /// all of a coordinator's time.
    pub(crate) fn gathering_time(&self) -> Duration {
        let shared = Duration::from_secs(1) * self.active_leases.load(Ordering::Relaxed) / PARTIALS_PER_SECOND;
        shared.clamp(Duration::from_secs_f64(SHORTEST_LINGER_SECONDS), LONGEST_GATHERING)
    }

    /// Workers may have said that they are there, up to now, without having been heard.
    pub(crate) fn listen_anew(&self) {
        self.listens_since(Instant::now());
    }

    pub(crate) fn listens_since(&self, since: Instant) {
        *self.listening.lock().unwrap_or_else(PoisonError::into_inner) = since;
    }

    /// Looks at everything that other coordinators may have done without being heard.
    pub(crate) fn look_around(&self) {
        self.events.stored();
        self.events.workers_changed();
        self.ring_for_work();
    }

    /// Lets some of those who wait for work look for it. Each that gets some rings again, so that soon all are at work if there is enough; while
    /// there is none, a thousand who wait cost no more than these.
    pub(crate) fn ring_for_work(&self) {
        for _ in 0..RUNG {
            self.work.notify_one();
        }
    }

    /// What rings the keeper.
    pub(crate) fn keeper(&self) -> mpsc::UnboundedSender<JobId> {
        self.keeper.clone()
    }

    /// Rings the keeper: a round of a job may have become complete.
    pub(crate) fn look_at_film(&self, job: JobId) {
        // The keeper is gone only when the coordinator stops; it looks at all open jobs when it starts again.
        let _ = self.keeper.send(job);
    }
}

fn milliseconds(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::server::open;

    #[tokio::test]
    async fn a_coordinator_that_has_not_listened_waits_for_every_worker() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = open(Config::new(directory.path())).await.unwrap();
        assert_eq!(farm.alive_ms(), i64::MIN);
        farm.listens_since(Instant::now().checked_sub(LONGEST_SILENCE).unwrap());
        let silent_ms = farm.config.clock.now_ms() - farm.alive_ms();
        assert!((15_000..20_000).contains(&silent_ms), "{silent_ms}");
        farm.listen_anew();
        assert_eq!(farm.alive_ms(), i64::MIN);
    }

    #[tokio::test]
    async fn nodes_wait_for_others_the_longer_the_more_leases_there_are() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = open(Config::new(directory.path())).await.unwrap();
        let gathering = |leases| {
            farm.has_active_leases(leases);
            farm.gathering_time().as_millis()
        };
        assert_eq!(
            [0, 1, 100, 400, 1000, 5000, u32::MAX].map(gathering),
            [1000, 1000, 1000, 4000, 10_000, 30_000, 30_000]
        );
    }
}
