//! Grants: the nodes that a [claim](super::claim) has chosen become a lease.
//!
//! A lease gets a fencing token beyond all that there are, and its nodes are marked as leased where they lie: in the queue, or among the
//! [checks](super::checks). The first grant of a job starts it, and notes which bits its workers have to compute.

use clerestory_film::NodeAddress;

use super::claim::ClaimTerms;
use super::events::{self, StoredKind};
use super::jobs::JobRecord;
use super::leases::{LeaseRecord, LeaseState};
use super::row::{is_of_nodes, nodes_json};
use super::sql::query;
use super::workers::Claimant;
use super::{Connection, StoreError};
use crate::schedule::Pace;

/// A granted lease.
#[derive(Clone, Debug)]
pub(crate) struct Grant {
    /// The lease.
    pub(crate) lease: LeaseRecord,
    /// Hash of the job's canonical scene.
    pub(crate) scene_hash: String,
    /// Its nodes, most urgent first.
    pub(crate) nodes: Vec<NodeAddress>,
    /// How long a complete node waits for others.
    pub(crate) gather_ms: i64,
}

/// What the nodes of a lease are to the farm.
#[derive(Clone, Copy, Debug)]
pub(super) enum Leased {
    /// Pending.
    Work,
    /// Accepted, and to be checked.
    Checks,
}

/// Nodes for a lease.
pub(super) struct Offer {
    nodes: Vec<NodeAddress>,
    leased: Leased,
    /// How long the lease may go on without an accepted node before others are given them.
    patience_ms: i64,
    gather_ms: i64,
}

impl Offer {
    /// Nodes that have been given out so often while others had them.
    pub(super) fn new(
        nodes: Vec<NodeAddress>,
        leased: Leased,
        repeats: u32,
        job: &JobRecord,
        pace: &Pace,
        terms: &ClaimTerms,
    ) -> Self {
        let samples: u64 = nodes.iter().map(|node| job.node_samples(node)).sum();
        let gathering = pace.gathering_seconds(nodes.len(), samples as f64, terms.gather_ms as f64 / 1000.0);
        let patience = pace.patience_seconds(samples as f64, repeats, gathering);
        let milliseconds = |seconds: f64| (seconds * 1000.0) as i64;
        Self { nodes, leased, patience_ms: milliseconds(patience), gather_ms: milliseconds(gathering) }
    }
}

/// Gives an offer to a worker as a lease.
pub(super) async fn grant(
    connection: &mut Connection,
    job: &JobRecord,
    offer: Offer,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Grant, StoreError> {
    let Offer { nodes, leased, patience_ms, gather_ms } = offer;
    let listed = nodes_json(&nodes)?;
    let deadline_ms = terms.now_ms.saturating_add(terms.ttl_ms);
    let granted = query(
        "insert into leases (id, token, job, worker, state, nodes, granted_ms, deadline_ms, patience_ms, due_ms, gather_ms) \
         select $1, coalesce(max(token), 0) + 1, $2, $3, 'active', $4, $5, $6, $7, $8, $9 from leases returning token",
    )
    .bind(terms.lease.to_string())
    .bind(job.id.to_string())
    .bind(terms.worker.to_string())
    .bind(listed.as_str())
    .bind(terms.now_ms)
    .bind(deadline_ms)
    .bind(patience_ms)
    .bind(terms.now_ms.saturating_add(patience_ms))
    .bind(gather_ms)
    .fetch_one(&mut *connection)
    .await?;
    let (table, holders) = match leased {
        Leased::Work => ("pending", "lease = $1"),
        // Whoever has a check keeps it: the first answer counts.
        Leased::Checks => {
            ("checks", "second_lease = case when lease is null then null else $1 end, lease = coalesce(lease, $1)")
        }
    };
    let statement = format!("update {table} set {holders} where {}", is_of_nodes(connection.engine(), table, 2, 3));
    let update = query(statement).bind(terms.lease.to_string()).bind(job.id.to_string()).bind(listed);
    update.execute(&mut *connection).await?;
    if job.probe_digest.is_none() {
        start(connection, job, claimant, terms).await?;
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
    Ok(Grant { lease, scene_hash: job.scene_hash.clone(), nodes, gather_ms })
}

/// Notes on a job that its first nodes have been given out, and to whom.
async fn start(
    connection: &mut Connection,
    job: &JobRecord,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<(), StoreError> {
    // One that an older build has started, or that begins again, goes on with whoever comes first.
    query("update jobs set state = 'running', started_ms = coalesce(started_ms, $2), probe_digest = $3 where id = $1")
        .bind(job.id.to_string())
        .bind(terms.now_ms)
        .bind(&claimant.probe_digest)
        .execute(&mut *connection)
        .await?;
    events::record(connection, StoredKind::Job, job.id, terms.now_ms).await
}
