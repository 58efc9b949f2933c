//! Acceptance of the nodes that a worker uploads.
//!
//! A node is accepted in one transaction, under three conditions. The worker holds a valid lease with this node. No
//! row of its tile shares a pass with it: no ancestor, no descendant, not the node itself. All of its passes are
//! pending, perhaps as smaller nodes or leased to another worker by now: the first result wins. Its bytes are on disk
//! before the transaction begins.
//!
//! Sums of times saturate at the largest integer, like those of counters. Workers measured the terms, and no reader
//! takes a sum that overflows.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{JobId, NodeVerdict, WorkerId};
use clerestory_film::NodeAddress;
use clerestory_film::counters::Counters;

use crate::model::{CheckOutcome, DeliveredNode, Delivery, LeaseRecord, NodeRow, Work};
use crate::store::checks;
use crate::store::checks::Brought;
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, address, big, is_of_nodes, nodes_json, rows_of, to_json};
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::errors::LeaseError;
use crate::store::films::nodes;
use crate::store::jobs;
use crate::store::leases::table as leases;
use crate::store::results::answers;
use crate::store::workers::table as workers;

/// Earlier work that counts in the mean rate of a worker, in microseconds of each of its cores. Scenes change from
/// tile to tile, and machines from minute to minute.
const REMEMBERED_US: f64 = 30e6;

/// What became of a delivery.
#[derive(Clone, Debug)]
pub(crate) struct Acceptance {
    /// One verdict for each node, in their order.
    pub(crate) verdicts: Vec<NodeVerdict>,
    /// Nodes of the lease that are still pending.
    pub(crate) outstanding: u32,
    /// Camera samples accepted.
    pub(crate) samples: u64,
    /// Whether all work of a round has been accepted.
    pub(crate) completes_round: bool,
    /// What checks have come to.
    pub(crate) checks: CheckOutcome,
}

impl Store {
    /// Accepts a partial. No row names the blob ranges of its nodes that were not accepted.
    pub(crate) async fn accept(&self, delivery: Delivery) -> Result<Acceptance, LeaseError> {
        self.write(move |connection| Box::pin(async move { accept(connection, &delivery).await })).await
    }
}

async fn accept(connection: &mut Connection, delivery: &Delivery) -> Result<Acceptance, LeaseError> {
    let (lease, job) = leases::valid_with_job(connection, delivery.lease, delivery.token, delivery.now_ms).await?;
    let all_samples: u64 = delivery.nodes.iter().map(|node| job.node_samples(&node.address)).sum();
    let taken = take_all(connection, &lease, &delivery.nodes).await?;
    // Shares of a whole number of milliseconds that add up to it, however short each node took.
    let core_ms_up_to = |samples: u64| (delivery.core_ms as f64 * samples as f64 / all_samples.max(1) as f64) as i64;
    let mut samples_before = 0;
    let (mut samples, mut core_ms, mut counters) = (0, 0_i64, Counters::default());
    let mut accepted = Vec::new();
    let (mut to_be_checked, mut checked) = (Vec::new(), Vec::new());
    let mut rounds: BTreeMap<(u32, i64), RoundWork> = BTreeMap::new();
    let mut frees_work = false;
    for (node, taken) in delivery.nodes.iter().zip(&taken) {
        let brought = || Brought { address: node.address, digest: node.digest.clone() };
        let own_samples = job.node_samples(&node.address);
        let own_core_ms = core_ms_up_to(samples_before + own_samples).saturating_sub(core_ms_up_to(samples_before));
        samples_before += own_samples;
        let Taken::From { round } = *taken else {
            if matches!(taken, Taken::Duplicate) && lease.nodes.contains(&node.address) {
                frees_work |= free_rest(connection, &lease, &node.address).await?;
            }
            // The coordinator that accepted them, perhaps with other settings, selected the nodes for checks.
            checked.push(brought());
            continue;
        };
        to_be_checked.extend(node.is_selected.then(|| (round, brought())));
        counters += node.counters;
        samples += own_samples;
        core_ms = core_ms.saturating_add(own_core_ms);
        let work = rounds.entry((node.address.frame, round)).or_default();
        work.passes += i64::from(node.address.passes().count);
        work.core_ms = work.core_ms.saturating_add(own_core_ms);
        let work = Work { counters: node.counters, builds: BTreeSet::from([lease.build.clone()]) };
        accepted.push(NodeRow { address: node.address, blob_range: node.blob_range.clone(), work });
    }
    nodes::insert(connection, job.id, &accepted).await?;
    let mut completes_round = false;
    for ((frame, round), work) in rounds {
        completes_round |= count_down(connection, job.id, frame, round, work, delivery.now_ms).await? == 0;
    }
    if accepted.is_empty() {
        workers::mark_seen(connection, lease.worker, delivery.now_ms).await?;
    } else {
        let count = accepted.len() as u64;
        jobs::add_accepted(connection, &job, count, samples, core_ms, counters).await?;
        let cores = credit_worker(connection, lease.worker, count, samples, core_ms, delivery.now_ms).await?;
        let core_us = delivery.core_ms as f64 * 1000.0 * samples as f64 / all_samples.max(1) as f64;
        measure(connection, lease.worker, job.id, samples, [core_us, REMEMBERED_US * f64::from(cores)]).await?;
    }
    let mut checks = CheckOutcome::default();
    if !to_be_checked.is_empty() {
        checks = checks::open(connection, &lease, &to_be_checked, delivery.alive_ms).await?;
    }
    if !checked.is_empty() {
        let answered = answers::answer(connection, &lease, &checked, delivery.now_ms).await?;
        checks = CheckOutcome { has_work: checks.has_work || answered.has_work, ..answered };
    }
    checks.has_work |= frees_work;
    let accepted_ms = (!accepted.is_empty()).then_some(delivery.now_ms);
    let outstanding = leases::go_on(connection, delivery.lease, accepted_ms).await?;
    let verdicts = taken.into_iter().map(Taken::verdict).collect();
    Ok(Acceptance { verdicts, outstanding, samples, completes_round, checks })
}

/// The fate of an uploaded node.
#[derive(Clone, Copy, Debug)]
enum Taken {
    /// It is accepted, as work of this round.
    From { round: i64 },
    /// An accepted node shares a pass with it.
    Duplicate,
    /// It was not leased, or not all of its passes are pending.
    Refused,
}

impl Taken {
    fn verdict(self) -> NodeVerdict {
        match self {
            Self::From { .. } => NodeVerdict::Accepted,
            Self::Duplicate => NodeVerdict::Duplicate,
            Self::Refused => NodeVerdict::Refused,
        }
    }
}

/// Accepted work of a round.
#[derive(Clone, Copy, Debug, Default)]
struct RoundWork {
    passes: i64,
    core_ms: i64,
}

/// Removes the uploaded nodes that can be accepted from the pending ones.
async fn take_all(
    connection: &mut Connection,
    lease: &LeaseRecord,
    nodes: &[DeliveredNode],
) -> Result<Vec<Taken>, StoreError> {
    let known = covered(connection, lease.job, nodes).await?;
    let is_new = |address: &NodeAddress| lease.nodes.contains(address) && !known.contains(address);
    let new: Vec<NodeAddress> = nodes.iter().map(|node| node.address).filter(is_new).collect();
    let whole = take(connection, lease.job, &new).await?;
    let mut taken = Vec::with_capacity(nodes.len());
    let mut accepted: BTreeMap<(u32, u32), Vec<NodeAddress>> = BTreeMap::new();
    for DeliveredNode { address, .. } in nodes {
        let of_tile = accepted.entry((address.frame, address.tile)).or_default();
        if known.contains(address) || of_tile.iter().any(|other| other.overlaps(address)) {
            taken.push(Taken::Duplicate);
            continue;
        }
        let round = match whole.get(address) {
            Some(round) => Some(*round),
            None if lease.nodes.contains(address) => take_parts(connection, lease.job, address).await?,
            None => None,
        };
        match round {
            Some(round) => {
                of_tile.push(*address);
                taken.push(Taken::From { round });
            }
            None => taken.push(Taken::Refused),
        }
    }
    Ok(taken)
}

/// Those of some nodes that share a pass with an accepted one.
async fn covered(
    connection: &mut Connection,
    job: JobId,
    nodes: &[DeliveredNode],
) -> Result<BTreeSet<NodeAddress>, StoreError> {
    if nodes.is_empty() {
        return Ok(BTreeSet::new());
    }
    // No two accepted nodes of a tile share a pass: of those that begin before its end, the last decides.
    let statement = format!(
        "select c0 as frame, c1 as tile, c2 as level, c3 as idx from {} as listed_nodes \
         where (select end_pass from nodes where job = $1 and frame = c0 and tile = c1 and first_pass < c5 \
         order by first_pass desc limit 1) > c4",
        rows_of(connection.engine(), 2, &[Kind::Integer; 6])
    );
    let listed = nodes.iter().map(|node| {
        let ([first, end], NodeAddress { frame, tile, level, index }) = (nodes::ends(&node.address), node.address);
        (frame, tile, level, index, first, end)
    });
    let listed = to_json(&listed.collect::<Vec<_>>())?;
    let rows = query(statement).bind(job.to_string()).bind(listed).fetch_all(connection).await?;
    rows.iter().map(address).collect()
}

/// Removes those of some nodes that are pending, and answers them with their rounds.
async fn take(
    connection: &mut Connection,
    job: JobId,
    nodes: &[NodeAddress],
) -> Result<BTreeMap<NodeAddress, i64>, StoreError> {
    if nodes.is_empty() {
        return Ok(BTreeMap::new());
    }
    let statement = format!(
        "delete from pending where {} returning frame, tile, level, idx, round",
        is_of_nodes(connection.engine(), "pending", 1, 2)
    );
    let rows = query(statement).bind(job.to_string()).bind(nodes_json(nodes)?).fetch_all(connection).await?;
    rows.iter().map(|row| Ok((address(row)?, row.integer("round")?))).collect()
}

/// A condition: the row is a part of a node, by its frame ($2), tile ($3), first pass ($4) and end ($5).
const WITHIN: &str = "frame = $2 and tile = $3 \
     and (idx << cast(level as integer)) >= $4 and ((idx + 1) << cast(level as integer)) <= $5";

/// Removes the pending parts of a node that is not pending itself, if all its passes are pending, and answers their
/// round.
async fn take_parts(connection: &mut Connection, job: JobId, node: &NodeAddress) -> Result<Option<i64>, StoreError> {
    let [first, end] = nodes::ends(node);
    let rows = query(format!("select level, round from pending where job = $1 and {WITHIN}"))
        .bind(job.to_string())
        .bind(i64::from(node.frame))
        .bind(i64::from(node.tile))
        .bind(first)
        .bind(end)
        .fetch_all(&mut *connection)
        .await?;
    let mut passes = 0;
    for row in &rows {
        passes += 1_i64 << row.integer("level")?;
    }
    // A node is work of one round.
    let Some(round) = rows.first().filter(|_| passes == end - first) else { return Ok(None) };
    let round = round.integer("round")?;
    for row in &rows {
        if row.integer("round")? != round {
            return Ok(None);
        }
    }
    query(format!("delete from pending where job = $1 and {WITHIN}"))
        .bind(job.to_string())
        .bind(i64::from(node.frame))
        .bind(i64::from(node.tile))
        .bind(first)
        .bind(end)
        .execute(connection)
        .await?;
    Ok(Some(round))
}

/// Frees the rest of a node that a lease still holds, when others have brought a part of it. Its worker has uploaded
/// the whole and will not bring the rest. Answers whether there was a rest.
async fn free_rest(connection: &mut Connection, lease: &LeaseRecord, node: &NodeAddress) -> Result<bool, StoreError> {
    if node.level == 0 {
        return Ok(false);
    }
    let [first, end] = nodes::ends(node);
    let freed = query(format!("update pending set lease = null where lease = $1 and {WITHIN}"))
        .bind(lease.id.to_string())
        .bind(i64::from(node.frame))
        .bind(i64::from(node.tile))
        .bind(first)
        .bind(end)
        .execute(connection)
        .await?;
    Ok(freed > 0)
}

/// Counts accepted work of a round, and answers how many of its passes are outstanding.
async fn count_down(
    connection: &mut Connection,
    job: JobId,
    frame: u32,
    round: i64,
    work: RoundWork,
    now_ms: i64,
) -> Result<i64, StoreError> {
    query(
        "update round_work set outstanding = outstanding - $4, \
         core_ms = case when core_ms > 9223372036854775807 - $5 then 9223372036854775807 else core_ms + $5 end, \
         completed_ms = case when outstanding = $4 then $6 else null end \
         where job = $1 and frame = $2 and round = $3 returning outstanding",
    )
    .bind(job.to_string())
    .bind(i64::from(frame))
    .bind(round)
    .bind(work.passes)
    .bind(work.core_ms)
    .bind(now_ms)
    .fetch_one(connection)
    .await?
    .integer("outstanding")
}

/// Counts accepted work of a worker, and answers its cores.
async fn credit_worker(
    connection: &mut Connection,
    worker: WorkerId,
    nodes: u64,
    samples: u64,
    core_ms: i64,
    now_ms: i64,
) -> Result<u32, StoreError> {
    query(
        "update workers set seen_ms = $5, accepted_nodes = accepted_nodes + $2, samples = samples + $3, \
         core_ms = case when core_ms > 9223372036854775807 - $4 then 9223372036854775807 else core_ms + $4 end, \
         failures_in_a_row = 0 where id = $1 returning cores",
    )
    .bind(worker.to_string())
    .bind(big(nodes))
    .bind(big(samples))
    .bind(core_ms)
    .bind(now_ms)
    .fetch_one(connection)
    .await?
    .number("cores")
}

/// Adds to a worker's measured rate for a job. Earlier work counts for at most `remembered_us`.
async fn measure(
    connection: &mut Connection,
    worker: WorkerId,
    job: JobId,
    samples: u64,
    [core_us, remembered_us]: [f64; 2],
) -> Result<(), StoreError> {
    query(
        "insert into rates (worker, job, samples, core_us) values ($1, $2, $3, $4) on conflict (worker, job) do \
         update set \
         samples = rates.samples * (case when rates.core_us > $5 then $5 / rates.core_us else 1.0 end) + \
         excluded.samples, \
         core_us = (case when rates.core_us > $5 then $5 else rates.core_us end) + excluded.core_us",
    )
    .bind(worker.to_string())
    .bind(job.to_string())
    .bind(Some(samples as f64))
    .bind(Some(core_us))
    .bind(Some(remembered_us))
    .execute(connection)
    .await?;
    Ok(())
}
