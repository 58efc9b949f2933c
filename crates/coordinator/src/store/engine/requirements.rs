//! Requirements: what a database must be for a farm. They are checked at the start, so that one sentence can say what
//! is wrong.

use std::collections::BTreeSet;

use crate::store::engine::error::StoreError;
use crate::store::engine::lists::Engine;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;

/// Oldest supported PostgreSQL, in the server's own numbering.
const OLDEST_VERSION: i64 = 150_000;

/// An encoding that holds every name.
const ENCODING: &str = "UTF8";

/// The table of applied migrations.
const MIGRATIONS_TABLE: &str = "_sqlx_migrations";

/// A PostgreSQL server and a role, as the server describes them.
#[derive(Clone, Debug)]
struct Server {
    version: i64,
    /// As people know it.
    version_name: String,
    encoding: String,
    role: String,
    /// Where tables are made; none when the role may use no schema of its search path.
    schema: Option<String>,
    may_create: bool,
}

impl Server {
    /// Why no farm can use it.
    fn problem(&self) -> Option<String> {
        let Self { version_name, encoding, role, .. } = self;
        if self.version < OLDEST_VERSION {
            let oldest = OLDEST_VERSION / 10_000;
            return Some(format!("its server is PostgreSQL {version_name}: expected version {oldest} or newer"));
        }
        if encoding != ENCODING {
            return Some(format!(
                "its encoding is {encoding}, which does not hold every name: expected {ENCODING}; make one with \
                 `create database NAME encoding '{ENCODING}' template template0`"
            ));
        }
        self.schema.is_none().then(|| {
            format!(
                "the role `{role}` may use no schema of its search path: run `grant usage, create on schema \
                     public to {role}`"
            )
        })
    }

    /// Why the role cannot change its schema.
    fn problem_of_change(&self) -> Option<String> {
        let (role, schema) = (&self.role, self.schema.as_deref().unwrap_or("public"));
        (!self.may_create).then(|| {
            format!(
                "the role `{role}` may not create tables in the schema `{schema}`: run `grant create on schema \
                 {schema} to {role}`"
            )
        })
    }
}

/// The state of a database before any change.
#[derive(Debug)]
pub(in crate::store) struct Found {
    server: Option<Server>,
    /// Whether it has the table of applied migrations.
    pub(in crate::store) has_migrations: bool,
}

impl Found {
    /// Why its schema cannot be changed.
    pub(in crate::store) fn problem_of_change(&self) -> Option<String> {
        self.server.as_ref().and_then(Server::problem_of_change)
    }
}

/// Inspects a database. The inner error says why a farm cannot use it, and what would be right.
pub(in crate::store) async fn inspect(connection: &mut Connection) -> Result<Result<Found, String>, StoreError> {
    let server = match connection.engine() {
        Engine::Sqlite => None,
        Engine::Postgres => Some(server(connection).await?),
    };
    if let Some(problem) = server.as_ref().and_then(Server::problem) {
        return Ok(Err(problem));
    }
    let tables = tables(connection).await?;
    let has_migrations = tables.contains(MIGRATIONS_TABLE);
    if !has_migrations && let Some(table) = tables.first() {
        return Ok(Err(format!("it is not empty and not of a farm: it has a table `{table}`; use an empty database")));
    }
    if has_migrations {
        let first = "select 1 as is_ours from _sqlx_migrations where version = 1 and description = 'first'";
        if query(first).fetch_optional(&mut *connection).await?.is_none() {
            let problem = format!(
                "it is another program's: its table `{MIGRATIONS_TABLE}` is not of a farm; use an empty database"
            );
            return Ok(Err(problem));
        }
    }
    Ok(Ok(Found { server, has_migrations }))
}

async fn server(connection: &mut Connection) -> Result<Server, StoreError> {
    let row = query(
        "select cast(current_setting('server_version_num') as bigint) as version, \
         current_setting('server_version') as version_name, current_setting('server_encoding') as encoding, \
         cast(current_user as text) as role, cast(current_schema() as text) as schema, \
         coalesce(has_schema_privilege(current_schema(), 'create'), false) as may_create",
    );
    let row = row.fetch_one(connection).await?;
    Ok(Server {
        version: row.integer("version")?,
        version_name: row.text("version_name")?,
        encoding: row.text("encoding")?,
        role: row.text("role")?,
        schema: row.optional_text("schema")?,
        may_create: row.integer("may_create")? != 0,
    })
}

/// The tables in the schema of a farm, without those of PostgreSQL extensions.
async fn tables(connection: &mut Connection) -> Result<BTreeSet<String>, StoreError> {
    let rows = query(match connection.engine() {
        Engine::Sqlite => "select name from sqlite_master where type in ('table', 'view') and name not like 'sqlite_%'",
        Engine::Postgres => {
            "select cast(relname as text) as name from pg_class \
             join pg_namespace on pg_namespace.oid = relnamespace and nspname = current_schema() \
             where relkind in ('r', 'p', 'v', 'm', 'f') and not exists (select 1 from pg_depend \
             where classid = cast('pg_class' as regclass) and objid = pg_class.oid and deptype = 'e')"
        }
    });
    rows.fetch_all(connection).await?.iter().map(|row| row.text("name")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_with_a_server_is_said_with_what_would_be_right() {
        let good = Server {
            version: 150_004,
            version_name: "15.4".to_owned(),
            encoding: "UTF8".to_owned(),
            role: "glazier".to_owned(),
            schema: Some("public".to_owned()),
            may_create: true,
        };
        assert_eq!((good.problem(), good.problem_of_change()), (None, None));
        let old = Server { version: 140_011, version_name: "14.11".to_owned(), ..good.clone() };
        assert_eq!(old.problem().unwrap(), "its server is PostgreSQL 14.11: expected version 15 or newer");
        for encoding in ["SQL_ASCII", "LATIN1"] {
            let problem = Server { encoding: encoding.to_owned(), ..good.clone() }.problem().unwrap();
            assert!(problem.contains(encoding) && problem.contains("expected UTF8"), "{problem}");
        }
        let unusable = Server { schema: None, ..good.clone() }.problem().unwrap();
        assert!(unusable.contains("grant usage, create on schema public to glazier"), "{unusable}");
        let denied = Server { may_create: false, ..good }.problem_of_change().unwrap();
        assert!(denied.contains("grant create on schema public to glazier"), "{denied}");
    }
}
