//! Film leases: of several coordinators, one at a time finalizes the rounds of a job.
//!
//! A lease is a row of the database that ends by itself. While a coordinator works on a film, a task renews its lease.
//! When renewing fails for so long that another coordinator may take over, the work is dropped.

use std::time::Duration;

use clerestory_api::JobId;
use tokio_util::sync::CancellationToken;
use tokio_util::task::AbortOnDropHandle;
use uuid::Uuid;

use crate::clock::Clock;
use crate::model::FilmLease;
use crate::store::{Store, StoreError};

/// How long a film lease lasts without being renewed. When a coordinator dies, another waits as long.
pub(super) const TERM_MS: i64 = 10_000;

/// Least pause before a renewal, also after one that failed.
const RENEWAL_MS: i64 = 1000;

/// Leases films for a coordinator.
#[derive(Clone, Debug)]
pub(crate) struct FilmLeases {
    pub(super) store: Store,
    pub(super) clock: Clock,
    pub(super) coordinator: Uuid,
    pub(super) stopping: CancellationToken,
}

impl FilmLeases {
    /// Leases for this coordinator.
    pub(crate) fn new(store: Store, clock: Clock, coordinator: Uuid, stopping: CancellationToken) -> Self {
        Self { store, clock, coordinator, stopping }
    }

    /// Leases the film of a job until some time, or renews its lease.
    pub(super) async fn acquire(&self, job: JobId, now_ms: i64, until_ms: i64) -> Result<FilmLease, StoreError> {
        self.store.acquire_film_lease(job, self.coordinator, now_ms, until_ms).await
    }

    /// Gives all leases of this coordinator back.
    pub(super) async fn release_all(&self) -> Result<(), StoreError> {
        self.store.release_film_leases(self.coordinator).await
    }

    /// Renews a lease that ends at some time.
    pub(super) fn renewing(&self, job: JobId, until_ms: i64) -> RenewedLease {
        let lost = self.stopping.child_token();
        // Cancelled however the task ends, also when it panics.
        let is_lost = lost.clone().drop_guard();
        let leases = self.clone();
        let renewing = AbortOnDropHandle::new(tokio::spawn(async move {
            leases.renew(job, until_ms).await;
            drop(is_lost);
        }));
        RenewedLease { lost, _renewing: renewing }
    }

    /// Renews a lease until another coordinator has it, or may have it because renewing failed for too long.
    async fn renew(&self, job: JobId, mut until_ms: i64) {
        loop {
            let left_ms = until_ms - self.clock.now_ms();
            if left_ms <= 0 {
                return;
            }
            let pause_ms = (left_ms - TERM_MS / 2).clamp(RENEWAL_MS, TERM_MS);
            tokio::time::sleep(milliseconds(pause_ms)).await;
            let now_ms = self.clock.now_ms();
            let next_ms = now_ms.saturating_add(TERM_MS);
            let renewal = self.acquire(job, now_ms, next_ms);
            // A database that does not answer leaves the film to others all the same.
            match tokio::time::timeout(milliseconds(until_ms - now_ms), renewal).await {
                Ok(Ok(FilmLease::Held)) => until_ms = next_ms,
                Ok(Ok(FilmLease::HeldElsewhere { .. })) | Err(_) => return,
                Ok(Err(error)) => tracing::warn!(%job, %error, "the film lease could not be renewed"),
            }
        }
    }
}

/// A film lease that a task renews until it is dropped.
pub(super) struct RenewedLease {
    /// Cancelled when another coordinator may have the film, and when this one stops.
    lost: CancellationToken,
    _renewing: AbortOnDropHandle<()>,
}

impl RenewedLease {
    /// Whether another coordinator may have the film.
    pub(super) fn is_lost(&self) -> bool {
        self.lost.is_cancelled()
    }

    /// Runs work that may be dropped at any moment. `None` when the lease is lost meanwhile.
    pub(super) async fn while_held<T>(&self, work: impl Future<Output = T>) -> Option<T> {
        self.lost.run_until_cancelled(work).await
    }
}

fn milliseconds(count: i64) -> Duration {
    Duration::from_millis(u64::try_from(count).unwrap_or(0))
}
