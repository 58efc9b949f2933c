//! Grants: the nodes that a [claim](crate::store::queue::claim) has chosen become a lease.
//!
//! A lease gets a fencing token above all others. Its nodes are marked as leased in the queue, or among the
//! [checks](crate::store::checks). The first grant of a job starts it, and pins it to the build fingerprint of the
//! worker.

use clerestory_film::NodeAddress;

use crate::model::{ClaimTerms, Grant, JobRecord, LeaseRecord, LeaseState, MeasuredRate, StoredKind};
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{is_of_nodes, nodes_json};
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::events;
use crate::store::workers::pins::pin_of;
use crate::store::workers::table::Claimant;

/// What the nodes of a lease are to the farm.
#[derive(Clone, Copy, Debug)]
pub(in crate::store) enum Leased {
    /// Pending.
    Work,
    /// Accepted, and to be checked.
    Checks,
}

/// Nodes for a lease.
pub(in crate::store) struct Offer {
    nodes: Vec<NodeAddress>,
    leased: Leased,
    /// Time until the lease is overdue.
    overdue_after_ms: i64,
    upload_linger_ms: i64,
}

impl Offer {
    /// An offer of nodes. `repeats` counts earlier leases on them beside a running one.
    pub(in crate::store) fn new(
        nodes: Vec<NodeAddress>,
        leased: Leased,
        repeats: u32,
        job: &JobRecord,
        rate: &MeasuredRate,
        terms: &ClaimTerms,
    ) -> Self {
        let samples: u64 = nodes.iter().map(|node| job.node_samples(node)).sum();
        let linger = rate.linger_seconds(nodes.len(), samples as f64, terms.upload_linger_ms as f64 / 1000.0);
        let overdue_after = rate.overdue_seconds(samples as f64, repeats, linger);
        let milliseconds = |seconds: f64| (seconds * 1000.0) as i64;
        Self { nodes, leased, overdue_after_ms: milliseconds(overdue_after), upload_linger_ms: milliseconds(linger) }
    }
}

/// Grants an offer to a worker as a lease.
pub(in crate::store) async fn grant(
    connection: &mut Connection,
    job: &JobRecord,
    offer: Offer,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Grant, StoreError> {
    let Offer { nodes, leased, overdue_after_ms, upload_linger_ms } = offer;
    let listed = nodes_json(&nodes)?;
    let deadline_ms = terms.now_ms.saturating_add(terms.ttl_ms);
    let granted = query(
        "insert into leases (id, token, job, worker, state, nodes, granted_ms, deadline_ms, overdue_after_ms, due_ms, \
         upload_linger_ms) \
         select $1, coalesce(max(token), 0) + 1, $2, $3, 'active', $4, $5, $6, $7, $8, $9 from leases returning token",
    )
    .bind(terms.lease.to_string())
    .bind(job.id.to_string())
    .bind(terms.worker.to_string())
    .bind(listed.as_str())
    .bind(terms.now_ms)
    .bind(deadline_ms)
    .bind(overdue_after_ms)
    .bind(terms.now_ms.saturating_add(overdue_after_ms))
    .bind(upload_linger_ms)
    .fetch_one(&mut *connection)
    .await?;
    let (table, holders) = match leased {
        Leased::Work => ("pending", "lease = $1"),
        // The holder of a check keeps it: the first answer counts.
        Leased::Checks => {
            ("checks", "second_lease = case when lease is null then null else $1 end, lease = coalesce(lease, $1)")
        }
    };
    let statement = format!("update {table} set {holders} where {}", is_of_nodes(connection.engine(), table, 2, 3));
    let update = query(statement).bind(terms.lease.to_string()).bind(job.id.to_string()).bind(listed);
    update.execute(&mut *connection).await?;
    if job.probe_digest.is_none() {
        start(connection, job, terms).await?;
    }
    let lease = LeaseRecord {
        id: terms.lease,
        token: granted.number("token")?,
        job: job.id,
        worker: terms.worker,
        build: claimant.build.clone(),
        state: LeaseState::Active,
        deadline_ms,
        nodes: nodes.iter().copied().collect(),
    };
    let (scene_hash, wants_report) = (job.scene_hash.clone(), job.built_scene.is_none());
    Ok(Grant { lease, scene_hash, nodes, upload_linger_ms, wants_report })
}

/// Starts a job with its first lease, and [pins](crate::store::workers::pins) it to the worker's build fingerprint.
/// A job that restarts is pinned anew.
async fn start(connection: &mut Connection, job: &JobRecord, terms: &ClaimTerms) -> Result<(), StoreError> {
    query(format!(
        "update jobs set state = 'running', started_ms = coalesce(started_ms, $2), probe_digest = {} where id = $1",
        pin_of("$3")
    ))
    .bind(job.id.to_string())
    .bind(terms.now_ms)
    .bind(terms.worker.to_string())
    .execute(&mut *connection)
    .await?;
    events::record(connection, StoredKind::Job, job.id, terms.now_ms).await
}
