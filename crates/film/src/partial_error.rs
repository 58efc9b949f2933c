//! Why a partial is not taken.

use thiserror::Error;

use super::address::{NodeAddress, Tile};
use super::node::NodeError;
use super::openexr_error::OpenExrError;
use super::partial_format::{COMPRESSION, FORMAT_VERSION};
use super::sampling::Sampling;

/// Why a partial is not taken; each is one way to be wrong.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PartialError {
    /// No OpenEXR file, larger than the budget, or damaged.
    #[error(transparent)]
    OpenExr(#[from] OpenExrError),
    /// A part lacks the attribute, or it is not the header of a node.
    #[error("part {part}: the attribute clerestory is not the header of a node: {message}")]
    BadHeader {
        /// Number of the part.
        part: usize,
        /// What is wrong.
        message: String,
    },
    /// The header is of another version.
    #[error("part {part}: the header has version {found}; this build reads version {FORMAT_VERSION}")]
    WrongVersion {
        /// Number of the part.
        part: usize,
        /// Its version.
        found: u64,
    },
    /// It is of another job.
    #[error("the partial is of job {found}; it was sent for job {expected}")]
    WrongJob {
        /// The job in the header.
        found: String,
        /// The job of the lease.
        expected: String,
    },
    /// It is of another scene.
    #[error("the partial is of a scene with hash {found}; the job's scene has {expected}")]
    WrongScene {
        /// The hash in the header.
        found: String,
        /// The hash of the job's scene.
        expected: String,
    },
    /// A node that was not asked for.
    #[error("node ({address}) was not leased")]
    UnexpectedNode {
        /// The node.
        address: NodeAddress,
    },
    /// A node twice.
    #[error("node ({address}) is there twice")]
    RepeatedNode {
        /// The node.
        address: NodeAddress,
    },
    /// Passes or blocks of another size.
    #[error("node ({address}) was rendered with {found}; the job has {expected}")]
    WrongSampling {
        /// The node.
        address: NodeAddress,
        /// As in the header.
        found: Sampling,
        /// As in the job.
        expected: Sampling,
    },
    /// The passes or samples that the header counts are not those of the node.
    #[error("node ({address}) claims {field} {found}; it must be {expected}")]
    WrongCount {
        /// The node.
        address: NodeAddress,
        /// The field of the header.
        field: &'static str,
        /// Its value.
        found: u64,
        /// What it must be.
        expected: u64,
    },
    /// More work than a worker can have done for the samples of the node.
    #[error("node ({address}) claims counters.{counter} {found}; it must be at most {most}")]
    AbsurdCounter {
        /// The node.
        address: NodeAddress,
        /// The counter.
        counter: &'static str,
        /// Its value.
        found: u64,
        /// The most that is believed.
        most: u64,
    },
    /// The data window is not the tile.
    #[error(
        "node ({address}) has a data window of {} x {} pixels at ({}, {}); its tile is {} x {} at ({}, {})",
        size[0], size[1], position[0], position[1], expected.width, expected.height, expected.x, expected.y
    )]
    WrongDimensions {
        /// The node.
        address: NodeAddress,
        /// Column and row of the data window.
        position: [i32; 2],
        /// Pixels across and down.
        size: [u64; 2],
        /// The tile.
        expected: Tile,
    },
    /// A channel that the node must have.
    #[error("node ({address}) lacks the 32-bit float channel {channel}")]
    MissingChannel {
        /// The node.
        address: NodeAddress,
        /// The channel.
        channel: &'static str,
    },
    /// A channel that the node must not have.
    #[error("node ({address}) has a channel {channel}, which it must not have")]
    UnexpectedChannel {
        /// The node.
        address: NodeAddress,
        /// The channel.
        channel: String,
    },
    /// Another compression than this program writes, which might lose bits.
    #[error("node ({address}) is compressed with {found}; it must be {COMPRESSION}")]
    WrongCompression {
        /// The node.
        address: NodeAddress,
        /// The compression.
        found: String,
    },
    /// The values, the counters or the address were changed after the worker had hashed them.
    #[error("node ({address}) is damaged: its values have the hash {found}; the header says {announced}")]
    Damaged {
        /// The node.
        address: NodeAddress,
        /// Hash of what arrived.
        found: String,
        /// The hash in the header.
        announced: String,
    },
    /// A value that cannot be.
    #[error("node ({address}): {source}")]
    BadValue {
        /// The node.
        address: NodeAddress,
        /// What is wrong.
        source: NodeError,
    },
}
