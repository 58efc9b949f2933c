//! Partials: decoded with distrust, stored, and accepted.
//!
//! The order makes the promise: the nodes' blobs are synced to disk, then one transaction accepts them, then the worker
//! is told. A crash anywhere in between leaves blobs that nobody names, or a worker that uploads again and hears that all
//! is there.

use std::sync::Arc;

use bytes::Bytes;
use clerestory_api::{LeaseId, NodeAnswer, NodeVerdict, PartialAnswer, ProblemCode};
use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{self, Expectation, Node, NodeAddress, Rendered, partial};
use futures::stream::{self, StreamExt, TryStreamExt};

use crate::farm::Farm;
use crate::http::ApiError;
use crate::news::News;
use crate::store::{DeliveredNode, Delivery, JobRecord, LeaseError, WorkFailure};

/// Nodes that are written at the same time.
const WRITES: usize = 8;

/// A node as the wire names it.
pub(crate) fn wire_address(address: &NodeAddress) -> clerestory_api::NodeAddress {
    let NodeAddress { frame, tile, level, index } = *address;
    clerestory_api::NodeAddress { frame, tile, level, index }
}

/// Accepts a partial under a lease. A partial that cannot be merged sends the lease's nodes back to the queue.
pub(crate) async fn accept(
    farm: &Farm,
    lease: LeaseId,
    token: u64,
    core_ms: u64,
    body: Bytes,
) -> Result<PartialAnswer, ApiError> {
    let record = farm.store.lease(lease).await?;
    let job = farm.store.job(record.job).await?.ok_or(LeaseError::JobNotRunning)?;
    let allowed = farm.store.leased_nodes(lease).await?;
    let expectation = Expectation {
        job: job.id.to_string(),
        scene_hash: job.scene_hash.clone(),
        grid: job.grid,
        sampling: job.sampling().map_err(ApiError::internal)?,
        allowed,
    };
    let decoded = tokio::task::spawn_blocking(move || partial::decode(&body, &expectation, expectation.budget()));
    let nodes = match decoded.await.map_err(ApiError::internal)? {
        Ok(nodes) => nodes,
        Err(error) => {
            let reason = error.to_string();
            tracing::warn!(%lease, worker = %record.worker, reason, "partial refused");
            let now_ms = farm.config.clock.now_ms();
            let failure = WorkFailure { lease, token, reason: reason.clone(), refused_partials: 1, now_ms };
            fail(farm, failure).await?;
            return Err(ApiError::new(ProblemCode::InvalidPartial, reason).field("body"));
        }
    };
    store(farm, &job, lease, token, core_ms, nodes).await
}

/// Takes a lease back because its work failed.
pub(crate) async fn fail(farm: &Farm, failure: WorkFailure) -> Result<(), ApiError> {
    if let Some(job) = farm.store.fail_lease(failure).await? {
        tracing::warn!(%job, "the job has failed");
        farm.tell(News::Job(job));
    }
    farm.tell(News::Work);
    Ok(())
}

async fn store(
    farm: &Farm,
    job: &JobRecord,
    lease: LeaseId,
    token: u64,
    core_ms: u64,
    rendered: Vec<Rendered>,
) -> Result<PartialAnswer, ApiError> {
    let (nodes, counters): (Vec<Arc<Node>>, Vec<Counters>) =
        rendered.into_iter().map(|Rendered { node, counters }| (Arc::new(node), counters)).unzip();
    let writes = nodes.iter().zip(counters).map(|(node, counters)| write(farm, job, Arc::clone(node), counters));
    let delivered: Vec<DeliveredNode> = stream::iter(writes.collect::<Vec<_>>()).buffered(WRITES).try_collect().await?;
    let now_ms = farm.config.clock.now_ms();
    let core_ms = i64::try_from(core_ms).unwrap_or(i64::MAX);
    let delivery = Delivery { lease, token, nodes: delivered.clone(), core_ms, now_ms };
    let acceptance = match farm.store.accept(delivery).await {
        Ok(acceptance) => acceptance,
        Err(error) => {
            // Where the database failed, it may have accepted them before: what it has not is left for the sweep.
            if !matches!(error, LeaseError::Store(_)) {
                farm.blobs.remove_nodes(delivered.into_iter().map(|node| node.blob).collect()).await;
            }
            return Err(error.into());
        }
    };
    let mut answers = Vec::with_capacity(nodes.len());
    let mut unused = Vec::new();
    for ((node, delivered), verdict) in nodes.into_iter().zip(delivered).zip(acceptance.verdicts) {
        let reason = match verdict {
            NodeVerdict::Refused => Some("the node is not pending under this lease".to_owned()),
            NodeVerdict::Accepted | NodeVerdict::Duplicate => None,
        };
        answers.push(NodeAnswer { node: wire_address(&delivered.address), verdict, reason });
        match verdict {
            NodeVerdict::Accepted => farm.film.keep(delivered.blob, node),
            NodeVerdict::Duplicate | NodeVerdict::Refused => unused.push(delivered.blob),
        }
    }
    farm.blobs.remove_nodes(unused).await;
    if acceptance.samples > 0 {
        farm.tell(News::Film { job: job.id, samples: acceptance.samples });
    }
    Ok(PartialAnswer { nodes: answers, outstanding: acceptance.outstanding })
}

async fn write(farm: &Farm, job: &JobRecord, node: Arc<Node>, counters: Counters) -> Result<DeliveredNode, ApiError> {
    let address = node.address();
    let bytes = tokio::task::spawn_blocking(move || film::store::encode(&node)).await.map_err(ApiError::internal)?;
    Ok(DeliveredNode { address, blob: farm.blobs.put_node(job.id, bytes).await?, counters })
}
