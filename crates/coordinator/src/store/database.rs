//! The handle on the database.

use futures::future::BoxFuture;

use crate::model::{Heartbeat, Renewal};
use crate::store::engine::batch::Batch;
use crate::store::engine::error::StoreError;
use crate::store::engine::postgres::Listener;
use crate::store::engine::schema::{self, SchemaError};
use crate::store::engine::source::{Connection, Readers, Source};
use crate::store::engine::sql::query;
use crate::store::engine::writer::{Turn, Writer};
use crate::store::errors::{LeaseError, WorkerError};

/// A handle on the database. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Store {
    pub(in crate::store) source: Source,
    pub(in crate::store) readers: Readers,
    pub(in crate::store) writer: Writer,
    pub(in crate::store) heartbeats: Batch<Heartbeat, (), WorkerError>,
    pub(in crate::store) renewals: Batch<Renewal, u32, LeaseError>,
}

impl Store {
    /// Opens the database and brings its schema up to date. A SQLite file may not be in use by another coordinator.
    pub(crate) async fn open(source: Source) -> Result<Self, SchemaError> {
        let connection = schema::open(&source).await?;
        let failed = |error: Box<dyn std::error::Error + Send + Sync>| SchemaError::Open {
            database: source.name().to_owned(),
            source: error,
        };
        let readers = source.readers().map_err(|error| failed(error.into()))?;
        let writer = Writer::start(source.clone(), connection).map_err(|error| failed(error.into()))?;
        Ok(Self { readers, writer, source, heartbeats: Batch::default(), renewals: Batch::default() })
    }

    /// Whether other coordinators may be using it.
    pub(crate) fn is_shared(&self) -> bool {
        self.source.is_shared()
    }

    /// The time of the clock that all coordinators share, milliseconds since the Unix epoch. `None` when there is one
    /// coordinator.
    pub(crate) async fn now_ms(&self) -> Result<Option<i64>, StoreError> {
        self.source.now_ms(&self.readers).await
    }

    /// Receives the notifications of all coordinators from now on. `None` when there is one coordinator.
    pub(crate) async fn listener(&self) -> Result<Option<Listener>, StoreError> {
        self.source.listener().await
    }

    /// Sends a text of less than 8000 bytes to all coordinators, where there may be several.
    pub(crate) async fn notify(&self, text: String) -> Result<(), StoreError> {
        self.source.notify(&self.readers, text).await
    }

    /// Runs `write` in the next transaction and answers after the commit. An error rolls back this write alone.
    pub(crate) async fn write<T, E, F>(&self, write: F) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
        F: for<'c> FnOnce(&'c mut Connection) -> BoxFuture<'c, Result<T, E>> + Send + 'static,
    {
        self.write_in(Turn::Usual, write).await
    }

    /// The same in another turn.
    pub(in crate::store) async fn write_in<T, E, F>(&self, turn: Turn, write: F) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
        F: for<'c> FnOnce(&'c mut Connection) -> BoxFuture<'c, Result<T, E>> + Send + 'static,
    {
        self.writer.write(turn, write).await
    }

    /// Waits for running reads and writes, then closes the database. The writer closes last, because SQLite then moves
    /// its log into the database.
    pub(crate) async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }

    /// Writes once, to prove that the database takes writes. It does not wait for other writes.
    pub(crate) async fn try_to_write(&self) -> Result<(), StoreError> {
        let write = self.write_in(Turn::First, |connection| {
            Box::pin(async move {
                // The value changes: SQLite writes nothing when a row stays as it was.
                let tried = "insert into sequences (name, value) values ('tried_write', 1) \
                             on conflict (name) do update set value = sequences.value + 1";
                query(tried).execute(connection).await.map(drop)
            })
        });
        write.await
    }

    /// Resolves with the panic message when the writer thread panics. It never resolves otherwise, also not after the
    /// writer was closed.
    pub(crate) async fn writer_failed(&self) -> String {
        self.writer.failed().await
    }
}
