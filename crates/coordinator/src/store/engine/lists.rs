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

/// A subquery for the rows of a JSON array of arrays, bound as parameter `$number`. Its columns are `c0`, `c1` and so
/// on.
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

/// An expression for all rows of a query, as a JSON array of arrays in no order. PostgreSQL answers null when there
/// are none. `query` is the part after `from`.
///
/// The engine looks them up for each row of the surrounding statement, by the index of its condition. A join would
/// scan a table that PostgreSQL believes to be small.
pub(in crate::store) fn array_of(engine: Engine, columns: &str, query: &str) -> String {
    match engine {
        Engine::Sqlite => format!("(select json_group_array(json_array({columns})) from {query})"),
        Engine::Postgres => format!("(select json_agg(json_build_array({columns})) from {query})::text"),
    }
}

/// SQL that joins a table with the rows of a JSON array parameter: a condition on the table. `found` finds the row for
/// one element by the table's columns and `c0`, `c1` and so on.
///
/// PostgreSQL would scan a table that it believes to be small. So each row is looked up by the index on the columns in
/// `found`, and addressed by its position.
pub(in crate::store) fn looked_up(engine: Engine, table: &str, number: usize, columns: &[Kind], found: &str) -> String {
    looked_up_if(engine, table, number, columns, found, "true")
}

/// As [`looked_up`], for those rows that also satisfy `wanted`. The planner may not use that condition to find them.
pub(in crate::store) fn looked_up_if(
    engine: Engine,
    table: &str,
    number: usize,
    columns: &[Kind],
    found: &str,
    wanted: &str,
) -> String {
    let listed = rows_of(engine, number, columns);
    let row_ids = |row_id| {
        format!(
            "select (select case when {wanted} then {row_id} end from {table} where {found}) from {listed} as \
             looked_up"
        )
    };
    match engine {
        Engine::Sqlite => format!("rowid in ({})", row_ids("rowid")),
        Engine::Postgres => format!("ctid = any(array({}))", row_ids("ctid")),
    }
}

/// A condition: the row belongs to job `$job`, and is one of the nodes in parameter `$number`, which [`nodes_json`]
/// writes.
pub(in crate::store) fn is_of_nodes(engine: Engine, table: &str, job: usize, number: usize) -> String {
    let found = format!("job = ${job} and frame = c0 and tile = c1 and level = c2 and idx = c3");
    looked_up(engine, table, number, &[Kind::Integer; 4], &found)
}

/// Nodes as a JSON parameter, and as the row of a lease holds them: frame, tile, level and index of each.
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
