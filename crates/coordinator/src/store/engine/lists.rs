//! Statements about many rows.

use clerestory_film::NodeAddress;
use serde::Serialize;

use crate::store::engine::error::StoreError;
use crate::store::engine::row::Row;

/// A database engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum Engine {
    /// SQLite.
    Sqlite,
    /// PostgreSQL.
    Postgres,
}

/// The type of a column of [`rows_of`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum Kind {
    /// 64-bit integers.
    Integer,
    /// Texts.
    Text,
}

/// A query, in brackets, for the rows of a JSON array of arrays that is bound as parameter `$number`; its columns are called `c0`, `c1` and so on.
pub(in crate::store) fn rows_of(engine: Engine, number: usize, columns: &[Kind]) -> String {
    let column = |(index, kind): (usize, &Kind)| match (engine, kind) {
        (Engine::Sqlite, _) => format!("value ->> {index} as c{index}"),
        (Engine::Postgres, Kind::Integer) => format!("(value ->> {index})::bigint as c{index}"),
        (Engine::Postgres, Kind::Text) => format!("value ->> {index} as c{index}"),
    };
    let columns: Vec<String> = columns.iter().enumerate().map(column).collect();
    let columns = columns.join(", ");
    match engine {
        Engine::Sqlite => format!("(select {columns} from json_each(${number}))"),
        Engine::Postgres => format!("(select {columns} from jsonb_array_elements(${number}::jsonb) as listed (value))"),
    }
}

/// An expression for all rows that a query would find, as a JSON array of arrays, in no order; null where PostgreSQL finds none. The query is what stands
/// after `from`.
///
/// It is looked up for each row of the statement that it is part of, by the index that its condition names; a join would read all of a table where
/// PostgreSQL believes that to be small.
pub(in crate::store) fn array_of(engine: Engine, columns: &str, query: &str) -> String {
    match engine {
        Engine::Sqlite => format!("(select json_group_array(json_array({columns})) from {query})"),
        Engine::Postgres => format!("(select json_agg(json_build_array({columns})) from {query})::text"),
    }
}

/// The condition that a row of a table is one of those that the rows of a JSON array find, which is bound as parameter `$number`. Each finds the
/// row that fits to it (`found`, a condition on the table's columns and on `c0` and so on), or none.
///
/// PostgreSQL would look for them in all of the table wherever it believes that to be small; so its rows are found one by one, by the index that `found`
/// names the columns of, and taken from where they lie.
pub(in crate::store) fn looked_up(engine: Engine, table: &str, number: usize, columns: &[Kind], found: &str) -> String {
    looked_up_if(engine, table, number, columns, found, "true")
}

/// The same, of rows that are wanted: a further condition, which is to be no part of how a row is found.
pub(in crate::store) fn looked_up_if(
    engine: Engine,
    table: &str,
    number: usize,
    columns: &[Kind],
    found: &str,
    wanted: &str,
) -> String {
    let listed = rows_of(engine, number, columns);
    let blob_ranges = |blob_range| {
        format!(
            "select (select case when {wanted} then {blob_range} end from {table} where {found}) from {listed} as looked_up"
        )
    };
    match engine {
        Engine::Sqlite => format!("rowid in ({})", blob_ranges("rowid")),
        Engine::Postgres => format!("ctid = any(array({}))", blob_ranges("ctid")),
    }
}

/// The condition that a row of a table is one of the nodes of job `$job` that are bound as parameter `$number`, as [`nodes_json`] writes them.
pub(in crate::store) fn is_of_nodes(engine: Engine, table: &str, job: usize, number: usize) -> String {
    let found = format!("job = ${job} and frame = c0 and tile = c1 and level = c2 and idx = c3");
    looked_up(engine, table, number, &[Kind::Integer; 4], &found)
}

/// Nodes as a statement takes them, and as a lease's row holds them: frame, tile, level and index of each.
pub(in crate::store) fn nodes_json<'n>(nodes: impl IntoIterator<Item = &'n NodeAddress>) -> Result<String, StoreError> {
    let rows = nodes.into_iter().map(|node| [node.frame, node.tile, node.level, node.index]);
    to_json(&rows.collect::<Vec<_>>())
}

/// A value as the JSON of a text column.
pub(in crate::store) fn to_json(value: &impl Serialize) -> Result<String, StoreError> {
    serde_json::to_string(value).map_err(|error| StoreError::Database(error.to_string()))
}

/// A count as SQL holds it.
pub(in crate::store) fn big(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

/// The node of a row.
pub(in crate::store) fn address(row: &Row) -> Result<NodeAddress, StoreError> {
    Ok(NodeAddress {
        frame: row.number("frame")?,
        tile: row.number("tile")?,
        level: row.number("level")?,
        index: row.number("idx")?,
    })
}
