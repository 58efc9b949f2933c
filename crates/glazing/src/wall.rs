//! The wall around an opening, so that light comes in through the window alone.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{GlazingError, check, join};
use crate::outline::{Outline, SAGITTA};
use crate::polygon;

/// A straight piece of wall with the opening in it, and reveals that may widen to both sides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Wall {
    /// Width of the wall to the left of the opening, metres; 0 to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub left: f64,
    /// Width of the wall to the right of the opening, metres; 0 to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub right: f64,
    /// Height of the wall below the sill, metres; 0 to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub below: f64,
    /// Height of the wall above the opening, metres; 0 to 100.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub above: f64,
    /// From the middle of the glass to the inner face, metres; 0.01 to 10.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub inside: f64,
    /// From the middle of the glass to the outer face, metres; 0.01 to 10.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub outside: f64,
    /// Angle by which the inner reveal widens, degrees; 0 to 75.
    #[schemars(range(min = 0.0, max = 75.0))]
    pub splay: f64,
    /// Angle by which the outer reveal widens, degrees; 0 to 75.
    #[schemars(range(min = 0.0, max = 75.0))]
    pub outer_splay: f64,
}

impl Default for Wall {
    fn default() -> Self {
        Self {
            left: 1.0,
            right: 1.0,
            below: 1.0,
            above: 1.0,
            inside: 0.35,
            outside: 0.2,
            splay: 30.0,
            outer_splay: 15.0,
        }
    }
}

/// The wall of a planned window: a slab, pierced by one hole.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedWall {
    /// The edge of the slab, counterclockwise, metres.
    pub outline: Vec<DVec2>,
    /// The edge of the hole at some depths, from the inner face to the outer one: z, and a polygon, counterclockwise.
    /// All have the same number of corners.
    pub hole: Vec<(f64, Vec<DVec2>)>,
}

/// The reveal is straight for so much to either side of the glass, metres, if nothing else asks for more.
const REBATE: f64 = 0.01;

/// Least stone that is left beside the hole, metres.
const LEAST_STONE: f64 = 1e-3;

impl Wall {
    /// Checks the settings.
    pub(crate) fn validate(&self, path: &str) -> Result<(), GlazingError> {
        let sizes = [("left", self.left), ("right", self.right), ("below", self.below), ("above", self.above)];
        sizes.into_iter().try_for_each(|(member, size)| check(path, member, size, 0.0..=100.0, "metres"))?;
        check(path, "inside", self.inside, 0.01..=10.0, "metres")?;
        check(path, "outside", self.outside, 0.01..=10.0, "metres")?;
        check(path, "splay", self.splay, 0.0..=75.0, "degrees")?;
        check(path, "outer_splay", self.outer_splay, 0.0..=75.0, "degrees")
    }

    /// The wall around an opening, which holds a frame of this depth.
    pub(crate) fn plan(&self, opening: &Outline, frame_depth: f64, path: &str) -> Result<PlannedWall, GlazingError> {
        let segments = opening.segments(SAGITTA);
        let edge = opening.polygon_with(&segments);
        let [low, high] = polygon::bounds(&edge);
        let (min, max) = (low - DVec2::new(self.left, self.below), high + DVec2::new(self.right, self.above));
        let mut hole = Vec::new();
        let widened = |depth: f64, splay: f64, member: &str| {
            let straight = (0.5 * frame_depth).max(REBATE).min(depth);
            let by = (depth - straight) * libm::tan(splay.to_radians());
            // Stretched along both axes: the outline at a distance outside need not exist beside a hollow arc.
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            let outline: Vec<DVec2> =
                edge.iter().map(|corner| middle + (*corner - middle) * ((half + by) / half)).collect();
            let fits = |corner: &DVec2| {
                let left = (*corner - min).min(max - *corner);
                left.min_element() >= LEAST_STONE
            };
            if !outline.iter().all(fits) {
                let found = format!("{splay} degrees, which widen the opening by {by:.3} m");
                let expected = "less, or more wall on every side of the opening";
                return Err(GlazingError::new(join(path, member), found, expected));
            }
            Ok((straight, outline))
        };
        let (straight, inner) = widened(self.inside, self.splay, "splay")?;
        if straight < self.inside {
            hole.push((self.inside, inner));
        }
        hole.push((straight, edge.clone()));
        let (straight, outer) = widened(self.outside, self.outer_splay, "outer_splay")?;
        hole.push((-straight, edge));
        if straight < self.outside {
            hole.push((-self.outside, outer));
        }
        let outline = vec![min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)];
        Ok(PlannedWall { outline, hole })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::WindowDesign;
    use crate::opening::{Arch, Head, Opening};

    #[test]
    fn every_head_has_a_wall_whose_hole_widens_to_both_faces() {
        for name in Head::NAMES {
            let head = Head::usual(name, 0.7).unwrap();
            let mut design = WindowDesign::new(Opening::Arch(Arch { width: 0.7, height: 1.9, head }));
            design.wall = Some(Wall::default());
            let wall = design.plan().unwrap_or_else(|error| panic!("{name}: {error}")).wall.unwrap();
            let widths: Vec<f64> =
                wall.hole.iter().map(|(_, edge)| polygon::bounds(edge)).map(|[a, b]| b.x - a.x).collect();
            assert_eq!(widths.len(), 4);
            assert!(widths[0] > widths[1] && (widths[1] - 0.7).abs() < 1e-9 && widths[3] > widths[2], "{widths:?}");
        }
        assert!(Head::usual("gothic", 1.0).is_none());
    }
}
