//! What everything in the coordinator shares.

use std::sync::Arc;

use clerestory_api::JobId;
use tokio::sync::{Notify, Semaphore, mpsc};
use tokio_util::sync::CancellationToken;

use crate::blobs::Blobs;
use crate::config::Config;
use crate::events::Events;
use crate::film::FilmReader;
use crate::images::Images;
use crate::rate::Rates;
use crate::store::Store;

/// Partials that are received and decoded at the same time: each is held in memory, and may be as large as the limit allows.
const PARTIALS: usize = 8;

/// The farm, as its coordinator holds it. All that must not be lost is in `store` and `blobs`; the rest is caches and
/// bells.
#[derive(Debug)]
pub(crate) struct Farm {
    /// How the coordinator is set up.
    pub(crate) config: Config,
    /// The database.
    pub(crate) store: Store,
    /// Assets and nodes.
    pub(crate) blobs: Blobs,
    /// Reads accepted nodes.
    pub(crate) film: FilmReader,
    /// Images as they are now.
    pub(crate) images: Images,
    /// Tells listeners what happens.
    pub(crate) events: Events,
    /// How fast jobs advance.
    pub(crate) rates: Rates,
    /// Rings when work may have become available.
    pub(crate) work: Notify,
    /// Permits for receiving a partial.
    pub(crate) partials: Semaphore,
    /// Permit for building a submitted scene, which may take much memory.
    pub(crate) building: Semaphore,
    /// Rings the keeper for a job whose film has grown.
    pub(crate) keeper: mpsc::UnboundedSender<JobId>,
    /// Says that the coordinator is stopping.
    pub(crate) stopping: CancellationToken,
}

impl Farm {
    /// A farm on an open store. The receiver is the keeper's.
    pub(crate) fn new(config: Config, store: Store, blobs: Blobs) -> (Arc<Self>, mpsc::UnboundedReceiver<JobId>) {
        let (keeper, grown) = mpsc::unbounded_channel();
        let film = FilmReader::new(blobs.clone(), config.node_cache_bytes);
        let rates = Rates::new(config.clock.now_ms());
        let farm = Self {
            config,
            store,
            blobs,
            film,
            images: Images::default(),
            events: Events::default(),
            rates,
            work: Notify::new(),
            partials: Semaphore::new(PARTIALS),
            building: Semaphore::new(1),
            keeper,
            stopping: CancellationToken::new(),
        };
        (Arc::new(farm), grown)
    }

    /// Tells everybody that a job has changed its state.
    pub(crate) fn job_changed(&self, job: JobId) {
        self.events.stored();
        self.events.progressed(job);
        self.work.notify_waiters();
    }

    /// Rings the keeper: the film of a job has grown.
    pub(crate) fn film_grew(&self, job: JobId) {
        // The keeper is gone only when the coordinator stops; it looks at all open jobs when it starts again.
        let _ = self.keeper.send(job);
    }
}
