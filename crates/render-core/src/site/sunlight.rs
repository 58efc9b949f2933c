//! How strong sunlight is, and its colour.

use super::SunPosition;

/// Lumens of a watt: luminance is 683 lm/W times the mean of the radiance of Rec. 709 with the weights of luminance.
pub const LUMINOUS_EFFICACY: f64 = 683.0;

/// Illuminance of a surface that faces the sun outside the atmosphere, at a distance of one astronomical unit, lux
/// (Kittler and Darula 1997).
const LUMINOUS_SOLAR_CONSTANT: f64 = 133_800.0;

/// Altitudes of the sun, degrees, and the colour of its light there: linear Rec. 709 with a luminance of one. The
/// spectrum is that of the model of Hosek and Wilkie 2013 for a turbidity of 3; turbidities of 2 to 5 change it by less
/// than 3 percent. Below 2 degrees blue would leave Rec. 709, and is none.
const COLOURS: [(f64, [f64; 3]); 8] = [
    (2.0, [2.455, 0.671, 0.0]),
    (5.0, [1.874, 0.829, 0.122]),
    (10.0, [1.528, 0.910, 0.331]),
    (20.0, [1.320, 0.951, 0.540]),
    (30.0, [1.250, 0.962, 0.636]),
    (45.0, [1.206, 0.968, 0.707]),
    (60.0, [1.186, 0.971, 0.740]),
    (90.0, [1.174, 0.972, 0.761]),
];

/// Weights of linear Rec. 709 in luminance.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Illuminance of a surface that faces the sun through clear air of a luminous turbidity, lux: 1 would be pure air, 2.5
/// is very clear, 4 usual and 6 hazy (Navvab, Karayel, Ne'eman and Selkowitz 1984, "Analysis of atmospheric turbidity
/// for daylight calculations"). None below the horizon.
pub fn clear_sunlight(sun: &SunPosition, turbidity: f64) -> f64 {
    if sun.altitude <= 0.0 {
        return 0.0;
    }
    let mass = air_mass(sun.altitude);
    let extinction = 1.0 / (9.9 + 0.043 * mass);
    LUMINOUS_SOLAR_CONSTANT / (sun.distance * sun.distance) * libm::exp(-extinction * mass * turbidity)
}

/// Illuminance of a horizontal surface by a clear sky alone, lux (IES 1984, "Recommended practice for the calculation
/// of daylight availability"). None below the horizon.
pub fn clear_skylight(sun: &SunPosition) -> f64 {
    let sine = libm::sin(sun.altitude.to_radians());
    if sine <= 0.0 { 0.0 } else { 800.0 + 15_500.0 * sine.sqrt() }
}

/// The colour of sunlight: linear Rec. 709 with a luminance of one.
pub fn sunlight_colour(altitude: f64) -> [f64; 3] {
    let next = COLOURS.iter().position(|(known, _)| *known >= altitude).unwrap_or(COLOURS.len() - 1);
    let (low, high) = (COLOURS[next.saturating_sub(1)], COLOURS[next]);
    let part = if high.0 > low.0 { ((altitude - low.0) / (high.0 - low.0)).clamp(0.0, 1.0) } else { 0.0 };
    let mut colour = [0, 1, 2].map(|channel| low.1[channel] + part * (high.1[channel] - low.1[channel]));
    let luminance: f64 = colour.iter().zip(LUMINANCE).map(|(part, weight)| part * weight).sum();
    colour.iter_mut().for_each(|part| *part /= luminance);
    colour
}

/// Relative optical air mass (Kasten and Young 1989) of an altitude, degrees.
fn air_mass(altitude: f64) -> f64 {
    1.0 / (libm::sin(altitude.to_radians()) + 0.505_72 * libm::pow(altitude + 6.079_95, -1.6364))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sun(altitude: f64) -> SunPosition {
        SunPosition {
            altitude,
            altitude_refracted: altitude,
            azimuth: 180.0,
            declination: 0.0,
            hour_angle: 0.0,
            distance: 1.0,
            angular_radius: 0.2666,
        }
    }

    #[test]
    fn air_masses_are_those_of_the_paper() {
        for (altitude, mass) in
            [(5.0, 10.31), (10.0, 5.586), (20.0, 2.903), (30.0, 1.994), (45.0, 1.413), (60.0, 1.154)]
        {
            assert!((air_mass(altitude) / mass - 1.0).abs() < 1e-3, "{altitude}");
        }
    }

    #[test]
    fn sunlight_has_the_strength_of_tables() {
        // For a solar constant of 133100 lx in the table.
        for (altitude, lux) in [(10.0, 25_494.0), (30.0, 73_110.0), (60.0, 93_986.0)] {
            let found = clear_sunlight(&sun(altitude), 3.0) * 133_100.0 / LUMINOUS_SOLAR_CONSTANT;
            assert!((found / lux - 1.0).abs() < 2e-3, "{altitude}: {found}");
        }
        assert_eq!((clear_sunlight(&sun(-0.1), 3.0), clear_skylight(&sun(-0.1))), (0.0, 0.0));
    }

    #[test]
    fn sunlight_is_red_when_it_is_low_and_its_luminance_is_one() {
        for altitude in [-1.0, 0.0, 2.0, 3.5, 17.0, 60.0, 89.0, 90.0] {
            let colour = sunlight_colour(altitude);
            let luminance: f64 = colour.iter().zip(LUMINANCE).map(|(part, weight)| part * weight).sum();
            assert!((luminance - 1.0).abs() < 1e-12 && colour.iter().all(|part| *part >= 0.0), "{colour:?}");
        }
        assert!(sunlight_colour(5.0)[0] > sunlight_colour(40.0)[0] && sunlight_colour(5.0)[2] < 0.2);
    }
}
