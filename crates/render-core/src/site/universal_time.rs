//! Universal time, and what a clock shows that is ahead of it.

use std::fmt;

use julian::Date;
use solar_positioning::delta_t;
use solar_positioning::time::JulianDate;

use super::{Calendar, SiteError};

/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// Julian date of the noon that begins the year 2000.
const J2000: f64 = 2_451_545.0;

/// Days of a Julian year.
const YEAR: f64 = 365.25;

/// A point in universal time (UT1, of which UTC differs by less than a second), as a Julian date.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct UniversalTime {
    julian_date: f64,
}

impl UniversalTime {
    /// By its Julian date: days since noon on 1 January 4713 BC, which resolve 40 microseconds.
    ///
    /// # Errors
    ///
    /// When the year is not -500 to 3000, for which the rotation of the earth is known.
    pub fn new(julian_date: f64) -> Result<Self, SiteError> {
        let year = decimal_year(julian_date);
        if (-499.0..3000.0).contains(&year) {
            return Ok(Self { julian_date });
        }
        Err(SiteError::Year(year as i64))
    }

    /// A time of day, hours, on a day by its Julian day number. The clock is `ahead` of universal time, in days.
    ///
    /// # Errors
    ///
    /// When the year is not -500 to 3000.
    pub fn at(day: i32, hours: f64, ahead: f64) -> Result<Self, SiteError> {
        Self::new(f64::from(day) - 0.5 + hours / 24.0 - ahead)
    }

    /// Days since noon on 1 January 4713 BC.
    pub fn julian_date(self) -> f64 {
        self.julian_date
    }

    /// Later by a number of days.
    ///
    /// # Errors
    ///
    /// When the year is not -500 to 3000.
    pub fn later(self, days: f64) -> Result<Self, SiteError> {
        Self::new(self.julian_date + days)
    }

    /// Terrestrial time less universal time, s (Espenak and Meeus 2006, with later fits from 2015 on).
    ///
    /// # Errors
    ///
    /// When the astronomy does not reach so far.
    pub fn delta_t(self) -> Result<f64, SiteError> {
        Ok(delta_t::estimate(decimal_year(self.julian_date))?)
    }

    /// Date and time on a clock that is `ahead` of universal time, in days, to the second.
    pub fn civil(self, calendar: Calendar, ahead: f64) -> Civil {
        let seconds = ((self.julian_date + 0.5 + ahead) * DAY).round() as i64;
        let day = 86_400;
        let date = calendar.date_of(seconds.div_euclid(day) as i32);
        Civil { date, second: seconds.rem_euclid(day) as u32 }
    }

    pub(super) fn solar(self) -> Result<JulianDate, SiteError> {
        Ok(JulianDate::new(self.julian_date, self.delta_t()?)?)
    }
}

fn decimal_year(julian_date: f64) -> f64 {
    2000.0 + (julian_date - J2000) / YEAR
}

/// What a clock shows: a date and a time of day.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Civil {
    /// The date.
    pub date: Date,
    /// The second of the day.
    pub second: u32,
}

impl Civil {
    /// The time of day: `08:41:12`.
    pub fn time_of_day(&self) -> String {
        let second = self.second;
        format!("{:02}:{:02}:{:02}", second / 3600, second / 60 % 60, second % 60)
    }
}

impl fmt::Display for Civil {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.date, self.time_of_day())
    }
}
