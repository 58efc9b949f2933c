//! A PostgreSQL database.

use std::sync::Arc;
use std::time::Duration;

use futures::StreamExt;
use sqlx::postgres::{PgConnectOptions, PgListener, PgRow, Postgres};
use sqlx::{
    AssertSqlSafe, Column, ConnectOptions, Connection as _, Either, Executor, PgConnection, PgPool, Row as _, TypeInfo,
};

use super::StoreError;
use super::patience::{Patience, in_time};
use super::row::Row;
use super::sql::{Answer, Query, Value, query};

/// What begins a transaction. The lock, whose number is `cleresto` in ASCII, lets the writers of several coordinators take turns: what
/// one reads, no other changes before it has committed, as with the one writer of a SQLite file.
pub(super) const BEGIN: &str =
    "begin isolation level read committed; select pg_advisory_xact_lock(7164212649242358895)";

/// On which channel coordinators of a database tell one another what happened.
pub(super) const CHANNEL: &str = "clerestory";

/// What a writing connection is told: whatever a server or a role has as its default, what is acknowledged is on disk. A coordinator that
/// is suspended in the middle of a transaction loses it, so that the others get their turn.
const SESSION: &str = "set synchronous_commit = on; set idle_in_transaction_session_timeout = '5s'";

/// What any connection is told. All that is asked often is found by an index, and has to be whatever the server believes of the size of tables
/// that may have grown a thousandfold since it looked. What it cannot find so is small, but costs so much by that reckoning that the server would
/// compile the query first.
pub(super) const LOOKUPS: &str = "set enable_seqscan = off; set jit = off";

/// Runs a statement.
pub(super) async fn run<'c, E>(executor: E, query: Query) -> Result<Answer, StoreError>
where
    E: Executor<'c, Database = Postgres>,
{
    let mut statement = sqlx::query(AssertSqlSafe(query.statement.into_owned()));
    for value in query.values {
        statement = match value {
            Value::Integer(value) => statement.bind(value),
            Value::Float(value) => statement.bind(value),
            Value::Text(value) => statement.bind(value),
        };
    }
    let mut answer = Answer::default();
    let mut names: Option<Arc<[String]>> = None;
    let mut parts = executor.fetch_many(statement);
    while let Some(part) = parts.next().await {
        match part? {
            Either::Left(done) => answer.affected += done.rows_affected(),
            Either::Right(row) => {
                let names =
                    names.get_or_insert_with(|| row.columns().iter().map(|column| column.name().to_owned()).collect());
                answer.rows.push(Row::new(Arc::clone(names), values(&row)?));
            }
        }
    }
    Ok(answer)
}

fn values(row: &PgRow) -> Result<Vec<Value>, StoreError> {
    let value = |(number, column): (usize, &sqlx::postgres::PgColumn)| {
        Ok(match column.type_info().name() {
            "INT8" => Value::Integer(row.try_get(number)?),
            "INT4" => Value::Integer(row.try_get::<Option<i32>, _>(number)?.map(i64::from)),
            "FLOAT8" => Value::Float(row.try_get(number)?),
            "BOOL" => Value::Integer(row.try_get::<Option<bool>, _>(number)?.map(i64::from)),
            "VOID" => Value::Text(None),
            _ => Value::Text(row.try_get(number)?),
        })
    };
    row.columns().iter().enumerate().map(value).collect()
}

/// A connection to write with.
#[derive(Debug)]
pub(crate) struct Session {
    connection: PgConnection,
    watch: Watch,
}

impl Session {
    /// A new connection.
    pub(super) async fn begin(options: Box<PgConnectOptions>, patience: Patience) -> Result<Self, StoreError> {
        let mut connection = options.connect().await?;
        for statements in [SESSION, LOOKUPS] {
            sqlx::raw_sql(statements).execute(&mut connection).await?;
        }
        let answer = run(&mut connection, query("select pg_backend_pid() as process")).await?;
        let row = answer.rows.first();
        let row = row.ok_or_else(|| StoreError::Database("it does not say who serves a connection".to_owned()))?;
        let process = row.integer("process")?;
        Ok(Self { connection, watch: Watch { options, process, patience, is_lost: false } })
    }

    /// Runs statements without parameters, of which nothing is wanted.
    pub(super) async fn batch(&mut self, statements: &'static str) -> Result<(), StoreError> {
        let Self { connection, watch } = self;
        let run = async { Ok(sqlx::raw_sql(statements).execute(connection).await.map(drop)?) };
        watch.unless_lost(run).await
    }

    /// Runs a statement.
    pub(super) async fn run(&mut self, query: Query) -> Result<Answer, StoreError> {
        let Self { connection, watch } = self;
        watch.unless_lost(run(connection, query)).await
    }

    /// Says goodbye.
    pub(super) async fn close(self) -> Result<(), StoreError> {
        Ok(self.connection.close().await?)
    }
}

/// What notices that the network has lost a statement or its answer, while the server is there: other writers wait for the one who waits for it.
#[derive(Debug)]
struct Watch {
    options: Box<PgConnectOptions>,
    /// The number of the server's process that serves the connection.
    process: i64,
    patience: Patience,
    is_lost: bool,
}

impl Watch {
    /// What is answered to a statement. It is not waited for when the server's process is gone, or has been waiting itself for two seconds; nor is
    /// that of any other statement then.
    async fn unless_lost<T>(&mut self, answer: impl Future<Output = Result<T, StoreError>>) -> Result<T, StoreError> {
        if !self.is_lost {
            tokio::select! {
                // What has come is not lost.
                biased;
                answer = answer => return answer,
                () = self.lost() => self.is_lost = true,
            }
        }
        Err(StoreError::Database("what was said on its connection is lost".to_owned()))
    }

    /// Comes to an end when what is waited for will not come. A server that cannot be asked may still be at it.
    async fn lost(&self) {
        loop {
            tokio::time::sleep(self.patience.doubt).await;
            let asked = async {
                let mut connection = self.options.connect().await?;
                let busy = query(
                    "select 1 from pg_stat_activity where pid = $1 and (state is null or state not like 'idle%' \
                     or state_change > clock_timestamp() - interval '2 seconds')",
                );
                let busy = run(&mut connection, busy.bind(self.process)).await?;
                // Nobody waits for its goodbye.
                tokio::spawn(connection.close());
                Ok(!busy.rows.is_empty())
            };
            if matches!(in_time(self.patience.connection, asked).await, Ok(false)) {
                return;
            }
        }
    }
}

/// Runs a statement on a connection of the pool, which is closed when the database does not answer in time: the pool itself would wait for it.
pub(super) async fn read(pool: &PgPool, query: Query, patience: Duration) -> Result<Answer, StoreError> {
    let mut connection = pool.acquire().await?;
    let answer = tokio::time::timeout(patience, run(&mut *connection, query)).await;
    answer.unwrap_or_else(|_| {
        drop(connection.detach());
        Err(StoreError::Database(format!("no answer in {} s", patience.as_secs())))
    })
}

/// Hears what is sent to all coordinators of a database.
#[derive(Debug)]
pub(crate) struct Listener {
    pub(super) connection: PgListener,
    pub(super) patience: Patience,
}

impl Listener {
    /// The next text. An error when the connection was lost, with whatever was sent since; also when it was lost without a word.
    pub(crate) async fn next(&mut self) -> Result<String, StoreError> {
        loop {
            match tokio::time::timeout(self.patience.silence, self.connection.try_recv()).await {
                Ok(Ok(Some(notification))) => return Ok(notification.payload().to_owned()),
                Ok(Ok(None)) => return Err(StoreError::Database("the connection was lost".to_owned())),
                Ok(Err(error)) => return Err(error.into()),
                Err(_) => self.ask().await?,
            }
        }
    }

    /// Makes sure that the database is still there.
    async fn ask(&mut self) -> Result<(), StoreError> {
        let asked = async { Ok(sqlx::query("select 1").execute(&mut self.connection).await?) };
        in_time(self.patience.connection, asked).await?;
        Ok(())
    }
}
