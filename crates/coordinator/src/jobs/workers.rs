//! Workers: registered, heard of, ended, released from quarantine.

use std::sync::Arc;

use clerestory_api::{WorkerActivity, WorkerId, WorkerRegistration};
use tokio::task::JoinError;
use uuid::Uuid;

use crate::clock::Clock;
use crate::store::{Store, StoreError, WorkerError};
use crate::tasks::to_completion;
use crate::watch::notifications::{Notification, Notifications};

/// A call of a worker fails.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WorkerCallError {
    /// It is unknown or quarantined, or the database failed.
    #[error(transparent)]
    Worker(#[from] WorkerError),
    /// The computation was stopped.
    #[error("the computation was stopped")]
    Stopped(#[from] JoinError),
}

impl From<StoreError> for WorkerCallError {
    fn from(error: StoreError) -> Self {
        Self::Worker(error.into())
    }
}

/// The workers of a farm.
#[derive(Debug)]
pub(crate) struct Workers {
    store: Store,
    clock: Clock,
    notifications: Arc<Notifications>,
}

impl Workers {
    /// The workers in a store.
    pub(crate) fn new(store: Store, clock: Clock, notifications: Arc<Notifications>) -> Self {
        Self { store, clock, notifications }
    }

    /// Registers a worker.
    pub(crate) async fn register(&self, registration: WorkerRegistration) -> Result<WorkerId, WorkerCallError> {
        let id = WorkerId::from(Uuid::now_v7());
        let (name, cores) = (registration.name.clone(), registration.cores);
        self.store.register_worker(id, registration, self.clock.now_ms()).await?;
        tracing::info!(worker = %id, name, cores, "worker registered");
        self.notifications.publish(Notification::Workers);
        Ok(id)
    }

    /// Stores a heartbeat.
    pub(crate) async fn heartbeat(&self, worker: WorkerId, activity: WorkerActivity) -> Result<(), WorkerCallError> {
        self.store.touch_worker(worker, self.clock.now_ms(), activity).await?;
        self.notifications.publish(Notification::Workers);
        Ok(())
    }

    /// Ends a worker. Its leases go back to the queue.
    pub(crate) async fn end(&self, worker: WorkerId) -> Result<(), WorkerCallError> {
        let (store, notifications, now_ms) = (self.store.clone(), Arc::clone(&self.notifications), self.clock.now_ms());
        let ended = to_completion(async move {
            if store.end_worker(worker, now_ms).await? {
                tracing::info!(%worker, "worker ended");
                notifications.publish(Notification::Work);
            }
            Ok::<_, WorkerError>(())
        });
        Ok(ended.await??)
    }

    /// Grants leases again to a quarantined worker, and to all workers of the same name.
    pub(crate) async fn release(&self, worker: WorkerId) -> Result<(), WorkerCallError> {
        let (store, notifications) = (self.store.clone(), Arc::clone(&self.notifications));
        let released = to_completion(async move {
            store.release_worker(worker).await?;
            tracing::info!(%worker, "worker released");
            notifications.publish(Notification::Work);
            Ok::<_, WorkerError>(())
        });
        Ok(released.await??)
    }
}
