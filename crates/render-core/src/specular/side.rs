//! A pane seen from the side on which a shading point lies, and the exact path of a ray through both of its faces.

use glam::{DVec2, DVec3};

use crate::math::absorption;
use crate::{
    bsdf::fresnel::refract,
    bsdf::polarisation::Polarisation,
    geometry::{Face, HeightField, Pane, PaneBoundary, Ray},
    light::Source,
};
use clerestory_film::counters::Counters;

/// Rays that cross a pane's plane at less than this cosine belong to the path tracer: at 89.9 degrees the bounds on
/// deflection grow past every pane.
pub const GRAZING_COSINE: f64 = 1e-3;

/// A pane seen from one side. `near` is the face that looks at the shading point.
#[derive(Clone, Copy, Debug)]
pub struct PaneSide<'a> {
    /// The pane.
    pub pane: &'a Pane,
    /// The face on the side of the shading point.
    pub near: Face,
    /// The other face.
    pub far: Face,
    /// 1 when the shading point lies in front, -1 when it lies behind: the sign of z along the way to the light.
    pub sign: f64,
}

/// A ray that went in through one face of a pane and out through the other. All in the pane's frame.
#[derive(Clone, Copy, Debug)]
pub struct Transmission {
    /// Where it went in.
    pub entry: DVec3,
    /// Where it came out.
    pub exit: DVec3,
    /// Unit direction in the glass.
    pub inner_direction: DVec3,
    /// Unit direction after the pane.
    pub direction: DVec3,
    /// What both faces transmit together of the light.
    pub transmitted: f64,
    /// The same times what the glass and its layers leave.
    pub transmittance: DVec3,
    /// Polarisation after the pane.
    pub(crate) polarisation: Polarisation,
}

impl<'a> PaneSide<'a> {
    /// The pane as seen from `point` (in the pane's frame); `None` for points between the highest and the lowest point
    /// of either face or of its plane, to which the specular methods give no light (see [`super::coverage`]).
    pub fn facing(pane: &'a Pane, point: DVec3) -> Option<Self> {
        if point.z < pane.bounds(Face::Front).height.min.min(0.0) {
            Some(Self { pane, near: Face::Front, far: Face::Back, sign: 1.0 })
        } else if point.z > pane.thickness + pane.bounds(Face::Back).height.max.max(0.0) {
            Some(Self { pane, near: Face::Back, far: Face::Front, sign: -1.0 })
        } else {
            None
        }
    }

    /// Whether any point of the pane lies in front of the plane through `point` with the normal `normal`, both in the
    /// pane's frame: light through a pane that lies behind a surface cannot reach it.
    pub fn rises_above(&self, point: DVec3, normal: DVec3) -> bool {
        let reach = self.pane.outline.extent(normal.truncate()).max;
        let heights = self.pane.bounds(self.near).height;
        let rise = |height: f64| normal.z * (self.near_base() + height - point.z);
        let depth = rise(heights.min).max(rise(heights.max));
        reach + depth - normal.x * point.x - normal.y * point.y > 0.0
    }

    /// Whether a source (in the pane's frame) is on the shading point's side of the undisplaced near face, so that the
    /// search for light that this face reflects looks for it.
    pub(super) fn is_lit_from_here(&self, source: Source) -> bool {
        match source {
            Source::Point(point) => (point.z - self.near_base()) * -self.sign > 0.0,
            Source::Direction(direction) => -direction.z * self.sign > 0.0,
        }
    }

    /// Height field of the near face.
    pub fn near_surface(&self) -> &'a HeightField {
        self.pane.surface(self.near)
    }

    /// Height field of the far face.
    pub fn far_surface(&self) -> &'a HeightField {
        self.pane.surface(self.far)
    }

    /// z of the undisplaced near face.
    pub fn near_base(&self) -> f64 {
        self.pane.base_height(self.near)
    }

    /// z of the undisplaced far face.
    pub fn far_base(&self) -> f64 {
        self.pane.base_height(self.far)
    }

    /// Traces a ray, given in the pane's frame, from outside through both faces. `None` when it misses the near face,
    /// meets the edge, leaves by the face by which it entered, or is totally reflected.
    pub fn transmit(&self, ray: &Ray, counters: &mut Counters) -> Option<Transmission> {
        self.transmit_polarised(ray, Polarisation::NONE, counters)
    }

    /// The same with light that has this polarisation, in the pane's frame.
    pub(crate) fn transmit_polarised(
        &self,
        ray: &Ray,
        light: Polarisation,
        counters: &mut Counters,
    ) -> Option<Transmission> {
        let index = self.pane.index_of_refraction;
        let entry = self.pane.intersect_outside(ray, f64::INFINITY, None, counters)?;
        if entry.boundary != PaneBoundary::Face(self.near) {
            return None;
        }
        let normal = unit_normal(entry.gradient);
        let inner = refract(ray.direction, normal, 1.0, index)?;
        let light = light.incident(ray.direction, normal);
        let (first, light) = light.after(inner.fresnel.transmission());
        let inner_ray = Ray::new(entry.point, inner.direction);
        let exit = self.pane.intersect_inside(&inner_ray, Some(self.near), counters)?;
        if exit.boundary != PaneBoundary::Face(self.far) {
            return None;
        }
        let normal = unit_normal(exit.gradient);
        let outer = refract(inner.direction, normal, index, 1.0)?;
        let (second, light) = light.incident(inner.direction, normal).after(outer.fresnel.transmission());
        let layers = self.pane.layer(self.near, inner.direction.dot(unit_normal(entry.gradient)))
            * self.pane.layer(self.far, inner.direction.dot(normal));
        Some(Transmission {
            entry: entry.point,
            exit: exit.point,
            inner_direction: inner.direction,
            direction: outer.direction,
            transmitted: first * second,
            transmittance: absorption(self.pane.absorption, exit.distance) * layers * (first * second),
            polarisation: light,
        })
    }
}

/// Unit normal of the surface `z = h(x, y)`, towards +z.
#[inline(always)]
pub fn unit_normal(gradient: DVec2) -> DVec3 {
    DVec3::new(-gradient.x, -gradient.y, 1.0).normalize()
}
