//! Where the state is kept, and how connections to it are made: a SQLite file, or a PostgreSQL database.
//!
//! Both run the same statements. Only this module knows which it is: what a connection has to be told before it is used, how
//! a transaction begins, how the writers of several coordinators take turns, and how they tell one another that something happened.

use std::fmt;
use std::path::Path;
use std::sync::Once;
use std::time::Duration;

use sqlx::any::{AnyConnectOptions, AnyPoolOptions, install_default_drivers};
use sqlx::postgres::PgListener;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AnyPool, ConnectOptions};

use super::{Connection, StoreError};
use crate::config::PostgresUrl;

/// Connections that read at the same time.
const READERS: u32 = 4;

/// How long it may take to reach a database.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// How long a writer waits for its turn before it takes its connection for dead.
pub(super) const TURN_TIMEOUT: Duration = Duration::from_secs(60);

/// What begins a transaction in PostgreSQL. The lock, whose number is `cleresto` in ASCII, lets the writers of several coordinators take
/// turns: what one reads, no other changes before it has committed, as with the one writer of a SQLite file.
const POSTGRES_BEGIN: &str = "begin isolation level read committed; select pg_advisory_xact_lock(7164212649242358895)";

/// On which channel coordinators of a database tell one another what happened.
const CHANNEL: &str = "clerestory";

/// What a writing connection to a SQLite file is told. `full` syncs each commit, also in WAL mode. The time to wait is for the lock of another
/// process, such as a backup.
const SQLITE_SESSION: [&str; 4] = [
    "pragma busy_timeout = 10000",
    "pragma journal_mode = wal",
    "pragma synchronous = full",
    "pragma foreign_keys = on",
];

/// What a writing connection to PostgreSQL is told: whatever a server or a role has as its default, what is acknowledged is on disk. A
/// coordinator that is suspended in the middle of a transaction loses it, so that the others get their turn.
const POSTGRES_SESSION: [&str; 2] = ["set synchronous_commit = on", "set idle_in_transaction_session_timeout = '5s'"];

/// A database, and how to reach it. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Source {
    engine: Engine,
    writing: AnyConnectOptions,
    reading: AnyConnectOptions,
    /// Address of a PostgreSQL database.
    postgres: Option<PostgresUrl>,
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
            postgres: None,
            name: file.display().to_string(),
        })
    }

    /// A PostgreSQL database.
    pub(crate) fn postgres(url: &PostgresUrl) -> Result<Self, sqlx::Error> {
        let options: AnyConnectOptions = url.secret().parse()?;
        Ok(Self {
            engine: Engine::Postgres,
            writing: options.clone(),
            reading: options,
            postgres: Some(url.clone()),
            name: url.to_string(),
        })
    }

    /// What people call it; without a password.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Whether several coordinators may use it at the same time.
    pub(crate) fn is_shared(&self) -> bool {
        self.engine == Engine::Postgres
    }

    /// A connection to write with, of which each coordinator has one.
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
            Engine::Postgres => POSTGRES_BEGIN,
        }
    }

    /// Hears what is sent to all coordinators of the database from now on; `None` where there is one coordinator.
    pub(super) async fn listener(&self) -> Result<Option<Listener>, ConnectError> {
        let Some(url) = &self.postgres else { return Ok(None) };
        let connect = async {
            let mut listener = PgListener::connect(url.secret()).await?;
            listener.listen(CHANNEL).await?;
            Ok::<_, sqlx::Error>(listener)
        };
        let connected = tokio::time::timeout(CONNECT_TIMEOUT, connect).await.map_err(|_| ConnectError::Slow)?;
        Ok(Some(Listener(connected?)))
    }

    /// Sends a text, shorter than 8000 bytes, to all coordinators of the database, where there may be several.
    pub(super) async fn notify(&self, readers: &AnyPool, text: String) -> Result<(), sqlx::Error> {
        if self.engine == Engine::Postgres {
            sqlx::query("select pg_notify($1, $2)").bind(CHANNEL).bind(text).execute(readers).await?;
        }
        Ok(())
    }
}

/// Hears what is sent to all coordinators of a database.
#[derive(Debug)]
pub(crate) struct Listener(PgListener);

impl Listener {
    /// The next text. An error when the connection was lost, with whatever was sent since.
    pub(crate) async fn next(&mut self) -> Result<String, StoreError> {
        match self.0.try_recv().await? {
            Some(notification) => Ok(notification.payload().to_owned()),
            None => Err(StoreError::Database("the connection was lost".to_owned())),
        }
    }
}

fn install_drivers() {
    static ONCE: Once = Once::new();
    ONCE.call_once(install_default_drivers);
}
