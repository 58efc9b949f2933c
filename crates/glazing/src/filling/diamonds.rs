//! Diamond quarries: two families of parallel lines.
//!
//! The lattice starts in the lower left corner of the light. Its width is adjusted to a whole number of quarries from
//! side to side, and its height such that lines end in the highest point.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{COMPUTED, Cell, FillingShape, Layout, MIN_SIZE, Region, check_pieces, clipped};
use crate::error::{GlazingError, check};
use crate::plan::Zone;
use crate::polygon;

/// Diamond quarries, as rhombi that stand on a corner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Diamonds {
    /// Width of a quarry from corner to corner, metres; 0.01 to 10. It is adjusted to whole numbers across the light.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub width: f64,
    /// Height of a quarry from corner to corner, metres; 0.01 to 10. It is adjusted so that lines end in the highest
    /// point of the light.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub height: f64,
}

impl Default for Diamonds {
    fn default() -> Self {
        Self { width: 0.1, height: 0.15 }
    }
}

/// The lattice. Lines have whole numbers of `u + v` or `v - u`, with u and v in units of a quarry.
#[derive(Clone, Copy, Debug)]
struct Lattice {
    origin: DVec2,
    quarry: DVec2,
}

impl Lattice {
    /// The lattice that fits a light.
    fn fit(corners: &[DVec2], wanted: DVec2) -> Self {
        let [low, high] = polygon::bounds(corners);
        let columns = ((high.x - low.x) / wanted.x).round().max(1.0);
        let width = (high.x - low.x) / columns;
        // Nodes are at whole numbers of half quarries, of which both or none are even.
        let top = corners.iter().copied().max_by(|a, b| a.y.total_cmp(&b.y).then(b.x.total_cmp(&a.x))).unwrap_or(high);
        let across = ((top.x - low.x) / (0.5 * width)).round();
        let parity = across.rem_euclid(2.0);
        let halves = (((high.y - low.y) / wanted.y - 0.5 * parity).round() * 2.0 + parity).max(2.0 - parity);
        Self { origin: low, quarry: DVec2::new(width, 2.0 * (high.y - low.y) / halves) }
    }

    /// The numbers of the strips between the two families of lines.
    fn strips(&self, point: DVec2) -> DVec2 {
        let DVec2 { x: u, y: v } = (point - self.origin) / self.quarry;
        DVec2::new(u + v, v - u)
    }

    /// The point with these numbers.
    fn point(&self, strips: DVec2) -> DVec2 {
        self.origin + DVec2::new(0.5 * (strips.x - strips.y), 0.5 * (strips.x + strips.y)) * self.quarry
    }

    /// The lines that cross a light.
    fn lines(&self, corners: &[DVec2]) -> Vec<[DVec2; 2]> {
        let strips: Vec<DVec2> = corners.iter().map(|&corner| self.strips(corner)).collect();
        let [low, high] = polygon::bounds(&strips);
        let numbers = |low: f64, high: f64| {
            let (first, last) = ((low - 1e-6).ceil() as i64, (high + 1e-6).floor() as i64);
            (first..=last).map(|number| number as f64)
        };
        let (before, after) = (low - 1.0, high + 1.0);
        let falling = numbers(low.x, high.x).map(|x| [DVec2::new(x, before.y), DVec2::new(x, after.y)]);
        let rising = numbers(low.y, high.y).map(|y| [DVec2::new(before.x, y), DVec2::new(after.x, y)]);
        falling.chain(rising).map(|ends| ends.map(|end| self.point(end))).collect()
    }
}

impl FillingShape for Diamonds {
    fn validate(&self, path: &str) -> Result<(), GlazingError> {
        check(path, "width", self.width, MIN_SIZE..=10.0, "metres")?;
        check(path, "height", self.height, MIN_SIZE..=10.0, "metres")
    }

    fn lay_out<'a>(&'a self, region: Region<'_>, path: &str) -> Result<Layout<'a>, GlazingError> {
        let lattice = Lattice::fit(region.polygon, DVec2::new(self.width, self.height));
        let area = polygon::area(region.polygon);
        check_pieces(path, "width", self.width, area, 0.5 * lattice.quarry.element_product())?;
        let locate = move |point: DVec2| {
            let DVec2 { x, y } = lattice.strips(point).floor();
            let (row, column) = ((x + y) as i64, (x - y) as i64);
            Cell { zone: Zone::Field, row, column, checker: x as i64 + y as i64, glass: None }
        };
        let lines = clipped(region.polygon, lattice.lines(region.polygon));
        Ok(Layout { lines, locate: Box::new(locate), tolerance: COMPUTED })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_the_corners_and_the_apex() {
        let wanted = DVec2::new(0.1, 0.15);
        let rectangle = [[-0.26, 0.0], [0.26, 0.0], [0.26, 1.1], [-0.26, 1.1]].map(DVec2::from);
        let pointed = [[-0.26, 0.0], [0.26, 0.0], [0.26, 1.1], [0.0, 1.6], [-0.26, 1.1]].map(DVec2::from);
        let narrow = [[-0.31, 0.0], [0.31, 0.0], [0.31, 1.1], [0.0, 1.6], [-0.31, 1.1]].map(DVec2::from);
        for (light, nodes) in [(&rectangle[..], &[0, 1, 2, 3][..]), (&pointed, &[0, 1, 3]), (&narrow, &[0, 1, 3])] {
            let lattice = Lattice::fit(light, wanted);
            assert!((lattice.quarry / wanted - 1.0).abs().max_element() < 0.1, "{lattice:?}");
            for &node in nodes {
                let strips = lattice.strips(light[node]);
                assert!((strips - strips.round()).abs().max_element() < 1e-9, "{strips}");
            }
        }
    }
}
