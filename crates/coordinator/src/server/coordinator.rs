//! The parts of a coordinator, each with what it needs, and its tasks.
//!
//! This is the only place that knows all parts. No part knows more than its own fields.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::error::RunError;
use super::storage::Storage;
use crate::background::Background;
use crate::config::Config;
use crate::films::FilmReader;
use crate::films::acceptance::{Acceptance, CheckSelection};
use crate::films::assets::Assets;
use crate::films::convergence::FrameMetrics;
use crate::films::garbage_collection::GarbageCollector;
use crate::films::images::Images;
use crate::films::live::LiveErrors;
use crate::films::pass_sharing::PassSharing;
use crate::films::previews::Previews;
use crate::films::repair::Repair;
use crate::films::rounds::film_lease::FilmLeases;
use crate::films::rounds::finalizer::{FinalizerParts, RoundFinalizer};
use crate::films::rounds::merging::Merger;
use crate::films::rounds::visits;
use crate::http::receiving::ReceivingMemory;
use crate::http::state::{Access, ApiState, BodyLimits};
use crate::jobs::claims::{Claims, LeasePolicy};
use crate::jobs::deadlines::Deadlines;
use crate::jobs::lifecycle::Jobs;
use crate::jobs::submission::Submissions;
use crate::jobs::upload_linger::UploadLinger;
use crate::jobs::workers::Workers;
use crate::store::{Store, StoreError};
use crate::tasks::Tasks;
use crate::watch::events::{EventFeed, Events};
use crate::watch::liveness::Liveness;
use crate::watch::notifications::{Notifications, Subscriptions};
use crate::watch::peers::Peers;
use crate::watch::rates::Rates;
use crate::watch::readiness::Readiness;
use crate::watch::views::Views;

/// A coordinator that is open and has not started its tasks.
#[derive(Debug)]
pub(super) struct Coordinator {
    directory: PathBuf,
    store: Store,
    stopping: CancellationToken,
    api: ApiState,
    notifications: Arc<Notifications>,
    subscriptions: Subscriptions,
    linger: Arc<UploadLinger>,
    finalizer: Arc<RoundFinalizer>,
    peers: Arc<Peers>,
    deadlines: Deadlines,
    collector: GarbageCollector,
}

impl Coordinator {
    /// Opens the storage of a farm, and makes the parts of a coordinator.
    pub(super) async fn open(config: Config) -> Result<Self, RunError> {
        let storage = Storage::open(&config).await?;
        let store = storage.store.clone();
        match Self::on(storage, config).await {
            Ok(coordinator) => Ok(coordinator),
            Err(error) => {
                store.close().await;
                Err(error.into())
            }
        }
    }

    /// Makes the parts of a coordinator on an open storage.
    async fn on(Storage { store, blobs }: Storage, config: Config) -> Result<Self, StoreError> {
        let Config { data_directory: directory, clock, build, image_bytes, lease_ttl, .. } = config;
        let checks = CheckSelection { key: store.check_key().await?, fraction: config.checked_fraction };
        // A SQLite file has one coordinator, which is the same after a restart.
        let id = if store.is_shared() { Uuid::now_v7() } else { Uuid::nil() };
        let stopping = CancellationToken::new();

        let (events, rates) = (Arc::new(Events::default()), Arc::new(Rates::new(clock.now_ms())));
        let (notifications, subscriptions) = Notifications::new(clock.clone(), Arc::clone(&events), Arc::clone(&rates));
        let notify = || Arc::clone(&notifications);
        let peers = Arc::new(Peers::new(store.clone(), id, notify(), stopping.clone()));
        let liveness = Arc::new(Liveness::new(clock.clone(), lease_ttl));
        let views = Arc::new(Views::new(store.clone(), clock.clone(), Arc::clone(&rates), Arc::clone(&liveness)));
        let feed = EventFeed::new(store.clone(), Arc::clone(&views), events, stopping.clone());
        let is_elsewhere = config.database.is_some() && config.bucket.is_some();
        let local = (!is_elsewhere).then(|| directory.clone());
        let readiness = Readiness::new(store.clone(), blobs.clone(), local, stopping.clone());

        let reader = Arc::new(FilmReader::new(store.clone(), blobs.clone(), config.node_cache_bytes));
        let read = || Arc::clone(&reader);
        let assets = Arc::new(Assets::new(store.clone(), blobs.clone(), notify(), clock.clone()));
        let repair =
            Arc::new(Repair::new(store.clone(), blobs.clone(), read(), Arc::clone(&assets), notify(), clock.clone()));
        let metrics = Arc::new(FrameMetrics::new(read(), blobs.clone(), clock.clone(), image_bytes));
        let parts = FinalizerParts {
            leases: FilmLeases::new(store.clone(), clock.clone(), id, stopping.clone()),
            metrics: Arc::clone(&metrics),
            merger: Merger::new(read(), blobs.clone()),
            sharing: PassSharing::new(read(), notify()),
            repair: Arc::clone(&repair),
            rates,
        };
        let finalizer = RoundFinalizer::new(store.clone(), clock.clone(), notify(), stopping.clone(), parts);
        let acceptance = Acceptance::new(
            store.clone(),
            blobs.clone(),
            read(),
            notify(),
            Arc::clone(&liveness),
            clock.clone(),
            checks,
        );
        let images = Images::new(read(), Arc::clone(&repair), directory.clone(), build, image_bytes);
        let previews = Previews::new(read(), Arc::clone(&repair), clock.clone(), config.preview_bytes);
        let live_errors = LiveErrors::new(read(), Arc::clone(&repair), blobs.clone(), clock.clone(), image_bytes);
        let collector = GarbageCollector::new(
            store.clone(),
            blobs.clone(),
            repair,
            Arc::clone(&assets),
            clock.clone(),
            stopping.clone(),
        );

        let linger = Arc::new(UploadLinger::default());
        let policy = LeasePolicy { ttl: lease_ttl, target: config.lease_target, fixed_nodes: config.lease_nodes };
        let claims = Arc::new(Claims::new(
            store.clone(),
            clock.clone(),
            policy,
            notify(),
            Arc::clone(&liveness),
            Arc::clone(&linger),
            stopping.clone(),
        ));
        let deadlines = Deadlines::new(
            store.clone(),
            clock.clone(),
            lease_ttl,
            notify(),
            liveness,
            Arc::clone(&linger),
            Arc::clone(&claims),
            stopping.clone(),
        );
        let submissions = Submissions::new(
            store.clone(),
            blobs.clone(),
            Arc::clone(&assets),
            metrics,
            notify(),
            clock.clone(),
            config.submission_bytes,
        );
        let api = ApiState {
            access: Access(config.token),
            limits: BodyLimits { asset: config.max_asset_bytes, partial: config.max_partial_bytes },
            receiving: Arc::new(ReceivingMemory::new(blobs)),
            store: store.clone(),
            jobs: Arc::new(Jobs::new(store.clone(), clock.clone(), notify(), Arc::clone(&views))),
            views,
            feed: Arc::new(feed),
            readiness: Arc::new(readiness),
            submissions: Arc::new(submissions),
            claims,
            acceptance: Arc::new(acceptance),
            workers: Arc::new(Workers::new(store.clone(), clock, notify())),
            assets,
            images: Arc::new(images),
            previews: Arc::new(previews),
            live_errors: Arc::new(live_errors),
        };
        let finalizer = Arc::new(finalizer);
        Ok(Self {
            directory,
            store,
            stopping,
            api,
            notifications,
            subscriptions,
            linger,
            finalizer,
            peers,
            deadlines,
            collector,
        })
    }

    /// The data directory.
    pub(super) fn directory(&self) -> &Path {
        &self.directory
    }

    /// The database.
    pub(super) fn store(&self) -> &Store {
        &self.store
    }

    /// Cancelled when the coordinator stops.
    pub(super) fn stopping(&self) -> &CancellationToken {
        &self.stopping
    }

    /// The parts that the API is made of.
    pub(super) fn api(&self) -> &ApiState {
        &self.api
    }

    /// Starts the tasks.
    pub(super) async fn start(self, background: &Background) -> Result<Tasks, StoreError> {
        for job in self.store.unsettled_jobs().await? {
            // A round may have been complete when the last coordinator stopped.
            self.notifications.wake_finalizer(job);
        }
        // The workers of a coordinator that was away come back all at once.
        self.linger.set_active_leases(self.store.active_leases().await?);
        let last_event = self.store.last_event_id().await?;
        let mut tasks = Tasks::default();
        let Subscriptions { films, peers } = self.subscriptions;
        tasks.add("recording rounds", background.spawn(visits::run(self.finalizer, films)));
        tasks.spawn("telling other coordinators", Arc::clone(&self.peers).send(peers));
        if self.store.is_shared() {
            tasks.spawn("hearing other coordinators", self.peers.receive());
        }
        tasks.spawn("sending events", self.api.feed.run(last_event));
        tasks.spawn("watching deadlines", self.deadlines.run());
        tasks.spawn("removing what is not needed", self.collector.run());
        Ok(tasks)
    }
}
