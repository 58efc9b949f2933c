//! Rows: from the few types of SQL to ours.

use std::str::FromStr;
use std::sync::Arc;

use serde::de::DeserializeOwned;

use crate::store::engine::error::StoreError;
use crate::store::engine::value::Value;

/// A row, whose columns have names.
#[derive(Clone, Debug)]
pub(in crate::store) struct Row {
    names: Arc<[String]>,
    values: Vec<Value>,
}

impl Row {
    /// A row with these columns.
    pub(in crate::store) fn new(names: Arc<[String]>, values: Vec<Value>) -> Self {
        Self { names, values }
    }

    /// The value of a column.
    fn value(&self, column: &'static str) -> Result<&Value, StoreError> {
        let position = self.names.iter().position(|name| name == column);
        let value = position.and_then(|position| self.values.get(position));
        value.ok_or_else(|| StoreError::Database(format!("there is no column `{column}` in the answer")))
    }

    /// A text.
    pub(in crate::store) fn text(&self, column: &'static str) -> Result<String, StoreError> {
        self.optional_text(column)?.ok_or_else(|| null(column))
    }

    /// A text that may be null.
    pub(in crate::store) fn optional_text(&self, column: &'static str) -> Result<Option<String>, StoreError> {
        match self.value(column)? {
            Value::Text(text) => Ok(text.clone()),
            Value::Integer(None) | Value::Float(None) => Ok(None),
            other => Err(unexpected(column, other)),
        }
    }

    /// A 64-bit integer.
    pub(in crate::store) fn integer(&self, column: &'static str) -> Result<i64, StoreError> {
        self.optional_integer(column)?.ok_or_else(|| null(column))
    }

    /// A 64-bit integer that may be null.
    pub(in crate::store) fn optional_integer(&self, column: &'static str) -> Result<Option<i64>, StoreError> {
        match self.value(column)? {
            Value::Integer(integer) => Ok(*integer),
            Value::Text(None) | Value::Float(None) => Ok(None),
            other => Err(unexpected(column, other)),
        }
    }

    /// A float that may be null.
    pub(in crate::store) fn optional_float(&self, column: &'static str) -> Result<Option<f64>, StoreError> {
        match self.value(column)? {
            Value::Float(float) => Ok(*float),
            Value::Text(None) | Value::Integer(None) => Ok(None),
            other => Err(unexpected(column, other)),
        }
    }

    /// An integer that fits into `T`.
    pub(in crate::store) fn number<T: TryFrom<i64>>(&self, column: &'static str) -> Result<T, StoreError> {
        let value = self.integer(column)?;
        T::try_from(value).map_err(|_| StoreError::Corrupt { column, value: value.to_string() })
    }

    /// A text that spells a `T`.
    pub(in crate::store) fn parsed<T: FromStr>(&self, column: &'static str) -> Result<T, StoreError> {
        parse(column, &self.text(column)?)
    }

    /// A text that spells a `T`, or null.
    pub(in crate::store) fn optional_parsed<T: FromStr>(&self, column: &'static str) -> Result<Option<T>, StoreError> {
        self.optional_text(column)?.map(|text| parse(column, &text)).transpose()
    }

    /// A text that holds JSON.
    pub(in crate::store) fn json<T: DeserializeOwned>(&self, column: &'static str) -> Result<T, StoreError> {
        self.optional_json(column)?.ok_or_else(|| null(column))
    }

    /// A text that holds JSON, or null.
    pub(in crate::store) fn optional_json<T: DeserializeOwned>(
        &self,
        column: &'static str,
    ) -> Result<Option<T>, StoreError> {
        let Some(value) = self.optional_text(column)? else { return Ok(None) };
        serde_json::from_str(&value).map(Some).map_err(|_| StoreError::Corrupt { column, value })
    }

    /// A word of an enumeration, spelled as on the wire.
    pub(in crate::store) fn word<T: DeserializeOwned>(&self, column: &'static str) -> Result<T, StoreError> {
        read_word(column, self.text(column)?)
    }

    /// A word of an enumeration, or null.
    pub(in crate::store) fn optional_word<T: DeserializeOwned>(
        &self,
        column: &'static str,
    ) -> Result<Option<T>, StoreError> {
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
