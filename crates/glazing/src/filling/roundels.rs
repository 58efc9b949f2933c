//! Discs in staggered rows, as spun bullions were set. Short leads tie each disc to its six neighbours, and others cut
//! the glass between three discs in three.

use std::f64::consts::{FRAC_PI_3, FRAC_PI_6, TAU};

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{COMPUTED, Cell, CellGlass, FillingShape, Layout, MIN_SIZE, Region, check_pieces};
use crate::error::{GlazingError, check, join};
use crate::glass::GlassPattern;
use crate::plan::Zone;
use crate::polygon;

/// Discs in staggered rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Roundels {
    /// Diameter of a disc, metres; 0.01 to 10. It is adjusted to whole numbers across the light.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub diameter: f64,
    /// Distance between neighbouring discs, metres; 0.001 to 1. By default, the leads around them touch.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub gap: f64,
    /// Glass between the discs. Absent: that of the window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub between: Option<GlassPattern>,
}

impl Default for Roundels {
    fn default() -> Self {
        Self { diameter: 0.11, gap: 0.01, between: None }
    }
}

/// Largest distance of the edge of a disc from its chords, metres.
const SAGITTA: f64 = 0.0003;

/// Most corners of a disc.
const MAX_CORNERS: f64 = 60.0;

/// Places of the discs.
#[derive(Clone, Copy, Debug)]
struct Rows {
    /// The middle of the first disc.
    first: DVec2,
    /// From disc to disc, and from row to row.
    pitch: DVec2,
    radius: f64,
}

impl Rows {
    fn fit(low: DVec2, high: DVec2, diameter: f64, gap: f64) -> Self {
        let wanted = diameter + gap;
        let across = ((high.x - low.x) / wanted).round().max(1.0);
        let pitch = (high.x - low.x) / across;
        Self {
            first: low + 0.5 * pitch,
            pitch: DVec2::new(pitch, pitch * 0.75_f64.sqrt()),
            radius: 0.5 * diameter * pitch / wanted,
        }
    }

    fn middle(&self, row: i64, column: i64) -> DVec2 {
        let shift = 0.5 * row.rem_euclid(2) as f64;
        self.first + DVec2::new(column as f64 - shift, row as f64) * self.pitch
    }

    /// The disc with the middle that is nearest to a point.
    fn nearest(&self, point: DVec2) -> (i64, i64) {
        let row = ((point.y - self.first.y) / self.pitch.y).round() as i64;
        let candidates = (row - 1..=row + 1).map(|row| {
            let left = self.middle(row, 0).x;
            (row, ((point.x - left) / self.pitch.x).round() as i64)
        });
        let distance = |&(row, column): &(i64, i64)| self.middle(row, column).distance_squared(point);
        candidates.min_by(|first, second| distance(first).total_cmp(&distance(second))).unwrap_or((row, 0))
    }

    /// Around a disc: its edge, the three leads to neighbours ahead, and the three that cut the glass on its side.
    fn lines(&self, middle: DVec2) -> Vec<Vec<DVec2>> {
        let towards = |angle: f64| {
            let (sine, cosine) = libm::sincos(angle);
            DVec2::new(cosine, sine)
        };
        let step = 2.0 * libm::acos(1.0 - (SAGITTA / self.radius).min(0.5));
        // Leads end in corners.
        let corners = 12 * (TAU / step).min(MAX_CORNERS).div_euclid(12.0).max(1.0) as u32;
        let edge: Vec<DVec2> = (0..=corners)
            .map(|corner| middle + self.radius * towards(TAU * f64::from(corner % corners) / f64::from(corners)))
            .collect();
        let mut lines = vec![edge];
        for sixth in 0..6 {
            let angle = f64::from(sixth) * FRAC_PI_3;
            let ahead = towards(angle);
            if sixth < 3 {
                lines.push(vec![middle + ahead * self.radius, middle + ahead * (self.pitch.x - self.radius)]);
            }
            let aside = towards(angle + FRAC_PI_6);
            lines.push(vec![middle + aside * self.radius, middle + aside * (self.pitch.x / 3.0_f64.sqrt())]);
        }
        lines
    }
}

impl FillingShape for Roundels {
    fn validate(&self, path: &str) -> Result<(), GlazingError> {
        check(path, "diameter", self.diameter, MIN_SIZE..=10.0, "metres")?;
        check(path, "gap", self.gap, 0.001..=1.0, "metres")?;
        self.between.as_ref().map_or(Ok(()), |glass| glass.validate(&join(path, "between")))
    }

    fn lay_out<'a>(&'a self, region: Region<'_>, path: &str) -> Result<Layout<'a>, GlazingError> {
        let [low, high] = polygon::bounds(region.polygon);
        let rows = Rows::fit(low, high, self.diameter, self.gap);
        // There are six pieces between discs for each disc.
        let cell = rows.pitch.element_product() / 7.0;
        check_pieces(path, "diameter", self.diameter, polygon::area(region.polygon), cell)?;
        let mut lines = Vec::new();
        let count = ((high - low) / rows.pitch).ceil();
        for row in -1..=count.y as i64 + 1 {
            for column in -1..=count.x as i64 + 1 {
                let middle = rows.middle(row, column);
                let distance = polygon::distance_to_border(region.polygon, middle);
                let is_inside = polygon::contains(region.polygon, middle);
                if is_inside && distance >= rows.pitch.x {
                    lines.extend(rows.lines(middle));
                } else if is_inside || distance <= rows.pitch.x {
                    for line in rows.lines(middle) {
                        let parts =
                            line.windows(2).flat_map(|ends| polygon::clip_segment(region.polygon, ends[0], ends[1]));
                        lines.extend(polygon::joined(parts));
                    }
                }
            }
        }
        let between = self.between.as_ref().map(CellGlass::Pattern);
        let locate = move |point: DVec2| {
            let (row, column) = rows.nearest(point);
            let is_disc = rows.middle(row, column).distance(point) < rows.radius;
            let (zone, glass) = if is_disc { (Zone::Roundel, None) } else { (Zone::Between, between) };
            Cell { zone, row, column, checker: row + column, glass }
        };
        Ok(Layout { lines, locate: Box::new(locate), tolerance: COMPUTED })
    }

    fn glass_names(&self) -> Vec<&str> {
        self.between.iter().flat_map(GlassPattern::names).collect()
    }
}
