//! Sources: a SQLite file or a PostgreSQL database, and connections to them.
//!
//! Both run the same statements. Only this module and the two engines know which one it is. They differ in the settings
//! of connections, the begin of a transaction, the turns of several coordinators' writers, and notifications.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use sqlx::PgPool;
use sqlx::postgres::PgConnectOptions;
use tokio::sync::watch;

use crate::config::PostgresUrl;
use crate::store::engine::damage::Damage;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::Engine;
use crate::store::engine::postgres::{self, Listener, Session};
use crate::store::engine::sql::{Answer, PREPARED, Query, Runner, query};
use crate::store::engine::sqlite;
use crate::store::engine::timeouts::{Timeouts, in_time};

/// Connections that read at the same time.
const READERS: u32 = 4;

/// A database, and how to reach it. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Source {
    location: Location,
    name: String,
    timeouts: Timeouts,
}

#[derive(Clone)]
enum Location {
    File(PathBuf),
    Server {
        url: PostgresUrl,
        /// Connections from before this time are not used again: their server may have been replaced.
        renewed: watch::Sender<Instant>,
    },
}

/// Options of a connection. They are read anew for each one: the password may be in a file, and may change.
fn options(url: &PostgresUrl) -> Result<PgConnectOptions, sqlx::Error> {
    let options: PgConnectOptions = url.secret().parse()?;
    Ok(options.statement_cache_capacity(PREPARED))
}

impl fmt::Debug for Source {
    /// Without the password in its options.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "Source({})", self.name)
    }
}

/// The connection that a write runs on.
#[derive(Debug)]
pub(crate) enum Connection {
    /// To a SQLite file.
    Sqlite(rusqlite::Connection),
    /// To PostgreSQL.
    Postgres(Session),
}

impl Connection {
    /// Which engine it is to.
    pub(in crate::store) fn engine(&self) -> Engine {
        match self {
            Self::Sqlite(_) => Engine::Sqlite,
            Self::Postgres(_) => Engine::Postgres,
        }
    }

    /// Runs statements without parameters or answers.
    pub(in crate::store) async fn batch(&mut self, statements: &'static str) -> Result<(), StoreError> {
        match self {
            Self::Sqlite(connection) => Ok(connection.execute_batch(statements)?),
            Self::Postgres(session) => session.batch(statements).await,
        }
    }

    /// Begins a transaction. SQLite takes the lock at once, because a transaction that has read cannot be retried when
    /// the lock is taken. PostgreSQL waits for its turn.
    pub(in crate::store) async fn begin(&mut self) -> Result<(), StoreError> {
        self.batch(match self.engine() {
            Engine::Sqlite => "begin immediate",
            Engine::Postgres => postgres::BEGIN,
        })
        .await
    }

    /// The damage of the connection so far.
    pub(in crate::store) fn damage(&self) -> Damage {
        match self {
            Self::Sqlite(_) => Damage::None,
            Self::Postgres(session) => session.damage(),
        }
    }

    /// Says goodbye.
    pub(in crate::store) async fn close(self) -> Result<(), StoreError> {
        match self {
            Self::Sqlite(connection) => connection.close().map_err(|(_, error)| error.into()),
            Self::Postgres(session) => session.close().await,
        }
    }
}

impl Runner for &mut Connection {
    async fn run(self, query: Query) -> Result<Answer, StoreError> {
        match self {
            Connection::Sqlite(connection) => sqlite::run(connection, &query),
            Connection::Postgres(session) => session.run(query).await,
        }
    }
}

/// Connections to read with, made when they are needed. Cheap to clone.
#[derive(Clone, Debug)]
pub(in crate::store) enum Readers {
    /// Of a SQLite file.
    Sqlite(sqlite::Readers),
    /// Of PostgreSQL.
    Postgres {
        pool: PgPool,
        url: PostgresUrl,
        /// The time that a read may take.
        timeout: Duration,
    },
}

impl Readers {
    /// Waits for running reads, then closes.
    pub(in crate::store) async fn close(&self) {
        match self {
            Self::Sqlite(readers) => readers.close(READERS).await,
            Self::Postgres { pool, timeout, .. } => {
                // The pool waits for each connection to be given back, and one that has fallen silent never is. They
                // all end with this process.
                if tokio::time::timeout(*timeout, pool.close()).await.is_err() {
                    tracing::warn!("some connections to the database did not close in time");
                }
            }
        }
    }
}

impl Runner for &Readers {
    async fn run(self, query: Query) -> Result<Answer, StoreError> {
        match self {
            Readers::Sqlite(readers) => readers.run(query).await,
            Readers::Postgres { pool, url, timeout } => {
                let answer = postgres::read(pool, query, *timeout).await;
                if answer.is_err() {
                    pool.set_connect_options(options(url)?);
                }
                answer
            }
        }
    }
}

impl Source {
    /// A SQLite file, made if there is none.
    pub(crate) fn file(file: &Path) -> Self {
        Self {
            location: Location::File(file.to_owned()),
            name: file.display().to_string(),
            timeouts: Timeouts::default(),
        }
    }

    /// A PostgreSQL database.
    pub(crate) fn postgres(url: &PostgresUrl) -> Result<Self, sqlx::Error> {
        options(url)?;
        let location = Location::Server { url: url.clone(), renewed: watch::Sender::new(Instant::now()) };
        Ok(Self { location, name: url.to_string(), timeouts: Timeouts::default() })
    }

    /// The same, with other timeouts.
    #[cfg(test)]
    pub(in crate::store) fn with_timeouts(self, timeouts: Timeouts) -> Self {
        Self { timeouts, ..self }
    }

    /// How long it is waited for.
    pub(in crate::store) fn timeouts(&self) -> &Timeouts {
        &self.timeouts
    }

    /// Its name for people, without a password.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Whether several coordinators may use it at the same time.
    pub(crate) fn is_shared(&self) -> bool {
        matches!(self.location, Location::Server { .. })
    }

    /// Opens the connection to write with. Each coordinator has one.
    pub(in crate::store) async fn writer(&self) -> Result<Connection, StoreError> {
        match &self.location {
            Location::File(file) => Ok(Connection::Sqlite(sqlite::writer(file)?)),
            Location::Server { url, .. } => {
                let session = Session::begin(Box::new(options(url)?), self.timeouts);
                Ok(Connection::Postgres(in_time(self.timeouts.connection, session).await?))
            }
        }
    }

    /// Connections to read with.
    pub(in crate::store) fn readers(&self) -> Result<Readers, StoreError> {
        Ok(match &self.location {
            Location::File(file) => Readers::Sqlite(sqlite::Readers::new(file.clone(), READERS as usize)),
            Location::Server { url, renewed } => Readers::Postgres {
                pool: postgres::pool(options(url)?, READERS, self.timeouts, renewed.subscribe()),
                url: url.clone(),
                timeout: self.timeouts.read,
            },
        })
    }

    /// Records the damage of a connection. When the server is to blame, all other connections to it are renewed.
    pub(in crate::store) fn has_damage(&self, damage: Damage) {
        if let (Location::Server { renewed, .. }, Damage::Server) = (&self.location, damage) {
            renewed.send_replace(Instant::now());
        }
    }

    /// Receives the notifications of all coordinators of the database. `None` when there is one coordinator.
    pub(in crate::store) async fn listener(&self) -> Result<Option<Listener>, StoreError> {
        let Location::Server { url, renewed } = &self.location else { return Ok(None) };
        Listener::connect(url.secret(), self.timeouts, renewed.subscribe()).await.map(Some)
    }

    /// The time of the server's clock, milliseconds since the Unix epoch. `None` when there is none.
    pub(in crate::store) async fn now_ms(&self, readers: &Readers) -> Result<Option<i64>, StoreError> {
        if !self.is_shared() {
            return Ok(None);
        }
        let row = query("select cast(extract(epoch from clock_timestamp()) * 1000 as bigint) as now_ms");
        Ok(Some(row.fetch_one(readers).await?.integer("now_ms")?))
    }

    /// Sends a text of less than 8000 bytes to all coordinators of the database, where there may be several.
    pub(in crate::store) async fn notify(&self, readers: &Readers, text: String) -> Result<(), StoreError> {
        if self.is_shared() {
            query("select pg_notify($1, $2)").bind(postgres::CHANNEL).bind(text).execute(readers).await?;
        }
        Ok(())
    }
}
