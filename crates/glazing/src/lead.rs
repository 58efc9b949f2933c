//! The cames: strips of lead with an H section. Two flanges cover the edges of the glass, and a heart between them
//! separates the pieces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{GlazingError, check, join};

/// What holds the pieces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Lead {
    /// Nothing: neighbouring pieces touch.
    None,
    /// Lead cames.
    Cames(Cames),
}

/// Lead cames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Cames {
    /// Width of the flanges between pieces, metres; 0.003 to 0.05, and more than the heart.
    #[schemars(range(min = 0.003, max = 0.05))]
    pub flange_width: f64,
    /// Width of the flanges along the edge of a light, metres; 0.003 to 0.1, and more than the heart. Half of it lies
    /// on the stone.
    #[schemars(range(min = 0.003, max = 0.1))]
    pub border_width: f64,
    /// Thickness of each flange across the glass, metres; 0.0002 to 0.01.
    #[schemars(range(min = 0.0002, max = 0.01))]
    pub flange_thickness: f64,
    /// Thickness of the heart, which is the distance between neighbouring pieces, metres; 0.0002 to 0.01.
    #[schemars(range(min = 0.0002, max = 0.01))]
    pub heart_thickness: f64,
    /// Distance between the two flanges, metres; 0.001 to 0.05. The glass lies between them.
    #[schemars(range(min = 0.001, max = 0.05))]
    pub heart_height: f64,
    /// Section of the flanges.
    pub profile: CameProfile,
    /// Whether joints are soldered.
    pub solder: bool,
}

/// Section of a flange.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CameProfile {
    /// A rectangle.
    #[default]
    Flat,
    /// Half of an ellipse, as high as the flange is thick.
    Round,
}

impl Default for Cames {
    fn default() -> Self {
        Self {
            flange_width: 0.01,
            border_width: 0.014,
            flange_thickness: 0.001,
            heart_thickness: 0.0015,
            heart_height: 0.005,
            profile: CameProfile::Flat,
            solder: true,
        }
    }
}

impl Default for Lead {
    fn default() -> Self {
        Self::Cames(Cames::default())
    }
}

impl Lead {
    /// Checks the settings.
    pub(crate) fn validate(&self, path: &str) -> Result<(), GlazingError> {
        let Self::Cames(cames) = self else { return Ok(()) };
        let path = join(path, "cames");
        let metres = |member, value, range| check(&path, member, value, range, "metres");
        metres("heart_thickness", cames.heart_thickness, 0.0002..=0.01)?;
        let least = (2.0 * cames.heart_thickness).max(0.003);
        metres("flange_width", cames.flange_width, least..=0.05)?;
        metres("border_width", cames.border_width, least..=0.1)?;
        metres("flange_thickness", cames.flange_thickness, 0.0002..=0.01)?;
        metres("heart_height", cames.heart_height, 0.001..=0.05)
    }

    /// The cames, if there are any.
    pub(crate) fn cames(&self) -> Option<&Cames> {
        match self {
            Self::None => None,
            Self::Cames(cames) => Some(cames),
        }
    }
}

/// The part of the visible flange under which corrections of pieces stay hidden.
const HIDDEN_PART: f64 = 0.8;

impl Cames {
    /// Width of the strip along the edges of every cell that the flanges hide, metres, with a margin.
    pub(crate) fn hidden(&self) -> f64 {
        HIDDEN_PART * 0.5 * (self.flange_width.min(self.border_width) - self.heart_thickness)
    }

    /// The outer faces of the flanges are at this distance from the middle of the glass, metres.
    pub(crate) fn half_depth(&self) -> f64 {
        0.5 * self.heart_height + self.flange_thickness
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flanges_are_wider_than_the_heart() {
        let lead = Lead::Cames(Cames { heart_thickness: 0.006, ..Cames::default() });
        assert_eq!(lead.validate("lead").unwrap_err().path, "lead.cames.flange_width");
        assert_eq!(Lead::default().validate("lead"), Ok(()));
    }
}
