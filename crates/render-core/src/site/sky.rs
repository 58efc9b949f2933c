//! How luminance is distributed over skies.
//!
//! - The general sky of ISO 15469:2004 (CIE S 011/E:2003), 15 types, and its traditional overcast sky.
//! - The all-weather sky of Perez, Seals and Michalsky 1993 (Solar Energy 50). Its efficacies are those of Perez,
//!   Ineichen, Seals, Michalsky and Stewart 1990 (Solar Energy 44).
//! - The intermediate sky of Matsuura 1987, as it is in wide use.
//!
//! Luminance is relative. [`SkyDistribution::horizontal`] integrates it, so that a sky can be given any level.

use std::f64::consts::{FRAC_PI_2, PI};

/// Parameters a to e of the types 1 to 15 of the general sky.
const GENERAL: [[f64; 5]; 15] = [
    [4.0, -0.70, 0.0, -1.0, 0.0],
    [4.0, -0.70, 2.0, -1.5, 0.15],
    [1.1, -0.8, 0.0, -1.0, 0.0],
    [1.1, -0.8, 2.0, -1.5, 0.15],
    [0.0, -1.0, 0.0, -1.0, 0.0],
    [0.0, -1.0, 2.0, -1.5, 0.15],
    [0.0, -1.0, 5.0, -2.5, 0.30],
    [0.0, -1.0, 10.0, -3.0, 0.45],
    [-1.0, -0.55, 2.0, -1.5, 0.15],
    [-1.0, -0.55, 5.0, -2.5, 0.30],
    [-1.0, -0.55, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 24.0, -2.8, 0.15],
];

/// Points of the quadrature along an axis.
const POINTS: usize = 256;

/// How luminance is distributed over a sky with the sun at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyDistribution {
    shape: Shape,
    /// Zenith angle of the sun.
    sun: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// (1 + a exp(b / cos Z)) (1 + c (exp(d chi) - base) + e cos^2 chi).
    Exponential {
        a: f64,
        b: f64,
        c: f64,
        d: f64,
        e: f64,
        base: f64,
    },
    /// (1 + 2 cos Z) / 3.
    Overcast,
    Matsuura,
}

impl SkyDistribution {
    /// Number of types of the general sky.
    pub const TYPES: u32 = GENERAL.len() as u32;

    /// The general sky of a type, 1 to 15, with the sun at a zenith angle in radians. Other numbers count as the
    /// nearest type.
    pub fn general(kind: u32, sun: f64) -> Self {
        let [a, b, c, d, e] = GENERAL[kind.clamp(1, Self::TYPES) as usize - 1];
        Self { shape: Shape::Exponential { a, b, c, d, e, base: libm::exp(d * FRAC_PI_2) }, sun }
    }

    /// The traditional overcast sky: three times as bright in the zenith as at the horizon.
    pub fn overcast() -> Self {
        Self { shape: Shape::Overcast, sun: 0.0 }
    }

    /// The intermediate sky of Matsuura.
    pub fn matsuura(sun: f64) -> Self {
        Self { shape: Shape::Matsuura, sun }
    }

    /// Relative luminance of a direction above the horizon, by its cosine with the zenith and with the sun.
    pub fn relative(&self, cos_zenith: f64, cos_sun: f64) -> f64 {
        let cos_sun = cos_sun.clamp(-1.0, 1.0);
        let luminance = match self.shape {
            Shape::Exponential { a, b, c, d, e, base } => {
                let gradation = 1.0 + a * libm::exp(b / cos_zenith.max(1e-9));
                gradation * (1.0 + c * (libm::exp(d * libm::acos(cos_sun)) - base) + e * cos_sun * cos_sun)
            }
            Shape::Overcast => (1.0 + 2.0 * cos_zenith) / 3.0,
            Shape::Matsuura => {
                let (zenith, sun) = (libm::acos(cos_zenith.clamp(-1.0, 1.0)), self.sun);
                let wave = (1.35 * libm::sin(5.631 - 3.59 * zenith) + 3.12) * libm::sin(4.396 - 2.6 * sun);
                let fall = libm::acos(cos_sun) * ((2.629 - zenith) * (1.562 - sun) + 0.812);
                (wave + 6.37 - zenith) / 2.326 * libm::exp(-0.563 * fall)
            }
        };
        luminance.max(0.0)
    }

    /// Relative luminance of the zenith.
    pub fn zenith(&self) -> f64 {
        self.relative(1.0, libm::cos(self.sun))
    }

    /// Relative illuminance of a horizontal surface: the integral of relative luminance times the cosine with the
    /// zenith, to 0.01 percent.
    pub fn horizontal(&self) -> f64 {
        let (sin_sun, cos_sun) = libm::sincos(self.sun);
        let step = 1.0 / POINTS as f64;
        let mut sum = 0.0;
        for row in 0..POINTS {
            // The luminance near the horizon is smooth in the root of the cosine.
            let root = (row as f64 + 0.5) * step;
            let cos = root * root;
            let sin = (1.0 - cos * cos).sqrt();
            for column in 0..POINTS {
                let azimuth = PI * (column as f64 + 0.5) * step;
                let luminance = self.relative(cos, cos * cos_sun + sin * sin_sun * libm::cos(azimuth));
                sum += luminance * cos * 2.0 * root;
            }
        }
        2.0 * PI * sum * step * step
    }
}

/// Least clearness of each bin.
const CLEARNESS: [f64; 8] = [1.0, 1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2];

/// Coefficients of a to e in each bin.
#[rustfmt::skip]
const PEREZ: [[[f64; 4]; 5]; 8] = [
    [[1.3525, -0.2576, -0.2690, -1.4366], [-0.7670, 0.0007, 1.2734, -0.1233], [2.8, 0.6004, 1.2375, 1.0],
     [1.8734, 0.6297, 0.9738, 0.2809], [0.0356, -0.1246, -0.5718, 0.9938]],
    [[-1.2219, -0.7730, 1.4148, 1.1016], [-0.2054, 0.0367, -3.9128, 0.9156], [6.975, 0.1774, 6.4477, -0.1239],
     [-1.5798, -0.5081, -1.7812, 0.1080], [0.2624, 0.0672, -0.2190, -0.4285]],
    [[-1.1, -0.2515, 0.8952, 0.0156], [0.2782, -0.1812, -4.5, 1.1766], [24.7219, -13.0812, -37.7, 34.8438],
     [-5.0, 1.5218, 3.9229, -2.6204], [-0.0156, 0.1597, 0.4199, -0.5562]],
    [[-0.5484, -0.6654, -0.2672, 0.7117], [0.7234, -0.6219, -5.6812, 2.6297], [33.3389, -18.3, -62.25, 52.0781],
     [-3.5, 0.0016, 1.1477, 0.1062], [0.4659, -0.3296, -0.0876, -0.0329]],
    [[-0.6, -0.3566, -2.5, 2.325], [0.2937, 0.0496, -5.6812, 1.8415], [21.0, -4.7656, -21.5906, 7.2492],
     [-3.5, -0.1554, 1.4062, 0.3988], [0.0032, 0.0766, -0.0656, -0.1294]],
    [[-1.0156, -0.3670, 1.0078, 1.4051], [0.2875, -0.5328, -3.85, 3.375], [14.0, -0.9999, -7.1406, 7.5469],
     [-3.4, -0.1078, -1.075, 1.5702], [-0.0672, 0.4016, 0.3017, -0.4844]],
    [[-1.0, 0.0211, 0.5025, -0.5119], [-0.3, 0.1922, 0.7023, -1.6317], [19.0, -5.0, 1.2438, -1.9094],
     [-4.0, 0.0250, 0.3844, 0.2656], [1.0468, -0.3788, -2.4517, 1.4656]],
    [[-1.05, 0.0289, 0.4260, 0.3590], [-0.3250, 0.1156, 0.7781, 0.0025], [31.0625, -14.5, -46.1148, 55.375],
     [-7.2312, 0.4050, 13.35, 0.6234], [1.5, -0.6426, 1.8564, 0.5636]],
];

/// Efficacies of diffuse and of direct light in each bin.
#[rustfmt::skip]
const EFFICACIES: [[[f64; 4]; 2]; 8] = [
    [[97.24, -0.46, 12.0, -8.91], [57.2, -4.55, -2.98, 117.12]],
    [[107.22, 1.15, 0.59, -3.95], [98.99, -3.46, -1.21, 12.38]],
    [[104.97, 2.96, -5.53, -8.77], [109.83, -4.9, -1.71, -8.81]],
    [[102.39, 5.59, -13.95, -13.9], [110.34, -5.84, -1.99, -4.56]],
    [[100.71, 5.94, -22.75, -23.74], [106.36, -3.97, -1.75, -6.16]],
    [[106.42, 3.83, -36.15, -28.83], [107.19, -1.25, -1.51, -26.73]],
    [[141.88, 1.9, -53.24, -14.03], [105.75, 0.77, -1.26, -34.44]],
    [[152.23, 0.35, -45.27, -7.98], [101.18, 1.58, -1.1, -8.29]],
];

/// Irradiance outside the atmosphere at a distance of one astronomical unit, W/m2, as in the fit of the model.
const EXTRATERRESTRIAL: f64 = 1367.0;

/// Water in the air, cm, if no dew point is known.
const WATER: f64 = 2.0;

/// The all-weather sky of measured irradiances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerezSky {
    /// Its luminance.
    pub distribution: SkyDistribution,
    /// Illuminance of a horizontal surface by the sky, lux.
    pub diffuse_illuminance: f64,
    /// Illuminance of a surface that faces the sun by the sun alone, lux.
    pub direct_illuminance: f64,
}

impl PerezSky {
    /// The sky of a direct normal and a diffuse horizontal irradiance, W/m2. The sun is at a zenith angle below a right
    /// angle, in radians, and `distance` astronomical units away. `None` without diffuse irradiance.
    pub fn new([direct, diffuse]: [f64; 2], sun: f64, distance: f64) -> Option<Self> {
        if !(diffuse > 0.0 && direct >= 0.0) {
            return None;
        }
        let cube = 1.041 * sun * sun * sun;
        let clearness = ((diffuse + direct) / diffuse + cube) / (1.0 + cube);
        let brightness = air_mass(sun) * diffuse * distance * distance / EXTRATERRESTRIAL;
        let bin = CLEARNESS.iter().rposition(|least| clearness >= *least).unwrap_or(0);
        let [first, second] = EFFICACIES[bin];
        let diffuse_efficacy =
            first[0] + first[1] * WATER + first[2] * libm::cos(sun) + first[3] * libm::log(brightness);
        let direct_efficacy =
            second[0] + second[1] * WATER + second[2] * libm::exp(5.73 * sun - 5.0) + second[3] * brightness;
        // The fit has no darker skies between these.
        let is_between = (1.065..2.8).contains(&clearness);
        let fitted = if is_between { brightness.max(0.2) } else { brightness };
        let shape = exponential(bin, sun, fitted);
        Some(Self {
            distribution: SkyDistribution { shape, sun },
            diffuse_illuminance: diffuse * diffuse_efficacy.max(0.0),
            direct_illuminance: direct * direct_efficacy.max(0.0),
        })
    }
}

fn exponential(bin: usize, sun: f64, brightness: f64) -> Shape {
    let [a, b, c, d, e] = PEREZ[bin].map(|[x1, x2, x3, x4]| x1 + x2 * sun + brightness * (x3 + x4 * sun));
    let (c, d) = match bin {
        0 => {
            let [c1, c2, c3, c4] = PEREZ[0][2];
            let [d1, d2, d3, d4] = PEREZ[0][3];
            let c = libm::exp(libm::pow(brightness * (c1 + c2 * sun), c3)) - c4;
            (c, -libm::exp(brightness * (d1 + d2 * sun)) + d3 + brightness * d4)
        }
        _ => (c, d),
    };
    // A positive exponent would have no bound at the horizon.
    Shape::Exponential { a, b: b.min(0.0), c, d, e, base: 0.0 }
}

/// Relative optical air mass (Kasten 1965), with which the model was fitted.
fn air_mass(sun: f64) -> f64 {
    let altitude = 90.0 - sun.to_degrees();
    1.0 / (libm::cos(sun) + 0.15 * libm::pow(altitude + 3.885, -1.253))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Zenith angles of a sun at altitudes of 10, 30 and 60 degrees.
    fn suns() -> [f64; 3] {
        [10.0_f64, 30.0, 60.0].map(|altitude| (90.0 - altitude).to_radians())
    }

    fn assert_near(found: f64, expected: f64, tolerance: f64, what: &str) {
        assert!((found / expected - 1.0).abs() < tolerance, "{what}: {found}, expected {expected}");
    }

    #[test]
    fn horizontal_over_zenith_is_that_of_tables() {
        let table = [
            [2.4495, 2.4495, 2.4495],
            [2.6787, 2.5566, 2.0860],
            [2.7700, 2.7700, 2.7700],
            [3.0535, 2.8901, 2.3154],
            [PI; 3],
            [3.4865, 3.2778, 2.5842],
            [3.9101, 3.6730, 2.4212],
            [4.4027, 4.1231, 2.3284],
            [4.9211, 4.5528, 3.4593],
            [5.6233, 5.1449, 3.1703],
            [6.4527, 5.8176, 2.9891],
            [7.2294, 6.3941, 3.1906],
            [8.0835, 6.9952, 3.0259],
            [9.1908, 7.7081, 3.2170],
            [10.6262, 8.1160, 3.0159],
        ];
        for (kind, row) in (1..).zip(table) {
            for (sun, expected) in suns().into_iter().zip(row) {
                let sky = SkyDistribution::general(kind, sun);
                assert_near(sky.horizontal() / sky.zenith(), expected, 1e-4, &format!("type {kind}, sun {sun}"));
            }
        }
        let overcast = SkyDistribution::overcast();
        assert_near(overcast.horizontal(), 7.0 * PI / 9.0, 1e-4, "overcast");
        for (sun, expected) in suns().into_iter().zip([3.580, 4.123, 2.505]) {
            let sky = SkyDistribution::matsuura(sun);
            assert_near(sky.horizontal() / sky.zenith(), expected, 1e-3, &format!("Matsuura, sun {sun}"));
        }
    }

    #[test]
    fn the_clear_sky_of_type_12_has_the_luminance_of_tables() {
        for (altitude, rows) in [
            (30.0_f64, [(45.0, 180.0, 0.89653), (45.0, 0.0, 5.38080), (80.0, 90.0, 2.17623)]),
            (60.0, [(45.0, 180.0, 0.45445), (45.0, 0.0, 2.35326), (80.0, 90.0, 0.98084)]),
        ] {
            let sun = (90.0 - altitude).to_radians();
            let sky = SkyDistribution::general(12, sun);
            for (zenith, azimuth, expected) in rows {
                let (zenith, azimuth) = (f64::to_radians(zenith), f64::to_radians(azimuth));
                let [(sin, cos), (sin_sun, cos_sun)] = [zenith, sun].map(libm::sincos);
                let cos_sun = cos * cos_sun + sin * sin_sun * libm::cos(azimuth);
                let found = sky.relative(cos, cos_sun) / sky.zenith();
                assert_near(
                    found,
                    expected,
                    1e-5,
                    &format!("sun {altitude}, zenith angle {zenith}, azimuth {azimuth}"),
                );
            }
        }
    }

    #[test]
    fn the_all_weather_sky_has_published_parameters_and_illuminances() {
        let sun = 60.0_f64.to_radians();
        // What gendaylit prints for a diffuse irradiance of 200 W/m2 alone, at the distance of the first of January.
        let distance = (1.0_f64 / 1.035_05).sqrt();
        let Shape::Exponential { a, b, c, d, e, .. } =
            PerezSky::new([0.0, 200.0], sun, distance).unwrap().distribution.shape
        else {
            panic!("another shape")
        };
        for (found, expected) in [a, b, c, d, e].into_iter().zip([0.5832, -0.4439, 1.6062, -0.9881, 0.0372]) {
            assert!((found - expected).abs() < 2e-4, "{found}, expected {expected}");
        }
        let sky = PerezSky::new([700.0, 100.0], sun, distance).unwrap();
        assert_near(sky.direct_illuminance, 67_770.0, 2e-3, "direct");
        assert_near(sky.diffuse_illuminance, 15_252.0, 2e-3, "diffuse");
        assert!(PerezSky::new([700.0, 0.0], sun, 1.0).is_none());
    }
}
