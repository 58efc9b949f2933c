//! An opening of any outline, as a measured drawing or a model of a building has it.

use std::fmt::Write;

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{OpeningForm, OpeningShape, SIZES};
use crate::drawing::{closed_path, millimetre};
use crate::error::{GlazingError, check};
use crate::outline::Outline;
use crate::polygon;

/// A drawn outline. It is moved so that its lowest point is at the height of the sill and its middle at x = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrawnOpening {
    /// The outline as an SVG path of one closed part, x to the right and y down.
    #[schemars(length(min = 1, max = 100_000))]
    pub path: String,
    /// Size of a unit of the path, metres; 0.000001 to 100. The default is for drawings in millimetres.
    #[serde(default = "millimetre")]
    #[schemars(range(min = 0.000_001, max = 100.0))]
    pub scale: f64,
}

/// Corners whose neighbours pass them this near are on a straight line, metres.
const STRAIGHT: f64 = 1e-5;

impl DrawnOpening {
    /// The opening with these corners, metres, x to the right and y upwards.
    pub fn around(corners: &[DVec2]) -> Self {
        let mut path = String::new();
        for (index, corner) in corners.iter().enumerate() {
            let command = if index == 0 { 'M' } else { 'L' };
            let _ = write!(path, "{command}{} {}", corner.x, -corner.y);
        }
        path.push('Z');
        Self { path, scale: 1.0 }
    }
}

impl OpeningShape for DrawnOpening {
    fn form(&self, path: &str) -> Result<OpeningForm, GlazingError> {
        check(path, "scale", self.scale, 1e-6..=100.0, "metres")?;
        let fault =
            |expected: String| GlazingError::new(format!("{path}.path"), format!("\"{}\"", self.path), expected);
        let corners = closed_path(&self.path, DVec2::ZERO, self.scale).map_err(fault)?;
        let [low, high] = polygon::bounds(&corners);
        for (way, size) in [("wide", high.x - low.x), ("high", high.y - low.y)] {
            if !SIZES.contains(&size) {
                let [least, most] = [SIZES.start(), SIZES.end()];
                return Err(fault(format!("an outline {least} to {most} metres {way}, not {size:.4}")));
            }
        }
        let origin = DVec2::new(0.5 * (low.x + high.x), low.y);
        let placed: Vec<DVec2> = corners.into_iter().map(|corner| corner - origin).collect();
        let outline = Outline::around(&polygon::cleaned(&placed, STRAIGHT))
            .ok_or_else(|| fault("an outline without folds".to_owned()))?;
        Ok(OpeningForm { outline, arch: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(path: &str) -> Result<Vec<DVec2>, String> {
        let opening = DrawnOpening { path: path.to_owned(), scale: 0.001 };
        opening.form("opening").map(|form| form.outline.polygon()).map_err(|error| error.to_string())
    }

    #[test]
    fn a_drawn_arch_stands_on_the_sill_in_the_middle() {
        let arch = outline("M 100 2000 V 600 A 400 400 0 0 1 900 600 V 2000 Z").unwrap();
        let [low, high] = polygon::bounds(&arch);
        assert!((low - DVec2::new(-0.4, 0.0)).length() < 1e-6, "{low}");
        assert!((high - DVec2::new(0.4, 1.8)).length() < 1e-3, "{high}");
        let area = 0.8 * 1.4 + 0.5 * std::f64::consts::PI * 0.16;
        assert!((polygon::area(&arch) - area).abs() < 1e-3);
    }

    #[test]
    fn corners_are_those_of_the_path_that_they_make() {
        let corners =
            [[-0.31, 0.0], [0.3, 0.1], [0.4, 1.7], [0.1, 1.2], [-0.5, 2.3]].map(|[x, y]| DVec2::new(x, y + 0.1));
        let form = DrawnOpening::around(&corners).form("opening").unwrap();
        let placed = form.outline.polygon();
        let middle = DVec2::new(-0.05, 0.1);
        assert_eq!(placed.len(), corners.len());
        for corner in corners {
            assert!(placed.iter().any(|other| other.distance(corner - middle) < 1e-9), "{corner} {placed:?}");
        }
    }

    #[test]
    fn what_is_no_opening_says_why() {
        for (path, reason) in [
            ("M0 0 L1000 1000 L1000 0 L0 1000Z", "does not cross itself"),
            ("M0 0 L10 0 L10 10Z", "0.05 to 30 metres wide, not 0.0100"),
            ("M0 0 L1000 0 L1000 1000Z M100 100 L200 100 L200 200Z", "without holes"),
            ("M0 0 X", "an SVG path"),
            ("M0 0 L1000 0", "around at least"),
        ] {
            let error = outline(path).unwrap_err();
            assert!(error.contains(reason) && error.contains("opening.path"), "{error}");
        }
    }
}
