//! Which farm this is.

use uuid::Uuid;

/// The identity of a farm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    /// Its identity.
    pub(crate) farm: Uuid,
    /// Whether a blob store bears its mark.
    pub(crate) has_blobs: bool,
}
