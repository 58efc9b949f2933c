//! Courses of rectangles.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{COMPUTED, Cell, FillingShape, Layout, MIN_SIZE, Region, check_pieces, clipped};
use crate::error::{GlazingError, check};
use crate::plan::Zone;
use crate::polygon;

/// Courses of rectangles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rectangles {
    /// Width of a piece, metres; 0.01 to 10. It is adjusted to whole numbers across the light.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub width: f64,
    /// Height of a course, metres; 0.01 to 10. It is adjusted to whole numbers up to the highest point of the light.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub height: f64,
    /// By which part of a width every second course is shifted, 0 to 1: half of it makes a running bond.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub offset: f64,
}

impl Default for Rectangles {
    fn default() -> Self {
        Self { width: 0.15, height: 0.2, offset: 0.0 }
    }
}

impl FillingShape for Rectangles {
    fn validate(&self, path: &str) -> Result<(), GlazingError> {
        check(path, "width", self.width, MIN_SIZE..=10.0, "metres")?;
        check(path, "height", self.height, MIN_SIZE..=10.0, "metres")?;
        check(path, "offset", self.offset, 0.0..=1.0, "")
    }

    fn lay_out<'a>(&'a self, region: Region<'_>, path: &str) -> Result<Layout<'a>, GlazingError> {
        let [low, high] = polygon::bounds(region.polygon);
        let wanted = DVec2::new(self.width, self.height);
        let counts = ((high - low) / wanted).round().max(DVec2::ONE);
        let piece = (high - low) / counts;
        check_pieces(path, "width", self.width, polygon::area(region.polygon), piece.element_product())?;
        let [columns, courses] = counts.to_array().map(|count| count as i64);
        let shift = move |course: i64| if course.rem_euclid(2) == 1 { self.offset } else { 0.0 };
        let x = |column: f64| low.x + column * piece.x;
        let y = |course: i64| low.y + course as f64 * piece.y;
        let mut lines: Vec<[DVec2; 2]> = Vec::new();
        for course in 0..courses {
            if course > 0 {
                lines.push([DVec2::new(low.x - 1.0, y(course)), DVec2::new(high.x + 1.0, y(course))]);
            }
            let at = |column: i64| x(column as f64 + shift(course));
            lines.extend((0..=columns).map(|column| [y(course), y(course + 1)].map(|y| DVec2::new(at(column), y))));
        }
        if self.offset.rem_euclid(1.0) == 0.0 {
            // Upright lines run through all courses.
            lines.retain(|[from, to]| from.x != to.x);
            lines.extend(
                (1..columns).map(|column| [low.y - 1.0, high.y + 1.0].map(|y| DVec2::new(x(column as f64), y))),
            );
        }
        let locate = move |point: DVec2| {
            let DVec2 { x, y } = (point - low) / piece;
            let row = y.floor() as i64;
            let column = (x - shift(row)).floor() as i64;
            Cell { zone: Zone::Field, row, column, checker: row + column, glass: None }
        };
        let lines = clipped(region.polygon, lines);
        Ok(Layout { lines, locate: Box::new(locate), tolerance: COMPUTED })
    }
}
