//! Y tracery and intersecting tracery: every mullion forks into two arcs with the radius of the head.
//!
//! The arc that leans right from mullion `a` and the one that leans left from mullion `b > a` meet halfway between
//! them. The cells are the pointed lights below, and a net of four-sided meshes above.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Cells, TraceryCell, TraceryShape, two_centred};
use crate::curve::Curve;
use crate::error::{GlazingError, check_count};
use crate::opening::{OpeningForm, TwoCentred};
use crate::outline::{Corner, Side};

/// Mullions that fork into arcs with the radius of the head, which cross.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Intersecting {
    /// Number of lights side by side, 2 to 12.
    #[schemars(range(min = 2, max = 12))]
    pub lights: u32,
}

impl Default for Intersecting {
    fn default() -> Self {
        Self { lights: 3 }
    }
}

/// A mullion that forks: intersecting tracery of two lights.
pub(super) struct Y;

impl TraceryShape for Y {
    fn cells(&self, form: &OpeningForm, _: f64, path: &str) -> Result<Cells, GlazingError> {
        cells(form, 2, path)
    }
}

impl TraceryShape for Intersecting {
    fn cells(&self, form: &OpeningForm, _: f64, path: &str) -> Result<Cells, GlazingError> {
        check_count(path, "lights", self.lights, 2..=12)?;
        cells(form, self.lights, path)
    }
}

fn cells(form: &OpeningForm, lights: u32, path: &str) -> Result<Cells, GlazingError> {
    let (arch, arcs) = two_centred(form, path)?;
    let springer = |mullion: u32| {
        let part = f64::from(mullion) / f64::from(lights) - 0.5;
        DVec2::new(part * arch.span, arch.springing)
    };
    let mut cells: Vec<TraceryCell> =
        (0..lights).map(|light| pointed_light(springer(light), springer(light + 1), arcs)).collect();
    for right in 1..lights {
        for left in (0..right).rev() {
            // Where both numbers of a mullion are the same, the lowest corner is a cusp above it.
            cells.push(TraceryCell::Bounded(vec![
                Side::convex(arcs.left(springer(left + 1)).reversed()),
                Side::convex(arcs.right(springer(right + 1))),
                Side::convex(arcs.left(springer(left))),
                Side::convex(arcs.right(springer(right)).reversed()),
            ]));
        }
    }
    Ok(Cells { cells, lights: lights as usize })
}

/// A light between two mullions, under arcs that start from both.
pub(super) fn pointed_light(left: DVec2, right: DVec2, arcs: TwoCentred) -> TraceryCell {
    let sill = |springer: DVec2| DVec2::new(springer.x, 0.0);
    TraceryCell::Bounded(vec![
        Side::convex(Curve::line(sill(left), sill(right))),
        Side { curve: Curve::line(sill(right), right), corner: Corner::Tangent(DVec2::X) },
        Side::convex(arcs.right(right)),
        Side { curve: arcs.left(left), corner: Corner::Tangent(DVec2::NEG_X) },
        Side::convex(Curve::line(left, sill(left))),
    ])
}
