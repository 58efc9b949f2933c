//! The state of the farm: one SQL database.
//!
//! The embedded default is SQLite in WAL mode with `synchronous=FULL`, and the other PostgreSQL ([`source`]): what is committed
//! survives the loss of power. All writes pass through one writer that groups those that wait into one transaction
//! ([`writer`]); readers have a pool of their own. The SQL keeps to what both engines understand (numbered parameters, text identities,
//! `bigint` milliseconds, `returning`, times bound by the caller), and one suite of tests holds both to the same behaviour. Bytes live
//! in the [blob store](crate::blobs); a row here is what makes a blob part of the farm.

mod accept;
mod adaptive;
mod assets;
mod attempts;
mod checks;
mod claim;
mod damage;
mod events;
mod expiry;
mod failures;
mod gathered;
mod grant;
mod jobs;
mod keepers;
mod leases;
mod lost;
mod nodes;
mod parts;
mod patience;
mod postgres;
mod redo;
mod renewals;
mod requirements;
mod rounds;
mod row;
mod schema;
mod signs_of_life;
mod source;
mod sql;
mod sqlite;
mod stock;
mod take_over;
#[cfg(test)]
pub(crate) mod tests;
mod workers;
mod writer;

use futures::future::BoxFuture;
use uuid::Uuid;

pub(crate) use accept::{DeliveredNode, Delivery};
pub(crate) use checks::{Outcome, is_chosen};
pub(crate) use claim::ClaimTerms;
pub(crate) use events::{StoredEvent, StoredKind};
pub(crate) use expiry::Watch;
pub(crate) use failures::WorkFailure;
use gathered::Gathered;
pub(crate) use grant::Grant;
pub(crate) use jobs::{Ending, JobRecord, NewJob};
pub(crate) use keepers::Keeping;
pub(crate) use leases::{LeaseError, LeaseRecord};
pub(crate) use nodes::{Merge, NodeRow, Removed, StoredNode, Work};
pub(crate) use postgres::Listener;
use renewals::Renewal;
pub(crate) use rounds::CompleteWave;
pub use schema::SchemaError;
use signs_of_life::SignOfLife;
use source::Readers;
pub(crate) use source::{Connection, Source};
use sql::query;
pub(crate) use workers::WorkerError;
use writer::{Turn, Writer};

use crate::causes::in_one_line;

/// A handle on the database. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Store {
    source: Source,
    readers: Readers,
    writer: Writer,
    signs_of_life: Gathered<SignOfLife, (), WorkerError>,
    renewals: Gathered<Renewal, u32, LeaseError>,
}

/// Which farm a database is that of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    /// Its identity.
    pub(crate) farm: Uuid,
    /// Whether a blob store has been marked as its own.
    pub(crate) has_blobs: bool,
}

/// What decides, for all coordinators of a farm, which nodes are [checked](is_chosen). Only they know it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct CheckKey(pub(crate) [u8; 32]);

impl std::fmt::Debug for CheckKey {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("CheckKey")
    }
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
        Ok(Self { readers, writer, source, signs_of_life: Gathered::default(), renewals: Gathered::default() })
    }

    /// Whether other coordinators may be using it.
    pub(crate) fn is_shared(&self) -> bool {
        self.source.is_shared()
    }

    /// What the clock that all coordinators share shows, milliseconds since the Unix epoch; `None` where there is one coordinator.
    pub(crate) async fn now_ms(&self) -> Result<Option<i64>, StoreError> {
        self.source.now_ms(&self.readers).await
    }

    /// Hears what is sent to all coordinators from now on; `None` where there is one coordinator.
    pub(crate) async fn listener(&self) -> Result<Option<Listener>, StoreError> {
        self.source.listener().await
    }

    /// Sends a text, shorter than 8000 bytes, to all coordinators, where there may be several.
    pub(crate) async fn notify(&self, text: String) -> Result<(), StoreError> {
        self.source.notify(&self.readers, text).await
    }

    /// Which farm this is. It is given an identity when it is asked for first.
    pub(crate) async fn identity(&self) -> Result<Identity, StoreError> {
        self.write(|connection| Box::pin(async move { identity(connection).await })).await
    }

    /// What decides which nodes are checked. It is made up when it is asked for first.
    pub(crate) async fn check_key(&self) -> Result<CheckKey, StoreError> {
        self.write(|connection| Box::pin(async move { check_key(connection).await })).await
    }

    /// Claims a blob store for the farm while no other coordinator can, and notes that the farm has one. What is wrong with the
    /// claim is answered as it is.
    pub(crate) async fn claim_blobs<E, F>(&self, claim: F) -> Result<Result<(), E>, StoreError>
    where
        E: Send + 'static,
        F: FnOnce(Identity) -> BoxFuture<'static, Result<(), E>> + Send + 'static,
    {
        self.write(|connection| {
            Box::pin(async move {
                let claimed = claim(identity(connection).await?).await;
                if claimed.is_ok() {
                    query("update farm set has_blobs = 1 where has_blobs = 0").execute(connection).await?;
                }
                Ok(claimed)
            })
        })
        .await
    }

    /// Runs `write` in the next transaction and answers when that is committed. An error rolls this write back, and
    /// nothing else.
    pub(crate) async fn write<T, E, F>(&self, write: F) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
        F: for<'c> FnOnce(&'c mut Connection) -> BoxFuture<'c, Result<T, E>> + Send + 'static,
    {
        self.write_in(Turn::Usual, write).await
    }

    /// The same in another turn.
    async fn write_in<T, E, F>(&self, turn: Turn, write: F) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
        F: for<'c> FnOnce(&'c mut Connection) -> BoxFuture<'c, Result<T, E>> + Send + 'static,
    {
        self.writer.write(turn, write).await
    }

    /// Waits for the reads and the writes that are under way, then closes the database. The writer comes last: SQLite then moves what is in the log
    /// into the database.
    pub(crate) async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }

    /// Makes sure that the database takes writes, by one. It waits for no other.
    pub(crate) async fn try_to_write(&self) -> Result<(), StoreError> {
        let write = self.write_in(Turn::First, |connection| {
            Box::pin(async move {
                // A value that changes: SQLite writes nothing where all is as it was.
                let tried = "insert into sequences (name, value) values ('tried_write', 1) \
                             on conflict (name) do update set value = sequences.value + 1";
                query(tried).execute(connection).await.map(drop)
            })
        });
        write.await
    }

    /// Why the thread that writes has failed, when it has: nothing can be written any more. It never comes while that thread lives, or when it was
    /// closed.
    pub(crate) async fn writer_failed(&self) -> String {
        self.writer.failed().await
    }
}

async fn check_key(connection: &mut Connection) -> Result<CheckKey, StoreError> {
    identity(connection).await?;
    let mut fresh = [0; 32];
    getrandom::fill(&mut fresh).map_err(|error| StoreError::Database(error.to_string()))?;
    query("update farm set check_key = $1 where check_key is null")
        .bind(hex::encode(fresh))
        .execute(&mut *connection)
        .await?;
    let key = query("select check_key from farm").fetch_one(connection).await?.text("check_key")?;
    let mut bytes = [0; 32];
    let decoded = hex::decode_to_slice(&key, &mut bytes);
    decoded
        .map(|()| CheckKey(bytes))
        .map_err(|_| StoreError::Corrupt { column: "check_key", value: "a text".to_owned() })
}

async fn identity(connection: &mut Connection) -> Result<Identity, StoreError> {
    query("insert into farm (single, id) values (1, $1) on conflict (single) do nothing")
        .bind(Uuid::now_v7().to_string())
        .execute(&mut *connection)
        .await?;
    let row = query("select id, has_blobs from farm").fetch_one(connection).await?;
    Ok(Identity { farm: row.parsed("id")?, has_blobs: row.integer("has_blobs")? != 0 })
}
