//! Leases: what a worker asks for, and what it is granted.

use std::collections::BTreeSet;

use clerestory_api::{JobId, LeaseId, WorkerId};
use clerestory_film::NodeAddress;
use serde::{Deserialize, Serialize};

/// Nodes in the largest lease.
pub(crate) const MOST_NODES: u32 = 256;

/// What a worker asks for.
#[derive(Clone, Debug)]
pub(crate) struct ClaimTerms {
    /// The worker.
    pub(crate) worker: WorkerId,
    /// Jobs whose scenes it has built.
    pub(crate) built: Vec<JobId>,
    /// Identity of the lease, if it is granted.
    pub(crate) lease: LeaseId,
    /// Most nodes that it wants.
    pub(crate) max_nodes: Option<u32>,
    /// The exact number of nodes, if there are as many: for experiments.
    pub(crate) fixed_nodes: Option<u32>,
    /// How long the work should take.
    pub(crate) target_ms: i64,
    /// How long a complete node of a long lease waits for others.
    pub(crate) upload_linger_ms: i64,
    /// How long the lease lasts.
    pub(crate) ttl_ms: i64,
    /// Last heartbeat of a worker that counts as absent.
    pub(crate) alive_ms: i64,
    /// Now.
    pub(crate) now_ms: i64,
}

impl ClaimTerms {
    /// Most nodes that the lease may have.
    pub(crate) fn most_nodes(&self) -> u32 {
        self.fixed_nodes.or(self.max_nodes).unwrap_or(MOST_NODES).clamp(1, MOST_NODES)
    }
}

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
    pub(crate) upload_linger_ms: i64,
    /// Whether no worker has built the job's scene yet.
    pub(crate) wants_report: bool,
}

/// What became of a lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum LeaseState {
    /// A worker holds it.
    Active,
    /// No node is wanted under it any more: all were accepted, or other workers have them.
    Complete,
    /// Given back by the worker, or taken back because what it brought could not be used.
    Returned,
    /// Ran out.
    Expired,
    /// The job ended.
    Ended,
}

/// A lease as stored.
#[derive(Clone, Debug)]
pub(crate) struct LeaseRecord {
    /// Its identity.
    pub(crate) id: LeaseId,
    /// Its fencing token.
    pub(crate) token: u64,
    /// The job.
    pub(crate) job: JobId,
    /// The worker.
    pub(crate) worker: WorkerId,
    /// Its build, as it introduced itself.
    pub(crate) build: String,
    /// What became of it.
    pub(crate) state: LeaseState,
    /// When it runs out.
    pub(crate) deadline_ms: i64,
    /// All nodes that were leased.
    pub(crate) nodes: BTreeSet<NodeAddress>,
}

/// A renewal of a lease.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Renewal {
    /// The lease.
    pub(crate) lease: LeaseId,
    /// Its fencing token.
    pub(crate) token: u64,
    /// Now.
    pub(crate) now_ms: i64,
    /// The new deadline.
    pub(crate) deadline_ms: i64,
}
