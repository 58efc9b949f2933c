//! Tracery: how stone divides an opening into lights. One file for each kind.
//!
//! Every kind gives cells that are bounded by the middle lines of its bars. A light is a cell without the half bar
//! along its edge. A cell with no room for a light stays stone.

mod geometrical;
mod intersecting;
mod mullions;

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::geometrical::Geometrical;
pub use self::intersecting::Intersecting;
pub use self::mullions::Mullions;
use crate::error::{GlazingError, join};
use crate::opening::{ArchForm, OpeningForm, TwoCentred, foil_outline};
use crate::outline::{Outline, Side};
use crate::polygon;

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
}

/// A cell between the middle lines of bars.
pub(crate) enum TraceryCell {
    /// Glazed up to the bars. Sides may touch in a cusp.
    Bounded(Vec<Side>),
    /// A disc that is filled by a foil.
    Foil { centre: DVec2, radius: f64, lobes: u32 },
}

impl TraceryCell {
    /// The cell without a strip along its edge.
    fn light(self, strip: f64) -> Option<Outline> {
        match self {
            Self::Bounded(sides) => {
                let inset = |side: Side| Some(Side { curve: side.curve.inset(strip)?, corner: side.corner });
                let light = Outline::new(sides.into_iter().map(inset).collect::<Option<Vec<Side>>>()?)?;
                let corners = light.polygon();
                (polygon::area(&corners) > 0.0 && polygon::crossing(&corners).is_none()).then_some(light)
            }
            Self::Foil { centre, radius, lobes } => {
                (radius > strip).then(|| foil_outline(centre, radius - strip, lobes)).flatten()
            }
        }
    }
}

/// What every kind of tracery does.
pub(crate) trait TraceryShape {
    /// Checks the settings, and gives the cells of an opening. The first ones are lights that must have room for glass.
    fn cells(&self, form: &OpeningForm, bar: f64, path: &str) -> Result<Cells, GlazingError>;
}

/// The cells of an opening.
pub(crate) struct Cells {
    pub(crate) cells: Vec<TraceryCell>,
    /// So many of them must have room for glass.
    pub(crate) lights: usize,
}

/// The least extent of a light, metres.
const MIN_LIGHT: f64 = 0.04;

impl Tracery {
    /// The name in a design, and the settings.
    fn parts(&self) -> Option<(&'static str, &dyn TraceryShape)> {
        match self {
            Self::None => None,
            Self::Mullions(tracery) => Some(("mullions", tracery)),
            Self::Y => Some(("y", &intersecting::Y)),
            Self::Intersecting(tracery) => Some(("intersecting", tracery)),
            Self::Geometrical(tracery) => Some(("geometrical", tracery)),
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

/// The arcs of a two-centred head, which a kind of tracery needs.
pub(crate) fn two_centred(form: &OpeningForm, path: &str) -> Result<(ArchForm, TwoCentred), GlazingError> {
    let arch = form.arch.and_then(|arch| Some((arch, arch.two_centred?)));
    arch.filter(|(arch, _)| arch.springing > 0.01).ok_or_else(|| {
        let found = "this tracery in another opening";
        GlazingError::new(path, found, "in an arch with jambs and a lancet, equilateral or drop head")
    })
}

#[cfg(test)]
mod tests;
