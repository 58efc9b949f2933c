//! Statements, what is bound to them, and their rows, whatever the engine.
//!
//! A statement about many things takes them as one parameter, a JSON array of arrays ([`rows_of`]): its text is the same however many there are, so
//! that engines parse and plan it once, and it costs one way to the database and back. Tables grow from nothing to millions of rows while such a plan is in
//! use: it may not depend on how large they are ([`looked_up`]).

use std::borrow::Cow;
use std::future::Future;

use super::StoreError;
use super::row::Row;

/// What can be bound to a statement, and what columns hold. Absent values know their type: PostgreSQL wants to be told.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// A 64-bit integer.
    Integer(Option<i64>),
    /// A double.
    Float(Option<f64>),
    /// A text.
    Text(Option<String>),
}

impl From<i64> for Value {
    fn from(value: i64) -> Self {
        Self::Integer(Some(value))
    }
}

impl From<Option<i64>> for Value {
    fn from(value: Option<i64>) -> Self {
        Self::Integer(value)
    }
}

impl From<Option<f64>> for Value {
    fn from(value: Option<f64>) -> Self {
        Self::Float(value)
    }
}

impl From<String> for Value {
    fn from(value: String) -> Self {
        Self::Text(Some(value))
    }
}

impl From<&String> for Value {
    fn from(value: &String) -> Self {
        Self::Text(Some(value.clone()))
    }
}

impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Self::Text(Some(value.to_owned()))
    }
}

impl From<Option<String>> for Value {
    fn from(value: Option<String>) -> Self {
        Self::Text(value)
    }
}

impl From<Option<&str>> for Value {
    fn from(value: Option<&str>) -> Self {
        Self::Text(value.map(str::to_owned))
    }
}

/// A database engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Engine {
    /// SQLite.
    Sqlite,
    /// PostgreSQL.
    Postgres,
}

/// The type of a column of [`rows_of`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// 64-bit integers.
    Integer,
    /// Texts.
    Text,
}

/// A query, in brackets, for the rows of a JSON array of arrays that is bound as parameter `$number`; its columns are called `c0`, `c1` and so on.
pub(super) fn rows_of(engine: Engine, number: usize, columns: &[Kind]) -> String {
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
pub(super) fn array_of(engine: Engine, columns: &str, query: &str) -> String {
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
pub(super) fn looked_up(engine: Engine, table: &str, number: usize, columns: &[Kind], found: &str) -> String {
    looked_up_if(engine, table, number, columns, found, "true")
}

/// The same, of rows that are wanted: a further condition, which is to be no part of how a row is found.
pub(super) fn looked_up_if(
    engine: Engine,
    table: &str,
    number: usize,
    columns: &[Kind],
    found: &str,
    wanted: &str,
) -> String {
    let listed = rows_of(engine, number, columns);
    let places = |place| {
        format!(
            "select (select case when {wanted} then {place} end from {table} where {found}) from {listed} as looked_up"
        )
    };
    match engine {
        Engine::Sqlite => format!("rowid in ({})", places("rowid")),
        Engine::Postgres => format!("ctid = any(array({}))", places("ctid")),
    }
}

/// A statement with what is bound to it.
#[derive(Clone, Debug)]
pub(super) struct Query {
    pub(super) statement: Cow<'static, str>,
    pub(super) values: Vec<Value>,
}

/// What a statement has come to.
#[derive(Clone, Debug, Default)]
pub(super) struct Answer {
    /// Its rows.
    pub(super) rows: Vec<Row>,
    /// Rows that it has changed.
    pub(super) affected: u64,
}

/// What statements run on.
pub(super) trait Runner {
    /// Runs one statement.
    fn run(self, query: Query) -> impl Future<Output = Result<Answer, StoreError>> + Send;
}

/// A statement with numbered parameters, `$1` and so on.
pub(super) fn query(statement: impl Into<Cow<'static, str>>) -> Query {
    Query { statement: statement.into(), values: Vec::new() }
}

impl Query {
    /// Binds the next parameter.
    pub(super) fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// All its rows.
    pub(super) async fn fetch_all(self, runner: impl Runner + Send) -> Result<Vec<Row>, StoreError> {
        Ok(runner.run(self).await?.rows)
    }

    /// Its first row, if there is any.
    pub(super) async fn fetch_optional(self, runner: impl Runner + Send) -> Result<Option<Row>, StoreError> {
        Ok(runner.run(self).await?.rows.into_iter().next())
    }

    /// Its first row.
    pub(super) async fn fetch_one(self, runner: impl Runner + Send) -> Result<Row, StoreError> {
        let statement = self.statement.clone();
        let row = self.fetch_optional(runner).await?;
        row.ok_or_else(|| StoreError::Database(format!("no row comes of `{statement}`")))
    }

    /// Runs it, and answers how many rows it has changed.
    pub(super) async fn execute(self, runner: impl Runner + Send) -> Result<u64, StoreError> {
        Ok(runner.run(self).await?.affected)
    }
}
