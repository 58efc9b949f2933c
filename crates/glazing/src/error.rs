//! What can be wrong with a design, and checks that say it.

use std::fmt;
use std::ops::RangeInclusive;

use thiserror::Error;

/// A design that cannot be planned. The path starts at the design, such as `opening.arch.width`.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{path}: found {found}, must be {expected}")]
pub struct GlazingError {
    /// Place of the member in the design.
    pub path: String,
    /// The value there.
    pub found: String,
    /// The values that are possible.
    pub expected: String,
}

/// At most this many characters of a user's text are repeated in a message.
const MAX_QUOTED: usize = 120;

impl GlazingError {
    /// An error at a member, with the value there on one line.
    pub(crate) fn new(path: impl fmt::Display, found: impl fmt::Display, expected: impl fmt::Display) -> Self {
        let mut found = found.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        if let Some((end, _)) = found.char_indices().nth(MAX_QUOTED) {
            found.truncate(end);
            found.push_str("...");
        }
        Self { path: path.to_string(), found, expected: expected.to_string() }
    }
}

/// Refuses a number outside of a range, and NaN.
pub(crate) fn check(
    path: &str,
    member: &str,
    value: f64,
    range: RangeInclusive<f64>,
    unit: &str,
) -> Result<(), GlazingError> {
    if range.contains(&value) {
        return Ok(());
    }
    let (least, most) = (range.start(), range.end());
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    Err(GlazingError::new(join(path, member), value, format!("{least} to {most}{unit}")))
}

/// Refuses a whole number outside of a range.
pub(crate) fn check_count(
    path: &str,
    member: &str,
    value: u32,
    range: RangeInclusive<u32>,
) -> Result<(), GlazingError> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(GlazingError::new(join(path, member), value, format!("{} to {}", range.start(), range.end())))
}

/// The path of a member.
pub(crate) fn join(path: &str, member: &str) -> String {
    if path.is_empty() { member.to_owned() } else { format!("{path}.{member}") }
}
