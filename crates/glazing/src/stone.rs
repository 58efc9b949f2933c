//! The section of tracery, and the stone of a planned window.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{GlazingError, check};

/// The section of mullions and tracery bars. Half a bar runs along the edge of the opening.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StoneSection {
    /// Width of a bar, metres; 0.02 to 1.
    #[schemars(range(min = 0.02, max = 1.0))]
    pub width: f64,
    /// Depth across the glass, metres; 0.02 to 2. The glass is in the middle.
    #[schemars(range(min = 0.02, max = 2.0))]
    pub depth: f64,
    /// Width of the chamfers along the edges of the lights, seen from the front, metres; 0 to 0.45 of the width. They
    /// are cut at 45 degrees, or less steeply where the depth is small.
    #[schemars(range(min = 0.0, max = 0.45))]
    pub chamfer: f64,
}

impl Default for StoneSection {
    fn default() -> Self {
        Self { width: 0.12, depth: 0.2, chamfer: 0.03 }
    }
}

impl StoneSection {
    /// Checks the settings.
    pub(crate) fn validate(&self, path: &str) -> Result<(), GlazingError> {
        check(path, "width", self.width, 0.02..=1.0, "metres")?;
        check(path, "depth", self.depth, 0.02..=2.0, "metres")?;
        check(path, "chamfer", self.chamfer, 0.0..=0.45 * self.width, "metres for this width")
    }
}

/// The tracery of a window: a slab in the opening, pierced by the lights.
#[derive(Clone, Debug, PartialEq)]
pub struct StoneFrame {
    /// The edge of the slab, counterclockwise, metres.
    pub outline: Vec<DVec2>,
    /// The holes.
    pub holes: Vec<StoneHole>,
    /// Depth across the glass, metres.
    pub depth: f64,
    /// Depth of the chamfers across the glass, metres; 0 where there are none.
    pub chamfer_depth: f64,
}

/// A hole in tracery. Both polygons have the same number of corners.
#[derive(Clone, Debug, PartialEq)]
pub struct StoneHole {
    /// The edge of the light, counterclockwise, metres.
    pub outline: Vec<DVec2>,
    /// The outer edge of the chamfer, on the faces of the slab, metres; the same as the outline where there is none.
    pub face_outline: Vec<DVec2>,
}
