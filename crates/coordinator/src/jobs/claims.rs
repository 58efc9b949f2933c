//! Claims: workers ask for work, and wait for it when there is none.

use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use clerestory_api::{Lease, LeaseId, LeaseRenewal, LeaseRequest, WorkerId};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use crate::clock::Clock;
use crate::jobs::idle_workers::IdleWorkers;
use crate::jobs::upload_linger::UploadLinger;
use crate::model::{ClaimTerms, Grant, wire_address};
use crate::store::{LeaseError, Store, WorkerError};
use crate::watch::liveness::Liveness;
use crate::watch::notifications::{Notification, Notifications};

/// How leases are sized and how long they last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeasePolicy {
    /// How long a lease lasts unless it is renewed.
    pub(crate) ttl: Duration,
    /// How long the work of a lease should take.
    pub(crate) target: Duration,
    /// The exact number of nodes in a lease, for experiments and tests.
    pub(crate) fixed_nodes: Option<u32>,
}

/// Grants leases.
#[derive(Debug)]
pub(crate) struct Claims {
    store: Store,
    clock: Clock,
    policy: LeasePolicy,
    notifications: Arc<Notifications>,
    liveness: Arc<Liveness>,
    linger: Arc<UploadLinger>,
    idle: IdleWorkers,
    stopping: CancellationToken,
}

impl Claims {
    /// Claims on the jobs in a store.
    pub(crate) fn new(
        store: Store,
        clock: Clock,
        policy: LeasePolicy,
        notifications: Arc<Notifications>,
        liveness: Arc<Liveness>,
        linger: Arc<UploadLinger>,
        stopping: CancellationToken,
    ) -> Self {
        Self { store, clock, policy, notifications, liveness, linger, idle: IdleWorkers::default(), stopping }
    }

    /// Grants a lease, or `None` when the queue has no work for this worker within its waiting time.
    pub(crate) async fn claim(self: &Arc<Self>, request: LeaseRequest) -> Result<Option<Lease>, WorkerError> {
        let worker = request.worker;
        let until = Instant::now() + Duration::from_millis(request.wait_ms.into());
        // A worker that was just sent away without work and asks again waits for a notification, if it waits at all.
        let mut queries = request.wait_ms == 0 || self.idle.may_query(worker, Instant::now().into_std());
        let mut has_waited = false;
        loop {
            // It subscribes before it queries, so that it misses no work which appears in between.
            let mut work = pin!(self.notifications.work());
            work.as_mut().enable();
            if queries {
                let (claims, request) = (Arc::clone(self), request.clone());
                if let Some(grant) = self.store.claim(move || claims.terms(&request)).await? {
                    self.idle.found_work(worker);
                    if has_waited {
                        // There may be more.
                        self.notifications.wake_claimants();
                    }
                    return Ok(Some(self.lease(grant)));
                }
                self.idle.found_nothing(worker, Instant::now().into_std());
            }
            tokio::select! {
                () = work => (has_waited, queries) = (true, true),
                () = tokio::time::sleep_until(until) => return Ok(None),
                () = self.stopping.cancelled() => return Ok(None),
            }
        }
    }

    /// Marks a worker as busy: another coordinator may have granted its lease.
    pub(crate) fn found_work(&self, worker: WorkerId) {
        self.idle.found_work(worker);
    }

    /// Forgets idle workers that have not asked again.
    pub(crate) fn forget_absent(&self) {
        self.idle.forget_absent(std::time::Instant::now());
    }

    /// Extends a lease by another term.
    pub(crate) async fn renew(&self, lease: LeaseId, token: u64) -> Result<LeaseRenewal, LeaseError> {
        let now_ms = self.clock.now_ms();
        let expires_in_ms = milliseconds(self.policy.ttl);
        let deadline_ms = now_ms.saturating_add(expires_in_ms);
        let outstanding = self.store.renew(lease, token, now_ms, deadline_ms).await?;
        Ok(LeaseRenewal { deadline_ms, expires_in_ms, outstanding })
    }

    fn terms(&self, request: &LeaseRequest) -> ClaimTerms {
        ClaimTerms {
            worker: request.worker,
            built: request.built.clone(),
            lease: LeaseId::from(Uuid::now_v7()),
            max_nodes: request.max_nodes,
            fixed_nodes: self.policy.fixed_nodes,
            target_ms: request.wanted_ms.map_or_else(|| milliseconds(self.policy.target), i64::from),
            upload_linger_ms: milliseconds(self.linger.duration()),
            ttl_ms: milliseconds(self.policy.ttl),
            alive_ms: self.liveness.alive_ms(),
            now_ms: self.clock.now_ms(),
        }
    }

    fn lease(&self, grant: Grant) -> Lease {
        let Grant { lease, scene_hash, nodes, upload_linger_ms, wants_report } = grant;
        let (id, job, worker) = (lease.id, lease.job, lease.worker);
        tracing::debug!(lease = %id, %job, %worker, nodes = nodes.len(), "lease granted");
        self.notifications.publish(Notification::Lease(job));
        Lease {
            id,
            token: lease.token,
            job,
            scene_hash,
            nodes: nodes.iter().map(wire_address).collect(),
            deadline_ms: lease.deadline_ms,
            expires_in_ms: milliseconds(self.policy.ttl),
            upload_linger_ms: u32::try_from(upload_linger_ms).unwrap_or(u32::MAX),
            wants_report,
        }
    }
}

fn milliseconds(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}
