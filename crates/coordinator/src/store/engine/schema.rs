//! The schema: the database is opened and brought up to date.

use crate::store::engine::backfill;
use crate::store::engine::error::StoreError;
use crate::store::engine::requirements::{self, Found};
use crate::store::engine::source::{Connection, Source};
use crate::store::engine::sql::query;

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
    /// No farm can use it.
    #[error("cannot use the database `{database}`: {problem}")]
    Unsuitable {
        /// What people call the database.
        database: String,
        /// What is wrong, and what would be right.
        problem: String,
    },
    /// A newer build has written it.
    #[error(
        "the database `{database}` has schema version {found}, but this build knows versions up to {known}: start \
         the newer \
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
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// The migration whose column is filled by [`backfill::same_by_first`].
const SAME_BY_FIRST: i64 = 29;

/// Migrations, each with its version and its name.
pub(in crate::store) const MIGRATIONS: [(i64, &str, &str); 33] = [
    (1, "first", include_str!("../../../migrations/0001_first.sql")),
    (2, "counters", include_str!("../../../migrations/0002_counters.sql")),
    (3, "farm", include_str!("../../../migrations/0003_farm.sql")),
    (4, "targets", include_str!("../../../migrations/0004_targets.sql")),
    (5, "coordinators", include_str!("../../../migrations/0005_coordinators.sql")),
    (6, "places", include_str!("../../../migrations/0006_places.sql")),
    (7, "repeats", include_str!("../../../migrations/0007_repeats.sql")),
    (8, "checks", include_str!("../../../migrations/0008_checks.sql")),
    (9, "adaptive", include_str!("../../../migrations/0009_adaptive.sql")),
    (10, "held", include_str!("../../../migrations/0010_held.sql")),
    (11, "trust", include_str!("../../../migrations/0011_trust.sql")),
    (12, "pace", include_str!("../../../migrations/0012_pace.sql")),
    (13, "open_waves", include_str!("../../../migrations/0013_open_waves.sql")),
    (14, "flip", include_str!("../../../migrations/0014_flip.sql")),
    (15, "lookups", include_str!("../../../migrations/0015_lookups.sql")),
    (16, "failures", include_str!("../../../migrations/0016_failures.sql")),
    (17, "gathering", include_str!("../../../migrations/0017_gathering.sql")),
    (18, "second_holders", include_str!("../../../migrations/0018_second_holders.sql")),
    (19, "events_of_jobs", include_str!("../../../migrations/0019_events_of_jobs.sql")),
    (20, "left_to_chance", include_str!("../../../migrations/0020_left_to_chance.sql")),
    (21, "attempts", include_str!("../../../migrations/0021_attempts.sql")),
    (22, "lost_nodes", include_str!("../../../migrations/0022_lost_nodes.sql")),
    (23, "building", include_str!("../../../migrations/0023_building.sql")),
    (24, "method_digests", include_str!("../../../migrations/0024_method_digests.sql")),
    (25, "chosen_methods", include_str!("../../../migrations/0025_chosen_methods.sql")),
    (26, "read_by_first", include_str!("../../../migrations/0026_read_by_first.sql")),
    (27, "built_scenes", include_str!("../../../migrations/0027_built_scenes.sql")),
    (28, "scene_refusals", include_str!("../../../migrations/0028_scene_refusals.sql")),
    (SAME_BY_FIRST, "same_by_first", include_str!("../../../migrations/0029_same_by_first.sql")),
    (30, "names", include_str!("../../../migrations/0030_names.sql")),
    (31, "import_notes", include_str!("../../../migrations/0031_import_notes.sql")),
    (32, "light_plane", include_str!("../../../migrations/0032_light_plane.sql")),
    (33, "caustic", include_str!("../../../migrations/0033_caustic.sql")),
];

/// The table of applied migrations. Newer builds leave the checksum empty.
pub(in crate::store) const APPLIED: &str = "create table _sqlx_migrations (version bigint primary key, description \
                                            text not null, \
    installed_on timestamp not null default current_timestamp, success boolean not null, checksum text not null, \
    execution_time bigint not null)";

/// Opens the connection to write with and brings the schema up to date.
pub(in crate::store) async fn open(source: &Source) -> Result<Connection, SchemaError> {
    let opened = |error: StoreError| SchemaError::Open { database: source.name().to_owned(), source: error.into() };
    let mut connection = source.writer().await.map_err(opened)?;
    match bring_up_to_date(&mut connection, source.name()).await {
        Ok(()) => Ok(connection),
        Err(error) => {
            // Closing undoes a half-done migration, and the first error says more than one of closing.
            let _ = connection.close().await;
            Err(error)
        }
    }
}

async fn bring_up_to_date(connection: &mut Connection, database: &str) -> Result<(), SchemaError> {
    let database = || database.to_owned();
    let failed = |error: StoreError| SchemaError::Migrate { database: database(), source: error.into() };
    let unsuitable = |problem| SchemaError::Unsuitable { database: database(), problem };
    // Coordinators that start together take turns. A migration that fails half-way is rolled back.
    connection.begin().await.map_err(failed)?;
    let looked = requirements::inspect(connection).await;
    let found = looked.map_err(|error| SchemaError::Open { database: database(), source: error.into() })?;
    let found: Found = found.map_err(unsuitable)?;
    let version = if found.has_migrations {
        let newest =
            query("select coalesce(max(version), 0) as version from _sqlx_migrations").fetch_one(&mut *connection);
        newest.await.and_then(|row| row.integer("version")).map_err(failed)?
    } else {
        0
    };
    let known = MIGRATIONS.iter().map(|(version, ..)| *version).max().unwrap_or(0);
    if version > known {
        return Err(SchemaError::Newer { database: database(), found: version, known });
    }
    if version < known
        && let Some(problem) = found.problem_of_change()
    {
        return Err(unsuitable(problem));
    }
    if !found.has_migrations {
        query(APPLIED).execute(&mut *connection).await.map_err(failed)?;
    }
    for (version, name, statements) in MIGRATIONS.into_iter().filter(|(of_it, ..)| *of_it > version) {
        connection.batch(statements).await.map_err(failed)?;
        if version == SAME_BY_FIRST {
            backfill::same_by_first(&mut *connection).await.map_err(failed)?;
        }
        let applied = "insert into _sqlx_migrations (version, description, success, checksum, execution_time) \
                       values ($1, $2, true, '', 0)";
        query(applied).bind(version).bind(name).execute(&mut *connection).await.map_err(failed)?;
    }
    query("commit").execute(connection).await.map(drop).map_err(failed)
}
