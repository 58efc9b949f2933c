//! The state of the farm: one SQL database.
//!
//! The embedded default is SQLite in WAL mode with `synchronous=FULL`: what is committed survives the loss of power. All
//! writes pass through one writer that groups those that wait into one transaction ([`writer`]); readers have a pool of
//! their own. The SQL keeps to what PostgreSQL understands too (numbered placeholders, text identities, `bigint`
//! milliseconds, `returning`, times bound by the caller). Bytes live in the [blob store](crate::blobs); a row here is
//! what makes a blob part of the farm.

mod assets;
mod claim;
mod events;
mod jobs;
mod leases;
mod nodes;
mod rounds;
mod row;
mod schema;
#[cfg(test)]
mod tests;
mod workers;
mod writer;

use std::path::Path;
use std::time::Duration;

use futures::future::BoxFuture;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};

pub(crate) use claim::{ClaimTerms, Grant};
pub(crate) use events::{StoredEvent, StoredKind};
pub(crate) use jobs::{JobRecord, NewJob};
pub(crate) use leases::{LeaseError, WorkFailure};
pub(crate) use nodes::{DeliveredNode, Delivery, NodeRow, Work};
pub(crate) use rounds::CompleteWave;
pub use schema::SchemaError;
pub(crate) use workers::WorkerError;
pub(crate) use writer::Connection;
use writer::Writer;

/// Connections that read at the same time.
const READERS: u32 = 4;

/// How long a connection waits for a lock of another process, such as a backup.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// A handle on the database. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Store {
    readers: SqlitePool,
    writer: Writer,
}

/// The database failed.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum StoreError {
    /// A statement failed.
    #[error("the database failed: {0}")]
    Database(String),
    /// A stored value is not one that this build can have written.
    #[error("column `{column}` holds `{value}`, which cannot be read")]
    Corrupt {
        /// The column.
        column: &'static str,
        /// Its value.
        value: String,
    },
    /// The writer has stopped.
    #[error("the database is closed")]
    Closed,
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        Self::Database(error.to_string())
    }
}

impl Store {
    /// Opens the database file, makes it if there is none, and brings its schema up to date.
    pub(crate) async fn open(file: &Path) -> Result<Self, SchemaError> {
        let options = SqliteConnectOptions::new()
            .filename(file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(BUSY_TIMEOUT);
        let connection = schema::open(file, &options).await?;
        let readers = SqlitePoolOptions::new().max_connections(READERS).connect_lazy_with(options.read_only(true));
        Ok(Self { readers, writer: Writer::start(connection) })
    }

    /// Runs `write` in the next transaction and answers when that is committed. An error rolls this write back, and
    /// nothing else.
    pub(crate) async fn write<T, E, F>(&self, write: F) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
        F: for<'c> FnOnce(&'c mut Connection) -> BoxFuture<'c, Result<T, E>> + Send + 'static,
    {
        self.writer.write(write).await
    }

    /// Waits for the writes that are under way, then closes the file.
    pub(crate) async fn close(&self) {
        self.writer.close().await;
        self.readers.close().await;
    }

    /// Whether the database answers.
    pub(crate) async fn is_usable(&self) -> bool {
        sqlx::query("select 1").execute(&self.readers).await.is_ok()
    }
}
