//! What closes an opening above. One file for each kind; `registry` lists them.

mod flat;
mod ogee;
mod registry;
mod round;
mod segmental;
mod tudor;
mod two_centred;

pub use self::ogee::Ogee;
pub use self::registry::Head;
pub use self::segmental::Segmental;
pub use self::tudor::Tudor;
pub(crate) use self::two_centred::TwoCentred;
pub use self::two_centred::{Drop, Lancet};
use crate::error::GlazingError;
use crate::outline::{Corner, Side};

/// The form of a head. The origin is the middle of its springing line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HeadForm {
    /// From the springing line to the highest point, metres.
    pub(crate) rise: f64,
    /// The corner between the right jamb and the first side.
    pub(crate) first_corner: Corner,
    /// From the right jamb to the left jamb. The corner of the last side is the one with the left jamb.
    pub(crate) sides: Vec<Side>,
    /// The arcs, if there are two that meet in a point.
    pub(crate) two_centred: Option<TwoCentred>,
}

/// What every kind of head does.
pub(crate) trait HeadShape {
    /// Checks the settings, and gives the form over a span.
    fn form(&self, span: f64, path: &str) -> Result<HeadForm, GlazingError>;
}

#[cfg(test)]
mod tests;
