//! A PostgreSQL database.

use std::sync::Arc;
use std::time::{Duration, Instant};

use futures::StreamExt;
use sqlx::postgres::{PgConnectOptions, PgListener, PgPoolOptions, PgRow, Postgres};
use sqlx::{
    AssertSqlSafe, Column, ConnectOptions, Connection as _, Either, Executor, PgConnection, PgPool, Row as _, TypeInfo,
};
use tokio::sync::watch;

use crate::store::engine::damage::Damage;
use crate::store::engine::error::StoreError;
use crate::store::engine::row::Row;
use crate::store::engine::sql::{Answer, Query, query};
use crate::store::engine::timeouts::{Timeouts, in_time};
use crate::store::engine::value::Value;

/// Begins a transaction. The lock, whose number is `cleresto` in ASCII, lets the writers of several coordinators take
/// turns. No other writer changes what a transaction has read until it commits, as with the one writer of a SQLite
/// file.
pub(in crate::store) const BEGIN: &str =
    "begin isolation level read committed; select pg_advisory_xact_lock(7164212649242358895)";

/// The channel on which coordinators of a database notify each other.
pub(in crate::store) const CHANNEL: &str = "clerestory";

/// Settings of a writing connection. What is acknowledged is on disk, whatever the defaults of server or role. A
/// coordinator that is suspended in a transaction loses it, so that the others get their turn.
const SESSION: &str = "set synchronous_commit = on; set idle_in_transaction_session_timeout = '5s'";

/// Settings of every connection. Frequent queries use an index, also when the server's statistics are out of date
/// because a table has grown a thousandfold. Queries without an index are small, but their estimated cost would make
/// the server compile them.
pub(in crate::store) const LOOKUPS: &str = "set enable_seqscan = off; set jit = off";

/// The message about a server that takes no writes from anybody.
const STANDBY: &str = "its server is a standby; the address has to lead to the primary";

/// Runs a statement.
async fn run<'c, E>(executor: E, query: Query) -> Result<Answer, sqlx::Error>
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

fn values(row: &PgRow) -> Result<Vec<Value>, sqlx::Error> {
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
    damage: Damage,
}

/// Records what an error says about its session.
async fn noting<T>(damage: &mut Damage, answer: impl Future<Output = Result<T, sqlx::Error>>) -> Result<T, StoreError> {
    answer.await.map_err(|error| {
        *damage = Damage::of(&error).max(*damage);
        error.into()
    })
}

impl Session {
    /// Opens a connection, which must take writes.
    pub(in crate::store) async fn begin(
        options: Box<PgConnectOptions>,
        timeouts: Timeouts,
    ) -> Result<Self, StoreError> {
        let mut connection = options.connect().await?;
        for statements in [SESSION, LOOKUPS] {
            sqlx::raw_sql(statements).execute(&mut connection).await?;
        }
        let about = "select pg_backend_pid() as process, pg_is_in_recovery() as is_standby, \
                     current_setting('transaction_read_only') = 'on' as is_read_only";
        let answer = run(&mut connection, query(about)).await?;
        let row = answer.rows.first();
        let row = row.ok_or_else(|| StoreError::Database("it does not say who serves a connection".to_owned()))?;
        if row.integer("is_standby")? != 0 {
            return Err(StoreError::ReadOnly(STANDBY));
        }
        if row.integer("is_read_only")? != 0 {
            return Err(StoreError::ReadOnly("its sessions are read-only (default_transaction_read_only)"));
        }
        let process = row.integer("process")?;
        Ok(Self { connection, watch: Watch { options, process, timeouts, is_lost: false }, damage: Damage::None })
    }

    /// Runs statements without parameters or answers.
    pub(in crate::store) async fn batch(&mut self, statements: &'static str) -> Result<(), StoreError> {
        let Self { connection, watch, damage } = self;
        let run = async { sqlx::raw_sql(statements).execute(connection).await.map(drop) };
        watch.unless_lost(noting(damage, run)).await
    }

    /// Runs a statement.
    pub(in crate::store) async fn run(&mut self, query: Query) -> Result<Answer, StoreError> {
        let Self { connection, watch, damage } = self;
        watch.unless_lost(noting(damage, run(connection, query))).await
    }

    /// The damage of the session so far.
    pub(in crate::store) fn damage(&self) -> Damage {
        if self.watch.is_lost { Damage::Server } else { self.damage }
    }

    /// Says goodbye.
    pub(in crate::store) async fn close(self) -> Result<(), StoreError> {
        Ok(self.connection.close().await?)
    }
}

/// Notices that the network has lost a statement or its answer while the server is up. Other writers wait for this
/// one.
#[derive(Debug)]
struct Watch {
    options: Box<PgConnectOptions>,
    /// Process of the server that serves the connection.
    process: i64,
    timeouts: Timeouts,
    is_lost: bool,
}

impl Watch {
    /// The answer to a statement, or an error when the server's process is gone or has been idle for two seconds.
    /// After that, every statement fails.
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

    /// Resolves when no answer will come. A server that cannot be asked may still be working on it.
    async fn lost(&self) {
        loop {
            tokio::time::sleep(self.timeouts.doubt).await;
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
            if matches!(in_time(self.timeouts.connection, asked).await, Ok(false)) {
                return;
            }
        }
    }
}

/// Connections to read with. Connections from before `renewed` are not used again.
pub(in crate::store) fn pool(
    options: PgConnectOptions,
    most: u32,
    timeouts: Timeouts,
    renewed: watch::Receiver<Instant>,
) -> PgPool {
    let pool = PgPoolOptions::new().max_connections(most).acquire_timeout(timeouts.connection);
    let pool = pool.after_connect(|connection, _| {
        Box::pin(async move {
            sqlx::raw_sql(LOOKUPS).execute(&mut *connection).await?;
            // A standby lags behind the primary, by any time.
            let asked = sqlx::query_scalar("select pg_is_in_recovery()").fetch_one(connection);
            if asked.await? { Err(sqlx::Error::Protocol(STANDBY.to_owned())) } else { Ok(()) }
        })
    });
    // The pool's own test may take as long as the whole acquisition.
    let pool = pool.test_before_acquire(false).before_acquire(move |connection, metadata| {
        let is_old = metadata.age > renewed.borrow().elapsed();
        Box::pin(async move { Ok(!is_old && is_there(connection, timeouts.idle).await) })
    });
    pool.connect_lazy_with(options)
}

/// Whether an idle connection is alive. A firewall that has cut it sends nothing.
async fn is_there(connection: &mut PgConnection, timeout: Duration) -> bool {
    matches!(tokio::time::timeout(timeout, connection.ping()).await, Ok(Ok(())))
}

/// Runs a statement on a pooled connection. The connection is closed after a timeout, for which the pool itself would
/// wait, and after an error that the statement did not cause.
pub(in crate::store) async fn read(pool: &PgPool, query: Query, timeout: Duration) -> Result<Answer, StoreError> {
    let mut connection = pool.acquire().await?;
    let slow = || StoreError::Database(format!("no answer in {} s", timeout.as_secs()));
    let answer = tokio::time::timeout(timeout, run(&mut *connection, query)).await;
    let damage =
        answer.as_ref().map_or(Damage::Session, |answer| answer.as_ref().err().map_or(Damage::None, Damage::of));
    if damage > Damage::None {
        drop(connection.detach());
    }
    Ok(answer.map_err(|_| slow())??)
}

/// Receives the notifications of all coordinators of a database.
#[derive(Debug)]
pub(crate) struct Listener {
    connection: PgListener,
    timeouts: Timeouts,
    renewed: watch::Receiver<Instant>,
}

impl Listener {
    /// Listens from now on, until the connection is lost or connections are renewed.
    pub(in crate::store) async fn connect(
        url: &str,
        timeouts: Timeouts,
        mut renewed: watch::Receiver<Instant>,
    ) -> Result<Self, StoreError> {
        renewed.mark_unchanged();
        let connect = async {
            let mut connection = PgListener::connect(url).await?;
            connection.eager_reconnect(false);
            connection.listen(CHANNEL).await?;
            Ok(connection)
        };
        Ok(Self { connection: in_time(timeouts.connection, connect).await?, timeouts, renewed })
    }

    /// The next text. Fails when the connection is lost, silently or not; texts since then are lost as well.
    pub(crate) async fn next(&mut self) -> Result<String, StoreError> {
        let lost = || StoreError::Database("the connection was lost".to_owned());
        loop {
            let heard = tokio::time::timeout(self.timeouts.silence, self.connection.try_recv());
            let heard = tokio::select! {
                // What has come is not lost.
                biased;
                heard = heard => heard,
                // The server may have been replaced.
                Ok(()) = self.renewed.changed() => return Err(lost()),
            };
            match heard {
                Ok(Ok(Some(notification))) => return Ok(notification.payload().to_owned()),
                Ok(Ok(None)) => return Err(lost()),
                Ok(Err(error)) => return Err(error.into()),
                Err(_) => self.ask().await?,
            }
        }
    }

    /// Checks that the database answers.
    async fn ask(&mut self) -> Result<(), StoreError> {
        let asked = async { Ok(sqlx::query("select 1").execute(&mut self.connection).await?) };
        in_time(self.timeouts.connection, asked).await?;
        Ok(())
    }
}
