//! Stragglers: a worker for whom nothing is free takes over what another has held for longer than it would need itself. The other's lease goes
//! on, and the first result wins.

use std::collections::BTreeMap;

use clerestory_api::JobId;
use clerestory_render_core::film::NodeAddress;

use super::claim::{ClaimTerms, OpenJob, last_round};
use super::jobs::JobRecord;
use super::leases::address;
use super::row::{Row, nodes_json, nodes_of, to_json};
use super::sql::{Kind, query, rows_of};
use super::{Connection, StoreError};
use crate::schedule::Pace;

/// How often a node is leased while another lease has it: whatever the first taker meets with, another may take it once more.
const MOST_REPEATS: i64 = 2;

/// Leases that have been held for longest, of which one may be taken over: to look at more of thousands would take longer than it is worth.
const OLDEST: i64 = 64;

/// How long a worker may keep what it has rendered before it brings it, in seconds.
const GATHERING_SECONDS: f64 = 1.0;

/// A lease of another worker with nodes that may be taken over.
pub(super) struct HeldLease {
    id: String,
    granted_ms: i64,
}

/// Of each of these jobs, the oldest such lease, if it is old enough for any worker and among the [`OLDEST`].
pub(super) async fn held_longest(
    connection: &mut Connection,
    jobs: &[OpenJob],
    terms: &ClaimTerms,
) -> Result<BTreeMap<JobId, HeldLease>, StoreError> {
    let listed: Vec<(String, i64)> =
        jobs.iter().map(|open| (open.job.id.to_string(), last_round(&open.job, terms))).collect();
    let listed_jobs = rows_of(connection.engine(), 1, &[Kind::Text, Kind::Integer]);
    let rows = query(format!(
        "select held.id, job, granted_ms from (select id, job, granted_ms, token from leases \
         where state = 'active' and worker <> $2 and granted_ms <= $3 and job in (select c0 from {listed_jobs} as open_jobs) \
         order by granted_ms, token limit $4) as held join {listed_jobs} as listed_jobs on c0 = job \
         where exists (select 1 from pending where lease = held.id and repeats < $5 and round <= c1) \
         order by granted_ms desc, token desc"
    ))
    .bind(to_json(&listed)?)
    .bind(terms.worker.to_string())
    .bind(terms.now_ms.saturating_sub((GATHERING_SECONDS * 1000.0) as i64))
    .bind(OLDEST)
    .bind(MOST_REPEATS)
    .fetch_all(connection)
    .await?;
    let lease =
        |row: &Row| Ok((row.parsed("job")?, HeldLease { id: row.text("id")?, granted_ms: row.integer("granted_ms")? }));
    // The oldest of a job comes last, and stays.
    rows.iter().map(lease).collect()
}

/// Nodes of a lease of another worker, if this one would have needed less for all that is left of it than the other has had: the later half of
/// them, since the other renders them in their order. A node is taken over [`MOST_REPEATS`] times at most.
pub(super) async fn take_over(
    connection: &mut Connection,
    job: &JobRecord,
    lease: &HeldLease,
    pace: &Pace,
    terms: &ClaimTerms,
) -> Result<Vec<NodeAddress>, StoreError> {
    let rows = query(
        "select frame, tile, level, idx from pending where lease = $1 and repeats < $2 and round <= $3 \
         order by round desc, frame desc, tile desc, idx desc",
    )
    .bind(lease.id.as_str())
    .bind(MOST_REPEATS)
    .bind(last_round(job, terms))
    .fetch_all(&mut *connection)
    .await?;
    let held_seconds = terms.now_ms.saturating_sub(lease.granted_ms) as f64 / 1000.0;
    let held = rows.iter().map(address).collect::<Result<Vec<_>, _>>()?;
    let samples: u64 = held.iter().map(|node| job.node_samples(node)).sum();
    if held_seconds < pace.seconds(samples as f64) + GATHERING_SECONDS {
        return Ok(Vec::new());
    }
    let count = held.len().div_ceil(2).min(terms.most_nodes() as usize);
    let mut taken = held;
    taken.truncate(count);
    taken.reverse();
    let statement = format!(
        "update pending set repeats = repeats + 1 where job = $1 and (frame, tile, level, idx) in {}",
        nodes_of(connection.engine(), 2)
    );
    query(statement).bind(job.id.to_string()).bind(nodes_json(&taken)?).execute(connection).await?;
    Ok(taken)
}
