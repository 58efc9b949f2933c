//! Acceptance of partials: decoded with distrust, stored, and accepted exactly once.
//!
//! The order keeps the promise that nothing acknowledged is lost. The blob of the nodes is synced to disk, then one
//! transaction accepts them, then the worker is answered. A crash in between leaves a blob that no row names, or a
//! worker that uploads again and is told that everything is there. A worker that hangs up interrupts none of it: its
//! next upload would contain only accepted nodes and notify nobody.

use std::sync::Arc;

use bytes::Bytes;
use clerestory_api::{BuildOutcome, LeaseId, NodeAnswer, NodeVerdict, PartialAnswer, Quarantine};
use clerestory_film::{Expectation, Rendered, SamplingError, partial};
use tokio::task::JoinError;

use crate::blobs::{BlobError, Blobs};
use crate::clock::Clock;
use crate::films::reader::FilmReader;
use crate::memory::MemoryBudget;
use crate::model::{
    BlobRange, CheckKey, CheckOutcome, DeliveredNode, Delivery, JobRecord, LeaseRecord, SceneChange, SceneReport,
    WorkFailure, is_selected, wire_address,
};
use crate::store::{LeaseError, Store, StoreError};
use crate::tasks::to_completion;
use crate::watch::liveness::Liveness;
use crate::watch::notifications::{Notification, Notifications};

/// Memory for partials that are decoded at the same time, and for their nodes until they are accepted. A partial that
/// needs more is decoded alone.
const DECODED_BYTES: u64 = 64 << 20;

/// A partial is not accepted.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AcceptanceError {
    /// Its lease does not allow it.
    #[error(transparent)]
    Lease(#[from] LeaseError),
    /// It cannot be merged.
    #[error("{0}")]
    InvalidPartial(String),
    /// The stored sampling is impossible.
    #[error("the job's sampling is impossible")]
    Sampling(#[from] SamplingError),
    /// A blob could not be written.
    #[error(transparent)]
    Blob(#[from] BlobError),
    /// The computation was stopped.
    #[error("the computation was stopped")]
    Stopped(#[from] JoinError),
}

impl From<StoreError> for AcceptanceError {
    fn from(error: StoreError) -> Self {
        Self::Lease(error.into())
    }
}

/// Selects accepted nodes for a check by a second worker.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CheckSelection {
    /// The farm's key.
    pub(crate) key: CheckKey,
    /// Fraction of nodes that are checked.
    pub(crate) fraction: f64,
}

/// Accepts what workers bring under their leases.
#[derive(Debug)]
pub(crate) struct Acceptance {
    store: Store,
    blobs: Blobs,
    reader: Arc<FilmReader>,
    notifications: Arc<Notifications>,
    liveness: Arc<Liveness>,
    clock: Clock,
    checks: CheckSelection,
    decoding: MemoryBudget,
}

impl Acceptance {
    /// Acceptance into a store and its blobs.
    pub(crate) fn new(
        store: Store,
        blobs: Blobs,
        reader: Arc<FilmReader>,
        notifications: Arc<Notifications>,
        liveness: Arc<Liveness>,
        clock: Clock,
        checks: CheckSelection,
    ) -> Self {
        let decoding = MemoryBudget::new(DECODED_BYTES);
        Self { store, blobs, reader, notifications, liveness, clock, checks, decoding }
    }

    /// A lease under which work may be brought with this fencing token.
    pub(crate) async fn valid_lease(&self, lease: LeaseId, token: u64) -> Result<LeaseRecord, LeaseError> {
        let record = self.store.lease(lease).await?;
        record.check(token, self.clock.now_ms())?;
        Ok(record)
    }

    /// Accepts a partial under a lease. A partial that cannot be merged sends the lease's nodes back to the queue.
    pub(crate) async fn accept(
        self: &Arc<Self>,
        record: LeaseRecord,
        core_ms: u64,
        body: Bytes,
    ) -> Result<PartialAnswer, AcceptanceError> {
        let (lease, token) = (record.id, record.token);
        let job = self.store.job(record.job).await?.ok_or(LeaseError::JobNotRunning)?;
        let expectation = Expectation {
            job: job.id.to_string(),
            scene_hash: job.scene_hash.clone(),
            grid: job.grid,
            sampling: job.sampling()?,
            allowed: record.nodes,
        };
        let reserved = self.decoding.reserve_owned(memory(&body)).await;
        let decoded = tokio::task::spawn_blocking(move || partial::decode(&body, &expectation, expectation.budget()));
        let nodes = match decoded.await? {
            Ok(nodes) => nodes,
            Err(error) => {
                let reason = error.to_string();
                tracing::warn!(%lease, worker = %record.worker, reason, "partial refused");
                self.fail(lease, token, reason.clone(), 1).await?;
                return Err(AcceptanceError::InvalidPartial(reason));
            }
        };
        let acceptance = Arc::clone(self);
        let stored = to_completion(async move {
            let answer = acceptance.store_nodes(&job, lease, token, core_ms, nodes).await;
            drop(reserved);
            answer
        });
        stored.await?
    }

    /// Takes a lease back because its work failed. `refused_partials` is 0 when the worker gave up by itself.
    pub(crate) async fn fail(
        &self,
        lease: LeaseId,
        token: u64,
        reason: String,
        refused_partials: u32,
    ) -> Result<(), AcceptanceError> {
        let (now_ms, alive_ms) = (self.clock.now_ms(), self.liveness.alive_ms());
        let failure = WorkFailure { lease, token, reason, refused_partials, now_ms, alive_ms };
        let (store, notifications) = (self.store.clone(), Arc::clone(&self.notifications));
        let failed = to_completion(async move {
            if let Some(job) = store.fail_lease(failure).await? {
                tracing::warn!(%job, "the job has failed");
                notifications.publish(Notification::Job(job));
            }
            notifications.publish(Notification::Work);
            Ok::<_, LeaseError>(())
        });
        Ok(failed.await??)
    }

    /// Records how a worker's building of a scene ended.
    pub(crate) async fn report_scene(
        &self,
        lease: LeaseId,
        token: u64,
        outcome: BuildOutcome,
    ) -> Result<(), AcceptanceError> {
        let (now_ms, alive_ms) = (self.clock.now_ms(), self.liveness.alive_ms());
        let refusal = match &outcome {
            BuildOutcome::Refused { reason } => reason.clone(),
            BuildOutcome::Built(_) => String::new(),
        };
        let report = SceneReport { lease, token, outcome, now_ms, alive_ms };
        let (store, notifications) = (self.store.clone(), Arc::clone(&self.notifications));
        let recorded = to_completion(async move {
            match store.report_scene(report).await? {
                Some(SceneChange::Built(job)) => {
                    tracing::info!(%job, "a worker has built the scene of the job");
                    notifications.publish(Notification::Job(job));
                }
                Some(SceneChange::Freed(job)) => {
                    tracing::warn!(%job, %lease, refusal, "a worker cannot build the scene of the job; others can try");
                    notifications.publish(Notification::Job(job));
                    notifications.publish(Notification::Work);
                }
                Some(SceneChange::Failed(job)) => {
                    tracing::warn!(%job, "the job has failed, because its scene cannot be built");
                    notifications.publish(Notification::Job(job));
                    notifications.publish(Notification::Work);
                }
                None => {}
            }
            Ok::<_, LeaseError>(())
        });
        Ok(recorded.await??)
    }

    /// Takes back a lease whose worker does no more of it.
    pub(crate) async fn give_back(&self, lease: LeaseId, token: u64) -> Result<(), AcceptanceError> {
        let (store, notifications, now_ms) = (self.store.clone(), Arc::clone(&self.notifications), self.clock.now_ms());
        let returned = to_completion(async move {
            store.return_lease(lease, token, now_ms).await?;
            notifications.publish(Notification::Work);
            Ok::<_, LeaseError>(())
        });
        Ok(returned.await??)
    }

    async fn store_nodes(
        &self,
        job: &JobRecord,
        lease: LeaseId,
        token: u64,
        core_ms: u64,
        rendered: Vec<Rendered>,
    ) -> Result<PartialAnswer, AcceptanceError> {
        let (id, CheckSelection { key, fraction }) = (job.id, self.checks);
        let encode = move || {
            let encoded: Vec<Vec<u8>> =
                rendered.iter().map(|rendered| clerestory_film::store::encode(&rendered.node)).collect();
            let digests: Vec<String> = encoded.iter().map(|bytes| blake3::hash(bytes).to_hex().to_string()).collect();
            (rendered, encoded, digests)
        };
        let (rendered, encoded, digests) = tokio::task::spawn_blocking(encode).await?;
        let blob_ranges = self.blobs.put_nodes(job.id, encoded).await?;
        let blob = blob_ranges.first().map(|blob_range| blob_range.blob.clone());
        let delivered = |((Rendered { node, counters }, blob_range), digest): ((&Rendered, &BlobRange), String)| {
            let address = node.address();
            DeliveredNode {
                address,
                blob_range: blob_range.clone(),
                counters: *counters,
                digest,
                is_selected: is_selected(&key, id, &address, fraction),
            }
        };
        let nodes = rendered.iter().zip(&blob_ranges).zip(digests).map(delivered).collect();
        let (now_ms, alive_ms) = (self.clock.now_ms(), self.liveness.alive_ms());
        let core_ms = i64::try_from(core_ms).unwrap_or(i64::MAX);
        let delivery = Delivery { lease, token, nodes, core_ms, now_ms, alive_ms };
        let acceptance = match self.store.accept(delivery).await {
            Ok(acceptance) => acceptance,
            Err(error) => {
                // A database that failed may have accepted them before. Garbage collection removes the blob if it has
                // not.
                if !matches!(error, LeaseError::Store(_)) {
                    self.blobs.remove(blob.into_iter().collect()).await;
                }
                return Err(error.into());
            }
        };
        let mut answers = Vec::with_capacity(rendered.len());
        let mut is_used = false;
        for ((Rendered { node, .. }, blob_range), verdict) in
            rendered.into_iter().zip(blob_ranges).zip(acceptance.verdicts)
        {
            let reason = match verdict {
                NodeVerdict::Refused => Some("the node was not leased, or is not pending".to_owned()),
                NodeVerdict::Accepted | NodeVerdict::Duplicate => None,
            };
            answers.push(NodeAnswer { node: wire_address(&node.address()), verdict, reason });
            if verdict == NodeVerdict::Accepted {
                is_used = true;
                self.reader.cache(blob_range, Arc::new(node));
            }
        }
        if !is_used {
            self.blobs.remove(blob.into_iter().collect()).await;
        }
        if acceptance.samples > 0 {
            self.notifications.publish(Notification::Film { job: job.id, samples: acceptance.samples });
        }
        if acceptance.completes_round || acceptance.checks.has_ended {
            self.notifications.publish(Notification::Round(job.id));
        }
        self.publish_checks(acceptance.checks).await;
        Ok(PartialAnswer { nodes: answers, outstanding: acceptance.outstanding })
    }

    /// Publishes the outcome of checks.
    async fn publish_checks(&self, outcome: CheckOutcome) {
        for (worker, Quarantine { reason, ended_jobs, .. }) in &outcome.quarantined {
            let ended_jobs: Vec<String> = ended_jobs.iter().map(ToString::to_string).collect();
            tracing::error!(
                %worker,
                reason,
                ?ended_jobs,
                "worker quarantined; its work in jobs that have not ended is done again"
            );
        }
        for job in outcome.redone {
            self.notifications.publish(Notification::Job(job));
        }
        if outcome.has_work {
            self.notifications.publish(Notification::Work);
        }
        self.reader.release(outcome.removed).await;
    }
}

/// Memory that a partial takes: its pixels twice, once decoded and once in its nodes.
fn memory(body: &[u8]) -> u64 {
    partial::decoded_bytes(body).saturating_mul(2)
}
