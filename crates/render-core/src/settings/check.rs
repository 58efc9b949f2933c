//! Checks of single settings: names, counts, ranges and directions.

use std::collections::BTreeSet;
use std::fmt;

use glam::DVec3;

use super::limits::{MAX_LIGHT_COORDINATE, MAX_NAME_BYTES};
use super::{JsonPath, SceneError, Triple};

/// Whether settings make sense.
pub type Check = Result<(), SceneError>;

/// Two directions are parallel when the sine of the angle between them is below this.
pub(crate) const MIN_SINE: f64 = 1e-6;

pub(crate) fn check_name(name: &str, path: &JsonPath<'_>) -> Check {
    if name.is_empty() || name.len() > MAX_NAME_BYTES || name.chars().any(char::is_control) {
        let expected = format!("1 to {MAX_NAME_BYTES} bytes without control characters");
        return Err(SceneError::value(path, Quoted(name), expected));
    }
    Ok(())
}

/// Names of one kind of thing, no two of them alike.
#[derive(Default)]
pub(crate) struct Names<'a>(BTreeSet<&'a str>);

impl<'a> Names<'a> {
    /// Adds the name of the thing at `path`.
    pub(crate) fn add(&mut self, name: &'a str, path: &JsonPath<'_>) -> Check {
        if self.0.insert(name) {
            return Ok(());
        }
        Err(SceneError::value(&path.member("name"), Quoted(name), "a name that no earlier one has"))
    }
}

pub(crate) fn check_count(count: usize, limit: usize, path: &JsonPath<'_>) -> Check {
    if count > limit {
        return Err(SceneError::value(path, format_args!("{count} elements"), format_args!("at most {limit}")));
    }
    Ok(())
}

/// Checks `min <= value <= max`; a number that is not finite is out of every range.
pub(crate) fn check_range<T: PartialOrd + fmt::Debug + fmt::Display + Copy>(
    value: T,
    min: T,
    max: T,
    path: &JsonPath<'_>,
) -> Check {
    if min <= value && value <= max {
        return Ok(());
    }
    Err(SceneError::value(path, Number(value), format_args!("{min} to {max}")))
}

/// Checks `min < value <= max`.
pub(crate) fn check_above(value: f64, min: f64, max: f64, path: &JsonPath<'_>) -> Check {
    if min < value && value <= max {
        return Ok(());
    }
    Err(SceneError::value(path, Number(value), format_args!("more than {min} and at most {max}")))
}

pub(crate) fn check_triple(triple: Triple, min: f64, max: f64, path: &JsonPath<'_>) -> Check {
    (0..).zip(triple).try_for_each(|(index, component)| check_range(component, min, max, &path.element(index)))
}

pub(crate) fn check_pair(pair: [f64; 2], min: f64, max: f64, path: &JsonPath<'_>) -> Check {
    (0..).zip(pair).try_for_each(|(index, component)| check_range(component, min, max, &path.element(index)))
}

/// Checks that a vector has a direction, and returns it.
pub(crate) fn check_direction(vector: Triple, path: &JsonPath<'_>) -> Result<DVec3, SceneError> {
    check_triple(vector, -MAX_LIGHT_COORDINATE, MAX_LIGHT_COORDINATE, path)?;
    let length = DVec3::from(vector).length();
    if length < 1e-9 {
        return Err(SceneError::value(path, Numbers(&vector), "a vector of a length above 0.000000001"));
    }
    Ok(DVec3::from(vector) / length)
}

/// A number as it reads back.
pub(crate) struct Number<T>(pub(crate) T);

impl<T: fmt::Debug> fmt::Display for Number<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:?}", self.0)
    }
}

/// An array of numbers.
pub(crate) struct Numbers<'a>(pub(crate) &'a [f64]);

impl fmt::Display for Numbers<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:?}", self.0)
    }
}

/// A text in quotation marks.
pub(crate) struct Quoted<'a>(pub(crate) &'a str);

impl fmt::Display for Quoted<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "\"{}\"", self.0)
    }
}

/// Checks that a file lies beside the scene file or below it and has one name on every system: the name is also that
/// of an uploaded asset.
pub(crate) fn check_asset_name(name: &str, path: &JsonPath<'_>) -> Check {
    if is_asset_name(name) {
        return Ok(());
    }
    let expected = format!("a path relative to the scene file {ASSET_NAME_RULE}");
    Err(SceneError::value(path, format_args!("\"{name}\""), expected))
}

/// Whether a path names a file beside the file that holds it, or below its folder, on every system.
pub(crate) fn is_asset_name(name: &str) -> bool {
    let is_part = |part: &str| !part.is_empty() && part != "." && part != "..";
    let is_forbidden = |character: char| character.is_control() || matches!(character, '\\' | ':');
    name.len() <= MAX_NAME_BYTES && name.split('/').all(is_part) && !name.chars().any(is_forbidden)
}

/// What [`is_asset_name`] demands, after "a path relative to".
pub(crate) const ASSET_NAME_RULE: &str =
    "of at most 200 bytes, with \"/\" between folders and without \".\", \"..\", \"\\\" and \":\"";
const _: () = assert!(MAX_NAME_BYTES == 200, "as the rule says");

/// Checks that all things of a kind together are not too many.
pub(crate) fn check_budget(count: usize, limit: usize, unit: &str, member: &str) -> Result<(), SceneError> {
    if count <= limit {
        return Ok(());
    }
    let root = JsonPath::Root;
    Err(SceneError::value(&root.member(member), format_args!("{count} {unit}"), format_args!("at most {limit}")))
}
