//! Calendars: Gregorian, Julian, and those that changed from one to the other.

use std::fmt;
use std::str::FromStr;

use julian::Date;

use super::SiteError;

/// A calendar in which dates are read. Years are counted as astronomers do: the year before 1 is 0. The year begins on
/// 1 January.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Calendar {
    calendar: julian::Calendar,
}

/// Places by which a calendar that changed is named, with the first Gregorian day there as a Julian day number.
const REFORMS: [(&str, i32); 4] =
    // 1582-10-15, 1582-12-20, 1752-09-14 and 1918-02-14.
    [("rome", 2_299_161), ("france", 2_299_227), ("britain", 2_361_222), ("russia", 2_421_639)];

impl Calendar {
    /// The Gregorian calendar, before its time as well.
    pub const GREGORIAN: Self = Self { calendar: julian::Calendar::GREGORIAN };

    /// The Julian calendar.
    pub const JULIAN: Self = Self { calendar: julian::Calendar::JULIAN };

    /// The first day of the Gregorian calendar in Rome, 15 October 1582, as a Julian day number.
    pub const REFORM: i32 = REFORMS[0].1;

    /// What the text of a calendar may be.
    pub const NAMES: &'static str = "gregorian, julian, one that changed as in rome (1582), france (1582), britain \
                                     (1752) or russia (1918), or the first Gregorian day of one, such as 1700-03-01";

    /// A date as it is written: `1250-12-25`.
    ///
    /// # Errors
    ///
    /// When the calendar does not have that date.
    pub fn date(self, text: &str) -> Result<Date, SiteError> {
        self.calendar.parse_date(text).map_err(|error| SiteError::Text {
            field: "date",
            value: text.to_owned(),
            expected: format!("YEAR-MONTH-DAY in the {self} calendar: {error}"),
        })
    }

    /// The date of a day by its Julian day number.
    pub fn date_of(self, day: i32) -> Date {
        self.calendar.at_jdn(day)
    }

    /// A date by its numbers, if the calendar has it.
    pub(super) fn date_by_numbers(self, year: i32, month: u32, day: u32) -> Option<Date> {
        self.calendar.at_ymd(year, julian::Month::try_from(month).ok()?, day).ok()
    }
}

impl FromStr for Calendar {
    type Err = SiteError;

    fn from_str(text: &str) -> Result<Self, SiteError> {
        let unknown =
            || SiteError::Text { field: "calendar", value: text.to_owned(), expected: Self::NAMES.to_owned() };
        let reform = match text {
            "gregorian" => return Ok(Self::GREGORIAN),
            "julian" => return Ok(Self::JULIAN),
            _ => REFORMS.iter().find(|(name, _)| *name == text).map(|(_, day)| *day),
        };
        let written = || Self::GREGORIAN.date(text).ok().map(|date| date.julian_day_number());
        let first = reform.or_else(written).ok_or_else(unknown)?;
        Ok(Self { calendar: julian::Calendar::reforming(first).map_err(|_| unknown())? })
    }
}

impl fmt::Display for Calendar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.calendar.reformation() {
            Some(first) => match REFORMS.iter().find(|(_, day)| *day == first) {
                Some((name, _)) => f.write_str(name),
                None => write!(f, "{}", Self::GREGORIAN.date_of(first)),
            },
            None if *self == Self::JULIAN => f.write_str("julian"),
            None => f.write_str("gregorian"),
        }
    }
}
