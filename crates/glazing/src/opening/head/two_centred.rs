//! Two arcs that meet in a point: lancet, equilateral and drop arches.
//!
//! The centre of each arc lies on the springing line, at the distance of the radius `r` from the jamb where it starts.
//! Over a span `s` the apex is `sqrt(r s - s^2/4)` high.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{HeadForm, HeadShape};
use crate::curve::Curve;
use crate::error::{GlazingError, check};
use crate::outline::{Corner, Side};

/// Two arcs with a radius greater than the width.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lancet {
    /// Radius of the arcs, metres; 1 to 10 times the width.
    #[schemars(range(min = 0.05, max = 300.0))]
    pub radius: f64,
}

/// Two arcs with a radius smaller than the width.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Drop {
    /// Radius of the arcs, metres; 0.51 to 1 times the width.
    #[schemars(range(min = 0.025, max = 30.0))]
    pub radius: f64,
}

/// Two arcs with a radius equal to the width.
pub(super) struct Equilateral;

impl HeadShape for Lancet {
    fn form(&self, span: f64, path: &str) -> Result<HeadForm, GlazingError> {
        check(path, "radius", self.radius, span..=10.0 * span, "metres for this width")?;
        Ok(form(span, self.radius))
    }
}

impl HeadShape for Drop {
    fn form(&self, span: f64, path: &str) -> Result<HeadForm, GlazingError> {
        check(path, "radius", self.radius, 0.51 * span..=span, "metres for this width")?;
        Ok(form(span, self.radius))
    }
}

impl HeadShape for Equilateral {
    fn form(&self, span: f64, _: &str) -> Result<HeadForm, GlazingError> {
        Ok(form(span, span))
    }
}

fn form(span: f64, radius: f64) -> HeadForm {
    let arcs = TwoCentred { radius };
    let half = 0.5 * span;
    HeadForm {
        rise: arcs.rise(span),
        first_corner: Corner::Tangent(DVec2::X),
        sides: vec![
            Side::convex(arcs.right(DVec2::new(half, 0.0))),
            Side { curve: arcs.left(DVec2::new(-half, 0.0)), corner: Corner::Tangent(DVec2::NEG_X) },
        ],
        two_centred: Some(arcs),
    }
}

/// The arcs of a two-centred arch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TwoCentred {
    /// The radius of both arcs, metres.
    pub(crate) radius: f64,
}

impl TwoCentred {
    /// From the springing line to the point where arcs meet that start at this distance from each other.
    pub(crate) fn rise(self, span: f64) -> f64 {
        (self.radius * span - 0.25 * span * span).sqrt()
    }

    /// The arc that rises from a point to the left. Its disc is inside.
    pub(crate) fn right(self, springer: DVec2) -> Curve {
        Curve::disc(springer - DVec2::new(self.radius, 0.0), self.radius)
    }

    /// The arc that falls from the right to a point. Its disc is inside.
    pub(crate) fn left(self, springer: DVec2) -> Curve {
        Curve::disc(springer + DVec2::new(self.radius, 0.0), self.radius)
    }
}
