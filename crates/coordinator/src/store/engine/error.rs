//! The one error of the database, for both engines.

use crate::error_chain::in_one_line;
use crate::store::engine::damage;

/// The database failed.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum StoreError {
    /// A statement failed.
    #[error("the database failed: {0}")]
    Database(String),
    /// A stored value that this build cannot have written.
    #[error("column `{column}` holds `{value}`, which cannot be read")]
    Corrupt {
        /// The column.
        column: &'static str,
        /// Its value.
        value: String,
    },
    /// It takes no writes now.
    #[error("the database takes no writes: {0}")]
    ReadOnly(&'static str),
    /// The writer has stopped.
    #[error("the database is closed")]
    Closed,
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        if damage::is_read_only(&error) {
            return Self::ReadOnly("a session of it is read-only, as after a failover; the next one is new");
        }
        Self::Database(in_one_line(&error))
    }
}

impl From<rusqlite::Error> for StoreError {
    fn from(error: rusqlite::Error) -> Self {
        Self::Database(in_one_line(&error))
    }
}
