//! Results on standard output.

use std::io::{self, Write};

use serde::Serialize;

use crate::failure::Failure;
use crate::text::{printable_json, printable_lines};

/// Writes a line to standard output.
pub(crate) fn print_line(line: &str) -> Result<(), Failure> {
    write_line(&printable_lines(line))
}

/// Writes a value to standard output as one line of JSON.
pub(crate) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let json = serde_json::to_string(value).expect("what commands print has a form in JSON");
    write_line(&printable_json(&json))
}

fn write_line(line: &str) -> Result<(), Failure> {
    writeln!(io::stdout().lock(), "{line}").map_err(Failure::Output)
}
