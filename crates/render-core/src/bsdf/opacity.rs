//! How much of a surface is there: all of it, a part of it, or what a picture cuts out.

use crate::settings::check::check_range;
use crate::settings::{Check, JsonPath};
use crate::texture::{Bitmaps, TextureCoordinates, Value, ValueDescription};

/// Opacities that differ by less are the same. Pictures have larger steps, rounding has smaller ones.
const SAME: f64 = 1e-6;

/// The part of a surface that is there.
#[derive(Clone, Debug)]
pub struct Opacity {
    value: Value,
    threshold: Option<f64>,
}

/// Checks the settings of a surface's opacity: `opacity` and `opacity_threshold` below `path`.
pub(super) fn check(opacity: &ValueDescription, threshold: Option<f64>, path: &JsonPath<'_>) -> Check {
    opacity.check(0.0, 1.0, &path.member("opacity"))?;
    threshold.map_or(Ok(()), |threshold| check_range(threshold, 0.0, 1.0, &path.member("opacity_threshold")))
}

impl Opacity {
    /// The opacity of settings that have been checked; `None` where all of the surface is there.
    pub(super) fn build(opacity: &ValueDescription, threshold: Option<f64>, bitmaps: &Bitmaps<'_>) -> Option<Self> {
        let built = Self { value: opacity.build(bitmaps), threshold };
        (built.of(built.value.least()) < 1.0).then_some(built)
    }

    /// The part of the surface that is there at a point: exactly 1 where it is solid, and 0 where there is none. The
    /// colours at the vertices of the mesh have the opacity `of_vertices` there.
    pub(crate) fn at(&self, at: TextureCoordinates, of_vertices: f64) -> f64 {
        self.of(self.value.at(at) * of_vertices)
    }

    fn of(&self, value: f64) -> f64 {
        match self.threshold {
            Some(threshold) if value < threshold => 0.0,
            Some(_) => 1.0,
            None if value < SAME => 0.0,
            None if value > 1.0 - SAME => 1.0,
            None => value,
        }
    }
}
