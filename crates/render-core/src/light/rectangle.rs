//! A rectangle of uniform radiance that shines to one side.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, EmissionCone, Emitter, LiSample, LightBounds, LightHit, LightSettings, Source, SourceSample, flat};
use crate::geometry::{Frame, Ray};
use crate::settings::check::{MIN_SINE, Numbers, check_direction, check_triple};
use crate::settings::limits::{MAX_EMISSION, MAX_LIGHT_COORDINATE};
use crate::settings::{Check, JsonPath, SceneError, Triple};

/// A rectangle that shines to the side to which `edge_u` cross `edge_v` points; its other side is black.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct RectangleLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Its centre.
    pub centre: Triple,
    /// One edge, metres.
    pub edge_u: Triple,
    /// The other edge, metres, perpendicular to `edge_u`.
    pub edge_v: Triple,
    /// Emitted radiance, W/(m2 sr).
    #[schemars(inner(range(min = 0.0)))]
    pub radiance: Triple,
}

impl LightSettings for RectangleLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        Some("centre")
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_triple(self.centre, -MAX_LIGHT_COORDINATE, MAX_LIGHT_COORDINATE, &path.member("centre"))?;
        let u = check_direction(self.edge_u, &path.member("edge_u"))?;
        let v = check_direction(self.edge_v, &path.member("edge_v"))?;
        if u.dot(v).abs() > MIN_SINE {
            let expected = format!("a vector perpendicular to edge_u ({})", Numbers(&self.edge_u));
            return Err(SceneError::value(&path.member("edge_v"), Numbers(&self.edge_v), expected));
        }
        check_triple(self.radiance, 0.0, MAX_EMISSION, &path.member("radiance"))
    }

    fn build(&self) -> Arc<dyn Emitter> {
        let (edge_u, edge_v) = (DVec3::from(self.edge_u), DVec3::from(self.edge_v));
        let normal = edge_u.cross(edge_v).normalize();
        let x = edge_u.normalize();
        Arc::new(Rectangle {
            // The second edge is perpendicular only as far as decimal numbers could say.
            frame: Frame::new(DVec3::from(self.centre), x, normal.cross(x)),
            half_size: [edge_u.length() / 2.0, edge_v.length() / 2.0],
            radiance: self.radiance.into(),
        })
    }
}

/// A rectangle that shines along its frame's z axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rectangle {
    /// Origin at the centre, x and y along the edges.
    frame: Frame,
    /// Half the extent along x and y, metres.
    half_size: [f64; 2],
    radiance: DVec3,
}

impl Rectangle {
    fn area(&self) -> f64 {
        4.0 * self.half_size[0] * self.half_size[1]
    }

    /// Distance from the centre to a corner.
    fn extent(&self) -> f64 {
        let [x, y] = self.half_size;
        (x * x + y * y).sqrt()
    }
}

impl Emitter for Rectangle {
    fn emission(&self) -> DVec3 {
        self.radiance
    }

    fn power(&self) -> f64 {
        std::f64::consts::PI * self.area() * (self.radiance.element_sum() / 3.0)
    }

    fn emission_cone(&self) -> EmissionCone {
        EmissionCone::from_plane(self.frame.axes.z_axis)
    }

    fn bounds(&self) -> LightBounds {
        LightBounds::Ball { centre: self.frame.origin, radius: self.extent() }
    }

    fn body(&self) -> Option<Body> {
        let [x, y] = self.half_size;
        let corners = [[-x, -y], [x, -y], [x, y], [-x, y]];
        Some(Body::Polygon(corners.map(|[x, y]| self.frame.point_to_world(DVec3::new(x, y, 0.0))).into()))
    }

    fn largest_solid_angle(&self, bounds: [DVec3; 2]) -> Option<f64> {
        Some(flat::largest_solid_angle(self.area(), self.frame.origin, self.extent(), bounds))
    }

    fn sample_source(&self, _: DVec3, _: f64, random: DVec2) -> SourceSample {
        let [x, y] = self.half_size;
        let local = DVec3::new((2.0 * random.x - 1.0) * x, (2.0 * random.y - 1.0) * y, 0.0);
        SourceSample {
            source: Source::Point(self.frame.point_to_world(local)),
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
        let [x, y] = self.half_size;
        flat::intersect(&self.frame, self.radiance, ray, |point| point.x.abs() <= x && point.y.abs() <= y)
    }
}
