//! The speed of the machine without a farm, beside which the figures of the farm are read.
//!
//! Each speed is measured for about a second, on the disk of the farm, while nothing else runs.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use serde::Serialize;
use sqlx::postgres::PgConnectOptions;
use sqlx::{ConnectOptions, Connection, Executor, PgConnection, Row};

use crate::error::LoadError;
use crate::settings::BUILD;

/// Time of each measurement.
const TIME: Duration = Duration::from_secs(1);

/// Rows of a group: the nodes of one lease, and those of sixteen leases whose partials come at the same time.
const GROUPS: [u32; 2] = [16, 256];

/// A table like that of the coordinator's accepted nodes, whose rows are its largest.
const NODES_TABLE: &str = "
    create table clerestory_bench_nodes (
        job text not null, frame bigint not null, tile bigint not null, level bigint not null, idx bigint not null,
        first_pass bigint not null, end_pass bigint not null, blob text not null, blob_offset bigint not null,
        blob_length bigint,
        counters text not null, builds text not null, primary key (job, frame, tile, level, idx)
    );
    create index clerestory_bench_nodes_by_pass on clerestory_bench_nodes (job, frame, tile, first_pass);
    create index clerestory_bench_nodes_by_blob on clerestory_bench_nodes (blob)";

/// Stores a group of rows in SQLite, in one statement as the coordinator does.
const SQLITE_INSERT: &str = "
    insert into clerestory_bench_nodes
        (job, frame, tile, level, idx, first_pass, end_pass, blob, blob_offset, blob_length, counters, builds)
    select ?1, value ->> 0, value ->> 1, value ->> 2, value ->> 3, value ->> 4, value ->> 5, value ->> 6, value ->> 7,
        value ->> 8, value ->> 9, value ->> 10
    from json_each(?2)";

/// The same in PostgreSQL.
const POSTGRES_INSERT: &str = "
    insert into clerestory_bench_nodes
        (job, frame, tile, level, idx, first_pass, end_pass, blob, blob_offset, blob_length, counters, builds)
    select $1, (value ->> 0)::bigint, (value ->> 1)::bigint, (value ->> 2)::bigint, (value ->> 3)::bigint,
        (value ->> 4)::bigint, (value ->> 5)::bigint, value ->> 6, (value ->> 7)::bigint, (value ->> 8)::bigint,
        value ->> 9, value ->> 10
    from jsonb_array_elements($2::jsonb) as listed (value)";

/// A job's identity.
const JOB: &str = "01999999-9999-7999-8999-999999999999";

/// The counters of a node's row.
const COUNTERS: &str = "{\"height_evaluations\":0,\"solver_calls\":0,\"converged\":0,\"unique_solutions\":0,\
    \"trials\":0,\"truncated\":0,\"rays\":4096,\"samples\":4096}";

/// Bytes of a stored node.
const NODE_BYTES: u32 = 12_000;

/// Bytes of an append: a page of most file systems.
const APPEND: usize = 4096;

/// Bytes that are written in sequence, or copied.
const LARGE: usize = 256 << 20;

/// Bytes that are written at a time.
const PIECE: usize = 1 << 20;

/// Copies of the large buffer.
const COPIES: u32 = 8;

/// The speed of disk, databases and memory.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Ceilings {
    /// Transactions of one small row that a SQLite file commits each second, with the coordinator's sync setting.
    sqlite_commits_per_second: f64,
    /// Transactions of groups of rows that it commits, for each size of a group.
    sqlite_groups: [Grouped; 2],
    /// The same for the PostgreSQL database, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    postgres_commits_per_second: Option<f64>,
    /// The same of groups of rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    postgres_groups: Option<[Grouped; 2]>,
    /// Appends of 4 KiB to a file, each synced.
    synced_appends_per_second: f64,
    /// Megabytes (10^6 bytes) a second written to a file in sequence and synced once.
    disk_megabytes_per_second: f64,
    /// Megabytes a second that one core copies in memory.
    memory_megabytes_per_second: f64,
}

/// Transactions of groups of rows, as the coordinator commits them when many uploads come together.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Grouped {
    /// Rows in each transaction, of the size of an accepted node's.
    rows: u32,
    /// Transactions that are committed each second, each synced.
    commits_per_second: f64,
    /// Rows in them.
    rows_per_second: f64,
}

impl Grouped {
    /// The rates of `commits` transactions in this time.
    fn new(rows: u32, commits: u32, time: Duration) -> Self {
        let commits_per_second = f64::from(commits) / time.as_secs_f64();
        Self { rows, commits_per_second, rows_per_second: commits_per_second * f64::from(rows) }
    }
}

impl Ceilings {
    /// Measures in `folder`, and in the database at this address.
    pub(crate) async fn measure(folder: &Path, database: Option<&str>) -> Result<Self, LoadError> {
        let postgres = match database {
            Some(url) => Some(postgres(url).await.map_err(database_failure)?),
            None => None,
        };
        let folder = folder.to_owned();
        let rest = tokio::task::spawn_blocking(move || {
            let sqlite = sqlite(&folder.join("commits.sqlite")).map_err(database_failure)?;
            Ok::<_, LoadError>((sqlite, appends(&folder.join("appends"))?, disk(&folder.join("row"))?, memory()))
        });
        let ((sqlite_commits, sqlite_groups), appends, disk, memory) =
            rest.await.map_err(|panic| LoadError::Ended(format!("a measurement failed: {panic}")))??;
        Ok(Self {
            sqlite_commits_per_second: sqlite_commits,
            sqlite_groups,
            postgres_commits_per_second: postgres.map(|(commits, _)| commits),
            postgres_groups: postgres.map(|(_, groups)| groups),
            synced_appends_per_second: appends,
            disk_megabytes_per_second: disk,
            memory_megabytes_per_second: memory,
        })
    }

    /// The ceilings with their names, for people.
    pub(crate) fn lines(&self) -> Vec<(String, f64)> {
        let databases = [
            ("SQLite", Some(self.sqlite_commits_per_second), Some(self.sqlite_groups)),
            ("PostgreSQL", self.postgres_commits_per_second, self.postgres_groups),
        ];
        let mut lines = Vec::new();
        for (engine, commits, groups) in databases {
            lines.extend(commits.map(|rate| (format!("{engine} commits of one row, synced, /s"), rate)));
            for group in groups.into_iter().flatten() {
                let name = format!("{engine} commits of {} rows, synced, /s", group.rows);
                lines.extend([(name, group.commits_per_second), ("  rows, /s".to_owned(), group.rows_per_second)]);
            }
        }
        let others = [
            ("appends of 4 KiB, each synced, /s", self.synced_appends_per_second),
            ("disk, written in a row and synced, MB/s", self.disk_megabytes_per_second),
            ("memory, copied by one core, MB/s", self.memory_megabytes_per_second),
        ];
        lines.extend(others.map(|(name, rate)| (name.to_owned(), rate)));
        lines
    }
}

/// Bytes of a PostgreSQL database.
pub(crate) async fn database_bytes(url: &str) -> Result<u64, LoadError> {
    let bytes = number(url, "select pg_database_size(current_database()) as number").await;
    Ok(bytes.map_err(database_failure)?.unsigned_abs())
}

/// Bytes that a PostgreSQL server has written to its log (WAL), for all of its databases. `None` for a server that does
/// not report it.
pub(crate) async fn log_bytes(url: &str) -> Result<Option<u64>, LoadError> {
    let statement = "select cast(pg_wal_lsn_diff(pg_current_wal_lsn(), '0/0') as bigint) as number";
    match number(url, statement).await {
        Ok(bytes) => Ok(Some(bytes.unsigned_abs())),
        Err(sqlx::Error::Database(_)) => Ok(None),
        Err(error) => Err(database_failure(error)),
    }
}

/// The column `number` of the only row of a statement.
async fn number(url: &str, statement: &'static str) -> Result<i64, sqlx::Error> {
    let mut connection = url.parse::<PgConnectOptions>()?.connect().await?;
    let row = sqlx::query(statement).fetch_one(&mut connection).await?;
    connection.close().await?;
    row.try_get::<i64, _>("number")
}

/// The failure of a measured database.
fn database_failure(error: impl std::error::Error + Send + Sync + 'static) -> LoadError {
    LoadError::Database(Box::new(error))
}

/// A group of accepted nodes as the coordinator's writer passes them to a database: a JSON array of arrays. Each group
/// has a number of its own, and with it its own addresses and blob.
fn group(rows: u32, number: u32) -> String {
    let (blob, builds) = (format!("nodes/{JOB}/{rows:04}{number:032}"), format!("[\"{BUILD}\"]"));
    let row = |place: u32| {
        // The size of the groups stands for the frame.
        let (frame, tile, offset) = (rows, number * rows + place, place * NODE_BYTES);
        (frame, tile, 0, 0, 0, 1, &blob, offset, NODE_BYTES, COUNTERS, &builds)
    };
    let all: Vec<_> = (0..rows).map(row).collect();
    serde_json::to_string(&all).expect("numbers and texts have a form in JSON")
}

/// Commits of one row, and of groups of rows, each second.
fn sqlite(file: &Path) -> Result<(f64, [Grouped; 2]), rusqlite::Error> {
    let connection = rusqlite::Connection::open(file)?;
    connection.execute_batch(
        "pragma journal_mode = wal; pragma synchronous = full; create table commits (number bigint primary key)",
    )?;
    connection.execute_batch(NODES_TABLE)?;
    let commits = sqlite_commits(&connection)?;
    let mut groups = [Grouped::default(); 2];
    for (grouped, rows) in groups.iter_mut().zip(GROUPS) {
        *grouped = sqlite_group(&connection, rows)?;
    }
    Ok((commits, groups))
}

fn sqlite_commits(connection: &rusqlite::Connection) -> Result<f64, rusqlite::Error> {
    let (start, mut commits) = (Instant::now(), 0_i64);
    let mut insert = connection.prepare("insert into commits (number) values (?1)")?;
    while start.elapsed() < TIME {
        commits += 1;
        insert.execute([commits])?;
    }
    Ok(commits as f64 / start.elapsed().as_secs_f64())
}

fn sqlite_group(connection: &rusqlite::Connection, rows: u32) -> Result<Grouped, rusqlite::Error> {
    let (start, mut commits) = (Instant::now(), 0);
    let mut insert = connection.prepare(SQLITE_INSERT)?;
    while start.elapsed() < TIME {
        insert.execute((JOB, group(rows, commits)))?;
        commits += 1;
    }
    Ok(Grouped::new(rows, commits, start.elapsed()))
}

/// Commits of one row, and of groups of rows, each second.
async fn postgres(url: &str) -> Result<(f64, [Grouped; 2]), sqlx::Error> {
    const DROP: &str = "drop table if exists clerestory_bench_commits, clerestory_bench_nodes";
    let mut connection = url.parse::<PgConnectOptions>()?.connect().await?;
    connection.execute("set synchronous_commit = on").await?;
    // A killed run may have left them.
    connection.execute(DROP).await?;
    connection.execute("create table clerestory_bench_commits (number bigint primary key)").await?;
    sqlx::raw_sql(NODES_TABLE).execute(&mut connection).await?;
    let rates = postgres_rates(&mut connection).await;
    connection.execute(DROP).await?;
    connection.close().await?;
    rates
}

async fn postgres_rates(connection: &mut PgConnection) -> Result<(f64, [Grouped; 2]), sqlx::Error> {
    let commits = postgres_commits(connection).await?;
    let mut groups = [Grouped::default(); 2];
    for (grouped, rows) in groups.iter_mut().zip(GROUPS) {
        *grouped = postgres_group(connection, rows).await?;
    }
    Ok((commits, groups))
}

async fn postgres_commits(connection: &mut PgConnection) -> Result<f64, sqlx::Error> {
    let (start, mut commits) = (Instant::now(), 0_i64);
    while start.elapsed() < TIME {
        commits += 1;
        let insert = sqlx::query("insert into clerestory_bench_commits (number) values ($1)");
        insert.bind(commits).execute(&mut *connection).await?;
    }
    Ok(commits as f64 / start.elapsed().as_secs_f64())
}

async fn postgres_group(connection: &mut PgConnection, rows: u32) -> Result<Grouped, sqlx::Error> {
    let (start, mut commits) = (Instant::now(), 0);
    while start.elapsed() < TIME {
        sqlx::query(POSTGRES_INSERT).bind(JOB).bind(group(rows, commits)).execute(&mut *connection).await?;
        commits += 1;
    }
    Ok(Grouped::new(rows, commits, start.elapsed()))
}

/// Writes a file and takes it away again.
fn with_file<T>(file: &Path, write: impl FnOnce(&mut File) -> std::io::Result<T>) -> Result<T, LoadError> {
    let written = File::create(file).and_then(|mut opened| write(&mut opened));
    let written = written.and_then(|written| fs::remove_file(file).map(|()| written));
    written.map_err(|source| LoadError::Write { file: file.to_owned(), source })
}

fn appends(file: &Path) -> Result<f64, LoadError> {
    with_file(file, |file| {
        let (start, mut appends) = (Instant::now(), 0_u32);
        while start.elapsed() < TIME {
            file.write_all(&[7; APPEND])?;
            file.sync_all()?;
            appends += 1;
        }
        Ok(f64::from(appends) / start.elapsed().as_secs_f64())
    })
}

fn disk(file: &Path) -> Result<f64, LoadError> {
    with_file(file, |file| {
        let (start, piece) = (Instant::now(), vec![7; PIECE]);
        for _ in 0..LARGE / PIECE {
            file.write_all(&piece)?;
        }
        file.sync_all()?;
        Ok(LARGE as f64 / 1e6 / start.elapsed().as_secs_f64())
    })
}

fn memory() -> f64 {
    let (source, mut target) = (vec![7_u8; LARGE], vec![0_u8; LARGE]);
    let start = Instant::now();
    for _ in 0..COPIES {
        target.copy_from_slice(std::hint::black_box(&source));
        std::hint::black_box(&mut target);
    }
    LARGE as f64 * f64::from(COPIES) / 1e6 / start.elapsed().as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn everything_is_measured_and_nothing_but_the_database_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let ceilings = Ceilings::measure(folder.path(), None).await.unwrap();
        let lines = ceilings.lines();
        let names: Vec<&str> = lines.iter().map(|(name, _)| &**name).collect();
        let groups = [
            "SQLite commits of 16 rows, synced, /s",
            "  rows, /s",
            "SQLite commits of 256 rows, synced, /s",
            "  rows, /s",
        ];
        assert_eq!((names.len(), &names[1..5]), (8, &groups[..]));
        assert!(lines.iter().all(|(_, rate)| rate.is_finite() && *rate > 0.0), "{ceilings:?}");
        assert!(!folder.path().join("appends").exists() && !folder.path().join("row").exists());
    }

    #[tokio::test]
    async fn a_folder_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let failure = appends(&folder.path().join("no/file")).unwrap_err();
        assert!(failure.to_string().contains("no/file"), "{failure}");
    }
}
