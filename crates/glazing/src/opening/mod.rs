//! The opening in the wall. One file for each kind; `registry` lists them.

mod arch;
mod drawn;
mod foil;
mod head;
mod registry;
mod roundel;

pub use self::arch::Arch;
pub use self::drawn::DrawnOpening;
pub use self::foil::Foil;
pub(crate) use self::foil::{LOBES, foil_outline};
pub(crate) use self::head::TwoCentred;
pub use self::head::{Drop, Head, Lancet, Ogee, Segmental, Tudor};
pub use self::registry::Opening;
pub use self::roundel::Roundel;
use crate::error::GlazingError;
use crate::outline::Outline;

/// The form of an opening.
pub(crate) struct OpeningForm {
    /// Its edge.
    pub(crate) outline: Outline,
    /// What tracery needs to know of an opening with jambs and a sill.
    pub(crate) arch: Option<ArchForm>,
}

/// The form of an opening with jambs and a sill.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ArchForm {
    /// From jamb to jamb, metres.
    pub(crate) span: f64,
    /// The height at which the head starts, metres above the sill.
    pub(crate) springing: f64,
    /// The head, if it is two arcs that meet in a point.
    pub(crate) two_centred: Option<TwoCentred>,
    /// Whether the head is a level line.
    pub(crate) is_level: bool,
}

/// What every kind of opening does.
pub(crate) trait OpeningShape {
    /// Checks the settings, and gives the form.
    fn form(&self, path: &str) -> Result<OpeningForm, GlazingError>;
}

/// Widths and heights of openings, metres.
pub(crate) const SIZES: std::ops::RangeInclusive<f64> = 0.05..=30.0;
