//! Where light is gathered.

use glam::DVec3;

use crate::geometry::SurfaceId;

/// A point of a surface that is not specular, where light is gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingPoint {
    /// Where it is.
    pub position: DVec3,
    /// Unit normal on the side from which the camera path came.
    pub normal: DVec3,
    /// The surface on which it lies.
    pub surface: SurfaceId,
    /// Diffuse vertices of the path before it.
    pub bounces: u32,
}
