//! The terms of a partial: its nodes, what they have in common, and what a coordinator expects.

use std::collections::BTreeSet;

use exr::meta::attribute::Compression;

use super::address::{NodeAddress, TileGrid};
use super::node::Node;
use super::openexr::DecodeBudget;
use super::sampling::Sampling;
use crate::counters::Counters;

/// The version of the header that this build writes and reads.
pub(super) const FORMAT_VERSION: u32 = 2;

/// Bytes of a pixel in a node with all its layers: beauty, moment, albedo, normal (three floats each) and depth (one).
const NODE_BYTES_PER_PIXEL: u64 = 13 * 4;

/// Bytes of a pixel of the layer `caustic`.
const CAUSTIC_BYTES_PER_PIXEL: u64 = 3 * 4;

/// How parts are compressed: run lengths take out black pixels and zero moments at several times the speed of ZIP,
/// which makes noise no smaller than that. Measured in `docs/film.md`.
pub(super) const COMPRESSION: Compression = Compression::RLE;

/// A rendered node, and the work that it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// The node.
    pub node: Node,
    /// What the methods did.
    pub counters: Counters,
}

/// What is common to the nodes of a partial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartialHeader {
    /// The job.
    pub job: String,
    /// Hash of the canonical scene, in hexadecimal.
    pub scene_hash: String,
    /// The program that rendered.
    pub build: String,
}

/// What a partial must be to be taken.
#[derive(Clone, Debug)]
pub struct Expectation {
    /// The job.
    pub job: String,
    /// Hash of the canonical scene, in hexadecimal.
    pub scene_hash: String,
    /// How the image is cut into tiles.
    pub grid: TileGrid,
    /// How samples are grouped.
    pub sampling: Sampling,
    /// The nodes that may be in it.
    pub allowed: BTreeSet<NodeAddress>,
}

impl Expectation {
    /// What decoding the nodes that may be in it can need at most: all layers of each, and its largest block, which is
    /// a row of the tile.
    pub fn budget(&self) -> DecodeBudget {
        let tiles = self.allowed.iter().filter_map(|node| self.grid.tile(node.tile));
        let pixels: u64 = tiles.map(|tile| u64::from(tile.width) * (u64::from(tile.height) + 1)).sum();
        let caustic = if self.grid.has_caustic { CAUSTIC_BYTES_PER_PIXEL } else { 0 };
        DecodeBudget { pixel_bytes: pixels * (NODE_BYTES_PER_PIXEL + caustic) }
    }
}
