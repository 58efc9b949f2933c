//! Where the sun stands.

use solar_positioning::{RefractionCorrection, SolarPositions};

use super::{Place, SiteError, UniversalTime};

/// Angular radius of the sun at a distance of one astronomical unit, degrees (959.63 arc seconds, IAU 1976).
const RADIUS_AT_UNIT_DISTANCE: f64 = 959.63 / 3600.0;

/// Where the sun stands at a place, and how large it is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunPosition {
    /// Of the centre above the horizon without refraction, degrees.
    pub altitude: f64,
    /// The same with the refraction in the air of the place, degrees.
    pub altitude_refracted: f64,
    /// From north by east, degrees, 0 to 360.
    pub azimuth: f64,
    /// Of the centre of the earth, degrees.
    pub declination: f64,
    /// From the meridian by west, degrees, -180 to 180. A sundial shows 12 hours and a 15th of it.
    pub hour_angle: f64,
    /// From the earth, astronomical units.
    pub distance: f64,
    /// Half the angle under which the disc is seen, degrees.
    pub angular_radius: f64,
}

/// Where the sun stands at a place and time: the algorithm SPA, to 0.0003 degrees.
///
/// # Errors
///
/// When the astronomy does not reach so far.
pub fn sun_position(place: &Place, time: UniversalTime) -> Result<SunPosition, SiteError> {
    let parts = SolarPositions::new().for_time_from_julian(time.solar()?)?;
    let air = RefractionCorrection::new(place.pressure(), place.temperature())?;
    let straight = parts.at(place.location(), place.elevation(), None)?;
    let refracted = parts.at(place.location(), place.elevation(), Some(air))?;
    // The algorithm always has a distance.
    let distance = parts.earth_radius_vector().unwrap_or(1.0);
    let (altitude, azimuth) = (straight.elevation_angle(), straight.azimuth());
    Ok(SunPosition {
        altitude,
        altitude_refracted: refracted.elevation_angle(),
        azimuth,
        declination: parts.declination(),
        hour_angle: hour_angle(place.latitude(), altitude, azimuth),
        distance,
        angular_radius: RADIUS_AT_UNIT_DISTANCE / distance,
    })
}

/// The hour angle of a direction, all in degrees: its angle about the axis of the earth, from the meridian by west.
fn hour_angle(latitude: f64, altitude: f64, azimuth: f64) -> f64 {
    let [(sin_latitude, cos_latitude), (sin_altitude, cos_altitude), (sin_azimuth, cos_azimuth)] =
        [latitude, altitude, azimuth].map(|angle| libm::sincos(angle.to_radians()));
    let west = -cos_altitude * sin_azimuth;
    let towards_equator = sin_altitude * cos_latitude - cos_altitude * cos_azimuth * sin_latitude;
    libm::atan2(west, towards_equator).to_degrees()
}
