//! Stragglers: a worker for whom nothing is free takes over what another has held for longer than it would need itself, and than that one may keep
//! what it has rendered. What another has had
//! for [far longer](crate::schedule::Pace::patience_seconds) without bringing a node is taken over before there is nothing else to do, however
//! often its lease is renewed. The other's lease goes on while it has anything left, and the first result wins.
//!
//! A single node is taken over by its passes: its second half goes to the other worker.

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

/// How often a node is leased while another lease has it, unless that is overdue: whatever the first taker meets with, another may take it once more.
const MOST_REPEATS: i64 = 2;

/// Leases that have been held for longest, of which one may be taken over: to look at more of thousands would take longer than it is worth.
const OLDEST: i64 = 64;

/// A lease of another worker with nodes that may be taken over.
pub(in crate::store) struct HeldLease {
    pub(in crate::store) id: LeaseId,
    granted_ms: i64,
    /// How long its worker may keep what it has rendered before it brings it.
    upload_linger_ms: i64,
    /// Its nodes that may be taken over, the least urgent first, with how often each has been leased while it had them.
    nodes: Vec<(NodeAddress, u32)>,
    /// Whether it is so whoever asks, and however often that has been done.
    is_overdue: bool,
}

impl HeldLease {
    /// Whether it is overdue, or a worker that needs so many seconds for some samples would have needed less for all that is left of it than the other has
    /// had, but for the time for which that may keep what it has rendered.
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
    /// How often one of them has been leased by now while another lease had it.
    pub(in crate::store) repeats: u32,
}

/// A lease of another worker with nodes of a job up to a round, that has been without an accepted node for too long.
pub(in crate::store) async fn overdue(
    connection: &mut Connection,
    job: &JobRecord,
    up_to: i64,
    terms: &ClaimTerms,
) -> Result<Option<HeldLease>, StoreError> {
    let last_round = up_to.min(last_round(job, terms));
    let nodes = nodes_of(connection.engine(), "lease = leases.id and round <= $4");
    let row = query(format!(
        "select id, granted_ms, gather_ms, {nodes} as nodes from leases where state = 'active' and due_ms <= $1 and job = $2 and worker <> $3 \
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

/// The pending nodes of a lease that a condition lets through, as [`held_lease`] reads them.
fn nodes_of(engine: Engine, condition: &str) -> String {
    array_of(engine, "round, frame, tile, level, idx, repeats", &format!("pending where {condition}"))
}

/// Of each of these jobs, the oldest such lease, if it is old enough for any worker and among the [`OLDEST`].
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
    // The shortest time that a worker may keep nodes is there for the index.
    let rows = query(format!(
        "with listed_jobs as materialized (select c0, c1 from {listed_jobs} as listed_rows) \
         select id, job, granted_ms, gather_ms, {nodes} as nodes from \
         (select held.*, row_number() over (partition by job order by granted_ms, token) as place from \
         (select id, job, granted_ms, gather_ms, token, (select c1 from listed_jobs where c0 = job) as last_round \
         from leases where state = 'active' and worker <> $2 \
         and granted_ms <= $3 and granted_ms + gather_ms <= $6 and (select c1 from listed_jobs where c0 = job) is not null \
         order by granted_ms, token limit $4) as held \
         where (select 1 from pending where lease = held.id and repeats < $5 and round <= last_round limit 1) is not null) \
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
    let (id, granted_ms, upload_linger_ms) = (row.parsed("id")?, row.integer("granted_ms")?, row.integer("gather_ms")?);
    let mut listed: Vec<[u32; 6]> = row.optional_json("nodes")?.unwrap_or_default();
    listed.sort_unstable_by_key(|[round, frame, tile, _, index, _]| Reverse([*round, *frame, *tile, *index]));
    let node = |[_, frame, tile, level, index, repeats]: [u32; 6]| (NodeAddress { frame, tile, level, index }, repeats);
    Ok(HeldLease { id, granted_ms, upload_linger_ms, nodes: listed.into_iter().map(node).collect(), is_overdue })
}

/// Nodes of a lease of another worker that [may be taken over](HeldLease::may_be_taken_over): the later half of them, since the other renders them in their
/// order, and no more than a lease should have. A node is taken over [`MOST_REPEATS`] times at most while nobody is overdue.
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
        // Its worker may have died with it, and no expiry of its lease would tell.
        expiry::record_loss(connection, job.id, node, lease.id).await?;
    }
    taken.reverse();
    let statement =
        format!("update pending set repeats = repeats + 1 where {}", is_of_nodes(connection.engine(), "pending", 1, 2));
    query(statement).bind(job.id.to_string()).bind(nodes_json(&taken)?).execute(connection).await?;
    Ok(TakenOver { nodes: taken, repeats: repeats.saturating_add(1) })
}
