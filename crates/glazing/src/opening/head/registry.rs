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
