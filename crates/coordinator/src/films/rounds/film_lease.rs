//! A coordinator's claim on the film of a job: renewed while it works on it, and lost when another may have it.
//!
//! Of several coordinators, one at a time keeps the film of a job, by a row of the database that ends by itself. Whoever works on a film holds a
//! [`Claim`]: a task renews the row in time, and when that fails for so long that another may go on, work under way is dropped.

use std::sync::Arc;
use std::time::Duration;

use clerestory_api::JobId;
use tokio_util::sync::CancellationToken;
use tokio_util::task::AbortOnDropHandle;

use crate::farm::Farm;
use crate::model::FilmLease;

/// How long a coordinator keeps a film without renewing its claim. As long may pass until another goes on when it dies.
pub(super) const TERM_MS: i64 = 10_000;

/// Least pause before a claim is renewed, also when that has just failed.
const RENEWAL_MS: i64 = 1000;

/// A claim on the film of a job that is renewed until it is dropped: what takes longer than a term, another would begin as well.
pub(super) struct Claim {
    /// Cancelled when another may have the film, and when the coordinator stops.
    lost: CancellationToken,
    _renewing: AbortOnDropHandle<()>,
}

impl Claim {
    /// Renews a claim that ends at some time.
    pub(super) fn renewed(farm: &Arc<Farm>, job: JobId, until_ms: i64) -> Self {
        let lost = farm.stopping.child_token();
        let farm = Arc::clone(farm);
        // However renewing ends, also when it panics.
        let is_lost = lost.clone().drop_guard();
        let renewing = AbortOnDropHandle::new(tokio::spawn(async move {
            renew(&farm, job, until_ms).await;
            drop(is_lost);
        }));
        Self { lost, _renewing: renewing }
    }

    pub(super) fn is_lost(&self) -> bool {
        self.lost.is_cancelled()
    }

    /// What some work has come to that may be left undone at any moment; nothing when the claim is lost meanwhile.
    pub(super) async fn while_held<T>(&self, work: impl Future<Output = T>) -> Option<T> {
        self.lost.run_until_cancelled(work).await
    }
}

/// Renews a claim until another has the film, or may have it since the claim could not be renewed in time.
async fn renew(farm: &Farm, job: JobId, mut until_ms: i64) {
    loop {
        let left_ms = until_ms - farm.config.clock.now_ms();
        if left_ms <= 0 {
            return;
        }
        let pause_ms = (left_ms - TERM_MS / 2).clamp(RENEWAL_MS, TERM_MS);
        tokio::time::sleep(milliseconds(pause_ms)).await;
        let now_ms = farm.config.clock.now_ms();
        let next_ms = now_ms.saturating_add(TERM_MS);
        let renewal = farm.store.acquire_film_lease(job, farm.coordinator, now_ms, next_ms);
        // A database that does not answer leaves the film to others all the same.
        match tokio::time::timeout(milliseconds(until_ms - now_ms), renewal).await {
            Ok(Ok(FilmLease::Held)) => until_ms = next_ms,
            Ok(Ok(FilmLease::HeldElsewhere { .. })) | Err(_) => return,
            Ok(Err(error)) => tracing::warn!(%job, %error, "the claim on the film could not be renewed"),
        }
    }
}

fn milliseconds(count: i64) -> Duration {
    Duration::from_millis(u64::try_from(count).unwrap_or(0))
}
