//! A time in all kinds.

use super::{Calendar, Civil, Day, Place, SiteError, UniversalTime, sun_position};

/// A time at a place, in all kinds of time. Dates of clocks are Gregorian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShownTimes {
    /// Universal time.
    pub universal: Civil,
    /// Local mean time.
    pub mean: Civil,
    /// Local apparent time: what a sundial shows.
    pub apparent: Civil,
    /// Whether the sun is up: between sunrise and sunset.
    pub is_day: Option<bool>,
    /// Of the twelve hours of the day, or of the night.
    pub seasonal: Option<f64>,
    /// Equal hours since the last sunset.
    pub italian: Option<f64>,
    /// Equal hours since the last sunrise.
    pub babylonian: Option<f64>,
}

impl ShownTimes {
    /// What clocks of all kinds show. Hours that are counted from sunrise or sunset are not there if the sun does not
    /// rise or set within a day.
    ///
    /// # Errors
    ///
    /// When the astronomy does not reach so far.
    pub fn at(place: &Place, time: UniversalTime) -> Result<Self, SiteError> {
        let mean = time.civil(Calendar::GREGORIAN, place.turns());
        let day = mean.date.julian_day_number();
        let (mut rises, mut sets) = (Vec::new(), Vec::new());
        for day in [day - 1, day, day + 1] {
            let day = Day::of(place, day)?;
            rises.extend(day.rise.map(UniversalTime::julian_date));
            sets.extend(day.set.map(UniversalTime::julian_date));
        }
        let now = time.julian_date();
        let last = |events: &[f64]| events.iter().copied().rfind(|event| *event <= now);
        let next = |events: &[f64]| events.iter().copied().find(|event| *event > now);
        let [last_rise, last_set, next_rise, next_set] = [last(&rises), last(&sets), next(&rises), next(&sets)];
        let since = |event: Option<f64>| event.map(|event| 24.0 * (now - event)).filter(|hours| *hours < 24.0);
        let is_day = last_rise.zip(last_set).map(|(rise, set)| rise > set);
        let part = match is_day {
            Some(true) => last_rise.zip(next_set),
            Some(false) => last_set.zip(next_rise),
            None => None,
        };
        Ok(Self {
            universal: time.civil(Calendar::GREGORIAN, 0.0),
            mean,
            apparent: time.civil(Calendar::GREGORIAN, ahead(place, time)?),
            is_day,
            seasonal: part.map(|(first, last)| 12.0 * (now - first) / (last - first)),
            italian: since(last_set),
            babylonian: since(last_rise),
        })
    }
}

/// Days by which a sundial is ahead of universal time.
fn ahead(place: &Place, time: UniversalTime) -> Result<f64, SiteError> {
    let shown = 0.5 + sun_position(place, time)?.hour_angle / 360.0;
    let mean = time.julian_date() + 0.5 + place.turns();
    // The date is that of local mean time, from which a sundial is not far.
    let difference = shown - mean;
    Ok(place.turns() + difference - difference.round())
}
