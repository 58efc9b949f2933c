//! Columns and rows: from the few types of SQL to ours, and statements about many rows at once.

use std::str::FromStr;

use clerestory_render_core::film::NodeAddress;
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

    /// A text that holds JSON, or null.
    fn optional_json<T: DeserializeOwned>(&self, column: &'static str) -> Result<Option<T>, StoreError> {
        let Some(value) = self.optional_text(column)? else { return Ok(None) };
        serde_json::from_str(&value).map(Some).map_err(|_| StoreError::Corrupt { column, value })
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

/// Rows that one statement is about at most: an engine takes only so many parameters.
pub(super) const MOST_ROWS: usize = 1000;

/// Placeholders for so many rows of so many columns, as `($1, $2), ($3, $4)`; the first has the number after `before`. A statement about many
/// rows costs little more than one about one: most of it is the way to the database and back.
pub(super) fn placeholders(before: usize, rows: usize, columns: usize) -> String {
    let row = |row: usize| {
        let numbers = (1..=columns).map(|column| format!("${}", before + row * columns + column));
        format!("({})", numbers.collect::<Vec<_>>().join(", "))
    };
    (0..rows).map(row).collect::<Vec<_>>().join(", ")
}

/// A statement of any engine, with its parameters.
pub(super) type Query<'q> = sqlx::query::Query<'q, sqlx::Any, sqlx::any::AnyArguments>;

/// Binds frame, tile, level and index of each of some nodes.
pub(super) fn bind_nodes<'q, 'n>(query: Query<'q>, nodes: impl IntoIterator<Item = &'n NodeAddress>) -> Query<'q> {
    let numbers = nodes.into_iter().flat_map(|node| [node.frame, node.tile, node.level, node.index]);
    numbers.fold(query, |query, number| query.bind(i64::from(number)))
}

/// A value as the JSON of a text column.
pub(super) fn to_json(value: &impl Serialize) -> Result<String, StoreError> {
    serde_json::to_string(value).map_err(|error| StoreError::Database(error.to_string()))
}

/// A count as SQL holds it.
pub(super) fn big(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::placeholders;

    #[test]
    fn placeholders_are_numbered_through() {
        assert_eq!(placeholders(0, 2, 3), "($1, $2, $3), ($4, $5, $6)");
        assert_eq!(placeholders(2, 1, 2), "($3, $4)");
    }
}
