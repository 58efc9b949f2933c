//! A BSDF where a path has met a surface, and what absorbs light on both sides of it.

use glam::DVec3;

use crate::bsdf::{Bsdf, SurfacePoint};
use crate::integrator::light_subpaths::FromCamera;
use crate::light::Receiver;
use crate::math::absorption;
use crate::scene::ShadingPoint;
use crate::scene::media::Bodies;

/// The point with the normal of each side on which light from specular surfaces is gathered.
pub(super) fn sides(point: ShadingPoint, gathers_behind: bool) -> impl Iterator<Item = ShadingPoint> {
    let behind = ShadingPoint { normal: -point.normal, ..point };
    std::iter::once(point).chain(gathers_behind.then_some(behind))
}

/// A BSDF at a point that a path has reached.
pub(super) struct Lobe<'a> {
    pub(super) bsdf: &'a dyn Bsdf,
    pub(super) at: &'a SurfacePoint,
    pub(super) incident: DVec3,
    /// How it asks for light.
    pub(super) receiver: Receiver,
    /// What absorbs light on the side from which the path has come, and on the other side, per metre.
    pub(super) bodies: [DVec3; 2],
    /// The bodies that meet others, on both sides.
    pub(super) around: [&'a Bodies; 2],
    /// What light subpaths find of the path up to it.
    pub(super) by_light: FromCamera,
}

impl Lobe<'_> {
    pub(super) fn eval(&self, outgoing: DVec3) -> DVec3 {
        self.bsdf.eval(self.at, self.incident, outgoing)
    }

    pub(super) fn pdf(&self, outgoing: DVec3) -> f64 {
        self.bsdf.pdf(self.at, self.incident, outgoing)
    }

    /// What light subpaths find of the path, if it goes on in a direction.
    pub(super) fn by_light(&self, outgoing: DVec3) -> f64 {
        self.by_light.total(|| self.bsdf.pdf(self.at, -outgoing, -self.incident))
    }

    pub(super) fn cosine(&self, outgoing: DVec3) -> f64 {
        self.at.normals.geometric.dot(outgoing).abs()
    }

    /// What remains of light that comes from this far in a direction.
    pub(super) fn kept(&self, outgoing: DVec3, distance: f64) -> DVec3 {
        through_body(self.bodies[self.side(outgoing)], distance)
    }

    /// The bodies into which a direction leads.
    pub(super) fn around(&self, outgoing: DVec3) -> &Bodies {
        self.around[self.side(outgoing)]
    }

    pub(super) fn side(&self, outgoing: DVec3) -> usize {
        let normal = self.at.normals.geometric;
        usize::from(outgoing.dot(normal) * self.incident.dot(normal) > 0.0)
    }
}

/// What absorbs light before a surface, per metre: the body that ends there, whether the path has entered it or began
/// in it. `body` is the one that the path has entered.
pub(super) fn absorption_before(bsdf: &dyn Bsdf, leaves: bool, body: DVec3) -> DVec3 {
    if leaves && bsdf.absorption() != DVec3::ZERO { bsdf.absorption() } else { body }
}

/// What absorbs light behind a surface, per metre, if this does before it. A thin wall bounds no body: behind it is
/// what was before it.
pub(super) fn absorption_behind(bsdf: &dyn Bsdf, leaves: bool, before: DVec3) -> DVec3 {
    match (bsdf.absorption(), leaves) {
        (coefficient, _) if coefficient == DVec3::ZERO => before,
        (_, true) => DVec3::ZERO,
        (coefficient, false) => coefficient,
    }
}

/// What a body lets through over a distance. Where nothing ends it, it has no end and takes no light.
pub(super) fn through_body(coefficient: DVec3, distance: f64) -> DVec3 {
    if coefficient == DVec3::ZERO || !distance.is_finite() { DVec3::ONE } else { absorption(coefficient, distance) }
}
