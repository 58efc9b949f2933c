//! Ogee arches.
//!
//! On either side, a convex arc of radius `r` starts upright at the jamb. A concave arc of radius `R` goes on without a
//! corner up to the apex. Let `n` be the direction of the concave arc's centre from the apex. Let `p` be the way from
//! the centre of the convex arc to the apex. Then `R = (|p|^2 - r^2) / (2 (r - p.n))`.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{HeadForm, HeadShape};
use crate::curve::Curve;
use crate::error::{GlazingError, check, join};
use crate::outline::{Corner, Side};

/// Four arcs: convex ones at the jambs, and concave ones that meet in a sharp point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ogee {
    /// From the springing line to the highest point, metres; 0.4 to 2 times the width.
    #[schemars(range(min = 0.02, max = 60.0))]
    pub rise: f64,
    /// Radius of the convex arcs, metres; 0.1 to 0.5 of the width. Absent: half of the width.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.005, max = 15.0))]
    pub radius: Option<f64>,
    /// Angle between the concave arcs in the apex, degrees; 10 to 90.
    #[serde(default = "apex_angle")]
    #[schemars(range(min = 10.0, max = 90.0))]
    pub apex_angle: f64,
}

fn apex_angle() -> f64 {
    40.0
}

impl Ogee {
    /// Usual proportions over a span, metres.
    pub(super) fn usual(span: f64) -> Self {
        Self { rise: span, radius: None, apex_angle: apex_angle() }
    }
}

impl HeadShape for Ogee {
    fn form(&self, span: f64, path: &str) -> Result<HeadForm, GlazingError> {
        let rise = self.rise;
        check(path, "rise", rise, 0.4 * span..=2.0 * span, "metres for this width")?;
        let convex = self.radius.unwrap_or(0.5 * span);
        check(path, "radius", convex, 0.1 * span..=0.5 * span, "metres for this width")?;
        check(path, "apex_angle", self.apex_angle, 10.0..=90.0, "degrees")?;
        let (sine, cosine) = libm::sincos(0.5 * self.apex_angle.to_radians());
        let outwards = DVec2::new(-cosine, sine);
        let convex_centre = DVec2::new(convex - 0.5 * span, 0.0);
        let apex = DVec2::new(0.0, rise);
        let way = apex - convex_centre;
        let concave = (way.length_squared() - convex * convex) / (2.0 * (convex - way.dot(outwards)));
        let concave_centre = apex + outwards * concave;
        let joint = (concave_centre - convex_centre).normalize_or_zero();
        let point = convex_centre + joint * convex;
        if !(concave > 0.0 && concave.is_finite() && point.x < 0.0 && point.y > 0.0 && point.y < rise) {
            let expected = format!(
                "such that concave arcs can join the convex ones: another apex_angle, or a rise other than {rise} \
                 metres"
            );
            return Err(GlazingError::new(join(path, "apex_angle"), self.apex_angle, expected));
        }
        let mirrored = |point: DVec2| DVec2::new(-point.x, point.y);
        Ok(HeadForm {
            rise,
            first_corner: Corner::Tangent(DVec2::X),
            sides: vec![
                Side { curve: Curve::disc(mirrored(convex_centre), convex), corner: Corner::Tangent(mirrored(joint)) },
                Side::convex(Curve::hole(mirrored(concave_centre), concave)),
                // The joint lies on the other side of the concave arc's centre.
                Side { curve: Curve::hole(concave_centre, concave), corner: Corner::Tangent(-joint) },
                Side { curve: Curve::disc(convex_centre, convex), corner: Corner::Tangent(DVec2::NEG_X) },
            ],
            two_centred: None,
        })
    }
}
