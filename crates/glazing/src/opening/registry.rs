//! The kinds of openings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::arch::Arch;
use super::drawn::DrawnOpening;
use super::foil::Foil;
use super::roundel::Roundel;
use super::{OpeningForm, OpeningShape};
use crate::error::{GlazingError, join};

/// The opening in the wall. Its lowest edge is at y = 0 and its middle at x = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Opening {
    /// Upright jambs on a level sill, and a head.
    Arch(Arch),
    /// A circle.
    Roundel(Roundel),
    /// Lobes within a circle: a trefoil, a quatrefoil.
    Foil(Foil),
    /// A drawn outline.
    Drawn(DrawnOpening),
}

impl Opening {
    /// The form of the opening.
    pub(crate) fn form(&self, path: &str) -> Result<OpeningForm, GlazingError> {
        let (name, shape): (&str, &dyn OpeningShape) = match self {
            Self::Arch(arch) => ("arch", arch),
            Self::Roundel(roundel) => ("roundel", roundel),
            Self::Foil(foil) => ("foil", foil),
            Self::Drawn(drawn) => ("drawn", drawn),
        };
        shape.form(&join(path, name))
    }
}
