//! What a worker brings under a lease: nodes, or a failure.

use clerestory_api::LeaseId;
use clerestory_film::NodeAddress;
use clerestory_film::counters::Counters;

use crate::model::node::BlobRange;

/// A node that was brought and whose blob is on disk.
#[derive(Clone, Debug)]
pub(crate) struct DeliveredNode {
    /// The node.
    pub(crate) address: NodeAddress,
    /// Where its bytes lie.
    pub(crate) blob_range: BlobRange,
    /// What was counted while rendering it.
    pub(crate) counters: Counters,
    /// Hash of its bytes.
    pub(crate) digest: String,
    /// Whether another worker is to [check](super::check::is_selected) it, if it is accepted.
    pub(crate) is_selected: bool,
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
    /// Last heartbeat of a worker that counts as absent.
    pub(crate) alive_ms: i64,
}

/// The work of a lease failed.
#[derive(Clone, Debug)]
pub(crate) struct WorkFailure {
    /// The lease.
    pub(crate) lease: LeaseId,
    /// Its fencing token.
    pub(crate) token: u64,
    /// Why, for people.
    pub(crate) reason: String,
    /// 1 when a partial was refused, 0 when the worker gave up by itself.
    pub(crate) refused_partials: u32,
    /// Now.
    pub(crate) now_ms: i64,
    /// Last heartbeat of a worker that counts as absent.
    pub(crate) alive_ms: i64,
}
