//! Flat lights of uniform radiance, which shine along the z axis of their frame. They differ in their shape alone.

use std::f64::consts::PI;
use std::fmt::Debug;

use glam::{DVec2, DVec3};

use super::cap;
use super::{Body, Emission, EmissionCone, Emitter, LiSample, LightBounds, LightHit, Receiver, Source, SourceSample};
use crate::geometry::{Frame, Ray};

/// A shape in the plane of x and y, around the origin.
pub(super) trait FlatShape: Debug + Send + Sync {
    /// Its area, square metres.
    fn area(&self) -> f64;

    /// The largest distance of a point of it from the origin, metres.
    fn extent(&self) -> f64;

    /// Half the extent along each axis of the world when it lies in a frame.
    fn half_extents(&self, frame: &Frame) -> DVec3;

    /// A point of it that is uniform over its area.
    fn sample(&self, random: DVec2) -> DVec2;

    /// Whether a point of the plane is in it.
    fn holds(&self, point: DVec2) -> bool;

    /// The corners of a convex polygon that stands for it.
    fn corners(&self) -> Vec<DVec2>;
}

/// A shape that shines to one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FlatLight<S> {
    /// Origin at the centre, z along the normal.
    pub(super) frame: Frame,
    pub(super) shape: S,
    /// Emitted radiance, W/(m2 sr).
    pub(super) radiance: DVec3,
}

impl<S: FlatShape> Emitter for FlatLight<S> {
    fn emission(&self) -> DVec3 {
        self.radiance
    }

    fn power(&self) -> f64 {
        PI * self.shape.area() * (self.radiance.element_sum() / 3.0)
    }

    fn emission_cone(&self) -> EmissionCone {
        EmissionCone::from_plane(self.frame.axes.z_axis)
    }

    fn bounds(&self) -> LightBounds {
        LightBounds::Ball { centre: self.frame.origin, radius: self.shape.extent() }
    }

    fn bounding_box(&self) -> Option<[DVec3; 2]> {
        let half = self.shape.half_extents(&self.frame);
        Some([self.frame.origin - half, self.frame.origin + half])
    }

    fn body(&self) -> Option<Body> {
        let corners = self.shape.corners().into_iter();
        Some(Body::Polygon(corners.map(|corner| self.frame.point_to_world(corner.extend(0.0))).collect()))
    }

    fn largest_solid_angle(&self, [min, max]: [DVec3; 2]) -> Option<f64> {
        let whole = 2.0 * PI;
        let centre = self.frame.origin;
        let nearest = centre.distance(centre.clamp(min, max)) - self.shape.extent();
        // From no nearer than this, the area can be seen at no larger angle than if it were all there, seen head on.
        Some(if nearest > 0.0 { (self.shape.area() / (nearest * nearest)).min(whole) } else { whole })
    }

    fn sample_source(&self, _: DVec3, _: f64, random: DVec2) -> SourceSample {
        SourceSample {
            source: Source::Point(self.frame.point_to_world(self.shape.sample(random).extend(0.0))),
            normal: Some(self.frame.axes.z_axis),
            triangle: None,
            weight: self.radiance * self.shape.area(),
        }
    }

    fn source_density(&self, _: DVec3, _: f64, _: Source) -> f64 {
        1.0 / self.shape.area()
    }

    fn emit(&self, place: DVec2, direction: DVec2) -> Option<Emission> {
        let origin = self.frame.point_to_world(self.shape.sample(place).extend(0.0));
        let ray = Ray::new(origin, self.frame.vector_to_world(cap::cosine_direction(direction)));
        Some(Emission { ray, radiance: self.radiance, density: self.emission_density(&ray) })
    }

    fn emission_density(&self, _: &Ray) -> f64 {
        1.0 / (PI * self.shape.area())
    }

    fn source_at(&self, ray: &Ray, hit: &LightHit) -> (Source, f64) {
        (Source::Point(ray.at(hit.distance)), -self.frame.axes.z_axis.dot(ray.direction))
    }

    fn normal_at(&self, _: Source, _: &LightHit) -> Option<DVec3> {
        Some(self.frame.axes.z_axis)
    }

    fn sample_li(&self, receiver: &Receiver, random: DVec2) -> Option<LiSample> {
        let position = self.frame.point_to_world(self.shape.sample(random).extend(0.0));
        let offset = position - receiver.position;
        let distance_squared = offset.length_squared();
        let distance = distance_squared.sqrt();
        let direction = offset / distance;
        let cosine = -direction.dot(self.frame.axes.z_axis);
        let solid_angle = self.shape.area() * cosine / distance_squared;
        // A light that is too far or too small for a density sends nothing.
        (solid_angle.is_normal() && solid_angle > 0.0).then(|| LiSample {
            direction,
            distance,
            weight: self.radiance * solid_angle,
            pdf: Some(1.0 / solid_angle),
        })
    }

    fn pdf_li(&self, _: &Receiver, ray: &Ray, hit: &LightHit) -> f64 {
        let cosine = -ray.direction.dot(self.frame.axes.z_axis);
        if cosine > 0.0 { hit.distance * hit.distance / (self.shape.area() * cosine) } else { 0.0 }
    }

    fn intersect(&self, ray: &Ray) -> Option<LightHit> {
        let origin = self.frame.point_to_local(ray.origin);
        let direction = self.frame.vector_to_local(ray.direction);
        let distance = -origin.z / direction.z;
        if !(distance > 0.0 && distance.is_finite()) {
            return None;
        }
        let point = origin + direction * distance;
        let radiance = if direction.z < 0.0 { self.radiance } else { DVec3::ZERO };
        self.shape.holds(point.truncate()).then_some(LightHit { distance, radiance, triangle: None })
    }
}
