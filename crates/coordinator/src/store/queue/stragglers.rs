//! Stragglers: leases of other workers that are taken over.
//!
//! A worker that finds no free nodes takes over nodes of another. That other has held them for longer than the first
//! would need, and longer than it may keep rendered nodes. [Overdue](crate::model::MeasuredRate::overdue_seconds) nodes
//! are taken over before other work, however often their lease is renewed. The other lease goes on while it has nodes
//! left, and the first result wins.
//!
//! A single node is split for that: its second half goes to the other worker.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use clerestory_api::{JobId, LeaseId};
use clerestory_film::NodeAddress;

use crate::model::{ClaimTerms, JobRecord, MeasuredRate, SHORTEST_LINGER_SECONDS};
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Engine, Kind, array_of, is_of_nodes, nodes_json, rows_of, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::leases::expiry;
use crate::store::queue::open_jobs::{OpenJob, first_of, last_round, most_samples};
use crate::store::queue::splits::{Side, split_off};

/// Most leases of a node while another lease holds it, unless that is overdue. When the first taker fails as well, one
/// more may try.
const MOST_REPEATS: i64 = 2;

/// Oldest leases among which one is chosen: reading thousands would take longer than it gains.
const OLDEST: i64 = 64;

/// A lease of another worker with nodes that may be taken over.
pub(in crate::store) struct HeldLease {
    pub(in crate::store) id: LeaseId,
    granted_ms: i64,
    /// How long its worker may keep rendered nodes before it uploads them.
    upload_linger_ms: i64,
    /// Its nodes that may be taken over, the least urgent first, each with the number of leases on it meanwhile.
    nodes: Vec<(NodeAddress, u32)>,
    /// Whether it may be taken over by any worker, any number of times.
    is_overdue: bool,
}

impl HeldLease {
    /// Whether it is overdue, or was held for longer than the asking worker would need for its rest. The time for
    /// which its worker may keep rendered nodes does not count.
    pub(in crate::store) fn may_be_taken_over(
        &self,
        job: &JobRecord,
        seconds: impl FnOnce(f64) -> f64,
        terms: &ClaimTerms,
    ) -> bool {
        let held_ms = terms.now_ms.saturating_sub(self.granted_ms).saturating_sub(self.upload_linger_ms);
        let samples: u64 = self.nodes.iter().map(|(node, _)| job.node_samples(node)).sum();
        self.is_overdue || held_ms as f64 / 1000.0 >= seconds(samples as f64)
    }
}

/// What has been taken over.
pub(in crate::store) struct TakenOver {
    /// The nodes, most urgent first.
    pub(in crate::store) nodes: Vec<NodeAddress>,
    /// Most leases of one of them while another lease holds it.
    pub(in crate::store) repeats: u32,
}

/// Another worker's overdue lease with nodes of a job up to a round.
pub(in crate::store) async fn overdue(
    connection: &mut Connection,
    job: &JobRecord,
    up_to: i64,
    terms: &ClaimTerms,
) -> Result<Option<HeldLease>, StoreError> {
    let last_round = up_to.min(last_round(job, terms));
    let nodes = nodes_of(connection.engine(), "lease = leases.id and round <= $4");
    let row = query(format!(
        "select id, granted_ms, upload_linger_ms, {nodes} as nodes from leases where state = 'active' and due_ms <= \
         $1 and job = $2 and worker <> $3 \
         and exists (select 1 from pending where lease = leases.id and round <= $4) order by due_ms, token limit 1"
    ))
    .bind(terms.now_ms)
    .bind(job.id.to_string())
    .bind(terms.worker.to_string())
    .bind(last_round)
    .fetch_optional(connection)
    .await?;
    row.map(|row| held_lease(&row, true)).transpose()
}

/// The pending nodes of a lease that satisfy a condition, as [`held_lease`] reads them.
fn nodes_of(engine: Engine, condition: &str) -> String {
    array_of(engine, "round, frame, tile, level, idx, repeats", &format!("pending where {condition}"))
}

/// For each of these jobs, the oldest lease among the [`OLDEST`] that is old enough for any worker.
pub(in crate::store) async fn held_longest(
    connection: &mut Connection,
    jobs: &[OpenJob],
    terms: &ClaimTerms,
) -> Result<BTreeMap<JobId, HeldLease>, StoreError> {
    if jobs.is_empty() {
        return Ok(BTreeMap::new());
    }
    let listed: Vec<(String, i64)> =
        jobs.iter().map(|open| (open.job.id.to_string(), last_round(&open.job, terms))).collect();
    let listed_jobs = rows_of(connection.engine(), 1, &[Kind::Text, Kind::Integer]);
    let nodes = nodes_of(connection.engine(), "lease = first_held.id and repeats < $5 and round <= last_round");
    // The shortest linger is in the condition for the index.
    let rows = query(format!(
        "with listed_jobs as materialized (select c0, c1 from {listed_jobs} as listed_rows) \
         select id, job, granted_ms, upload_linger_ms, {nodes} as nodes from \
         (select held.*, row_number() over (partition by job order by granted_ms, token) as place from \
         (select id, job, granted_ms, upload_linger_ms, token, (select c1 from listed_jobs where c0 = job) as \
         last_round from leases where state = 'active' and worker <> $2 \
         and granted_ms <= $3 and granted_ms + upload_linger_ms <= $6 and (select c1 from listed_jobs where c0 = job) \
         is not null \
         order by granted_ms, token limit $4) as held \
         where (select 1 from pending where lease = held.id and repeats < $5 and round <= last_round limit 1) is not \
         null) \
         as first_held where place = 1"
    ))
    .bind(to_json(&listed)?)
    .bind(terms.worker.to_string())
    .bind(terms.now_ms.saturating_sub((SHORTEST_LINGER_SECONDS * 1000.0) as i64))
    .bind(OLDEST)
    .bind(MOST_REPEATS)
    .bind(terms.now_ms)
    .fetch_all(connection)
    .await?;
    rows.iter().map(|row| Ok((row.parsed("job")?, held_lease(row, false)?))).collect()
}

fn held_lease(row: &Row, is_overdue: bool) -> Result<HeldLease, StoreError> {
    let (id, granted_ms, upload_linger_ms) =
        (row.parsed("id")?, row.integer("granted_ms")?, row.integer("upload_linger_ms")?);
    let mut listed: Vec<[u32; 6]> = row.optional_json("nodes")?.unwrap_or_default();
    listed.sort_unstable_by_key(|[round, frame, tile, _, index, _]| Reverse([*round, *frame, *tile, *index]));
    let node = |[_, frame, tile, level, index, repeats]: [u32; 6]| (NodeAddress { frame, tile, level, index }, repeats);
    Ok(HeldLease { id, granted_ms, upload_linger_ms, nodes: listed.into_iter().map(node).collect(), is_overdue })
}

/// Takes nodes over from a lease that [allows it](HeldLease::may_be_taken_over): its later half, since the other
/// worker renders them in order, and at most as many as a lease should have. While it is not overdue, a node is taken
/// over at most [`MOST_REPEATS`] times.
pub(in crate::store) async fn take_over(
    connection: &mut Connection,
    job: &JobRecord,
    lease: &HeldLease,
    rate: &MeasuredRate,
    terms: &ClaimTerms,
) -> Result<TakenOver, StoreError> {
    let held: Vec<NodeAddress> = lease.nodes.iter().map(|(node, _)| *node).collect();
    let samples: u64 = held.iter().map(|node| job.node_samples(node)).sum();
    let count = held.len().div_ceil(2).min(terms.most_nodes() as usize);
    let is_alone = held.len() == 1;
    let mut taken = held;
    taken.truncate(count);
    let mut taken = first_of(taken, job, rate, terms);
    let repeats = lease.nodes.iter().take(taken.len()).map(|(_, repeats)| *repeats).max().unwrap_or(0);
    let mut longest = most_samples(job, rate, terms);
    if is_alone && terms.fixed_nodes.is_none() {
        longest = longest.min(samples as f64 / 2.0);
    }
    if let Some(last) = taken.first_mut() {
        *last = split_off(connection, job, *last, longest, Side::Last).await?;
    }
    if is_alone && let Some(node) = taken.first() {
        // Its worker may have died with it, and the expiry of its lease would not tell.
        expiry::record_loss(connection, job.id, node, lease.id).await?;
    }
    taken.reverse();
    let statement =
        format!("update pending set repeats = repeats + 1 where {}", is_of_nodes(connection.engine(), "pending", 1, 2));
    query(statement).bind(job.id.to_string()).bind(nodes_json(&taken)?).execute(connection).await?;
    Ok(TakenOver { nodes: taken, repeats: repeats.saturating_add(1) })
}
