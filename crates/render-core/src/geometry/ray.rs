//! Rays, and what they have just left.

use glam::DVec3;

/// A half line with a unit direction, so that distances along it are in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Where it goes; unit length.
    pub direction: DVec3,
}

impl Ray {
    /// The ray from `origin` along the unit vector `direction`.
    pub const fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction }
    }

    /// The point at `distance`.
    pub fn at(&self, distance: f64) -> DVec3 {
        self.origin + self.direction * distance
    }
}

/// One of the two refracting faces of a pane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Face {
    /// `z = h1(x, y)` in the pane's frame.
    Front,
    /// `z = thickness + h2(x, y)` in the pane's frame.
    Back,
}

/// What a ray starts on. It is skipped by identity, never by a distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceId {
    /// Nothing: a camera, or a point in free space.
    Nothing,
    /// A triangle of the scene, by index. It is flat, so the ray cannot meet it again.
    Triangle(u32),
    /// A face of a pane, into the air or into the glass: the ray's direction tells which.
    Pane {
        /// Index of the pane in the scene.
        index: u32,
        /// The face on which the ray starts.
        face: Face,
    },
}
