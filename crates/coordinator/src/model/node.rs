//! Accepted nodes: where their bytes lie, and what they cost.

use std::collections::BTreeSet;
use std::ops::AddAssign;

use clerestory_film::NodeAddress;
use clerestory_film::counters::Counters;

/// Where the bytes of a node lie.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct BlobRange {
    /// Name of the blob.
    pub(crate) blob: String,
    /// Where in it they begin.
    pub(crate) offset: u64,
    /// Their number, or none for the whole blob, as older builds stored nodes.
    pub(crate) length: Option<u64>,
}

/// An accepted node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NodeRow {
    /// The node.
    pub(crate) address: NodeAddress,
    /// Where its bytes lie.
    pub(crate) blob_range: BlobRange,
    /// The work that it took.
    pub(crate) work: Work,
}

/// A node and the blob in which it lies.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct StoredNode {
    /// The node.
    pub(crate) address: NodeAddress,
    /// Name of its blob.
    pub(crate) blob: String,
}

/// The work of nodes. Sums do not depend on their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Work {
    /// What was counted.
    pub(crate) counters: Counters,
    /// Builds of the workers that did it.
    pub(crate) builds: BTreeSet<String>,
}

impl AddAssign<&Self> for Work {
    fn add_assign(&mut self, other: &Self) {
        self.counters += other.counters;
        self.builds.extend(other.builds.iter().cloned());
    }
}

/// A node that replaces others.
#[derive(Clone, Debug)]
pub(crate) struct Merge {
    /// The node.
    pub(crate) parent: NodeAddress,
    /// Where its bytes lie.
    pub(crate) blob_range: BlobRange,
    /// The nodes that it is the sum of.
    pub(crate) children: Vec<NodeAddress>,
}

/// What was removed from films.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Removed {
    /// Where the nodes lay.
    pub(crate) blob_ranges: Vec<BlobRange>,
    /// Blobs that hold no accepted node any more.
    pub(crate) blobs: Vec<String>,
}

impl AddAssign for Removed {
    fn add_assign(&mut self, other: Self) {
        self.blob_ranges.extend(other.blob_ranges);
        self.blobs.extend(other.blobs);
    }
}

/// A node as the wire names it.
pub(crate) fn wire_address(address: &NodeAddress) -> clerestory_api::NodeAddress {
    let NodeAddress { frame, tile, level, index } = *address;
    clerestory_api::NodeAddress { frame, tile, level, index }
}
