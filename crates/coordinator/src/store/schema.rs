//! Opening the database and bringing its schema up to date.

use std::borrow::Cow;

use sqlx::SqlSafeStr;
use sqlx::migrate::{Migrate, MigrateError, Migration, MigrationType, Migrator};

use super::Connection;
use super::source::Source;

/// The database cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SchemaError {
    /// It cannot be opened.
    #[error("cannot open the database `{database}`")]
    Open {
        /// What people call the database.
        database: String,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A newer build has written it.
    #[error(
        "the database `{database}` has schema version {found}, but this build knows versions up to {known}: start the newer \
         build that wrote it, or use another database or data directory"
    )]
    Newer {
        /// What people call the database.
        database: String,
        /// Its version.
        found: i64,
        /// The newest version that this build knows.
        known: i64,
    },
    /// The schema could not be brought up to date.
    #[error("cannot bring the schema of the database `{database}` up to date")]
    Migrate {
        /// What people call the database.
        database: String,
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
        migration(3, "farm", include_str!("../../migrations/0003_farm.sql")),
        migration(4, "targets", include_str!("../../migrations/0004_targets.sql")),
        migration(5, "coordinators", include_str!("../../migrations/0005_coordinators.sql")),
        migration(6, "places", include_str!("../../migrations/0006_places.sql")),
        migration(7, "repeats", include_str!("../../migrations/0007_repeats.sql")),
        migration(8, "checks", include_str!("../../migrations/0008_checks.sql")),
    ]
}

/// Opens the connection to write with and brings the schema up to date.
pub(super) async fn open(source: &Source) -> Result<Connection, SchemaError> {
    let database = || source.name().to_owned();
    let failed = |source| SchemaError::Migrate { database: database(), source };
    let opened = |source| SchemaError::Open { database: database(), source };
    let mut connection = source.writer().await.map_err(|error| opened(error.into()))?;
    let migrator = Migrator::with_migrations(migrations());
    let known = migrator.iter().map(|migration| migration.version).max().unwrap_or(0);
    // Coordinators that start together take turns.
    connection.lock().await.map_err(failed)?;
    connection.ensure_migrations_table(&migrator.table_name).await.map_err(failed)?;
    let applied = connection.list_applied_migrations(&migrator.table_name).await.map_err(failed)?;
    if let Some(found) = applied.iter().map(|migration| migration.version).max().filter(|found| *found > known) {
        return Err(SchemaError::Newer { database: database(), found, known });
    }
    // `run` takes any `Acquire`, whose future the compiler cannot prove to be `Send` for all lifetimes.
    migrator.run_direct(None, &mut connection, false).await.map_err(failed)?;
    connection.unlock().await.map_err(failed)?;
    Ok(connection)
}
