//! Why a film cannot be read.

use clerestory_film::{ImageError, InsertError, NodeAddress, SamplingError, SumError};

use crate::blobs::BlobError;
use crate::model::StoredNode;
use crate::store::StoreError;

/// The film cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FilmError {
    /// No node has been accepted.
    #[error("there is no node yet")]
    Empty,
    /// Nodes were lost or damaged, and are rendered again.
    #[error(
        "stored nodes of this image are lost; they are rendered again, and the image is there when the job is done"
    )]
    RenderedAgain,
    /// A stored node has lost bits or is cut off, or is not the one that its row names.
    #[error("the stored node {node} in {blob} cannot be used")]
    Damaged {
        /// The node.
        node: NodeAddress,
        /// Name of its blob.
        blob: String,
        /// What is wrong, unless it is cut off or another node altogether.
        source: Option<clerestory_film::StoreError>,
    },
    /// A stored node is not there.
    #[error("the stored node {node} is not there: {blob} is missing")]
    Lost {
        /// The node.
        node: NodeAddress,
        /// Name of its blob.
        blob: String,
        /// What the blob store says.
        source: BlobError,
    },
    /// The rows do not make a film.
    #[error("the accepted nodes do not fit together")]
    Inconsistent(#[from] InsertError),
    /// The passes are not all there.
    #[error("the accepted nodes are not the passes that are wanted")]
    Incomplete(#[from] SumError),
    /// The stored sampling is impossible.
    #[error("the job's sampling is impossible")]
    Sampling(#[from] SamplingError),
    /// The sums do not make an image.
    #[error("the sums do not make an image")]
    Image(#[from] ImageError),
    /// A file could not be written.
    #[error("the image cannot be written")]
    Write(#[from] clerestory_film::OpenExrError),
    /// A frame and its reference do not have the same rows.
    #[error("the image and its reference cannot be compared")]
    Flip(#[from] clerestory_film::FlipError),
    /// A preview could not be written.
    #[error("the preview cannot be written")]
    Preview(#[from] clerestory_film::PreviewError),
    /// A file for what is being made cannot be written or read.
    #[error("a temporary file in the data directory failed")]
    Scratch(#[from] std::io::Error),
    /// The stored scene cannot be read.
    #[error("the stored scene cannot be read")]
    Scene(#[from] serde_json::Error),
    /// A blob could not be read.
    #[error(transparent)]
    Blob(#[from] BlobError),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The computation was stopped.
    #[error("the computation was stopped")]
    Stopped(#[from] tokio::task::JoinError),
}

impl FilmError {
    /// Whether the rows do not make a film, as far as what was read belongs together.
    pub(crate) fn is_damage(&self) -> bool {
        matches!(self, Self::Inconsistent(_) | Self::Incomplete(_))
    }

    /// The node that is lost or damaged.
    pub(crate) fn unreadable_node(&self) -> Option<StoredNode> {
        match self {
            Self::Damaged { node, blob, .. } | Self::Lost { node, blob, .. } => {
                Some(StoredNode { address: *node, blob: blob.clone() })
            }
            _ => None,
        }
    }
}
