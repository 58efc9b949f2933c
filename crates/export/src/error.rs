//! Why a scene cannot be exported.

use clerestory_render_core::scene::SceneError;
use thiserror::Error;

/// Why a scene cannot be exported. Every error names the place in the scene, what stands there and what would be right.
#[derive(Debug, Error)]
pub enum ExportError {
    /// A value that cannot be exported.
    #[error("{place}: found {found}, which cannot be exported: expected {expected}")]
    Value {
        /// Place in the scene file.
        place: String,
        /// What stands there.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// The tolerance does not go with a pane.
    #[error("--tolerance: found {found}, expected {expected} for the pane \"{pane}\"")]
    Tolerance {
        /// The pane.
        pane: String,
        /// The tolerance.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// A file of the scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A picture cannot be written.
    #[error("a texture cannot be written: {0}")]
    Texture(String),
}
