//! Accepted nodes: the film, as the database knows it.
//!
//! A node is accepted in one transaction, only under a valid lease that holds it, and only if no row of its tile shares a
//! pass with it: no ancestor, no descendant, not itself. Its blob is on disk before the transaction begins.
//!
//! Sums of times saturate at the largest integer, as those of counters do: their terms were measured by others, and a sum
//! that overflows would be a number that no reader takes.

use std::collections::BTreeSet;
use std::ops::AddAssign;

use clerestory_api::{JobId, LeaseId, NodeVerdict, WorkerId};
use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::NodeAddress;
use sqlx::any::AnyRow;

use super::jobs::{self, JobRecord};
use super::leases::{self, LeaseError, address};
use super::row::{Columns, big, to_json};
use super::{Connection, Store, StoreError};

/// A node that was brought and whose blob is on disk.
#[derive(Clone, Debug)]
pub(crate) struct DeliveredNode {
    /// The node.
    pub(crate) address: NodeAddress,
    /// Name of its blob.
    pub(crate) blob: String,
    /// What was counted while rendering it.
    pub(crate) counters: Counters,
}

/// What came with one partial.
#[derive(Clone, Debug)]
pub(crate) struct Delivery {
    /// The lease.
    pub(crate) lease: LeaseId,
    /// Its fencing token.
    pub(crate) token: u64,
    /// The nodes.
    pub(crate) nodes: Vec<DeliveredNode>,
    /// Time spent rendering all of them, summed over cores.
    pub(crate) core_ms: i64,
    /// Now.
    pub(crate) now_ms: i64,
}

/// What became of a delivery.
#[derive(Clone, Debug)]
pub(crate) struct Acceptance {
    /// One verdict for each node, in their order.
    pub(crate) verdicts: Vec<NodeVerdict>,
    /// Nodes of the lease that are still pending.
    pub(crate) outstanding: u32,
    /// Camera samples accepted.
    pub(crate) samples: u64,
}

/// An accepted node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NodeRow {
    /// The node.
    pub(crate) address: NodeAddress,
    /// Name of its blob.
    pub(crate) blob: String,
    /// The work that it took.
    pub(crate) work: Work,
}

/// The work that nodes took. Sums are the same whatever their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Work {
    /// What was counted.
    pub(crate) counters: Counters,
    /// Builds of the workers that did it.
    pub(crate) builds: BTreeSet<String>,
}

impl AddAssign<&Self> for Work {
    fn add_assign(&mut self, other: &Self) {
        self.counters += other.counters;
        self.builds.extend(other.builds.iter().cloned());
    }
}

fn work(row: &AnyRow) -> Result<Work, StoreError> {
    Ok(Work { counters: row.json("counters")?, builds: row.json("builds")? })
}

fn node_row(row: &AnyRow) -> Result<NodeRow, StoreError> {
    Ok(NodeRow { address: address(row)?, blob: row.text("blob")?, work: work(row)? })
}

impl Store {
    /// Accepts what came with a partial. Blobs of nodes that were not accepted belong to nobody afterwards.
    pub(crate) async fn accept(&self, delivery: Delivery) -> Result<Acceptance, LeaseError> {
        self.write(move |connection| Box::pin(async move { accept(connection, &delivery).await })).await
    }

    /// All accepted nodes of a job, ordered by frame, tile and pass.
    pub(crate) async fn nodes(&self, job: JobId) -> Result<Vec<NodeRow>, StoreError> {
        let rows = sqlx::query(
            "select frame, tile, level, idx, blob, counters, builds from nodes where job = $1 \
             order by frame, tile, first_pass",
        )
        .bind(job.to_string())
        .fetch_all(&self.readers)
        .await?;
        rows.iter().map(node_row).collect()
    }

    /// Names of all node blobs that belong to the farm.
    pub(crate) async fn node_blobs(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar("select blob from nodes").fetch_all(&self.readers).await?)
    }

    /// Replaces everything below `parent` by it, with the sum of their work, and answers the names of the blobs that are
    /// not needed any more; an error when a pass of it is missing.
    pub(crate) async fn replace_descendants(
        &self,
        job: JobId,
        parent: NodeAddress,
        blob: String,
    ) -> Result<Vec<String>, StoreError> {
        self.write(move |connection| Box::pin(async move { replace_descendants(connection, job, parent, blob).await }))
            .await
    }
}

async fn accept(connection: &mut Connection, delivery: &Delivery) -> Result<Acceptance, LeaseError> {
    let lease = leases::valid(connection, delivery.lease, delivery.token, delivery.now_ms).await?;
    let job = jobs::job_in(connection, lease.job).await?.ok_or(LeaseError::JobNotRunning)?;
    let build = build(connection, lease.worker).await?;
    let brought: u64 = delivery.nodes.iter().map(|node| job.node_samples(&node.address)).sum();
    let mut verdicts = Vec::with_capacity(delivery.nodes.len());
    let (mut nodes, mut samples, mut core_ms, mut counters) = (0, 0, 0_i64, Counters::default());
    for node in &delivery.nodes {
        let own_samples = job.node_samples(&node.address);
        let own_core_ms = (delivery.core_ms as f64 * own_samples as f64 / brought.max(1) as f64) as i64;
        let work = Work { counters: node.counters, builds: BTreeSet::from([build.clone()]) };
        let row = NodeRow { address: node.address, blob: node.blob.clone(), work };
        let verdict = accept_node(connection, &job, delivery.lease, &row, own_core_ms, delivery.now_ms).await?;
        if verdict == NodeVerdict::Accepted {
            counters += node.counters;
            (nodes, samples) = (nodes + 1, samples + own_samples);
            core_ms = core_ms.saturating_add(own_core_ms);
        }
        verdicts.push(verdict);
    }
    if nodes > 0 {
        jobs::add_accepted(connection, &job, nodes, samples, core_ms, counters).await?;
        credit_worker(connection, lease.worker, job.id, nodes, samples, core_ms).await?;
    }
    let outstanding = sqlx::query("select count(*) as outstanding from pending where lease = $1")
        .bind(delivery.lease.to_string())
        .fetch_one(&mut *connection)
        .await?
        .number("outstanding")?;
    if outstanding == 0 {
        sqlx::query("update leases set state = 'complete' where id = $1 and state = 'active'")
            .bind(delivery.lease.to_string())
            .execute(connection)
            .await?;
    }
    Ok(Acceptance { verdicts, outstanding, samples })
}

async fn accept_node(
    connection: &mut Connection,
    job: &JobRecord,
    lease: LeaseId,
    node: &NodeRow,
    core_ms: i64,
    now_ms: i64,
) -> Result<NodeVerdict, StoreError> {
    let address = &node.address;
    let passes = address.passes();
    let (first_pass, end_pass) = (i64::from(passes.first), i64::from(passes.first) + i64::from(passes.count));
    let overlap = sqlx::query(
        "select 1 from nodes where job = $1 and frame = $2 and tile = $3 and first_pass < $5 and end_pass > $4 limit 1",
    )
    .bind(job.id.to_string())
    .bind(i64::from(address.frame))
    .bind(i64::from(address.tile))
    .bind(first_pass)
    .bind(end_pass)
    .fetch_optional(&mut *connection)
    .await?;
    if overlap.is_some() {
        return Ok(NodeVerdict::Duplicate);
    }
    let taken = sqlx::query(
        "delete from pending where job = $1 and frame = $2 and tile = $3 and level = $4 and idx = $5 and lease = $6 \
         returning round",
    )
    .bind(job.id.to_string())
    .bind(i64::from(address.frame))
    .bind(i64::from(address.tile))
    .bind(i64::from(address.level))
    .bind(i64::from(address.index))
    .bind(lease.to_string())
    .fetch_optional(&mut *connection)
    .await?;
    let Some(taken) = taken else { return Ok(NodeVerdict::Refused) };
    insert(connection, job.id, node).await?;
    sqlx::query(
        "update waves set outstanding = outstanding - $4, \
         core_ms = case when core_ms > 9223372036854775807 - $5 then 9223372036854775807 else core_ms + $5 end, \
         completed_ms = case when outstanding = $4 then $6 else null end \
         where job = $1 and frame = $2 and round = $3",
    )
    .bind(job.id.to_string())
    .bind(i64::from(address.frame))
    .bind(taken.integer("round")?)
    .bind(i64::from(passes.count))
    .bind(core_ms)
    .bind(now_ms)
    .execute(connection)
    .await?;
    Ok(NodeVerdict::Accepted)
}

/// Takes away everything that begins at a pass or after it, and answers the names of the blobs that are not needed any more.
/// Of a job whose last round ends there, nothing else reaches beyond: no node is formed across the end of a round before that is
/// recorded.
pub(super) async fn discard(
    connection: &mut Connection,
    job: JobId,
    first_pass: u32,
) -> Result<Vec<String>, StoreError> {
    let rows = sqlx::query("delete from nodes where job = $1 and first_pass >= $2 returning blob")
        .bind(job.to_string())
        .bind(i64::from(first_pass))
        .fetch_all(connection)
        .await?;
    rows.iter().map(|row| row.text("blob")).collect()
}

async fn insert(connection: &mut Connection, job: JobId, node: &NodeRow) -> Result<(), StoreError> {
    let NodeRow { address, blob, work } = node;
    let passes = address.passes();
    sqlx::query(
        "insert into nodes (job, frame, tile, level, idx, first_pass, end_pass, blob, counters, builds) \
         values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)",
    )
    .bind(job.to_string())
    .bind(i64::from(address.frame))
    .bind(i64::from(address.tile))
    .bind(i64::from(address.level))
    .bind(i64::from(address.index))
    .bind(i64::from(passes.first))
    .bind(i64::from(passes.first) + i64::from(passes.count))
    .bind(blob)
    .bind(to_json(&work.counters)?)
    .bind(to_json(&work.builds)?)
    .execute(connection)
    .await?;
    Ok(())
}

/// The build of a worker, as it introduced itself.
async fn build(connection: &mut Connection, worker: WorkerId) -> Result<String, StoreError> {
    let query = sqlx::query("select build from workers where id = $1").bind(worker.to_string());
    query.fetch_one(connection).await?.text("build")
}

async fn credit_worker(
    connection: &mut Connection,
    worker: WorkerId,
    job: JobId,
    nodes: u64,
    samples: u64,
    core_ms: i64,
) -> Result<(), StoreError> {
    sqlx::query(
        "update workers set accepted_nodes = accepted_nodes + $2, samples = samples + $3, \
         core_ms = case when core_ms > 9223372036854775807 - $4 then 9223372036854775807 else core_ms + $4 end, \
         failures_in_a_row = 0 where id = $1",
    )
    .bind(worker.to_string())
    .bind(big(nodes))
    .bind(big(samples))
    .bind(core_ms)
    .execute(&mut *connection)
    .await?;
    sqlx::query(
        "insert into rates (worker, job, samples, core_ms) values ($1, $2, $3, $4) on conflict (worker, job) \
         do update set samples = rates.samples + excluded.samples, \
         core_ms = case when rates.core_ms > 9223372036854775807 - excluded.core_ms then 9223372036854775807 \
         else rates.core_ms + excluded.core_ms end",
    )
    .bind(worker.to_string())
    .bind(job.to_string())
    .bind(big(samples))
    .bind(core_ms)
    .execute(connection)
    .await?;
    Ok(())
}

async fn replace_descendants(
    connection: &mut Connection,
    job: JobId,
    parent: NodeAddress,
    blob: String,
) -> Result<Vec<String>, StoreError> {
    let passes = parent.passes();
    let (first, end) = (i64::from(passes.first), i64::from(passes.first) + i64::from(passes.count));
    let rows = sqlx::query(
        "delete from nodes where job = $1 and frame = $2 and tile = $3 and first_pass >= $4 and end_pass <= $5 \
         returning first_pass, end_pass, blob, counters, builds",
    )
    .bind(job.to_string())
    .bind(i64::from(parent.frame))
    .bind(i64::from(parent.tile))
    .bind(first)
    .bind(end)
    .fetch_all(&mut *connection)
    .await?;
    let mut covered = 0;
    let mut sum = Work::default();
    let mut blobs = Vec::with_capacity(rows.len());
    for row in &rows {
        covered += row.integer("end_pass")? - row.integer("first_pass")?;
        sum += &work(row)?;
        blobs.push(row.text("blob")?);
    }
    if covered != end - first {
        // The caller's savepoint takes the half-done replacement back.
        let value = format!("{covered} of the {} passes of {parent:?}", end - first);
        return Err(StoreError::Corrupt { column: "nodes", value });
    }
    insert(connection, job, &NodeRow { address: parent, blob, work: sum }).await?;
    Ok(blobs)
}
