//! Four-centred arches.
//!
//! On either side, an arc of radius `r` starts upright at the jamb and turns by an angle `a`. An arc of radius `R`
//! goes on without a corner up to the apex. With `e` the direction of the joint from the centre `C` of the first arc,
//! and `v` the way from `C` to the apex, `R - r = (|v|^2 - r^2) / (2 (r - v.e))`.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{HeadForm, HeadShape};
use crate::curve::Curve;
use crate::error::{GlazingError, check, join};
use crate::outline::{Corner, Side};

/// Four arcs: narrow ones at the jambs, and wide ones that meet in a low point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tudor {
    /// From the springing line to the highest point, metres; 0.1 to 0.8 of the width.
    #[schemars(range(min = 0.005, max = 24.0))]
    pub rise: f64,
    /// Radius of the arcs at the jambs, metres; 0.02 of the width to less than the rise. Absent: half of the rise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.001, max = 15.0))]
    pub haunch_radius: Option<f64>,
    /// By how much the arcs at the jambs turn, degrees; 20 to 80.
    #[serde(default = "haunch_angle")]
    #[schemars(range(min = 20.0, max = 80.0))]
    pub haunch_angle: f64,
}

fn haunch_angle() -> f64 {
    55.0
}

impl Tudor {
    /// Usual proportions over a span, metres.
    pub(super) fn usual(span: f64) -> Self {
        Self { rise: 0.32 * span, haunch_radius: None, haunch_angle: haunch_angle() }
    }
}

impl HeadShape for Tudor {
    fn form(&self, span: f64, path: &str) -> Result<HeadForm, GlazingError> {
        let rise = self.rise;
        check(path, "rise", rise, 0.1 * span..=0.8 * span, "metres for this width")?;
        let haunch = self.haunch_radius.unwrap_or(0.5 * rise);
        check(path, "haunch_radius", haunch, 0.02 * span..=0.95 * rise, "metres for this width and rise")?;
        check(path, "haunch_angle", self.haunch_angle, 20.0..=80.0, "degrees")?;
        let (sine, cosine) = libm::sincos(self.haunch_angle.to_radians());
        let joint = DVec2::new(-cosine, sine);
        let haunch_centre = DVec2::new(haunch - 0.5 * span, 0.0);
        let apex = DVec2::new(0.0, rise) - haunch_centre;
        let growth = (apex.length_squared() - haunch * haunch) / (2.0 * (haunch - apex.dot(joint)));
        let centre = haunch_centre - joint * growth;
        // The upper arc rises to the right up to the apex, where it meets its mirror image in a point.
        if !(growth > 0.0 && growth.is_finite() && centre.x > 1e-3 * span) {
            let expected = format!(
                "such that arcs that meet in a point can go on from the haunches: for a rise of {rise} metres a \
                 smaller haunch_radius than {haunch}, or another haunch_angle"
            );
            return Err(GlazingError::new(join(path, "haunch_angle"), self.haunch_angle, expected));
        }
        let mirrored = |point: DVec2| DVec2::new(-point.x, point.y);
        let side = |centre, radius, corner| Side { curve: Curve::disc(centre, radius), corner };
        let radius = haunch + growth;
        Ok(HeadForm {
            rise,
            first_corner: Corner::Tangent(DVec2::X),
            sides: vec![
                side(mirrored(haunch_centre), haunch, Corner::Tangent(mirrored(joint))),
                side(mirrored(centre), radius, Corner::Convex),
                side(centre, radius, Corner::Tangent(joint)),
                side(haunch_centre, haunch, Corner::Tangent(DVec2::NEG_X)),
            ],
            two_centred: None,
        })
    }
}
