//! Tracery: how stone divides an opening into lights. One file for each kind; `registry` lists
//! them.
//!
//! Every kind gives cells that are bounded by the middle lines of its bars. A light is a cell without the half bar
//! along its edge. A cell with no room for a light stays stone.

mod geometrical;
mod intersecting;
mod mullions;
mod registry;
mod reticulated;

use glam::DVec2;

pub use self::geometrical::Geometrical;
pub use self::intersecting::Intersecting;
pub use self::mullions::Mullions;
pub use self::registry::Tracery;
pub use self::reticulated::Reticulated;
use crate::clip::clipped;
use crate::curve::Curve;
use crate::error::GlazingError;
use crate::grid::crossing;
use crate::opening::{ArchForm, OpeningForm, TwoCentred, foil_outline};
use crate::outline::{Outline, Side};
use crate::polygon;

/// A cell between the middle lines of bars.
pub(crate) enum TraceryCell {
    /// Glazed up to the bars. Sides may touch in a cusp.
    Bounded(Vec<Side>),
    /// The same, within the discs of a head.
    Cut { sides: Vec<Side>, heads: [Curve; 2] },
    /// A disc that is filled by a foil.
    Foil { centre: DVec2, radius: f64, lobes: u32 },
}

impl TraceryCell {
    /// The cell without a strip along its edge.
    pub(crate) fn light(self, strip: f64) -> Option<Outline> {
        match self {
            Self::Bounded(sides) => bounded(sides, strip),
            Self::Cut { sides, heads } => {
                let light = bounded(sides, strip)?;
                heads.into_iter().try_fold(light, |light, head| clipped(&light, head.inset(strip)?))
            }
            Self::Foil { centre, radius, lobes } => {
                (radius > strip).then(|| foil_outline(centre, radius - strip, lobes)).flatten()
            }
        }
    }
}

/// What is left within sides that are moved inwards.
fn bounded(sides: Vec<Side>, strip: f64) -> Option<Outline> {
    let inset = |side: Side| Some(Side { curve: side.curve.inset(strip)?, corner: side.corner });
    let light = Outline::new(sides.into_iter().map(inset).collect::<Option<Vec<Side>>>()?)?;
    let corners = light.polygon();
    (polygon::area(&corners) > 0.0 && crossing(&corners).is_none()).then_some(light)
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
