//! Parsers of whole numbers for options.

use std::fmt::Display;
use std::num::NonZeroU32;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Returns a parser of whole numbers within a range.
pub(crate) fn whole<T>(range: RangeInclusive<T>) -> impl Fn(&str) -> Result<T, String> + Clone
where
    T: FromStr + PartialOrd + Display + Clone,
{
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("expected a whole number, {} to {}", range.start(), range.end()))
    }
}

/// Parses a positive whole number.
pub(crate) fn positive(text: &str) -> Result<NonZeroU32, String> {
    text.parse().map_err(|_| format!("expected a whole number, 1 to {}", u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_positive_number_is_whole_and_not_zero() {
        assert_eq!(positive("7"), Ok(NonZeroU32::new(7).unwrap()));
        for text in ["0", "-1", "1.5", "4294967296", "many", ""] {
            let message = positive(text).unwrap_err();
            assert_eq!(message, "expected a whole number, 1 to 4294967295", "{text}");
        }
    }

    #[test]
    fn a_whole_number_is_within_its_range() {
        let priority = whole(-2..=2_i32);
        assert_eq!((priority("-2"), priority("2")), (Ok(-2), Ok(2)));
        for text in ["3", "-3", "1.5", "high", ""] {
            assert_eq!(priority(text).unwrap_err(), "expected a whole number, -2 to 2", "{text}");
        }
    }
}
