//! The embedded database: a SQLite file.
//!
//! Statements run on the calling thread, without a switch to another thread for each row. So the writer has a thread
//! of its own. Each reader has a connection of its own and runs where blocking is allowed.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rusqlite::types::ValueRef;
use rusqlite::{Connection, OpenFlags, ToSql};
use tokio::sync::Semaphore;

use crate::directory;
use crate::store::engine::error::StoreError;
use crate::store::engine::row::Row;
use crate::store::engine::sql::{Answer, PREPARED, Query};
use crate::store::engine::value::Value;

/// Longest wait for the lock of another process, such as a backup.
const BUSY: Duration = Duration::from_secs(10);

/// Settings of a writing connection. `full` syncs each commit, also in WAL mode.
const SESSION: &str = "pragma journal_mode = wal; pragma synchronous = full; pragma foreign_keys = on;";

/// Opens a connection to write with; the file is made if there is none.
pub(in crate::store) fn writer(file: &Path) -> Result<Connection, StoreError> {
    directory::keep_private(file, &["-wal", "-shm"]).map_err(|error| StoreError::Database(error.to_string()))?;
    let connection = open(file, OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE)?;
    connection.execute_batch(SESSION)?;
    Ok(connection)
}

fn open(file: &Path, flags: OpenFlags) -> Result<Connection, StoreError> {
    let connection = Connection::open_with_flags(file, flags | OpenFlags::SQLITE_OPEN_NO_MUTEX)?;
    connection.busy_timeout(BUSY)?;
    connection.set_prepared_statement_cache_capacity(PREPARED);
    Ok(connection)
}

/// Runs a statement.
pub(in crate::store) fn run(connection: &Connection, query: &Query) -> Result<Answer, StoreError> {
    let mut statement = connection.prepare_cached(&query.statement)?;
    for index in 1..=statement.parameter_count() {
        // `$2` is a name to SQLite: its index follows from where it first occurs.
        let value = numbered(statement.parameter_name(index), &query.values);
        let value = value
            .ok_or_else(|| StoreError::Database(format!("nothing is bound to a parameter of `{}`", query.statement)))?;
        match value {
            Value::Integer(value) => statement.raw_bind_parameter(index, value)?,
            Value::Float(value) => statement.raw_bind_parameter(index, value)?,
            Value::Text(value) => statement.raw_bind_parameter(index, value.as_ref().map(|text| text as &dyn ToSql))?,
        }
    }
    let names: Arc<[String]> = statement.column_names().map(str::to_owned).collect();
    let mut found = statement.raw_query();
    let mut rows = Vec::new();
    while let Some(row) = found.next()? {
        let values = (0..names.len()).map(|column| Ok(value(row.get_ref(column)?)));
        rows.push(Row::new(Arc::clone(&names), values.collect::<Result<_, rusqlite::Error>>()?));
    }
    drop(found);
    Ok(Answer { rows, affected: connection.changes() })
}

/// The value of the parameter `$1`, `$2` and so on.
fn numbered<'v>(name: Option<&str>, values: &'v [Value]) -> Option<&'v Value> {
    let number: usize = name?.strip_prefix('$')?.parse().ok()?;
    values.get(number.checked_sub(1)?)
}

fn value(column: ValueRef<'_>) -> Value {
    match column {
        ValueRef::Null => Value::Text(None),
        ValueRef::Integer(value) => value.into(),
        ValueRef::Real(value) => Some(value).into(),
        ValueRef::Text(bytes) | ValueRef::Blob(bytes) => String::from_utf8_lossy(bytes).into_owned().into(),
    }
}

/// Connections to read with, made when they are needed. Cheap to clone.
#[derive(Clone, Debug)]
pub(in crate::store) struct Readers {
    file: PathBuf,
    idle: Arc<Mutex<Vec<Connection>>>,
    permits: Arc<Semaphore>,
}

impl Readers {
    /// So many connections at most.
    pub(in crate::store) fn new(file: PathBuf, most: usize) -> Self {
        Self { file, idle: Arc::default(), permits: Arc::new(Semaphore::new(most)) }
    }

    /// Runs a statement on one of them.
    pub(in crate::store) async fn run(&self, query: Query) -> Result<Answer, StoreError> {
        let permit = Arc::clone(&self.permits).acquire_owned().await.map_err(|_| StoreError::Closed)?;
        let (file, idle) = (self.file.clone(), Arc::clone(&self.idle));
        let run = move || {
            let held = idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let connection = held.map_or_else(|| open(&file, OpenFlags::SQLITE_OPEN_READ_ONLY), Ok)?;
            let answer = run(&connection, &query);
            idle.lock().unwrap_or_else(PoisonError::into_inner).push(connection);
            drop(permit);
            answer
        };
        tokio::task::spawn_blocking(run).await.map_err(|_| StoreError::Closed)?
    }

    /// Waits for running reads, then closes.
    pub(in crate::store) async fn close(&self, most: u32) {
        // Another call may have closed it already.
        let _ = self.permits.acquire_many(most).await;
        self.permits.close();
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn nobody_else_may_read_the_state() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("farm.sqlite");
        let connection = writer(&file).unwrap();
        connection.execute_batch("create table panes (name text)").unwrap();
        for name in ["farm.sqlite", "farm.sqlite-wal", "farm.sqlite-shm"] {
            let mode = folder.path().join(name).metadata().unwrap().permissions().mode();
            assert_eq!(mode & 0o077, 0, "{name}: {mode:o}");
        }
    }
}
