//! A day of the sun: when it rises, stands highest and sets.

use solar_positioning::{Horizon, SolarEvents};

use super::{Place, SiteError, UniversalTime};

/// Half a day, the reach of a search from noon.
const HALF: f64 = 0.5;

/// A day of the sun at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Day {
    /// The sun crosses the meridian.
    pub noon: UniversalTime,
    /// The last sunrise in the half day before noon, if there is one. The upper limb touches a level horizon, and the
    /// refraction there is 34 arc minutes: the centre is at an altitude of -50 arc minutes.
    pub rise: Option<UniversalTime>,
    /// The first sunset in the half day after noon, if there is one.
    pub set: Option<UniversalTime>,
}

impl Day {
    /// The day around the noon between two midnights of local mean time; by its Julian day number.
    ///
    /// # Errors
    ///
    /// When the astronomy does not reach so far.
    pub fn of(place: &Place, day: i32) -> Result<Self, SiteError> {
        let midnight = UniversalTime::at(day, 0.0, place.turns())?;
        let (start, delta_t, events) = (midnight.julian_date(), midnight.delta_t()?, SolarEvents::new());
        let transit = events.next_transit_from_julian(start, start + 1.0, place.longitude(), delta_t)?;
        // Apparent noon is within 17 minutes of mean noon.
        let noon = transit.unwrap_or(start + HALF);
        let (location, horizon) = (place.location(), Horizon::SunriseSunset);
        let rise = events.next_rise_from_julian(noon - HALF, noon, location, delta_t, horizon)?;
        let set = events.next_set_from_julian(noon, noon + HALF, location, delta_t, horizon)?;
        Ok(Self {
            noon: UniversalTime::new(noon)?,
            rise: rise.map(UniversalTime::new).transpose()?,
            set: set.map(UniversalTime::new).transpose()?,
        })
    }
}
