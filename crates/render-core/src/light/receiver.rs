//! Points that light arrives at, as far as they decide which lights are worth asking.

use glam::DVec3;

/// A point that asks for light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Where it is, metres.
    pub position: DVec3,
    /// From where light counts.
    pub side: Side,
}

impl Receiver {
    /// A point at which light may arrive from anywhere.
    pub const fn anywhere(position: DVec3) -> Self {
        Self { position, side: Side::Anywhere }
    }
}

/// From where light counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Side {
    /// Straight from the side to which a surface's unit normal points.
    Front(DVec3),
    /// Straight from both sides of a surface with this unit normal, through which light goes too.
    Both(DVec3),
    /// From anywhere: light that is bent on its way may leave a light in any direction and arrive from any.
    Anywhere,
}

impl Side {
    /// The cosine at which light arrives from a direction towards it; `None` where all directions count alike.
    pub(super) fn cosine(&self, towards: DVec3) -> Option<f64> {
        match self {
            Self::Front(normal) => Some(normal.dot(towards)),
            Self::Both(normal) => Some(normal.dot(towards).abs()),
            Self::Anywhere => None,
        }
    }
}
