//! Where the state is kept, and how connections to it are made: a SQLite file, or a PostgreSQL database.
//!
//! Both run the same statements. Only this module knows which it is: what a connection has to be told before it is used, how
//! a transaction begins, and how it is made sure that no other coordinator writes.

use std::fmt;
use std::path::Path;
use std::sync::Once;
use std::time::Duration;

use sqlx::any::{AnyConnectOptions, AnyPoolOptions, install_default_drivers};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AnyPool, ConnectOptions};

use super::{Connection, StoreError};
use crate::config::PostgresUrl;

/// Connections that read at the same time.
const READERS: u32 = 4;

/// How long it may take to reach a database.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// Number of the PostgreSQL lock that the one coordinator of a database holds: `cleresto` in ASCII.
const LOCK: i64 = 0x636c_6572_6573_746f;

/// What PostgreSQL says when a lock cannot be had in time. A coordinator that was killed keeps its lock until the server has noticed.
const LOCK_NOT_AVAILABLE: &str = "55P03";

/// What a writing connection to a SQLite file is told. `full` syncs each commit, also in WAL mode. The time to wait is for the lock of another
/// process, such as a backup.
const SQLITE_SESSION: [&str; 4] = [
    "pragma busy_timeout = 10000",
    "pragma journal_mode = wal",
    "pragma synchronous = full",
    "pragma foreign_keys = on",
];

/// What a writing connection to PostgreSQL is told: whatever a server or a role has as its default, what is acknowledged is on disk.
const POSTGRES_SESSION: [&str; 1] = ["set synchronous_commit = on"];

/// A database, and how to reach it. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Source {
    engine: Engine,
    writing: AnyConnectOptions,
    reading: AnyConnectOptions,
    name: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Engine {
    Sqlite,
    Postgres,
}

impl fmt::Debug for Source {
    /// Without the password that its options hold.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "Source({:?}, {})", self.engine, self.name)
    }
}

/// A connection cannot be had.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ConnectError {
    /// The database does not answer, or refuses.
    #[error(transparent)]
    Database(#[from] sqlx::Error),
    /// It does not answer in time.
    #[error("no answer in {} s", CONNECT_TIMEOUT.as_secs())]
    Slow,
    /// Another coordinator writes to it.
    #[error("another coordinator uses it")]
    InUse,
}

impl From<ConnectError> for StoreError {
    fn from(error: ConnectError) -> Self {
        Self::Database(error.to_string())
    }
}

impl Source {
    /// A SQLite file, made if there is none.
    pub(crate) fn file(file: &Path) -> Result<Self, sqlx::Error> {
        let options = |options: SqliteConnectOptions| AnyConnectOptions::from_url(&options.to_url_lossy());
        let file_options = SqliteConnectOptions::new().filename(file);
        Ok(Self {
            engine: Engine::Sqlite,
            writing: options(file_options.clone().create_if_missing(true))?,
            reading: options(file_options.read_only(true))?,
            name: file.display().to_string(),
        })
    }

    /// A PostgreSQL database.
    pub(crate) fn postgres(url: &PostgresUrl) -> Result<Self, sqlx::Error> {
        let options: AnyConnectOptions = url.secret().parse()?;
        Ok(Self { engine: Engine::Postgres, writing: options.clone(), reading: options, name: url.to_string() })
    }

    /// What people call it; without a password.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// A connection to write with, of which there is one at a time.
    pub(super) async fn writer(&self) -> Result<Connection, ConnectError> {
        install_drivers();
        let connect = tokio::time::timeout(CONNECT_TIMEOUT, self.writing.connect());
        let mut connection = connect.await.map_err(|_| ConnectError::Slow)??;
        let session = match self.engine {
            Engine::Sqlite => SQLITE_SESSION.as_slice(),
            Engine::Postgres => &POSTGRES_SESSION,
        };
        for statement in session {
            sqlx::query(*statement).execute(&mut connection).await?;
        }
        if self.engine == Engine::Postgres {
            sqlx::query("set lock_timeout = '5s'").execute(&mut connection).await?;
            let locked = sqlx::query("select pg_advisory_lock($1)").bind(LOCK).execute(&mut connection).await;
            locked.map_err(|error| match &error {
                sqlx::Error::Database(cause) if cause.code().as_deref() == Some(LOCK_NOT_AVAILABLE) => {
                    ConnectError::InUse
                }
                _ => ConnectError::Database(error),
            })?;
            sqlx::query("set lock_timeout = 0").execute(&mut connection).await?;
        }
        Ok(connection)
    }

    /// Connections to read with, made when they are needed.
    pub(super) fn readers(&self) -> AnyPool {
        install_drivers();
        let options = AnyPoolOptions::new().max_connections(READERS).acquire_timeout(CONNECT_TIMEOUT);
        options.connect_lazy_with(self.reading.clone())
    }

    /// The statement that begins a transaction. In SQLite one that reads first and then finds the database locked could not be retried:
    /// it takes the lock at once.
    pub(super) fn begin(&self) -> &'static str {
        match self.engine {
            Engine::Sqlite => "begin immediate",
            Engine::Postgres => "begin",
        }
    }
}

fn install_drivers() {
    static ONCE: Once = Once::new();
    ONCE.call_once(install_default_drivers);
}
