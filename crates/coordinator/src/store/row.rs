//! Columns and rows: from the few types of SQL to ours, and back.

use std::str::FromStr;
use std::sync::Arc;

use clerestory_film::NodeAddress;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::StoreError;
use super::sql::{Engine, Kind, Value, looked_up};

/// A row, whose columns have names.
#[derive(Clone, Debug)]
pub(super) struct Row {
    names: Arc<[String]>,
    values: Vec<Value>,
}

impl Row {
    /// A row with these columns.
    pub(super) fn new(names: Arc<[String]>, values: Vec<Value>) -> Self {
        Self { names, values }
    }

    /// The value of a column.
    fn value(&self, column: &'static str) -> Result<&Value, StoreError> {
        let position = self.names.iter().position(|name| name == column);
        let value = position.and_then(|position| self.values.get(position));
        value.ok_or_else(|| StoreError::Database(format!("there is no column `{column}` in the answer")))
    }

    /// A text.
    pub(super) fn text(&self, column: &'static str) -> Result<String, StoreError> {
        self.optional_text(column)?.ok_or_else(|| null(column))
    }

    /// A text that may be null.
    pub(super) fn optional_text(&self, column: &'static str) -> Result<Option<String>, StoreError> {
        match self.value(column)? {
            Value::Text(text) => Ok(text.clone()),
            Value::Integer(None) | Value::Float(None) => Ok(None),
            other => Err(unexpected(column, other)),
        }
    }

    /// A 64-bit integer.
    pub(super) fn integer(&self, column: &'static str) -> Result<i64, StoreError> {
        self.optional_integer(column)?.ok_or_else(|| null(column))
    }

    /// A 64-bit integer that may be null.
    pub(super) fn optional_integer(&self, column: &'static str) -> Result<Option<i64>, StoreError> {
        match self.value(column)? {
            Value::Integer(integer) => Ok(*integer),
            Value::Text(None) | Value::Float(None) => Ok(None),
            other => Err(unexpected(column, other)),
        }
    }

    /// A float that may be null.
    pub(super) fn optional_float(&self, column: &'static str) -> Result<Option<f64>, StoreError> {
        match self.value(column)? {
            Value::Float(float) => Ok(*float),
            Value::Text(None) | Value::Integer(None) => Ok(None),
            other => Err(unexpected(column, other)),
        }
    }

    /// An integer that fits into `T`.
    pub(super) fn number<T: TryFrom<i64>>(&self, column: &'static str) -> Result<T, StoreError> {
        let value = self.integer(column)?;
        T::try_from(value).map_err(|_| StoreError::Corrupt { column, value: value.to_string() })
    }

    /// A text that spells a `T`.
    pub(super) fn parsed<T: FromStr>(&self, column: &'static str) -> Result<T, StoreError> {
        parse(column, &self.text(column)?)
    }

    /// A text that spells a `T`, or null.
    pub(super) fn optional_parsed<T: FromStr>(&self, column: &'static str) -> Result<Option<T>, StoreError> {
        self.optional_text(column)?.map(|text| parse(column, &text)).transpose()
    }

    /// A text that holds JSON.
    pub(super) fn json<T: DeserializeOwned>(&self, column: &'static str) -> Result<T, StoreError> {
        self.optional_json(column)?.ok_or_else(|| null(column))
    }

    /// A text that holds JSON, or null.
    pub(super) fn optional_json<T: DeserializeOwned>(&self, column: &'static str) -> Result<Option<T>, StoreError> {
        let Some(value) = self.optional_text(column)? else { return Ok(None) };
        serde_json::from_str(&value).map(Some).map_err(|_| StoreError::Corrupt { column, value })
    }

    /// A word of an enumeration, spelled as on the wire.
    pub(super) fn word<T: DeserializeOwned>(&self, column: &'static str) -> Result<T, StoreError> {
        read_word(column, self.text(column)?)
    }

    /// A word of an enumeration, or null.
    pub(super) fn optional_word<T: DeserializeOwned>(&self, column: &'static str) -> Result<Option<T>, StoreError> {
        self.optional_text(column)?.map(|text| read_word(column, text)).transpose()
    }
}

fn null(column: &'static str) -> StoreError {
    StoreError::Corrupt { column, value: "null".to_owned() }
}

fn unexpected(column: &'static str, value: &Value) -> StoreError {
    StoreError::Corrupt { column, value: format!("{value:?}") }
}

fn read_word<T: DeserializeOwned>(column: &'static str, value: String) -> Result<T, StoreError> {
    serde_json::from_value(serde_json::Value::String(value.clone())).map_err(|_| StoreError::Corrupt { column, value })
}

fn parse<T: FromStr>(column: &'static str, text: &str) -> Result<T, StoreError> {
    text.parse().map_err(|_| StoreError::Corrupt { column, value: text.to_owned() })
}

/// The condition that a row of a table is one of the nodes of job `$job` that are bound as parameter `$number`, as [`nodes_json`] writes them.
pub(super) fn is_of_nodes(engine: Engine, table: &str, job: usize, number: usize) -> String {
    let found = format!("job = ${job} and frame = c0 and tile = c1 and level = c2 and idx = c3");
    looked_up(engine, table, number, &[Kind::Integer; 4], &found)
}

/// Nodes as a statement takes them, and as a lease's row holds them: frame, tile, level and index of each.
pub(super) fn nodes_json<'n>(nodes: impl IntoIterator<Item = &'n NodeAddress>) -> Result<String, StoreError> {
    let rows = nodes.into_iter().map(|node| [node.frame, node.tile, node.level, node.index]);
    to_json(&rows.collect::<Vec<_>>())
}

/// A value as the JSON of a text column.
pub(super) fn to_json(value: &impl Serialize) -> Result<String, StoreError> {
    serde_json::to_string(value).map_err(|error| StoreError::Database(error.to_string()))
}

/// A count as SQL holds it.
pub(super) fn big(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}
