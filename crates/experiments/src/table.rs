//! Tables, with one definition for JSON, CSV and the page.

use serde::Serialize;
use serde_json::{Map, Value};

use crate::error::ExperimentError;

/// A column of a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    /// Its name, a member of the rows.
    pub(crate) name: &'static str,
    /// What it means, with its unit.
    pub(crate) meaning: &'static str,
}

/// Rows of values under columns.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    /// What files and the page call it.
    pub(crate) name: &'static str,
    /// What it shows.
    pub(crate) caption: String,
    /// Whether the page shows it.
    pub(crate) is_on_page: bool,
    columns: Vec<Column>,
    rows: Vec<Vec<Value>>,
}

/// A column, in short.
pub(crate) const fn column(name: &'static str, meaning: &'static str) -> Column {
    Column { name, meaning }
}

impl Table {
    /// A table of rows that are objects in JSON; what a row lacks is `null`.
    pub(crate) fn new(name: &'static str, caption: String, columns: &[Column], rows: &[impl Serialize]) -> Self {
        let rows = rows.iter().map(|row| {
            let row = serde_json::to_value(row).expect("rows have a form in JSON");
            columns.iter().map(|column| row.get(column.name).cloned().unwrap_or(Value::Null)).collect()
        });
        Self { name, caption, is_on_page: true, columns: columns.to_vec(), rows: rows.collect() }
    }

    /// The same for files alone: too long for a page.
    pub(crate) fn off_page(self) -> Self {
        Self { is_on_page: false, ..self }
    }

    pub(crate) fn columns(&self) -> &[Column] {
        &self.columns
    }

    pub(crate) fn rows(&self) -> &[Vec<Value>] {
        &self.rows
    }

    /// An array of objects.
    pub(crate) fn json(&self) -> Value {
        let object = |row: &Vec<Value>| {
            let members = self.columns.iter().zip(row).map(|(column, value)| (column.name.to_owned(), value.clone()));
            Value::Object(members.collect::<Map<_, _>>())
        };
        Value::Array(self.rows.iter().map(object).collect())
    }

    /// Comma-separated values with a line of names; what is not known is empty.
    pub(crate) fn csv(&self) -> Result<Vec<u8>, ExperimentError> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let written = writer
            .write_record(self.columns.iter().map(|column| column.name))
            .and_then(|()| self.rows.iter().try_for_each(|row| writer.write_record(row.iter().map(plain))));
        written.map_err(|error| ExperimentError::Table(error.into()))?;
        writer.into_inner().map_err(|error| ExperimentError::Table(error.into_error()))
    }
}

/// A value as a person or a spreadsheet reads it, with all of its digits.
fn plain(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// A value for the page: three or four digits.
pub(crate) fn rounded(value: &Value) -> String {
    match value.as_f64() {
        Some(number) if !value.is_u64() && !value.is_i64() => rounded_number(number),
        _ if value.is_null() => "–".to_owned(),
        _ => plain(value),
    }
}

/// A number in four significant digits.
pub(crate) fn rounded_number(number: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    let exponent = number.abs().log10().floor();
    match exponent {
        -3.0..6.0 => format!("{number:.*}", (3.0 - exponent).max(0.0) as usize),
        _ => format!("{number:.3e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Row {
        variant: &'static str,
        mse: f64,
        bias: Option<f64>,
        hidden: u32,
    }

    #[test]
    fn one_table_has_the_same_content_in_json_and_csv() {
        let rows = [
            Row { variant: "sms, M = 4", mse: 0.5, bias: None, hidden: 1 },
            Row { variant: "path", mse: 1e-12, bias: Some(-2.0), hidden: 2 },
        ];
        let columns = [column("variant", "what"), column("mse", "how wrong"), column("bias", "how far off")];
        let table = Table::new("errors", "Errors".to_owned(), &columns, &rows);
        let text = String::from_utf8(table.csv().unwrap()).unwrap();
        assert_eq!(text, "variant,mse,bias\n\"sms, M = 4\",0.5,\npath,1e-12,-2.0\n");
        let json = table.json();
        assert_eq!(json[0], serde_json::json!({ "variant": "sms, M = 4", "mse": 0.5, "bias": null }));
        assert_eq!(json.as_array().unwrap().len(), 2);
    }

    #[test]
    fn numbers_on_the_page_have_few_digits_and_counts_all() {
        let texts = [0.0, 0.012345, 1.23456, 123.456, 12345.6, 1.5e7, -2.5e-6].map(rounded_number);
        assert_eq!(texts, ["0", "0.01235", "1.235", "123.5", "12346", "1.500e7", "-2.500e-6"]);
        assert_eq!(rounded(&serde_json::json!(76832)), "76832");
    }
}
