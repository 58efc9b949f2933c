//! Why there is no image.

use clerestory_film::{InsertError, NodeAddress, SumError};
use clerestory_render_core::integrator::RenderError;

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub enum LocalRenderError {
    /// A pass of a tile cannot be rendered.
    #[error("cannot render pass {} of tile {}", address.index, address.tile)]
    Render {
        /// The pass.
        address: NodeAddress,
        /// Why.
        source: RenderError,
    },
    /// The film refuses a node.
    #[error("a node does not fit the film")]
    Insert(#[from] InsertError),
    /// The nodes of a tile have no sum.
    #[error("the film cannot be summed")]
    Sum(#[from] SumError),
}
