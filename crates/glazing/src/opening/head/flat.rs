//! A level lintel.

use glam::DVec2;

use super::{HeadForm, HeadShape};
use crate::curve::Curve;
use crate::error::GlazingError;
use crate::outline::{Corner, Side};

/// A level lintel.
pub(super) struct Flat;

impl HeadShape for Flat {
    fn form(&self, span: f64, _: &str) -> Result<HeadForm, GlazingError> {
        let half = 0.5 * span;
        let lintel = Curve::line(DVec2::new(half, 0.0), DVec2::new(-half, 0.0));
        Ok(HeadForm { rise: 0.0, first_corner: Corner::Convex, sides: vec![Side::convex(lintel)], two_centred: None })
    }
}
