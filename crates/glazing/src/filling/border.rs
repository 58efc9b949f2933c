//! A border along the edge of a light, around a field that has a filling of its own.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{COMPUTED, Cell, CellGlass, Filling, FillingShape, Layout, MIN_SIZE, Region, check_pieces, clipped};
use crate::error::{GlazingError, check, join};
use crate::glass::GlassPattern;
use crate::outline::Outline;
use crate::plan::Zone;
use crate::polygon;

/// A border along the edge of each light, around a field. A light that has no room for both is one piece of border.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Border {
    /// Width of the border, metres; 0.01 to 10.
    #[serde(default = "width")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub width: f64,
    /// Length of the pieces of the border, metres; 0.01 to 10. It is adjusted to whole numbers along each line or arc
    /// of the edge. Absent: three times the width.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 10.0))]
    pub length: Option<f64>,
    /// Glass of the border. Absent: that of the window.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub glass: Option<GlassPattern>,
    /// How the field within the border is divided.
    #[serde(default)]
    pub field: Box<Filling>,
}

fn width() -> f64 {
    0.04
}

impl Border {
    fn length(&self) -> f64 {
        self.length.unwrap_or(3.0 * self.width)
    }
}

impl FillingShape for Border {
    fn validate(&self, path: &str) -> Result<(), GlazingError> {
        check(path, "width", self.width, MIN_SIZE..=10.0, "metres")?;
        check(path, "length", self.length(), MIN_SIZE..=30.0, "metres")?;
        self.glass.as_ref().map_or(Ok(()), |glass| glass.validate(&join(path, "glass")))?;
        self.field.validate(&join(path, "field"))
    }

    fn check_fit(&self, lights: &[Outline], upper_left: DVec2, path: &str) -> Result<(), GlazingError> {
        let fields: Vec<Outline> = lights.iter().filter_map(|light| light.inset(self.width)).collect();
        if fields.is_empty() {
            let expected = "narrow enough to leave a field in at least one light";
            return Err(GlazingError::new(join(path, "width"), self.width, expected));
        }
        self.field.check_fit(&fields, upper_left, &join(path, "field"))
    }

    fn lay_out<'a>(&'a self, region: Region<'_>, path: &str) -> Result<Layout<'a>, GlazingError> {
        let glass = self.glass.as_ref().map(CellGlass::Pattern);
        let cell = move |column: i64| Cell { zone: Zone::Border, row: 0, column, checker: column, glass };
        let Some(inner) = region.outline.inset(self.width) else {
            return Ok(Layout { lines: Vec::new(), locate: Box::new(move |_: DVec2| cell(0)), tolerance: COMPUTED });
        };
        let perimeter: f64 = (0..inner.sides().len()).map(|side| inner.length(side)).sum();
        check_pieces(path, "length", self.length(), perimeter, self.length())?;
        let edge = inner.polygon();
        let mut middles = Vec::new();
        let mut lines = vec![edge.iter().chain(edge.first()).copied().collect::<Vec<DVec2>>()];
        for run in inner.runs() {
            let length: f64 = run.iter().map(|&side| inner.length(side)).sum();
            let count = (length / self.length()).round().max(1.0) as u32;
            let across = |part: f64| {
                let (side, point) = inner.point_of_run(&run, part);
                [point, point - inner.sides()[side].curve.tangent(point).perp() * self.width]
            };
            let part = |number: f64| number / f64::from(count);
            lines.extend((1..count).map(|number| across(part(f64::from(number))).to_vec()));
            // At a sharp corner, the line to it may leave the light past a hollow side.
            let corner = run.last().map(|&last| [inner.end(last), region.outline.end(last)]);
            lines.extend(clipped(region.polygon, corner));
            middles.extend((0..count).map(|number| {
                let [inside, outside] = across(part(f64::from(number) + 0.5));
                0.5 * (inside + outside)
            }));
        }
        let field = self.field.lay_out(Region { outline: &inner, polygon: &edge, ..region }, &join(path, "field"))?;
        lines.extend(field.lines);
        let locate = move |point: DVec2| {
            if polygon::contains(&edge, point) {
                let cell = (field.locate)(point);
                // Borders within borders are further rows.
                return Cell { row: cell.row + i64::from(cell.zone == Zone::Border), ..cell };
            }
            let distance = |middle: &DVec2| middle.distance_squared(point);
            let nearest = (middles.iter().enumerate())
                .min_by(|(_, first), (_, second)| distance(first).total_cmp(&distance(second)));
            cell(nearest.map_or(0, |(index, _)| index as i64))
        };
        Ok(Layout { lines, locate: Box::new(locate), tolerance: field.tolerance })
    }

    fn glass_names(&self) -> Vec<&str> {
        let own = self.glass.iter().flat_map(GlassPattern::names);
        own.chain(self.field.glass_names()).collect()
    }
}
