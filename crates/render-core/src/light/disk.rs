//! A disk of uniform radiance that shines to one side.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, EmissionCone, Emitter, LiSample, LightBounds, LightHit, LightSettings, Source, SourceSample, flat};
use crate::geometry::{Frame, Ray};
use crate::settings::check::{check_above, check_direction, check_triple};
use crate::settings::limits::{MAX_EMISSION, MAX_LIGHT_COORDINATE};
use crate::settings::{Check, JsonPath, Triple};

/// Corners of the polygon that stands for a disk: it lies in it, and lacks 0.04 percent of its radius.
const CORNERS: u32 = 128;

/// A disk that shines to the side to which `normal` points; its other side is black.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct DiskLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Its centre.
    pub centre: Triple,
    /// Direction to which it shines, perpendicular to it.
    pub normal: Triple,
    /// Its radius, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
    /// Emitted radiance, W/(m2 sr).
    #[schemars(inner(range(min = 0.0)))]
    pub radiance: Triple,
}

impl LightSettings for DiskLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        Some("centre")
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_triple(self.centre, -MAX_LIGHT_COORDINATE, MAX_LIGHT_COORDINATE, &path.member("centre"))?;
        check_direction(self.normal, &path.member("normal"))?;
        check_above(self.radius, 0.0, MAX_LIGHT_COORDINATE, &path.member("radius"))?;
        check_triple(self.radiance, 0.0, MAX_EMISSION, &path.member("radiance"))
    }

    fn build(&self) -> Arc<dyn Emitter> {
        Arc::new(Disk {
            frame: Frame { origin: self.centre.into(), ..Frame::around(DVec3::from(self.normal).normalize()) },
            radius: self.radius,
            radiance: self.radiance.into(),
        })
    }
}

/// A disk that shines along its frame's z axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Disk {
    /// Origin at the centre, z along the normal.
    frame: Frame,
    radius: f64,
    radiance: DVec3,
}

impl Disk {
    fn area(&self) -> f64 {
        PI * self.radius * self.radius
    }
}

impl Emitter for Disk {
    fn emission(&self) -> DVec3 {
        self.radiance
    }

    fn power(&self) -> f64 {
        PI * self.area() * (self.radiance.element_sum() / 3.0)
    }

    fn emission_cone(&self) -> EmissionCone {
        EmissionCone::from_plane(self.frame.axes.z_axis)
    }

    fn bounds(&self) -> LightBounds {
        LightBounds::Ball { centre: self.frame.origin, radius: self.radius }
    }

    fn body(&self) -> Option<Body> {
        let corner = |step: u32| {
            let (sin, cos) = libm::sincos(2.0 * PI * f64::from(step) / f64::from(CORNERS));
            self.frame.point_to_world(DVec3::new(self.radius * cos, self.radius * sin, 0.0))
        };
        Some(Body::Polygon((0..CORNERS).map(corner).collect()))
    }

    fn largest_solid_angle(&self, bounds: [DVec3; 2]) -> Option<f64> {
        Some(flat::largest_solid_angle(self.area(), self.frame.origin, self.radius, bounds))
    }

    fn sample_source(&self, _: DVec3, _: f64, random: DVec2) -> SourceSample {
        let (sin, cos) = libm::sincos(2.0 * PI * random.y);
        let local = DVec2::new(cos, sin) * (self.radius * random.x.sqrt());
        SourceSample {
            source: Source::Point(self.frame.point_to_world(local.extend(0.0))),
            normal: Some(self.frame.axes.z_axis),
            weight: self.radiance * self.area(),
        }
    }

    fn source_density(&self, _: DVec3, _: f64, _: Source) -> f64 {
        1.0 / self.area()
    }

    fn source_at(&self, ray: &Ray, hit: &LightHit) -> (Source, f64) {
        (Source::Point(ray.at(hit.distance)), -self.frame.axes.z_axis.dot(ray.direction))
    }

    fn normal_at(&self, _: Source) -> Option<DVec3> {
        Some(self.frame.axes.z_axis)
    }

    fn sample_li(&self, point: DVec3, random: DVec2) -> Option<LiSample> {
        flat::sample_li(self, &self.frame, self.area(), point, random)
    }

    fn pdf_li(&self, ray: &Ray, hit: &LightHit) -> f64 {
        flat::pdf_li(&self.frame, self.area(), ray, hit)
    }

    fn intersect(&self, ray: &Ray) -> Option<LightHit> {
        flat::intersect(&self.frame, self.radiance, ray, |point| point.length_squared() <= self.radius * self.radius)
    }
}
