//! Reticulated tracery: a net of ogee meshes above ogee-headed lights.
//!
//! Every mullion forks at the springing line. The branches of neighbours touch halfway between them, part again, and so
//! on. A branch goes aside by `d`, half the width of a light, while it rises by `q`. It consists of two arcs with the
//! radius `(d^2 + q^2) / (4 d)` that pass into each other without a corner. The head cuts the meshes at its edge.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Cells, TraceryCell, TraceryShape, two_centred};
use crate::curve::Curve;
use crate::error::{GlazingError, check, check_count, join};
use crate::opening::OpeningForm;
use crate::outline::{Corner, Side};

/// Ogee-headed lights under a net of ogee meshes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Reticulated {
    /// Number of lights side by side, 2 to 12.
    #[schemars(range(min = 2, max = 12))]
    pub lights: u32,
    /// Height of the lights' heads, which is half of the height of a mesh, metres; 0.5 to 3 times the width of a light.
    /// Absent: 0.85 times that width.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.005, max = 30.0))]
    pub rise: Option<f64>,
}

impl Default for Reticulated {
    fn default() -> Self {
        Self { lights: 3, rise: None }
    }
}

impl TraceryShape for Reticulated {
    fn cells(&self, form: &OpeningForm, _: f64, path: &str) -> Result<Cells, GlazingError> {
        check_count(path, "lights", self.lights, 2..=12)?;
        let (arch, arcs) = two_centred(form, path)?;
        let width = arch.span / f64::from(self.lights);
        let rise = self.rise.unwrap_or(0.85 * width);
        check(path, "rise", rise, 0.5 * width..=3.0 * width, "metres for this width of a light")?;
        let net = Net { aside: 0.5 * width, rise };
        let half = 0.5 * arch.span;
        let heads = [arcs.right(DVec2::new(half, arch.springing)), arcs.left(DVec2::new(-half, arch.springing))];
        let apex = DVec2::new(half - 0.5 * width, arch.springing + rise);
        if !heads.iter().all(|&head| is_inside(head, apex)) {
            let expected = "small enough for the lights to end below the head of the opening";
            return Err(GlazingError::new(join(path, "rise"), rise, expected));
        }
        let mut cells: Vec<TraceryCell> = (0..self.lights)
            .map(|light| TraceryCell::Bounded(net.light(-half + f64::from(light) * width, arch.springing)))
            .collect();
        let rows = (arcs.rise(arch.span) / rise).ceil() as u32;
        for row in 0..rows {
            let shift = 0.5 * f64::from(row % 2);
            for column in 0..=self.lights - row % 2 {
                let x = -half + (f64::from(column) + shift) * width;
                let lowest = DVec2::new(x, arch.springing + f64::from(row) * rise);
                cells.push(TraceryCell::Cut { sides: net.mesh(lowest).to_vec(), heads });
            }
        }
        Ok(Cells { cells, lights: self.lights as usize })
    }
}

/// The measures of a net.
#[derive(Clone, Copy)]
struct Net {
    /// By how much a branch goes aside.
    aside: f64,
    /// By how much it rises.
    rise: f64,
}

impl Net {
    fn radius(self) -> f64 {
        (self.aside * self.aside + self.rise * self.rise) / (4.0 * self.aside)
    }

    /// The mesh above a point, counterclockwise from there.
    fn mesh(self, lowest: DVec2) -> [Side; 6] {
        let Self { aside, rise } = self;
        let radius = self.radius();
        let at = |x: f64, halves: f64| lowest + DVec2::new(x, halves * rise);
        let side = |curve: Curve, corner: Corner| Side { curve, corner };
        let lower_hollow = |sign: f64| Curve::hole(at(sign * radius, 0.0), radius);
        let middle = |sign: f64| Curve::disc(at(sign * (aside - radius), 1.0), radius);
        let upper_hollow = |sign: f64| Curve::hole(at(sign * radius, 2.0), radius);
        // From the centre of a middle arc to its lower and its upper joint.
        let [lower, upper] = [-0.5, 0.5].map(|height| DVec2::new(radius - 0.5 * aside, height * rise) / radius);
        let mirrored = |direction: DVec2| DVec2::new(-direction.x, direction.y);
        [
            side(lower_hollow(1.0), Corner::Tangent(-lower)),
            side(middle(1.0), Corner::Tangent(upper)),
            side(upper_hollow(1.0), Corner::Convex),
            side(upper_hollow(-1.0), Corner::Tangent(-mirrored(upper))),
            side(middle(-1.0), Corner::Tangent(mirrored(lower))),
            side(lower_hollow(-1.0), Corner::Convex),
        ]
    }

    /// The light to the right of a mullion, up to the branches of its mullions.
    fn light(self, left: f64, springing: f64) -> Vec<Side> {
        let right = left + 2.0 * self.aside;
        // Its head is the upper half of a mesh.
        let mesh = self.mesh(DVec2::new(left + self.aside, springing - self.rise));
        let [falling, rising] = [Corner::Tangent(DVec2::NEG_X), Corner::Tangent(DVec2::X)];
        vec![
            Side::convex(Curve::line(DVec2::new(left, 0.0), DVec2::new(right, 0.0))),
            Side { curve: Curve::line(DVec2::new(right, 0.0), DVec2::new(right, springing)), corner: rising },
            mesh[1],
            mesh[2],
            mesh[3],
            Side { curve: mesh[4].curve, corner: falling },
            Side::convex(Curve::line(DVec2::new(left, springing), DVec2::new(left, 0.0))),
        ]
    }
}

fn is_inside(disc: Curve, point: DVec2) -> bool {
    matches!(disc, Curve::Circle { centre, radius, .. } if centre.distance(point) < radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outline::Outline;

    #[test]
    fn arcs_of_a_mesh_pass_into_each_other() {
        let net = Net { aside: 0.3, rise: 0.5 };
        let sides = net.mesh(DVec2::new(0.1, 2.0));
        // Within half a bar, so that the cusps are corners.
        let inset = sides.map(|side| Side { curve: side.curve.inset(0.05).unwrap(), corner: side.corner });
        let mesh = Outline::new(inset.to_vec()).unwrap();
        for (index, side) in mesh.sides().iter().enumerate() {
            let (end, next) = (mesh.end(index), mesh.sides()[(index + 1) % 6].curve);
            let is_straight = side.curve.tangent(end).distance(next.tangent(end)) < 1e-9;
            assert_eq!(is_straight, index % 3 != 2, "side {index}");
            for curve in [side.curve, next] {
                let Curve::Circle { centre, radius, .. } = curve else { panic!("a line") };
                assert!((centre.distance(end) - radius).abs() < 1e-12);
            }
        }
    }
}
