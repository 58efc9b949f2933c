//! A round opening.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{OpeningForm, OpeningShape, SIZES};
use crate::error::{GlazingError, check};
use crate::outline::Outline;

/// A circle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Roundel {
    /// Diameter, metres; 0.05 to 30.
    #[schemars(range(min = 0.05, max = 30.0))]
    pub diameter: f64,
}

impl OpeningShape for Roundel {
    fn form(&self, path: &str) -> Result<OpeningForm, GlazingError> {
        check(path, "diameter", self.diameter, SIZES, "metres")?;
        let radius = 0.5 * self.diameter;
        let outline = Outline::disc(DVec2::new(0.0, radius), radius)
            .ok_or_else(|| GlazingError::new(path, self.diameter, "a circle"))?;
        Ok(OpeningForm { outline, arch: None })
    }
}
