//! A semicircle.

use glam::DVec2;

use super::{HeadForm, HeadShape};
use crate::curve::Curve;
use crate::error::GlazingError;
use crate::outline::{Corner, Side};

/// A semicircle, whose radius is half the span.
pub(super) struct Round;

impl HeadShape for Round {
    fn form(&self, span: f64, _: &str) -> Result<HeadForm, GlazingError> {
        let radius = 0.5 * span;
        let arc = Side { curve: Curve::disc(DVec2::ZERO, radius), corner: Corner::Tangent(DVec2::NEG_X) };
        Ok(HeadForm { rise: radius, first_corner: Corner::Tangent(DVec2::X), sides: vec![arc], two_centred: None })
    }
}
