//! Stragglers: a worker for whom nothing is free takes over what another has held for longer than it would need itself, and than that one may keep
//! what it has rendered. What another has had
//! for [far longer](crate::schedule::Pace::patience_seconds) without bringing a node is taken over before there is nothing else to do, however
//! often its lease is renewed. The other's lease goes on while it has anything left, and the first result wins.
//!
//! A single node is taken over by its passes: its second half goes to the other worker.

use std::collections::BTreeMap;

use clerestory_api::JobId;
use clerestory_render_core::film::NodeAddress;

use super::claim::{ClaimTerms, OpenJob, first_of, last_round, most_samples};
use super::jobs::JobRecord;
use super::leases::address;
use super::parts::{Side, split_off};
use super::row::{Row, is_of_nodes, nodes_json, to_json};
use super::sql::{Kind, query, rows_of};
use super::{Connection, StoreError};
use crate::schedule::{Pace, SHORTEST_GATHERING_SECONDS};

/// How often a node is leased while another lease has it, unless that is overdue: whatever the first taker meets with, another may take it once more.
const MOST_REPEATS: i64 = 2;

/// Leases that have been held for longest, of which one may be taken over: to look at more of thousands would take longer than it is worth.
const OLDEST: i64 = 64;

/// A lease of another worker with nodes that may be taken over.
pub(super) struct HeldLease {
    id: String,
    granted_ms: i64,
    /// How long its worker may keep what it has rendered before it brings it.
    gather_ms: i64,
    /// The last round of which nodes may be taken over.
    last_round: i64,
    /// Whether it is so whoever asks, and however often that has been done.
    is_overdue: bool,
}

/// What has been taken over.
pub(super) struct TakenOver {
    /// The nodes, most urgent first.
    pub(super) nodes: Vec<NodeAddress>,
    /// How often one of them has been leased by now while another lease had it.
    pub(super) repeats: u32,
}

/// A lease of another worker with nodes of a job up to a round, that has been without an accepted node for too long.
pub(super) async fn overdue(
    connection: &mut Connection,
    job: &JobRecord,
    up_to: i64,
    terms: &ClaimTerms,
) -> Result<Option<HeldLease>, StoreError> {
    let last_round = up_to.min(last_round(job, terms));
    let row = query(
        "select id, granted_ms, gather_ms from leases where state = 'active' and due_ms <= $1 and job = $2 and worker <> $3 \
         and exists (select 1 from pending where lease = leases.id and round <= $4) order by due_ms, token limit 1",
    )
    .bind(terms.now_ms)
    .bind(job.id.to_string())
    .bind(terms.worker.to_string())
    .bind(last_round)
    .fetch_optional(connection)
    .await?;
    row.map(|row| held_lease(&row, last_round, true)).transpose()
}

/// Of each of these jobs, the oldest such lease, if it is old enough for any worker and among the [`OLDEST`].
pub(super) async fn held_longest(
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
    // The shortest time that a worker may keep nodes is there for the index.
    let rows = query(format!(
        "with listed_jobs as materialized (select c0, c1 from {listed_jobs} as listed_rows) \
         select held.id, job, granted_ms, gather_ms, last_round from (select id, job, granted_ms, gather_ms, token, \
         (select c1 from listed_jobs where c0 = job) as last_round from leases where state = 'active' and worker <> $2 \
         and granted_ms <= $3 and granted_ms + gather_ms <= $6 and (select c1 from listed_jobs where c0 = job) is not null \
         order by granted_ms, token limit $4) as held \
         where (select 1 from pending where lease = held.id and repeats < $5 and round <= last_round limit 1) is not null \
         order by granted_ms desc, token desc"
    ))
    .bind(to_json(&listed)?)
    .bind(terms.worker.to_string())
    .bind(terms.now_ms.saturating_sub((SHORTEST_GATHERING_SECONDS * 1000.0) as i64))
    .bind(OLDEST)
    .bind(MOST_REPEATS)
    .bind(terms.now_ms)
    .fetch_all(connection)
    .await?;
    let lease = |row: &Row| {
        let last_round = row.integer("last_round")?;
        Ok((row.parsed("job")?, held_lease(row, last_round, false)?))
    };
    // The oldest of a job comes last, and stays.
    rows.iter().map(lease).collect()
}

fn held_lease(row: &Row, last_round: i64, is_overdue: bool) -> Result<HeldLease, StoreError> {
    let (id, granted_ms, gather_ms) = (row.text("id")?, row.integer("granted_ms")?, row.integer("gather_ms")?);
    Ok(HeldLease { id, granted_ms, gather_ms, last_round, is_overdue })
}

/// Nodes of a lease of another worker, if that is overdue or this one would have needed less for all that is left of it than the other has had, but for
/// the time for which that may keep what it has rendered: the later half of them, since the other renders them in their order, and no more than a lease should have. A node is taken over [`MOST_REPEATS`]
/// times at most while nobody is overdue.
pub(super) async fn take_over(
    connection: &mut Connection,
    job: &JobRecord,
    lease: &HeldLease,
    pace: &Pace,
    terms: &ClaimTerms,
) -> Result<Option<TakenOver>, StoreError> {
    let rows = query(
        "select frame, tile, level, idx, repeats from pending where lease = $1 and repeats < $2 and round <= $3 \
         order by round desc, frame desc, tile desc, idx desc",
    )
    .bind(lease.id.as_str())
    .bind(if lease.is_overdue { i64::MAX } else { MOST_REPEATS })
    .bind(lease.last_round)
    .fetch_all(&mut *connection)
    .await?;
    let held_ms = terms.now_ms.saturating_sub(lease.granted_ms).saturating_sub(lease.gather_ms);
    let held = rows.iter().map(address).collect::<Result<Vec<_>, _>>()?;
    let samples: u64 = held.iter().map(|node| job.node_samples(node)).sum();
    let is_slow = held_ms as f64 / 1000.0 >= pace.seconds(samples as f64);
    if held.is_empty() || !(lease.is_overdue || is_slow) {
        return Ok(None);
    }
    let count = held.len().div_ceil(2).min(terms.most_nodes() as usize);
    let is_alone = held.len() == 1;
    let mut taken = held;
    taken.truncate(count);
    let mut taken = first_of(taken, job, pace, terms);
    let mut repeats = 0_u32;
    for row in rows.iter().take(taken.len()) {
        repeats = repeats.max(row.number("repeats")?);
    }
    let mut longest = most_samples(job, pace, terms);
    if is_alone && terms.fixed_nodes.is_none() {
        longest = longest.min(samples as f64 / 2.0);
    }
    if let Some(last) = taken.first_mut() {
        *last = split_off(connection, job, *last, longest, Side::Last).await?;
    }
    taken.reverse();
    let statement =
        format!("update pending set repeats = repeats + 1 where {}", is_of_nodes(connection.engine(), "pending", 1, 2));
    query(statement).bind(job.id.to_string()).bind(nodes_json(&taken)?).execute(connection).await?;
    Ok(Some(TakenOver { nodes: taken, repeats: repeats.saturating_add(1) }))
}
