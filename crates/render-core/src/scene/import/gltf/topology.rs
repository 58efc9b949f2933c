//! How the corners of a primitive form triangles: lists, strips and fans.

use super::fault::fault;
use crate::settings::AssetProblem;

/// The member `mode` of a primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Topology {
    /// Points or lines, which have no triangles.
    PointsOrLines,
    Triangles,
    Strip,
    Fan,
}

impl Topology {
    pub(super) fn of(mode: Option<u32>, place: &str) -> Result<Self, AssetProblem> {
        match mode {
            Some(0..=3) => Ok(Self::PointsOrLines),
            None | Some(4) => Ok(Self::Triangles),
            Some(5) => Ok(Self::Strip),
            Some(6) => Ok(Self::Fan),
            Some(mode) => Err(fault(format_args!("{place}.mode"), format_args!("found {mode}, must be 0 to 6"))),
        }
    }

    /// Triangles of a number of corners. Corners that complete none are ignored, as glTF recommends.
    pub(super) fn triangles(self, corners: usize) -> usize {
        match self {
            Self::PointsOrLines => 0,
            Self::Triangles => corners / 3,
            Self::Strip | Self::Fan => corners.saturating_sub(2),
        }
    }

    /// The corners of triangle `number`, in the order that makes its front face counterclockwise.
    pub(super) fn triangle(self, number: usize) -> [usize; 3] {
        match self {
            Self::PointsOrLines => [0; 3],
            Self::Triangles => [3 * number, 3 * number + 1, 3 * number + 2],
            Self::Strip => [number, number + 1 + number % 2, number + 2 - number % 2],
            Self::Fan => [number + 1, number + 2, 0],
        }
    }
}
