//! Orthonormal frames.

use glam::{DMat3, DVec3};

/// A right-handed orthonormal frame with an origin: the placement of a pane, a receiver or a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The origin, in world coordinates.
    pub origin: DVec3,
    /// Columns are the frame's x, y and z axes in world coordinates.
    pub axes: DMat3,
}

impl Frame {
    /// That of world coordinates.
    pub const WORLD: Self = Self { origin: DVec3::ZERO, axes: DMat3::IDENTITY };

    /// A frame at `origin` with the given orthonormal x and y axes; z is their cross product.
    pub fn new(origin: DVec3, x: DVec3, y: DVec3) -> Self {
        Self { origin, axes: DMat3::from_cols(x, y, x.cross(y)) }
    }

    /// A frame at the world's origin whose z axis is the unit vector `z` (Duff et al. 2017, without a branch).
    pub fn around(z: DVec3) -> Self {
        let sign = 1f64.copysign(z.z);
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        let x = DVec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x);
        let y = DVec3::new(b, sign + z.y * z.y * a, -z.y);
        Self { origin: DVec3::ZERO, axes: DMat3::from_cols(x, y, z) }
    }

    /// A world point in this frame.
    pub fn point_to_local(&self, point: DVec3) -> DVec3 {
        self.vector_to_local(point - self.origin)
    }

    /// A point of this frame in the world.
    pub fn point_to_world(&self, point: DVec3) -> DVec3 {
        self.origin + self.vector_to_world(point)
    }

    /// A world direction in this frame.
    pub fn vector_to_local(&self, vector: DVec3) -> DVec3 {
        DVec3::new(self.axes.x_axis.dot(vector), self.axes.y_axis.dot(vector), self.axes.z_axis.dot(vector))
    }

    /// A direction of this frame in the world.
    pub fn vector_to_world(&self, vector: DVec3) -> DVec3 {
        self.axes.x_axis * vector.x + self.axes.y_axis * vector.y + self.axes.z_axis * vector.z
    }
}
