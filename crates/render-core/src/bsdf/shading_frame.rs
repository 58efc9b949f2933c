//! The frame in which a material with interpolated normals scatters light.
//!
//! The triangle's own normal says on which side of the surface a direction is. The interpolated normal is the axis of
//! the lobes. A ray that comes from behind the plane of the interpolated normal sees that normal mirrored to its side.
//!
//! At the terminator of a coarse mesh the triangles cut light off that the lobes still scatter. Chiang, Li and Burley
//! 2019, "Taming the Shadow Terminator", fade it out before.

use glam::DVec3;

use super::SurfacePoint;
use crate::geometry::Frame;

/// A frame around the interpolated normal, on the side from which a path comes.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShadingFrame {
    frame: Frame,
    /// The triangle's normal, on the side from which the path comes.
    geometric: DVec3,
    /// Unit direction back along the path, in this frame.
    pub(super) view: DVec3,
}

impl ShadingFrame {
    /// The frame at a point to which a path comes along `incident`.
    pub(super) fn new(at: &SurfacePoint, incident: DVec3) -> Self {
        let geometric = at.normals.facing(incident);
        let is_behind = at.normals.geometric.dot(incident) > 0.0;
        let shading = if is_behind { -at.normals.shading } else { at.normals.shading };
        let cosine = -incident.dot(shading);
        let normal = if cosine < 0.0 { shading + incident * (2.0 * cosine) } else { shading };
        let frame = Frame::around(normal);
        Self { frame, geometric, view: frame.vector_to_local(-incident) }
    }

    /// A direction away from the surface in this frame, if it is in front of both normals' planes.
    pub(super) fn reflected(&self, outgoing: DVec3) -> Option<DVec3> {
        let local = self.frame.vector_to_local(outgoing);
        (local.z > 0.0 && outgoing.dot(self.geometric) > 0.0).then_some(local)
    }

    /// A direction away from the surface in this frame, if it is behind both normals' planes.
    pub(super) fn transmitted(&self, outgoing: DVec3) -> Option<DVec3> {
        let local = self.frame.vector_to_local(outgoing);
        (local.z < 0.0 && outgoing.dot(self.geometric) < 0.0).then_some(local)
    }

    /// A direction of this frame in the world.
    pub(super) fn vector_to_world(&self, local: DVec3) -> DVec3 {
        self.frame.vector_to_world(local)
    }

    /// The part of reflected light that is kept so that light fades out before the triangle's terminator; 1 where the
    /// normals agree.
    pub(super) fn terminator(&self, outgoing: DVec3) -> f64 {
        let normal = self.frame.axes.z_axis;
        let ratio = self.geometric.dot(outgoing) / (normal.dot(outgoing) * normal.dot(self.geometric));
        if ratio >= 1.0 {
            return 1.0;
        }
        // Written so that it is 1 at 1.
        let ratio = ratio.max(0.0);
        ratio * (1.0 + ratio * (1.0 - ratio))
    }
}

#[cfg(test)]
mod tests {
    use crate::texture::TextureCoordinates;

    use super::*;
    use crate::bsdf::Normals;

    fn at(shading: DVec3) -> SurfacePoint {
        let normals = Normals { geometric: DVec3::Z, shading: shading.normalize() };
        SurfacePoint { normals, texture: TextureCoordinates::default(), colour: DVec3::ONE }
    }

    #[test]
    fn a_ray_sees_the_normal_from_in_front_and_on_the_side_of_the_triangle() {
        let at = at(DVec3::new(1.0, 0.3, 0.2));
        for incident in [DVec3::new(0.9, 0.0, -0.2), DVec3::new(-0.5, 0.2, -0.8), DVec3::new(0.1, -0.9, 0.3)] {
            let incident = incident.normalize();
            let frame = ShadingFrame::new(&at, incident);
            assert!(frame.view.z > 0.0, "{incident}");
            let normal = frame.vector_to_world(DVec3::Z);
            assert!(normal.dot(at.normals.facing(incident)) > 0.0, "{incident}");
            assert!((normal.length() - 1.0).abs() < 1e-14);
            assert!((frame.vector_to_world(frame.view) + incident).length() < 1e-14);
        }
    }

    #[test]
    fn light_fades_out_at_the_terminator_of_the_triangle() {
        let tilted = ShadingFrame::new(&at(DVec3::new(0.5, 0.0, 0.8)), DVec3::NEG_Z);
        let kept = |elevation: f64| tilted.terminator(DVec3::new(libm::cos(elevation), 0.0, libm::sin(elevation)));
        assert!(kept(1e-6) < 1e-5);
        let steps: Vec<f64> = (1..=90).map(|degrees| kept(f64::from(degrees).to_radians())).collect();
        assert!(steps.is_sorted() && steps[89] == 1.0, "{steps:?}");
        let flat = ShadingFrame::new(&at(DVec3::Z), DVec3::NEG_Z);
        assert_eq!(flat.terminator(DVec3::new(0.99, 0.0, 0.1).normalize()), 1.0);
    }
}
