//! What the machine does without a farm: the numbers beside which those of the farm are read.
//!
//! Each is measured for about a second, on the disk of the farm and with nothing else going on.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use serde::Serialize;
use sqlx::postgres::PgConnectOptions;
use sqlx::{ConnectOptions, Connection, Executor, PgConnection, Row};

use crate::failure::Failure;

/// How long each is measured.
const TIME: Duration = Duration::from_secs(1);

/// Bytes of an append: a page of most file systems.
const APPEND: usize = 4096;

/// Bytes that are written in a row, or copied.
const LARGE: usize = 256 << 20;

/// Bytes that are written at a time.
const PIECE: usize = 1 << 20;

/// Copies of the large buffer.
const COPIES: u32 = 8;

/// What the disk, the databases and the memory do.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Ceilings {
    /// Transactions of one small row that a SQLite file commits each second, synced as the coordinator's.
    sqlite_commits_per_second: f64,
    /// The same of the PostgreSQL database, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    postgres_commits_per_second: Option<f64>,
    /// Appends of 4 KiB to a file, each synced.
    synced_appends_per_second: f64,
    /// Megabytes (10^6 bytes) a second written to a file in a row and synced once.
    disk_megabytes_per_second: f64,
    /// Megabytes a second that one core copies in memory.
    memory_megabytes_per_second: f64,
}

impl Ceilings {
    /// Measures in `folder`, and in the database at this address.
    pub(super) async fn measure(folder: &Path, database: Option<&str>) -> Result<Self, Failure> {
        let postgres = match database {
            Some(url) => Some(postgres_commits(url).await.map_err(database_failure)?),
            None => None,
        };
        let folder = folder.to_owned();
        let rest = tokio::task::spawn_blocking(move || {
            let commits = sqlite_commits(&folder.join("commits.sqlite")).map_err(database_failure)?;
            Ok::<_, Failure>((commits, appends(&folder.join("appends"))?, disk(&folder.join("row"))?, memory()))
        });
        let (commits, appends, disk, memory) =
            rest.await.map_err(|panic| Failure::Job(format!("a measurement failed: {panic}")))??;
        Ok(Self {
            sqlite_commits_per_second: commits,
            postgres_commits_per_second: postgres,
            synced_appends_per_second: appends,
            disk_megabytes_per_second: disk,
            memory_megabytes_per_second: memory,
        })
    }

    /// The ceilings with their names, for people.
    pub(super) fn lines(&self) -> Vec<(&'static str, f64)> {
        let mut lines = vec![("SQLite commits of one row, synced, /s", self.sqlite_commits_per_second)];
        lines.extend(self.postgres_commits_per_second.map(|rate| ("PostgreSQL commits of one row, synced, /s", rate)));
        lines.extend([
            ("appends of 4 KiB, each synced, /s", self.synced_appends_per_second),
            ("disk, written in a row and synced, MB/s", self.disk_megabytes_per_second),
            ("memory, copied by one core, MB/s", self.memory_megabytes_per_second),
        ]);
        lines
    }
}

/// Bytes of a PostgreSQL database.
pub(super) async fn database_bytes(url: &str) -> Result<u64, Failure> {
    let measured = async {
        let mut connection = url.parse::<PgConnectOptions>()?.connect().await?;
        let row =
            sqlx::query("select pg_database_size(current_database()) as bytes").fetch_one(&mut connection).await?;
        connection.close().await?;
        row.try_get::<i64, _>("bytes")
    };
    let bytes: Result<i64, sqlx::Error> = measured.await;
    Ok(bytes.map_err(database_failure)?.unsigned_abs())
}

/// A database that was measured failed.
fn database_failure(error: impl std::error::Error + Send + Sync + 'static) -> Failure {
    Failure::Database(Box::new(error))
}

fn sqlite_commits(file: &Path) -> Result<f64, rusqlite::Error> {
    let connection = rusqlite::Connection::open(file)?;
    connection.execute_batch(
        "pragma journal_mode = wal; pragma synchronous = full; create table commits (number bigint primary key)",
    )?;
    let (start, mut commits) = (Instant::now(), 0_i64);
    let mut insert = connection.prepare("insert into commits (number) values (?1)")?;
    while start.elapsed() < TIME {
        commits += 1;
        insert.execute([commits])?;
    }
    Ok(commits as f64 / start.elapsed().as_secs_f64())
}

async fn postgres_commits(url: &str) -> Result<f64, sqlx::Error> {
    let mut connection = url.parse::<PgConnectOptions>()?.connect().await?;
    connection.execute("set synchronous_commit = on").await?;
    // A run that was killed may have left it.
    connection.execute("drop table if exists clerestory_bench_commits").await?;
    connection.execute("create table clerestory_bench_commits (number bigint primary key)").await?;
    let rate = postgres_rate(&mut connection).await;
    connection.execute("drop table clerestory_bench_commits").await?;
    connection.close().await?;
    rate
}

async fn postgres_rate(connection: &mut PgConnection) -> Result<f64, sqlx::Error> {
    let (start, mut commits) = (Instant::now(), 0_i64);
    while start.elapsed() < TIME {
        commits += 1;
        let insert = sqlx::query("insert into clerestory_bench_commits (number) values ($1)");
        insert.bind(commits).execute(&mut *connection).await?;
    }
    Ok(commits as f64 / start.elapsed().as_secs_f64())
}

/// Writes a file and takes it away again.
fn with_file<T>(file: &Path, write: impl FnOnce(&mut File) -> std::io::Result<T>) -> Result<T, Failure> {
    let written = File::create(file).and_then(|mut opened| write(&mut opened));
    let written = written.and_then(|written| fs::remove_file(file).map(|()| written));
    written.map_err(|source| Failure::Write { file: file.to_owned(), source })
}

fn appends(file: &Path) -> Result<f64, Failure> {
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

fn disk(file: &Path) -> Result<f64, Failure> {
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
        assert_eq!(ceilings.lines().len(), 4);
        assert!(ceilings.lines().iter().all(|(_, rate)| rate.is_finite() && *rate > 0.0), "{ceilings:?}");
        assert!(!folder.path().join("appends").exists() && !folder.path().join("row").exists());
    }

    #[tokio::test]
    async fn a_folder_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let failure = appends(&folder.path().join("no/file")).unwrap_err();
        assert!(failure.to_string().contains("no/file"), "{failure}");
    }
}
