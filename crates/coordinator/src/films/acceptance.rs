//! Partials: decoded with distrust, stored, and accepted.
//!
//! The order makes the promise: the blob of the nodes is synced to disk, then one transaction accepts them, then the worker
//! is told. A crash anywhere in between leaves a blob that nobody names, or a worker that uploads again and hears that all
//! is there. A worker that hangs up cuts none of it short: what is accepted has to be told to those who wait for it, and its next
//! upload, of nodes that are all there, would tell nobody.

use std::sync::Arc;

use bytes::Bytes;
use clerestory_api::{LeaseId, NodeAnswer, NodeVerdict, PartialAnswer, ProblemCode, Quarantine};
use clerestory_film::{Expectation, Rendered, partial};

use crate::farm::{DECODED_BYTES, Farm};
use crate::http::problem::ApiError;
use crate::memory::permits;
use crate::model::{
    BlobRange, DeliveredNode, Delivery, JobRecord, LeaseRecord, WorkFailure, is_selected, wire_address,
};
use crate::store::{LeaseError, Outcome};
use crate::tasks::to_completion;
use crate::watch::notifications::News;

/// Accepts a partial under a lease. A partial that cannot be merged sends the lease's nodes back to the queue.
pub(crate) async fn accept(
    farm: &Arc<Farm>,
    record: LeaseRecord,
    core_ms: u64,
    body: Bytes,
) -> Result<PartialAnswer, ApiError> {
    let (lease, token) = (record.id, record.token);
    let job = farm.store.job(record.job).await?.ok_or(LeaseError::JobNotRunning)?;
    let expectation = Expectation {
        job: job.id.to_string(),
        scene_hash: job.scene_hash.clone(),
        grid: job.grid,
        sampling: job.sampling().map_err(ApiError::internal)?,
        allowed: record.nodes,
    };
    let wanted = permits(memory(&body).min(DECODED_BYTES));
    let permits = Arc::clone(&farm.decoding).acquire_many_owned(wanted).await.map_err(ApiError::internal)?;
    let decoded = tokio::task::spawn_blocking(move || partial::decode(&body, &expectation, expectation.budget()));
    let nodes = match decoded.await.map_err(ApiError::internal)? {
        Ok(nodes) => nodes,
        Err(error) => {
            let reason = error.to_string();
            tracing::warn!(%lease, worker = %record.worker, reason, "partial refused");
            let (now_ms, alive_ms) = (farm.config.clock.now_ms(), farm.alive_ms());
            let failure = WorkFailure { lease, token, reason: reason.clone(), refused_partials: 1, now_ms, alive_ms };
            fail(farm, failure).await?;
            return Err(ApiError::new(ProblemCode::InvalidPartial, reason).field("body"));
        }
    };
    let farm = Arc::clone(farm);
    let stored = to_completion(async move {
        let answer = store(&farm, &job, lease, token, core_ms, nodes).await;
        drop(permits);
        answer
    });
    stored.await.map_err(ApiError::internal)?
}

/// Memory that a partial takes: that of its pixels twice, as they are decoded and as they are in its nodes, and then encoded again to be stored.
fn memory(body: &[u8]) -> u64 {
    partial::decoded_bytes(body).saturating_mul(2)
}

/// Takes a lease back because its work failed.
pub(crate) async fn fail(farm: &Arc<Farm>, failure: WorkFailure) -> Result<(), ApiError> {
    let farm = Arc::clone(farm);
    let failed = to_completion(async move {
        if let Some(job) = farm.store.fail_lease(failure).await? {
            tracing::warn!(%job, "the job has failed");
            farm.tell(News::Job(job));
        }
        farm.tell(News::Work);
        Ok::<_, LeaseError>(())
    });
    failed.await.map_err(ApiError::internal)??;
    Ok(())
}

/// Takes back a lease whose worker does no more of it.
pub(crate) async fn give_back(farm: &Arc<Farm>, lease: LeaseId, token: u64, now_ms: i64) -> Result<(), ApiError> {
    let farm = Arc::clone(farm);
    let returned = to_completion(async move {
        farm.store.return_lease(lease, token, now_ms).await?;
        farm.tell(News::Work);
        Ok::<_, LeaseError>(())
    });
    returned.await.map_err(ApiError::internal)??;
    Ok(())
}

/// Tells what checks have come to.
async fn checked(farm: &Farm, outcome: Outcome) {
    for (worker, Quarantine { reason, ended_jobs, .. }) in &outcome.quarantined {
        let ended_jobs: Vec<String> = ended_jobs.iter().map(ToString::to_string).collect();
        tracing::error!(%worker, reason, ?ended_jobs, "worker quarantined; its work in jobs that have not ended is done again");
    }
    for job in outcome.redone {
        farm.tell(News::Job(job));
    }
    if outcome.has_work {
        farm.tell(News::Work);
    }
    farm.let_go(outcome.removed).await;
}

async fn store(
    farm: &Farm,
    job: &JobRecord,
    lease: LeaseId,
    token: u64,
    core_ms: u64,
    rendered: Vec<Rendered>,
) -> Result<PartialAnswer, ApiError> {
    let (id, check_key, checked_fraction) = (job.id, farm.check_key, farm.config.checked_fraction);
    let encode = move || {
        let encoded: Vec<Vec<u8>> =
            rendered.iter().map(|rendered| clerestory_film::store::encode(&rendered.node)).collect();
        let digests: Vec<String> = encoded.iter().map(|bytes| blake3::hash(bytes).to_hex().to_string()).collect();
        (rendered, encoded, digests)
    };
    let (rendered, encoded, digests) = tokio::task::spawn_blocking(encode).await.map_err(ApiError::internal)?;
    let blob_ranges = farm.blobs.put_nodes(job.id, encoded).await?;
    let blob = blob_ranges.first().map(|blob_range| blob_range.blob.clone());
    let delivered = |((Rendered { node, counters }, blob_range), digest): ((&Rendered, &BlobRange), String)| {
        let (address, blob_range) = (node.address(), blob_range.clone());
        DeliveredNode {
            address,
            blob_range,
            counters: *counters,
            digest,
            is_selected: is_selected(&check_key, id, &address, checked_fraction),
        }
    };
    let nodes = rendered.iter().zip(&blob_ranges).zip(digests).map(delivered).collect();
    let (now_ms, alive_ms) = (farm.config.clock.now_ms(), farm.alive_ms());
    let core_ms = i64::try_from(core_ms).unwrap_or(i64::MAX);
    let delivery = Delivery { lease, token, nodes, core_ms, now_ms, alive_ms };
    let acceptance = match farm.store.accept(delivery).await {
        Ok(acceptance) => acceptance,
        Err(error) => {
            // Where the database failed, it may have accepted them before: what it has not is left for the sweep.
            if !matches!(error, LeaseError::Store(_)) {
                farm.blobs.remove(blob.into_iter().collect()).await;
            }
            return Err(error.into());
        }
    };
    let mut answers = Vec::with_capacity(rendered.len());
    let mut is_used = false;
    for ((Rendered { node, .. }, blob_range), verdict) in rendered.into_iter().zip(blob_ranges).zip(acceptance.verdicts)
    {
        let reason = match verdict {
            NodeVerdict::Refused => Some("the node was not leased, or is not pending".to_owned()),
            NodeVerdict::Accepted | NodeVerdict::Duplicate => None,
        };
        answers.push(NodeAnswer { node: wire_address(&node.address()), verdict, reason });
        if verdict == NodeVerdict::Accepted {
            is_used = true;
            farm.film.keep(blob_range, Arc::new(node));
        }
    }
    if !is_used {
        farm.blobs.remove(blob.into_iter().collect()).await;
    }
    if acceptance.samples > 0 {
        farm.tell(News::Film { job: job.id, samples: acceptance.samples });
    }
    if acceptance.completes_round || acceptance.checks.has_ended {
        farm.tell(News::Wave(job.id));
    }
    checked(farm, acceptance.checks).await;
    Ok(PartialAnswer { nodes: answers, outstanding: acceptance.outstanding })
}
