//! A moment as sources have it: a date or a feast, and an hour.

use std::fmt;

use julian::Date;

use super::kind_of_time::{rise, set};
use super::{Calendar, Day, HourReading, KindOfTime, NamedHour, Place, SiteError, UniversalTime, feast};

/// A moment as sources have it: `1250-12-25T08:30`, `1250-christmas terce`, `2003-10-17T12:30:30-07:00`.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    date: Date,
    is_calendar_given: bool,
    hour: Hour,
}

/// The hour of a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hour {
    /// Hours, 0 to 24, of a kind of time.
    Clock(f64, KindOfTime),
    Named(NamedHour, HourReading),
}

/// What a reader of a moment should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remark {
    /// No calendar is given, and at that time the Julian calendar was in use.
    NoCalendar {
        /// The date as it is read.
        read: Date,
        /// The same day in the Julian calendar.
        julian: Date,
    },
    /// Many sources of that time begin the year in March.
    BeginningOfYear {
        /// The year as it is read.
        year: i32,
    },
    /// Clocks did not show universal time or that of a zone.
    BeforeZones {
        /// The year.
        year: i32,
    },
}

/// The first year in which clocks showed the time of zones.
const FIRST_ZONES: i32 = 1880;

/// The last year that began in March: 1751 in England.
const LAST_YEAR_FROM_MARCH: i32 = 1752;

impl Moment {
    /// Reads a moment: a date (`1250-12-25`) or a feast (`1250-easter`), then `T` or a space, then an hour. That is a
    /// name (`terce`) or a time of day (`08:30`) with a zone (`Z`, `+01:00`) or of the given kind. Without a calendar,
    /// dates are Gregorian. Without a reading, a named hour is over.
    ///
    /// # Errors
    ///
    /// When the text is no moment, or two kinds of time or none are given.
    pub fn parse(
        text: &str,
        calendar: Option<Calendar>,
        kind: Option<KindOfTime>,
        reading: HourReading,
    ) -> Result<Self, SiteError> {
        let (date, hour) = text.split_once(['T', ' ']).ok_or_else(|| SiteError::Text {
            field: "moment",
            value: text.to_owned(),
            expected: "a date, T, and an hour, such as 1250-12-25T08:30 or 1250-christmasTterce".to_owned(),
        })?;
        let hour = match hour.starts_with(|first: char| first.is_ascii_alphabetic()) {
            true => Hour::Named(hour.parse()?, reading),
            false => clock(hour, kind)?,
        };
        let is_calendar_given = calendar.is_some();
        Ok(Self { date: date_or_feast(date, calendar.unwrap_or(Calendar::GREGORIAN))?, is_calendar_given, hour })
    }

    /// The date as it was given.
    pub fn date(&self) -> Date {
        self.date
    }

    /// When it is at a place.
    ///
    /// # Errors
    ///
    /// When the hour is counted from a sunrise or sunset that is not there, or the astronomy does not reach so far.
    pub fn universal(&self, place: &Place) -> Result<UniversalTime, SiteError> {
        match self.hour {
            Hour::Clock(hours, kind) => kind.universal(place, self.date, hours),
            Hour::Named(NamedHour::Seasonal(number), reading) => {
                KindOfTime::Seasonal.universal(place, self.date, reading.twelfths(number))
            }
            Hour::Named(NamedHour::Sunrise, _) => rise(place, self.date, 0),
            Hour::Named(NamedHour::Noon, _) => Ok(Day::of(place, self.date.julian_day_number())?.noon),
            Hour::Named(NamedHour::Sunset, _) => set(place, self.date, 0),
        }
    }

    /// What a reader should know of the date and the kind of time.
    pub fn remarks(&self) -> Vec<Remark> {
        let (date, day) = (self.date, self.date.julian_day_number());
        let is_early = (date.month().number(), date.day()) < (3, 25);
        let no_calendar = (!self.is_calendar_given && day < Calendar::REFORM)
            .then(|| Remark::NoCalendar { read: date, julian: Calendar::JULIAN.date_of(day) });
        let beginning = (date.is_julian() && is_early && date.year() <= LAST_YEAR_FROM_MARCH)
            .then(|| Remark::BeginningOfYear { year: date.year() });
        let is_of_a_zone = matches!(self.hour, Hour::Clock(_, KindOfTime::Zone(_)));
        let zones = (is_of_a_zone && date.year() < FIRST_ZONES).then(|| Remark::BeforeZones { year: date.year() });
        [no_calendar, beginning, zones].into_iter().flatten().collect()
    }
}

/// A date or a feast, which is a year and a name: `1250-palm-sunday`.
fn date_or_feast(text: &str, calendar: Calendar) -> Result<Date, SiteError> {
    let Some(name) = text.find(|character: char| character.is_ascii_alphabetic()) else { return calendar.date(text) };
    let year = text[..name].strip_suffix('-').and_then(|year| year.parse().ok());
    let year = year.ok_or_else(|| SiteError::Text {
        field: "date",
        value: text.to_owned(),
        expected: "YEAR-MONTH-DAY, or YEAR-FEAST such as 1250-christmas".to_owned(),
    })?;
    feast::date(year, &text[name..], calendar)
}

/// A time of day with the zone behind it, or of the given kind.
fn clock(text: &str, kind: Option<KindOfTime>) -> Result<Hour, SiteError> {
    let zone_at = text.find(['Z', '+', '-']).unwrap_or(text.len());
    let (time, zone) = text.split_at(zone_at);
    let bad_time = || SiteError::Text {
        field: "hour",
        value: text.to_owned(),
        expected: "HH:MM or HH:MM:SS, 00:00 to 24:00".to_owned(),
    };
    let hours = time_of_day(time).ok_or_else(bad_time)?;
    let kind = match (zone, kind) {
        ("", Some(kind)) => kind,
        ("", None) => return Err(SiteError::NoKind { hour: text.to_owned(), kinds: KindOfTime::NAMES }),
        (zone, Some(kind)) => return Err(SiteError::TwoKinds { found: kind.to_string(), zone: zone.to_owned() }),
        (zone, None) => KindOfTime::Zone(minutes_ahead(zone).ok_or_else(|| SiteError::Text {
            field: "zone",
            value: zone.to_owned(),
            expected: "Z, or +HH:MM or -HH:MM up to 15 hours".to_owned(),
        })?),
    };
    Ok(Hour::Clock(hours, kind))
}

/// Hours of `08:30` or `08:30:12.5`.
fn time_of_day(text: &str) -> Option<f64> {
    let mut parts = text.split(':');
    let (hour, minute) = (whole(parts.next()?)?, whole(parts.next()?)?);
    let second = parts.next().map_or(Some(0.0), seconds)?;
    let hours = f64::from(hour) + f64::from(minute) / 60.0 + second / 3600.0;
    (parts.next().is_none() && minute < 60 && second < 60.0 && hours <= 24.0).then_some(hours)
}

/// Two digits.
fn whole(text: &str) -> Option<u32> {
    let is_right = text.len() == 2 && text.bytes().all(|byte| byte.is_ascii_digit());
    if is_right { text.parse().ok() } else { None }
}

/// Two digits, with or without a fraction.
fn seconds(text: &str) -> Option<f64> {
    let (number, fraction) = text.split_once('.').unwrap_or((text, "0"));
    let is_right = !fraction.is_empty() && fraction.bytes().all(|byte| byte.is_ascii_digit());
    whole(number).filter(|_| is_right)?;
    text.parse().ok()
}

/// Minutes by which a zone is ahead of universal time.
fn minutes_ahead(zone: &str) -> Option<i32> {
    if zone == "Z" {
        return Some(0);
    }
    let sign = if zone.starts_with('-') { -1 } else { 1 };
    let (hours, minutes) = match zone.get(1..)?.split_once(':') {
        Some((hours, minutes)) => (whole(hours)?, whole(minutes)?),
        None => (whole(zone.get(1..)?)?, 0),
    };
    let size = (60 * hours + minutes) as i32;
    (minutes < 60 && size <= 15 * 60).then_some(sign * size)
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoCalendar { read, julian } => write!(
                f,
                "no calendar is given, so {read} is a date of the Gregorian calendar; in the Julian calendar, which \
                 was in use then, that day is {julian}"
            ),
            Self::BeginningOfYear { year } => write!(
                f,
                "the year {year} begins on 1 January here; a source that begins it on 25 March or at Easter calls this \
                 day one of {}",
                year - 1
            ),
            Self::BeforeZones { year } => {
                write!(f, "clocks of the year {year} did not show universal time or that of a zone")
            }
        }
    }
}
