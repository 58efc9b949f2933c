//! The kinds of heads.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::flat::Flat;
use super::ogee::Ogee;
use super::round::Round;
use super::segmental::Segmental;
use super::tudor::Tudor;
use super::two_centred::{Drop, Equilateral, Lancet};
use super::{HeadForm, HeadShape};
use crate::error::{GlazingError, join};

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
            "tudor" => Self::Tudor(Tudor::usual(span)),
            "ogee" => Self::Ogee(Ogee::usual(span)),
            _ => return None,
        })
    }

    /// The name in a design, and the settings.
    fn parts(&self) -> (&'static str, &dyn HeadShape) {
        match self {
            Self::Rectangle => ("rectangle", &Flat),
            Self::Round => ("round", &Round),
            Self::Segmental(head) => ("segmental", head),
            Self::Lancet(head) => ("lancet", head),
            Self::Equilateral => ("equilateral", &Equilateral),
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
