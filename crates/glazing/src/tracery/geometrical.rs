//! Geometrical tracery: a circle above two pointed lights.
//!
//! The head has the span `s` and the radius `r`, the lights half of both. The circle touches both arcs of the head from
//! inside, and one arc of each light from outside. With `p = r/2` the radius of the lights, its radius is
//! `R = (r s - s^2/4) / (2 (r + p))`, and its centre lies `sqrt(2 p R + R^2)` above the springing line.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::intersecting::pointed_light;
use super::{Cells, TraceryCell, TraceryShape, two_centred};
use crate::curve::Curve;
use crate::error::{GlazingError, check_count};
use crate::opening::{OpeningForm, TwoCentred};
use crate::outline::{Corner, Side};

/// Two pointed lights under a circle with a foil.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Geometrical {
    /// Number of lobes of the foil in the circle, 3 to 16.
    #[schemars(range(min = 3, max = 16))]
    pub lobes: u32,
}

impl Default for Geometrical {
    fn default() -> Self {
        Self { lobes: 4 }
    }
}

impl TraceryShape for Geometrical {
    fn cells(&self, form: &OpeningForm, _: f64, path: &str) -> Result<Cells, GlazingError> {
        check_count(path, "lobes", self.lobes, crate::opening::LOBES)?;
        let (arch, arcs) = two_centred(form, path)?;
        let (half, lights) = (0.5 * arch.span, TwoCentred { radius: 0.5 * arcs.radius });
        let [left, middle, right] = [-half, 0.0, half].map(|x| DVec2::new(x, arch.springing));
        let (centre, radius) = circle(arch.span, arcs, lights);
        let centre = middle + DVec2::new(0.0, centre);
        let circle = Curve::hole(centre, radius);
        // Above the arcs of the lights, which are the lower edges of these cells.
        let [rising, falling] = [lights.left(middle), lights.right(middle)].map(Curve::reversed);
        let spandrel = |head: Curve, first: Curve, second: Curve| {
            vec![
                Side::convex(head),
                Side::convex(circle),
                Side { curve: first, corner: Corner::Reflex },
                Side::convex(second),
            ]
        };
        let right_spandrel = spandrel(arcs.right(right), rising, lights.right(right).reversed());
        let left_spandrel = vec![
            Side::convex(circle),
            Side::convex(arcs.left(left)),
            Side { curve: lights.left(left).reversed(), corner: Corner::Reflex },
            Side::convex(falling),
        ];
        let eyelet = vec![Side::convex(rising), Side::convex(circle), Side::convex(falling)];
        let mut cells = vec![
            pointed_light(left, middle, lights),
            pointed_light(middle, right, lights),
            TraceryCell::Foil { centre, radius, lobes: self.lobes },
        ];
        cells.extend([eyelet, left_spandrel, right_spandrel].map(TraceryCell::Bounded));
        Ok(Cells { cells, lights: 3 })
    }
}

/// The height of the circle's centre above the springing line, and its radius.
fn circle(span: f64, head: TwoCentred, lights: TwoCentred) -> (f64, f64) {
    let radius = (head.radius * span - 0.25 * span * span) / (2.0 * (head.radius + lights.radius));
    ((2.0 * lights.radius * radius + radius * radius).sqrt(), radius)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_circle_touches_head_and_lights() {
        for radius in [1.1, 1.5, 2.0] {
            let (span, head, lights) = (1.5, TwoCentred { radius }, TwoCentred { radius: 0.5 * radius });
            let (height, circle) = circle(span, head, lights);
            let centre = DVec2::new(0.0, height);
            let to_head = centre.distance(DVec2::new(radius - 0.5 * span, 0.0));
            assert!((to_head - (radius - circle)).abs() < 1e-12);
            let to_light = centre.distance(DVec2::new(lights.radius, 0.0));
            assert!((to_light - (lights.radius + circle)).abs() < 1e-12);
        }
    }
}
