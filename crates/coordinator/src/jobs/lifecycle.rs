//! The life of a job after its submission: shown, cancelled, released.

use std::sync::Arc;

use clerestory_api::{JobId, JobView};
use tokio::task::JoinError;

use crate::clock::Clock;
use crate::model::{Ending, JobRecord};
use crate::store::{Store, StoreError};
use crate::tasks::to_completion;
use crate::watch::notifications::{Notification, Notifications};
use crate::watch::views::Views;

/// A call about a job fails.
#[derive(Debug, thiserror::Error)]
pub(crate) enum JobError {
    /// There is no such job.
    #[error("there is no job {0}")]
    Unknown(JobId),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The computation was stopped.
    #[error("the computation was stopped")]
    Stopped(#[from] JoinError),
}

/// The jobs of a farm.
#[derive(Debug)]
pub(crate) struct Jobs {
    store: Store,
    clock: Clock,
    notifications: Arc<Notifications>,
    views: Arc<Views>,
}

impl Jobs {
    /// The jobs in a store.
    pub(crate) fn new(store: Store, clock: Clock, notifications: Arc<Notifications>, views: Arc<Views>) -> Self {
        Self { store, clock, notifications, views }
    }

    /// The record of a job.
    pub(crate) async fn find(&self, job: JobId) -> Result<JobRecord, JobError> {
        self.store.job(job).await?.ok_or(JobError::Unknown(job))
    }

    /// A job as the API shows it.
    pub(crate) async fn view(&self, job: JobId) -> Result<JobView, JobError> {
        Ok(self.views.job(self.find(job).await?).await?)
    }

    /// Cancels a job. A job that has ended does not change.
    pub(crate) async fn cancel(&self, job: JobId) -> Result<JobView, JobError> {
        self.find(job).await?;
        let (store, notifications, now_ms) = (self.store.clone(), Arc::clone(&self.notifications), self.clock.now_ms());
        let cancelled = to_completion(async move {
            if store.end_job(job, Ending::Cancelled, now_ms).await? {
                tracing::info!(%job, "job cancelled");
                notifications.publish(Notification::Job(job));
            }
            Ok::<_, StoreError>(())
        });
        cancelled.await??;
        self.view(job).await
    }

    /// Grants leases again of a job that is held. A job that is not held does not change.
    pub(crate) async fn release(&self, job: JobId) -> Result<JobView, JobError> {
        self.find(job).await?;
        let (store, notifications, now_ms) = (self.store.clone(), Arc::clone(&self.notifications), self.clock.now_ms());
        let released = to_completion(async move {
            if store.release_job(job, now_ms).await? {
                tracing::info!(%job, "job released");
                notifications.publish(Notification::Job(job));
            }
            Ok::<_, StoreError>(())
        });
        released.await??;
        self.view(job).await
    }
}
