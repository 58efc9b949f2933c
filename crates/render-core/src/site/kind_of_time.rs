//! Kinds of time: what the hours of a source are counted from.

use std::fmt;
use std::str::FromStr;

use julian::Date;

use super::{Day, Place, SiteError, UniversalTime, sun_position};

/// What the hours of a source are counted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KindOfTime {
    /// Midnight of a zone, which is this number of minutes ahead of universal time.
    Zone(i32),
    /// Midnight of local mean time, which is ahead of universal time by four minutes for each degree of longitude.
    Mean,
    /// The sun in the meridian is at 12 hours: what a sundial shows.
    Apparent,
    /// Twelve equal parts from sunrise to sunset, and twelve from there to the next sunrise.
    Seasonal,
    /// Equal hours since sunset of the day before.
    Italian,
    /// Equal hours since sunrise.
    Babylonian,
}

/// Their names.
const KINDS: [(&str, KindOfTime); 6] = [
    ("utc", KindOfTime::Zone(0)),
    ("mean", KindOfTime::Mean),
    ("apparent", KindOfTime::Apparent),
    ("seasonal", KindOfTime::Seasonal),
    ("italian", KindOfTime::Italian),
    ("babylonian", KindOfTime::Babylonian),
];

/// Steps towards an hour angle. Each leaves less than a thousandth of the error, which begins at 17 minutes.
const STEPS: usize = 4;

/// Degrees in which the earth turns in an hour of the sun.
const DEGREES: f64 = 15.0;

impl KindOfTime {
    /// The names of the kinds.
    pub const NAMES: &'static str = "utc, mean (local mean time), apparent (sundial), seasonal (twelve hours from \
                                     sunrise to sunset), italian (from sunset), babylonian (from sunrise)";

    /// The universal time of an hour of this kind on a date.
    ///
    /// # Errors
    ///
    /// When the sun does not rise or set on that date, or the astronomy does not reach so far.
    pub fn universal(self, place: &Place, date: Date, hours: f64) -> Result<UniversalTime, SiteError> {
        let day = date.julian_day_number();
        match self {
            Self::Zone(minutes) => UniversalTime::at(day, hours, f64::from(minutes) / 1440.0),
            Self::Mean => UniversalTime::at(day, hours, place.turns()),
            Self::Apparent => apparent(place, day, hours),
            Self::Seasonal if hours <= 12.0 => {
                let [rise, set] = [rise(place, date, 0)?, set(place, date, 0)?];
                between(rise, set, hours / 12.0)
            }
            Self::Seasonal => {
                let [set, rise] = [set(place, date, 0)?, rise(place, date, 1)?];
                between(set, rise, hours / 12.0 - 1.0)
            }
            Self::Italian => set(place, date, -1)?.later(hours / 24.0),
            Self::Babylonian => rise(place, date, 0)?.later(hours / 24.0),
        }
    }
}

fn between(first: UniversalTime, last: UniversalTime, part: f64) -> Result<UniversalTime, SiteError> {
    first.later(part * (last.julian_date() - first.julian_date()))
}

/// The time at which a sundial shows an hour.
fn apparent(place: &Place, day: i32, hours: f64) -> Result<UniversalTime, SiteError> {
    let wanted = DEGREES * (hours - 12.0);
    let mut time = UniversalTime::at(day, hours, place.turns())?;
    for _ in 0..STEPS {
        let error = wanted - sun_position(place, time)?.hour_angle;
        // Hour angles begin again after a turn.
        let error = error - 360.0 * (error / 360.0).round();
        time = time.later(error / 360.0)?;
    }
    Ok(time)
}

/// The sunrise of a date, or of one that is days later.
pub(super) fn rise(place: &Place, date: Date, later: i32) -> Result<UniversalTime, SiteError> {
    let rise = Day::of(place, date.julian_day_number() + later)?.rise;
    rise.ok_or_else(|| none(place, date, later, ["sunrise", "rise"]))
}

/// The sunset of a date, or of one that is days later.
pub(super) fn set(place: &Place, date: Date, later: i32) -> Result<UniversalTime, SiteError> {
    let set = Day::of(place, date.julian_day_number() + later)?.set;
    set.ok_or_else(|| none(place, date, later, ["sunset", "set"]))
}

fn none(place: &Place, date: Date, later: i32, [event, verb]: [&'static str; 2]) -> SiteError {
    let date = date.calendar().at_jdn(date.julian_day_number() + later).to_string();
    SiteError::NoEvent { event, verb, latitude: place.latitude(), date }
}

impl FromStr for KindOfTime {
    type Err = SiteError;

    fn from_str(text: &str) -> Result<Self, SiteError> {
        SiteError::look_up("time", text, &KINDS, &format!("one of {}", Self::NAMES))
    }
}

impl fmt::Display for KindOfTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (KINDS.iter().find(|(_, kind)| kind == self), self) {
            (Some((name, _)), _) => f.write_str(name),
            (None, Self::Zone(minutes)) => {
                let (sign, size) = (if *minutes < 0 { '-' } else { '+' }, minutes.abs());
                write!(f, "{sign}{:02}:{:02}", size / 60, size % 60)
            }
            (None, _) => Ok(()),
        }
    }
}
