//! An arc of less than a semicircle.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{HeadForm, HeadShape};
use crate::curve::Curve;
use crate::error::{GlazingError, check};
use crate::outline::{Corner, Side};

/// An arc of less than a semicircle, with the radius `(s^2/4 + q^2) / (2 q)` over a span `s` with a rise `q`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Segmental {
    /// From the springing line to the highest point, metres; 0.01 to 0.49 of the width.
    #[schemars(range(min = 0.0005, max = 15.0))]
    pub rise: f64,
}

impl HeadShape for Segmental {
    fn form(&self, span: f64, path: &str) -> Result<HeadForm, GlazingError> {
        let rise = self.rise;
        check(path, "rise", rise, 0.01 * span..=0.49 * span, "metres for this width")?;
        let radius = (0.25 * span * span + rise * rise) / (2.0 * rise);
        let arc = Side::convex(Curve::disc(DVec2::new(0.0, rise - radius), radius));
        Ok(HeadForm { rise, first_corner: Corner::Convex, sides: vec![arc], two_centred: None })
    }
}
