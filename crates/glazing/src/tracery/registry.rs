//! The kinds of tracery.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::geometrical::Geometrical;
use super::intersecting::{Intersecting, Y};
use super::mullions::Mullions;
use super::reticulated::Reticulated;
use super::{Cells, TraceryShape};
use crate::error::{GlazingError, join};
use crate::opening::OpeningForm;
use crate::outline::Outline;

/// How stone divides the opening into lights.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Tracery {
    /// The whole opening is one light.
    #[default]
    None,
    /// Upright bars up to the head.
    Mullions(Mullions),
    /// A mullion that forks into two arcs with the radius of the head.
    Y,
    /// Mullions that fork into arcs with the radius of the head, which cross.
    Intersecting(Intersecting),
    /// Two pointed lights under a circle with a foil.
    Geometrical(Geometrical),
    /// Ogee-headed lights under a net of ogee meshes.
    Reticulated(Reticulated),
}

/// The least extent of a light, metres.
const MIN_LIGHT: f64 = 0.04;

impl Tracery {
    /// The name in a design, and the settings.
    fn parts(&self) -> Option<(&'static str, &dyn TraceryShape)> {
        match self {
            Self::None => None,
            Self::Mullions(tracery) => Some(("mullions", tracery)),
            Self::Y => Some(("y", &Y)),
            Self::Intersecting(tracery) => Some(("intersecting", tracery)),
            Self::Geometrical(tracery) => Some(("geometrical", tracery)),
            Self::Reticulated(tracery) => Some(("reticulated", tracery)),
        }
    }

    /// The lights of an opening between bars of a width.
    pub(crate) fn lights(&self, form: &OpeningForm, bar: f64, path: &str) -> Result<Vec<Outline>, GlazingError> {
        let Some((name, tracery)) = self.parts() else { return Ok(vec![form.outline.clone()]) };
        let path = join(path, name);
        let Cells { cells, lights: needed } = tracery.cells(form, bar, &path)?;
        let mut lights = Vec::new();
        for (index, cell) in cells.into_iter().enumerate() {
            match cell.light(0.5 * bar).filter(|light| light.inset(0.5 * MIN_LIGHT).is_some()) {
                Some(light) => lights.push(light),
                None if index < needed => {
                    let expected = "narrow enough to leave room for glass in every light of this tracery";
                    return Err(GlazingError::new("stone.width", bar, expected));
                }
                None => {}
            }
        }
        Ok(lights)
    }
}
