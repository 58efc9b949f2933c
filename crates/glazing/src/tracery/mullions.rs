//! Upright bars at equal distances.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Cells, TraceryCell, TraceryShape};
use crate::curve::Curve;
use crate::error::{GlazingError, check_count, join};
use crate::opening::{ArchForm, Head, OpeningForm};
use crate::outline::{Corner, Side};

/// Upright bars up to the head.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mullions {
    /// Number of lights side by side, 2 to 12.
    #[schemars(range(min = 2, max = 12))]
    pub lights: u32,
    /// The head of each light, under a level lintel. Absent: the lights end at the head of the opening.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub head: Option<Head>,
}

impl Default for Mullions {
    fn default() -> Self {
        Self { lights: 2, head: None }
    }
}

impl TraceryShape for Mullions {
    fn cells(&self, form: &OpeningForm, _: f64, path: &str) -> Result<Cells, GlazingError> {
        check_count(path, "lights", self.lights, 2..=12)?;
        let arch = form.arch.ok_or_else(|| {
            GlazingError::new(path, "mullions in an opening without jambs", "in an arch with a sill and jambs")
        })?;
        let mullion = |number: u32| (f64::from(number) / f64::from(self.lights) - 0.5) * arch.span;
        let cells = (0..self.lights)
            .map(|light| {
                let (left, right) = (mullion(light), mullion(light + 1));
                let sides = match &self.head {
                    Some(head) => arched_light(arch, head, left, right, &join(path, "head"))?,
                    None => open_light(form, left, right),
                };
                Ok(TraceryCell::Bounded(sides))
            })
            .collect::<Result<Vec<_>, GlazingError>>()?;
        Ok(Cells { cells, lights: self.lights as usize })
    }
}

/// A light between two mullions or jambs, up to the head of the opening.
fn open_light(form: &OpeningForm, left: f64, right: f64) -> Vec<Side> {
    let outline = &form.outline;
    let highest = outline.polygon().iter().map(|corner| corner.y).fold(0.0, f64::max);
    let upright = |x: f64| Curve::line(DVec2::new(x, 0.0), DVec2::new(x, highest));
    let mut sides = vec![Side::convex(Curve::line(DVec2::new(left, 0.0), DVec2::new(right, 0.0)))];
    // A cell at a jamb takes the jamb from the outline.
    let middle = 0.5 * (left + right);
    let margin = 1e-9 * (right - left);
    let [first, last] = [(right, 1.0), (left, -1.0)].map(|(x, towards): (f64, f64)| {
        (0..outline.sides().len()).all(|side| (outline.end(side).x - x) * towards <= margin)
    });
    if !first {
        sides.push(Side::convex(upright(right)));
    }
    for (index, side) in outline.sides().iter().enumerate().skip(1) {
        let (from, to) = (outline.start(index).x, outline.end(index).x);
        let is_upright = (from - to).abs() <= margin;
        let is_jamb = is_upright && (from > middle && first || from < middle && last);
        if is_jamb || from.max(to) > left + margin && from.min(to) < right - margin && !is_upright {
            sides.push(*side);
        }
    }
    if !last {
        if let Some(side) = sides.last_mut() {
            side.corner = Corner::Convex;
        }
        sides.push(Side::convex(upright(left).reversed()));
    }
    sides
}

/// A light between two mullions, with a head of its own.
fn arched_light(arch: ArchForm, head: &Head, left: f64, right: f64, path: &str) -> Result<Vec<Side>, GlazingError> {
    if !arch.is_level {
        let expected = "absent: only under a level lintel do lights have heads of their own";
        return Err(GlazingError::new(path, head.name(), expected));
    }
    let form = head.form(right - left, path)?;
    let springing = arch.springing - form.rise;
    if springing < 0.01 {
        let expected = format!("a head that is lower than the opening, {} metres", arch.springing);
        return Err(GlazingError::new(path, format!("a head of {} metres", form.rise), expected));
    }
    let origin = DVec2::new(0.5 * (left + right), springing);
    let mut sides = vec![
        Side::convex(Curve::line(DVec2::new(left, 0.0), DVec2::new(right, 0.0))),
        Side { curve: Curve::line(DVec2::new(right, 0.0), DVec2::new(right, springing)), corner: form.first_corner },
    ];
    sides.extend(form.sides.iter().map(|side| Side { curve: side.curve.moved(origin), ..*side }));
    sides.push(Side::convex(Curve::line(DVec2::new(left, springing), DVec2::new(left, 0.0))));
    Ok(sides)
}
