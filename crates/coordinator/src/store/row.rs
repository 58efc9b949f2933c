//! Reading columns: from the few types of SQL to ours.

use std::str::FromStr;

use serde::Serialize;
use serde::de::DeserializeOwned;
use sqlx::Row;
use sqlx::any::AnyRow;

use super::StoreError;

/// Reads typed columns of a row.
pub(super) trait Columns {
    /// A text.
    fn text(&self, column: &'static str) -> Result<String, StoreError>;
    /// A text that may be null.
    fn optional_text(&self, column: &'static str) -> Result<Option<String>, StoreError>;
    /// A 64-bit integer.
    fn integer(&self, column: &'static str) -> Result<i64, StoreError>;
    /// A 64-bit integer that may be null.
    fn optional_integer(&self, column: &'static str) -> Result<Option<i64>, StoreError>;
    /// A float that may be null.
    fn optional_float(&self, column: &'static str) -> Result<Option<f64>, StoreError>;

    /// An integer that fits into `T`.
    fn number<T: TryFrom<i64>>(&self, column: &'static str) -> Result<T, StoreError> {
        let value = self.integer(column)?;
        T::try_from(value).map_err(|_| StoreError::Corrupt { column, value: value.to_string() })
    }

    /// A text that spells a `T`.
    fn parsed<T: FromStr>(&self, column: &'static str) -> Result<T, StoreError> {
        parse(column, &self.text(column)?)
    }

    /// A text that spells a `T`, or null.
    fn optional_parsed<T: FromStr>(&self, column: &'static str) -> Result<Option<T>, StoreError> {
        self.optional_text(column)?.map(|text| parse(column, &text)).transpose()
    }

    /// A text that holds JSON.
    fn json<T: DeserializeOwned>(&self, column: &'static str) -> Result<T, StoreError> {
        let value = self.text(column)?;
        serde_json::from_str(&value).map_err(|_| StoreError::Corrupt { column, value })
    }

    /// A word of an enumeration, spelled as on the wire.
    fn word<T: DeserializeOwned>(&self, column: &'static str) -> Result<T, StoreError> {
        read_word(column, self.text(column)?)
    }

    /// A word of an enumeration, or null.
    fn optional_word<T: DeserializeOwned>(&self, column: &'static str) -> Result<Option<T>, StoreError> {
        self.optional_text(column)?.map(|text| read_word(column, text)).transpose()
    }
}

fn read_word<T: DeserializeOwned>(column: &'static str, value: String) -> Result<T, StoreError> {
    serde_json::from_value(serde_json::Value::String(value.clone())).map_err(|_| StoreError::Corrupt { column, value })
}

fn parse<T: FromStr>(column: &'static str, text: &str) -> Result<T, StoreError> {
    text.parse().map_err(|_| StoreError::Corrupt { column, value: text.to_owned() })
}

impl Columns for AnyRow {
    fn text(&self, column: &'static str) -> Result<String, StoreError> {
        Ok(self.try_get(column)?)
    }

    fn optional_text(&self, column: &'static str) -> Result<Option<String>, StoreError> {
        Ok(self.try_get(column)?)
    }

    fn integer(&self, column: &'static str) -> Result<i64, StoreError> {
        Ok(self.try_get(column)?)
    }

    fn optional_integer(&self, column: &'static str) -> Result<Option<i64>, StoreError> {
        Ok(self.try_get(column)?)
    }

    fn optional_float(&self, column: &'static str) -> Result<Option<f64>, StoreError> {
        Ok(self.try_get(column)?)
    }
}

/// A value as the JSON of a text column.
pub(super) fn to_json(value: &impl Serialize) -> Result<String, StoreError> {
    serde_json::to_string(value).map_err(|error| StoreError::Database(error.to_string()))
}

/// A count as SQL holds it.
pub(super) fn big(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}
