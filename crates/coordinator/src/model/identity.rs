//! Which farm this is.

use uuid::Uuid;

/// Which farm a database is that of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    /// Its identity.
    pub(crate) farm: Uuid,
    /// Whether a blob store has been marked as its own.
    pub(crate) has_blobs: bool,
}
