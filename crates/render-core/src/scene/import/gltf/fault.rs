//! Faults of a glTF file, each with its place in the JSON of the file.

use std::fmt;
use std::ops::RangeInclusive;

use crate::settings::AssetProblem;

/// What is wrong at a place, such as `accessors[3].count`.
pub(super) fn fault(place: impl fmt::Display, message: impl fmt::Display) -> AssetProblem {
    AssetProblem::malformed(format_args!("is not a readable glTF file: {place}: {message}"))
}

/// Element `index` of the member `name` of the file, which `place` refers to.
pub(super) fn lookup<'d, T>(
    list: &'d [T],
    index: usize,
    name: &str,
    place: impl fmt::Display,
) -> Result<&'d T, AssetProblem> {
    list.get(index).ok_or_else(|| no_element(index, list.len(), name, place))
}

/// That a reference names none of the `length` elements of a list.
pub(super) fn no_element(index: usize, length: usize, name: &str, place: impl fmt::Display) -> AssetProblem {
    let message = match length {
        0 => format!("names {name}[{index}], but the file has no {name}"),
        _ => format!("names {name}[{index}], must be below {length}, the number of {name}"),
    };
    fault(place, message)
}

/// Checks that a number is in a range. A number that is not finite is in none.
pub(super) fn check_range(
    place: impl fmt::Display,
    number: f64,
    range: RangeInclusive<f64>,
) -> Result<f64, AssetProblem> {
    if range.contains(&number) && number.is_finite() {
        return Ok(number);
    }
    let [least, most] = [*range.start(), *range.end()];
    let expected = match (least == f64::MIN_POSITIVE, most == f64::INFINITY) {
        (true, true) => "more than 0".to_owned(),
        (true, false) => format!("more than 0 and at most {most}"),
        (false, true) => format!("at least {least}"),
        (false, false) => format!("{least} to {most}"),
    };
    Err(fault(place, format_args!("found {number:?}, must be {expected}")))
}

/// Checks each component of a vector as [`check_range`] checks a number.
pub(super) fn check_ranges<const N: usize>(
    place: &str,
    numbers: [f64; N],
    range: RangeInclusive<f64>,
) -> Result<[f64; N], AssetProblem> {
    for (index, number) in numbers.into_iter().enumerate() {
        check_range(format_args!("{place}[{index}]"), number, range.clone())?;
    }
    Ok(numbers)
}
