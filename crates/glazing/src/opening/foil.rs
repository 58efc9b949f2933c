//! Foils: lobes around a centre, within a circle that they touch from inside.
//!
//! Lobes of radius `R sin(pi/n) / (1 + sin(pi/n))` touch each other, and the cusps between them would be infinitely
//! thin. Ours are larger by [`OVERLAP`], so that neighbours intersect in a cusp of stone.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{OpeningForm, OpeningShape, SIZES};
use crate::curve::Curve;
use crate::error::{GlazingError, check, check_count};
use crate::outline::{Corner, Outline, Side};

/// The radius of the lobes, as a multiple of that at which they touch each other.
const OVERLAP: f64 = 1.25;

/// Lobes within a circle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Foil {
    /// Diameter of the circle that the lobes touch, metres; 0.05 to 30.
    #[schemars(range(min = 0.05, max = 30.0))]
    pub diameter: f64,
    /// Number of lobes, 3 to 16. One of them points upwards.
    #[schemars(range(min = 3, max = 16))]
    pub lobes: u32,
}

impl OpeningShape for Foil {
    fn form(&self, path: &str) -> Result<OpeningForm, GlazingError> {
        check(path, "diameter", self.diameter, SIZES, "metres")?;
        check_count(path, "lobes", self.lobes, LOBES)?;
        let radius = 0.5 * self.diameter;
        // The lowest lobe of an odd number does not reach the lowest point of the circle.
        let outline = |height: f64| {
            foil_outline(DVec2::new(0.0, height), radius, self.lobes)
                .ok_or_else(|| GlazingError::new(path, self.lobes, "lobes that fit the circle"))
        };
        let lowest = outline(0.0)?.polygon().iter().map(|corner| corner.y).fold(f64::INFINITY, f64::min);
        Ok(OpeningForm { outline: outline(-lowest)?, arch: None })
    }
}

/// Numbers of lobes.
pub(crate) const LOBES: std::ops::RangeInclusive<u32> = 3..=16;

/// The outline of lobes within a circle, of which one points upwards.
pub(crate) fn foil_outline(centre: DVec2, radius: f64, lobes: u32) -> Option<Outline> {
    let sine = libm::sin(PI / f64::from(lobes));
    let lobe = OVERLAP * radius * sine / (1.0 + sine);
    let sides = (0..lobes)
        .map(|index| {
            let angle = FRAC_PI_2 + TAU * f64::from(index) / f64::from(lobes);
            let (sine, cosine) = libm::sincos(angle);
            let curve = Curve::disc(centre + DVec2::new(cosine, sine) * (radius - lobe), lobe);
            Side { curve, corner: Corner::Reflex }
        })
        .collect();
    Outline::new(sides)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lobes_touch_the_circle_and_meet_in_cusps() {
        for lobes in LOBES {
            let outline = foil_outline(DVec2::ZERO, 1.0, lobes).unwrap();
            let distances: Vec<f64> =
                outline.polygon_with(&vec![64; lobes as usize]).iter().map(|corner| corner.length()).collect();
            let farthest = distances.iter().copied().fold(0.0, f64::max);
            assert!((farthest - 1.0).abs() < 1e-3, "{lobes}: {farthest}");
            let sine = libm::sin(PI / f64::from(lobes));
            let cusp = outline.end(0);
            assert!(cusp.length() < 0.95, "{lobes}: {}", cusp.length());
            let Curve::Circle { radius, .. } = outline.sides()[0].curve else { panic!("no circle") };
            assert!((radius - 1.25 * sine / (1.0 + sine)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_foil_stands_on_the_sill() {
        for lobes in [3, 4, 5] {
            let form = Foil { diameter: 1.0, lobes }.form("").unwrap();
            let lowest = form.outline.polygon().iter().map(|corner| corner.y).fold(f64::INFINITY, f64::min);
            assert!(lowest.abs() < 1e-9);
        }
    }
}
