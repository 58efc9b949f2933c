//! Leases: work given to a worker, and what comes back.

use bytes::Bytes;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::{ContentHash, JobId, LeaseId, WorkerId};

/// Request header of a partial: the fencing token of its lease.
pub const FENCING_TOKEN_HEADER: &str = "clerestory-fencing-token";

/// Request header of a partial: milliseconds spent rendering it, summed over the cores that worked.
pub const CORE_MILLISECONDS_HEADER: &str = "clerestory-core-ms";

/// A node of the merge tree: one tile over the passes `[index * 2^level, (index + 1) * 2^level)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeAddress {
    /// The frame.
    pub frame: u32,
    /// The tile's number.
    pub tile: u32,
    /// Binary logarithm of the number of passes.
    pub level: u32,
    /// Which aligned run of that length.
    pub index: u32,
}

/// A worker asks for work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LeaseRequest {
    /// Who asks.
    pub worker: WorkerId,
    /// Most nodes that it wants.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_nodes: Option<u32>,
    /// How long the work should take; the coordinator knows the worker's rate and has its own default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wanted_ms: Option<u32>,
    /// How long the coordinator may wait for work to appear before it answers that there is none; at most 20 000.
    #[serde(default)]
    pub wait_ms: u32,
    /// Jobs whose scenes it has built or is building: it is given work of these before work of others that are as
    /// urgent and have workers; at most 64.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub built: Vec<JobId>,
}

/// Nodes given to one worker until a deadline.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Lease {
    /// Its identity.
    pub id: LeaseId,
    /// Fencing token: rises with every lease. Sent back with every use of the lease.
    pub token: u64,
    /// The job.
    pub job: JobId,
    /// Hash of the job's canonical scene.
    pub scene_hash: String,
    /// What to render, most urgent first. Partials may carry any subset.
    pub nodes: Vec<NodeAddress>,
    /// When the lease ends unless it is renewed.
    pub deadline_ms: i64,
    /// The same from the moment of the answer, for clocks that disagree.
    pub expires_in_ms: i64,
    /// How long a complete node is to wait for others that travel with it, at most: the longer, the more leases there
    /// are, but no longer than the lease should take.
    // Older coordinators say `gather_ms`.
    #[serde(default = "default_upload_linger_ms", alias = "gather_ms")]
    pub upload_linger_ms: u32,
    /// Whether the coordinator wants a report on the scene: no worker has built it yet.
    #[serde(default)]
    pub wants_report: bool,
}

/// What coordinators expect that do not say so.
const fn default_upload_linger_ms() -> u32 {
    1000
}

/// The fencing token that proves that a caller holds a lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LeaseToken {
    /// The lease's fencing token.
    pub token: u64,
}

/// Most characters of [`LeaseReturn::failure`]. A coordinator refuses a longer one.
pub const LONGEST_FAILURE: usize = 500;

/// A worker gives the rest of a lease back.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LeaseReturn {
    /// The lease's fencing token.
    pub token: u64,
    /// Why the worker cannot render it, for instance that the scene cannot be built; absent when it only stops early.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
}

/// A lease goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct LeaseRenewal {
    /// When the lease ends unless it is renewed again.
    pub deadline_ms: i64,
    /// The same from the moment of the answer.
    pub expires_in_ms: i64,
    /// Nodes of the lease that are still wanted from this worker; where it is none, the lease is over.
    pub outstanding: u32,
}

/// A partial on its way to the coordinator.
#[derive(Clone, Debug)]
pub struct PartialUpload {
    /// The lease under which it was rendered.
    pub lease: LeaseId,
    /// The lease's fencing token.
    pub token: u64,
    /// Time spent rendering it, summed over cores.
    pub core_ms: u64,
    /// The multi-part OpenEXR file.
    pub body: Bytes,
}

/// A partial whose pieces have been uploaded.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PartialPieces {
    /// The lease's fencing token.
    pub token: u64,
    /// Milliseconds spent rendering it, summed over cores, at most 10^12.
    pub core_ms: u64,
    /// The hashes of its pieces, in their order; at most 65 536.
    pub pieces: Vec<ContentHash>,
}

/// What became of the nodes of a partial. Whatever the verdict, the worker drops its copy.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct PartialAnswer {
    /// One answer for each part, in the order of the file.
    pub nodes: Vec<NodeAnswer>,
    /// Nodes of the lease that are still wanted from this worker; where it is none, the lease is over.
    pub outstanding: u32,
}

/// What became of one node.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct NodeAnswer {
    /// The node.
    pub node: NodeAddress,
    /// What became of it.
    pub verdict: NodeVerdict,
    /// Why it was refused; absent unless it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// What became of one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum NodeVerdict {
    /// Merged into the film, and safe on disk.
    Accepted,
    /// Already in the film: an earlier upload or another worker brought it.
    Duplicate,
    /// Not part of the lease; nothing changed.
    Refused,
}
