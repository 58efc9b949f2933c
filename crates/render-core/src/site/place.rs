//! Where on earth.

use super::SiteError;

/// A place on earth with its air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    latitude: f64,
    longitude: f64,
    elevation: f64,
    pressure: f64,
    temperature: f64,
}

/// Pressure at sea level in the standard atmosphere, hPa.
const SEA_LEVEL_PRESSURE: f64 = 1013.25;

/// Temperature there, degrees Celsius.
const SEA_LEVEL_TEMPERATURE: f64 = 15.0;

/// Fall of the temperature with height in the standard atmosphere, K/m.
const LAPSE: f64 = 0.0065;

/// Zero degrees Celsius, K.
const FREEZING: f64 = 273.15;

/// Exponent of the barometric formula in the standard atmosphere: g M / (R LAPSE).
const BAROMETRIC_EXPONENT: f64 = 5.25588;

impl Place {
    /// A place by its latitude (degrees, north is positive), longitude (degrees, east is positive) and elevation above
    /// sea level (m). Its air is that of the standard atmosphere (ISO 2533).
    ///
    /// # Errors
    ///
    /// When a number is out of its range.
    pub fn new(latitude: f64, longitude: f64, elevation: f64) -> Result<Self, SiteError> {
        let check = |field, value: f64, [low, high]: [f64; 2], expected| {
            let is_there = (low..=high).contains(&value);
            if is_there { Ok(value) } else { Err(SiteError::Range { field, value, expected }) }
        };
        let elevation = check("elevation", elevation, [-500.0, 9000.0], "-500 to 9000 m")?;
        let sea_level = SEA_LEVEL_TEMPERATURE + FREEZING;
        let relative = (sea_level - LAPSE * elevation) / sea_level;
        Ok(Self {
            latitude: check("latitude", latitude, [-90.0, 90.0], "-90 to 90 degrees, north is positive")?,
            longitude: check("longitude", longitude, [-180.0, 180.0], "-180 to 180 degrees, east is positive")?,
            elevation,
            pressure: SEA_LEVEL_PRESSURE * libm::pow(relative, BAROMETRIC_EXPONENT),
            temperature: SEA_LEVEL_TEMPERATURE - LAPSE * elevation,
        })
    }

    /// The place with the pressure of its air, hPa.
    ///
    /// # Errors
    ///
    /// When the pressure is out of its range.
    pub fn with_pressure(self, pressure: f64) -> Result<Self, SiteError> {
        if (100.0..=1100.0).contains(&pressure) {
            return Ok(Self { pressure, ..self });
        }
        Err(SiteError::Range { field: "pressure", value: pressure, expected: "100 to 1100 hPa" })
    }

    /// The place with the temperature of its air, degrees Celsius.
    ///
    /// # Errors
    ///
    /// When the temperature is out of its range.
    pub fn with_temperature(self, temperature: f64) -> Result<Self, SiteError> {
        if (-90.0..=60.0).contains(&temperature) {
            return Ok(Self { temperature, ..self });
        }
        Err(SiteError::Range { field: "temperature", value: temperature, expected: "-90 to 60 degrees Celsius" })
    }

    /// Degrees; north is positive.
    pub fn latitude(&self) -> f64 {
        self.latitude
    }

    /// Degrees; east is positive.
    pub fn longitude(&self) -> f64 {
        self.longitude
    }

    /// Above sea level, m.
    pub fn elevation(&self) -> f64 {
        self.elevation
    }

    /// Of the air, hPa.
    pub fn pressure(&self) -> f64 {
        self.pressure
    }

    /// Of the air, degrees Celsius.
    pub fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Longitude as a part of a turn: what local mean time is ahead of universal time, days.
    pub(super) fn turns(&self) -> f64 {
        self.longitude / 360.0
    }

    pub(super) fn location(&self) -> solar_positioning::Location {
        solar_positioning::Location { latitude: self.latitude, longitude: self.longitude }
    }
}
