//! The kinds of fillings.

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::border::Border;
use super::diamonds::Diamonds;
use super::drawn::Drawn;
use super::plain::Plain;
use super::rectangles::Rectangles;
use super::roundels::Roundels;
use super::{FillingShape, Layout, Region};
use crate::error::{GlazingError, join};
use crate::outline::Outline;

/// How each light is divided into pieces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Filling {
    /// One piece, which is cut only where its outline is hollow.
    Plain,
    /// Diamond quarries.
    Diamonds(Diamonds),
    /// Courses of rectangles.
    Rectangles(Rectangles),
    /// A border along the edge, around a field.
    Border(Border),
    /// Discs in staggered rows.
    Roundels(Roundels),
    /// Pieces along drawn outlines.
    Drawn(Drawn),
}

impl Default for Filling {
    fn default() -> Self {
        Self::Diamonds(Diamonds::default())
    }
}

impl Filling {
    /// The name in a design, and the settings.
    fn parts(&self) -> (&'static str, &dyn FillingShape) {
        match self {
            Self::Plain => ("plain", &Plain),
            Self::Diamonds(filling) => ("diamonds", filling),
            Self::Rectangles(filling) => ("rectangles", filling),
            Self::Border(filling) => ("border", filling),
            Self::Roundels(filling) => ("roundels", filling),
            Self::Drawn(filling) => ("drawn", filling),
        }
    }

    /// Checks the settings.
    pub(crate) fn validate(&self, path: &str) -> Result<(), GlazingError> {
        let (name, filling) = self.parts();
        filling.validate(&join(path, name))
    }

    /// The lead lines in a region.
    pub(crate) fn lay_out<'a>(&'a self, region: Region<'_>, path: &str) -> Result<Layout<'a>, GlazingError> {
        let (name, filling) = self.parts();
        filling.lay_out(region, &join(path, name))
    }

    /// Checks the settings against all lights of a window.
    pub(crate) fn check_fit(&self, lights: &[Outline], upper_left: DVec2, path: &str) -> Result<(), GlazingError> {
        let (name, filling) = self.parts();
        filling.check_fit(lights, upper_left, &join(path, name))
    }

    /// Kinds of glass that the filling names.
    pub(crate) fn glass_names(&self) -> Vec<&str> {
        self.parts().1.glass_names()
    }
}
