//! What closes an opening above. One file for each kind.

mod flat;
mod ogee;
mod round;
mod segmental;
mod tudor;
mod two_centred;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::ogee::Ogee;
pub use self::segmental::Segmental;
pub use self::tudor::Tudor;
pub(crate) use self::two_centred::TwoCentred;
pub use self::two_centred::{Drop, Lancet};
use crate::error::{GlazingError, join};
use crate::outline::{Corner, Side};

/// What closes an opening above.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Head {
    /// A level lintel.
    #[default]
    Rectangle,
    /// A semicircle.
    Round,
    /// An arc of less than a semicircle.
    Segmental(Segmental),
    /// Two arcs with a radius greater than the width, which meet in a point.
    Lancet(Lancet),
    /// Two arcs with a radius equal to the width, which meet in a point.
    Equilateral,
    /// Two arcs with a radius smaller than the width, which meet in a point.
    Drop(Drop),
    /// Four arcs: narrow ones at the jambs, and wide ones that meet in a low point.
    Tudor(Tudor),
    /// Four arcs: convex ones at the jambs, and concave ones that meet in a sharp point.
    Ogee(Ogee),
}

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

impl Head {
    /// The names of all kinds.
    pub const NAMES: [&'static str; 8] =
        ["rectangle", "round", "segmental", "lancet", "equilateral", "drop", "tudor", "ogee"];

    /// A head of this kind with usual proportions over a span, metres; `None` for a name that is no kind.
    pub fn usual(name: &str, span: f64) -> Option<Self> {
        Some(match name {
            "rectangle" => Self::Rectangle,
            "round" => Self::Round,
            "segmental" => Self::Segmental(Segmental { rise: 0.15 * span }),
            "lancet" => Self::Lancet(Lancet { radius: 1.5 * span }),
            "equilateral" => Self::Equilateral,
            "drop" => Self::Drop(Drop { radius: 0.75 * span }),
            "tudor" => {
                Self::Tudor(Tudor { rise: 0.32 * span, haunch_radius: None, haunch_angle: tudor::haunch_angle() })
            }
            "ogee" => Self::Ogee(Ogee { rise: span, radius: None, apex_angle: ogee::apex_angle() }),
            _ => return None,
        })
    }

    /// The name in a design, and the settings.
    fn parts(&self) -> (&'static str, &dyn HeadShape) {
        match self {
            Self::Rectangle => ("rectangle", &flat::Flat),
            Self::Round => ("round", &round::Round),
            Self::Segmental(head) => ("segmental", head),
            Self::Lancet(head) => ("lancet", head),
            Self::Equilateral => ("equilateral", &two_centred::Equilateral),
            Self::Drop(head) => ("drop", head),
            Self::Tudor(head) => ("tudor", head),
            Self::Ogee(head) => ("ogee", head),
        }
    }

    /// The name in a design.
    pub(crate) fn name(&self) -> &'static str {
        self.parts().0
    }

    /// The form over a span.
    pub(crate) fn form(&self, span: f64, path: &str) -> Result<HeadForm, GlazingError> {
        let (name, head) = self.parts();
        head.form(span, &join(path, name))
    }
}

#[cfg(test)]
mod tests;
