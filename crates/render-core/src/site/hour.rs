//! Hours that have a name.

use std::fmt;
use std::str::FromStr;

use super::SiteError;

/// An hour of the day that sources name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamedHour {
    /// One of the twelve hours from sunrise to sunset, by its number.
    Seasonal(u32),
    /// The upper limb of the sun appears.
    Sunrise,
    /// The sun crosses the meridian.
    Noon,
    /// The upper limb of the sun disappears.
    Sunset,
}

/// The names.
const NAMED: [(&str, NamedHour); 9] = [
    ("sunrise", NamedHour::Sunrise),
    ("prime", NamedHour::Seasonal(1)),
    ("terce", NamedHour::Seasonal(3)),
    ("sext", NamedHour::Seasonal(6)),
    ("noon", NamedHour::Noon),
    ("none", NamedHour::Seasonal(9)),
    ("nones", NamedHour::Seasonal(9)),
    ("vespers", NamedHour::Seasonal(11)),
    ("sunset", NamedHour::Sunset),
];

impl NamedHour {
    /// The canonical hours of the day, in order.
    pub const CANONICAL: [(&'static str, Self); 5] = [NAMED[1], NAMED[2], NAMED[3], NAMED[5], NAMED[7]];
}

impl FromStr for NamedHour {
    type Err = SiteError;

    fn from_str(text: &str) -> Result<Self, SiteError> {
        let names = NAMED.map(|(name, _)| name).join(", ");
        SiteError::look_up("hour", text, &NAMED, &format!("HH:MM, HH:MM:SS or one of {names}"))
    }
}

/// Which part of the named hour is meant: sources differ. The third hour is from two to three twelfths of the day.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum HourReading {
    /// Terce is when the third hour begins.
    Beginning,
    /// Terce is in the middle of the third hour.
    Middle,
    /// Terce is when the third hour is over.
    #[default]
    End,
}

/// The names of the readings.
const READINGS: [(&str, HourReading); 3] =
    [("beginning", HourReading::Beginning), ("middle", HourReading::Middle), ("end", HourReading::End)];

impl HourReading {
    /// Twelfths of the day that are over in the hour of a number.
    pub fn twelfths(self, number: u32) -> f64 {
        let left = match self {
            Self::Beginning => 1.0,
            Self::Middle => 0.5,
            Self::End => 0.0,
        };
        f64::from(number) - left
    }
}

impl FromStr for HourReading {
    type Err = SiteError;

    fn from_str(text: &str) -> Result<Self, SiteError> {
        SiteError::look_up("hour reading", text, &READINGS, &READINGS.map(|(name, _)| name).join(", "))
    }
}

impl fmt::Display for HourReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = READINGS.iter().find(|(_, reading)| reading == self).map_or("", |(name, _)| name);
        f.write_str(name)
    }
}
