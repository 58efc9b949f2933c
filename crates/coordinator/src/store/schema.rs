//! Opening the database and bringing its schema up to date.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use sqlx::migrate::{Migrate, MigrateError, Migration, MigrationType, Migrator};
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{ConnectOptions, SqlSafeStr};

/// The database cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SchemaError {
    /// The file cannot be opened.
    #[error("cannot open the database `{}`", file.display())]
    Open {
        /// The file.
        file: PathBuf,
        /// Why.
        source: sqlx::Error,
    },
    /// A newer build has written it.
    #[error(
        "the database `{}` has schema version {found}, but this build knows versions up to {known}: start the newer build \
         that wrote it, or use another data directory",
        file.display()
    )]
    Newer {
        /// The file.
        file: PathBuf,
        /// Its version.
        found: i64,
        /// The newest version that this build knows.
        known: i64,
    },
    /// The schema could not be brought up to date.
    #[error("cannot bring the schema of the database `{}` up to date", file.display())]
    Migrate {
        /// The file.
        file: PathBuf,
        /// Why.
        source: MigrateError,
    },
}

fn migrations() -> Vec<Migration> {
    let migration = |version, name: &'static str, sql: &'static str| {
        Migration::new(version, Cow::Borrowed(name), MigrationType::Simple, sql.into_sql_str(), false)
    };
    vec![
        migration(1, "first", include_str!("../../migrations/0001_first.sql")),
        migration(2, "counters", include_str!("../../migrations/0002_counters.sql")),
    ]
}

/// Opens a connection and brings the schema up to date.
pub(super) async fn open(file: &Path, options: &SqliteConnectOptions) -> Result<SqliteConnection, SchemaError> {
    let failed = |source| SchemaError::Migrate { file: file.to_owned(), source };
    let mut connection =
        options.connect().await.map_err(|source| SchemaError::Open { file: file.to_owned(), source })?;
    let migrator = Migrator::with_migrations(migrations());
    let known = migrator.iter().map(|migration| migration.version).max().unwrap_or(0);
    connection.ensure_migrations_table(&migrator.table_name).await.map_err(failed)?;
    let applied = connection.list_applied_migrations(&migrator.table_name).await.map_err(failed)?;
    if let Some(found) = applied.iter().map(|migration| migration.version).max().filter(|found| *found > known) {
        return Err(SchemaError::Newer { file: file.to_owned(), found, known });
    }
    // `run` takes any `Acquire`, whose future the compiler cannot prove to be `Send` for all lifetimes.
    migrator.run_direct(None, &mut connection, false).await.map_err(failed)?;
    Ok(connection)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Store;

    #[tokio::test]
    async fn a_database_of_a_newer_build_is_refused_with_both_versions() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("farm.sqlite");
        Store::open(&file).await.unwrap().close().await;
        let mut connection = SqliteConnectOptions::new().filename(&file).connect().await.unwrap();
        sqlx::query(
            "insert into _sqlx_migrations (version, description, success, checksum, execution_time) \
             values (99, 'later', 1, x'00', 0)",
        )
        .execute(&mut connection)
        .await
        .unwrap();
        let error = Store::open(&file).await.unwrap_err();
        assert!(matches!(error, SchemaError::Newer { found: 99, known: 2, .. }), "{error}");
    }
}
