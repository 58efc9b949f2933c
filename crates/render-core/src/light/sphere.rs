//! A sphere of uniform radiance.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    Body, Emission, EmissionCone, Emitter, LiSample, LightAssets, LightBounds, LightHit, LightSettings, Receiver,
    Source, SourceSample, cap,
};
use crate::exchange::LightModel;
use crate::geometry::{Frame, Ray};
use crate::settings::check::{check_above, check_triple};
use crate::settings::limits::{MAX_EMISSION, MAX_LIGHT_COORDINATE};
use crate::settings::{Check, JsonPath, Triple};
use crate::texture::Bitmaps;

/// A sphere of uniform radiance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct SphereLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Its centre.
    pub centre: Triple,
    /// Its radius, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radius: f64,
    /// Emitted radiance, W/(m2 sr).
    #[schemars(inner(range(min = 0.0)))]
    pub radiance: Triple,
}

impl LightSettings for SphereLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        Some("centre")
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_triple(self.centre, -MAX_LIGHT_COORDINATE, MAX_LIGHT_COORDINATE, &path.member("centre"))?;
        check_above(self.radius, 0.0, MAX_LIGHT_COORDINATE, &path.member("radius"))?;
        check_triple(self.radiance, 0.0, MAX_EMISSION, &path.member("radiance"))
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<LightModel> {
        Some(LightModel::Sphere { centre: self.centre, radius: self.radius, radiance: self.radiance })
    }

    fn build(&self, _: &LightAssets) -> Arc<dyn Emitter> {
        Arc::new(Sphere { centre: self.centre.into(), radius: self.radius, radiance: self.radiance.into() })
    }
}

/// A sphere that shines outwards.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sphere {
    centre: DVec3,
    radius: f64,
    radiance: DVec3,
}

impl Sphere {
    /// Axis, cosine and sine of the cone that the sphere subtends; `None` from inside.
    fn subtended_cap(&self, point: DVec3) -> Option<(DVec3, f64, f64)> {
        let offset = self.centre - point;
        let distance = offset.length();
        if distance <= self.radius {
            return None;
        }
        let sine = self.radius / distance;
        Some((offset / distance, (1.0 - sine * sine).sqrt(), sine))
    }

    /// The middle of the side that may be seen from inside a ball, and the cosine of its edge.
    fn side_seen(&self, ball: DVec3, ball_radius: f64) -> (DVec3, f64) {
        let offset = ball - self.centre;
        let distance = offset.length();
        if distance > 0.0 {
            (offset / distance, ((self.radius - ball_radius) / distance).clamp(-1.0, 1.0))
        } else {
            (DVec3::Z, -1.0)
        }
    }
}

impl Emitter for Sphere {
    fn emission(&self) -> DVec3 {
        self.radiance
    }

    fn power(&self) -> f64 {
        4.0 * PI * PI * self.radius * self.radius * (self.radiance.element_sum() / 3.0)
    }

    fn emission_cone(&self) -> EmissionCone {
        EmissionCone::EVERYWHERE
    }

    fn bounds(&self) -> LightBounds {
        LightBounds::Ball { centre: self.centre, radius: self.radius }
    }

    fn body(&self) -> Option<Body> {
        Some(Body::Ball { centre: self.centre, radius: self.radius })
    }

    fn largest_solid_angle(&self, [min, max]: [DVec3; 2]) -> Option<f64> {
        let whole = 2.0 * PI;
        let sine = self.radius / self.centre.distance(self.centre.clamp(min, max));
        Some(if sine < 1.0 { (whole * (1.0 - (1.0 - sine * sine).sqrt())).min(whole) } else { whole })
    }

    /// A surface point with the normal n is visible from X when (X - C).n > r. Over all X of the ball that is
    /// n.d > (r - R)/D. A density linear in n.d - cos_min cancels the cosine at the light.
    fn sample_source(&self, centre: DVec3, radius: f64, random: DVec2) -> SourceSample {
        let (axis, cos_min) = self.side_seen(centre, radius);
        let cosine = cos_min + (1.0 - cos_min) * random.x.sqrt();
        let normal = around(axis, cosine, random.y);
        let source = Source::Point(self.centre + normal * self.radius);
        let density = self.source_density(centre, radius, source);
        let weight = if density > 0.0 { self.radiance / density } else { DVec3::ZERO };
        SourceSample { source, normal: Some(normal), triangle: None, weight }
    }

    fn emit(&self, place: DVec2, direction: DVec2) -> Option<Emission> {
        let (normal, _) = cap::sample(DVec3::Z, -1.0, 0.0, place);
        let frame = Frame { origin: self.centre + normal * self.radius, ..Frame::around(normal) };
        let ray = Ray::new(frame.origin, frame.vector_to_world(cap::cosine_direction(direction)));
        Some(Emission { ray, radiance: self.radiance, density: self.emission_density(&ray) })
    }

    fn emission_density(&self, _: &Ray) -> f64 {
        1.0 / (4.0 * PI * PI * self.radius * self.radius)
    }

    fn source_density(&self, centre: DVec3, radius: f64, source: Source) -> f64 {
        let Source::Point(position) = source else { return f64::INFINITY };
        let (axis, cos_min) = self.side_seen(centre, radius);
        let cosine = (position - self.centre).dot(axis) / self.radius;
        let side = self.radius * (1.0 - cos_min);
        (cosine - cos_min).max(0.0) / (PI * side * side)
    }

    fn source_at(&self, ray: &Ray, hit: &LightHit) -> (Source, f64) {
        let position = ray.at(hit.distance);
        (Source::Point(position), (-(position - self.centre).dot(ray.direction) / self.radius).max(0.0))
    }

    fn normal_at(&self, source: Source, _: &LightHit) -> Option<DVec3> {
        let Source::Point(position) = source else { return None };
        Some((position - self.centre) / self.radius)
    }

    fn sample_li(&self, receiver: &Receiver, random: DVec2) -> Option<LiSample> {
        let (axis, cos_radius, sin_radius) = self.subtended_cap(receiver.position)?;
        let (direction, solid_angle) = cap::sample(axis, cos_radius, sin_radius, random);
        // A light that is too far or too small for a density sends nothing.
        if !solid_angle.is_normal() {
            return None;
        }
        let hit = self.intersect(&Ray::new(receiver.position, direction));
        // Rounding can push a direction at the limb past the sphere: the limb is then at the tangent length.
        let offset = self.centre - receiver.position;
        let distance = hit.map_or_else(|| direction.dot(offset), |hit| hit.distance);
        Some(LiSample { direction, distance, weight: self.radiance * solid_angle, pdf: Some(1.0 / solid_angle) })
    }

    fn pdf_li(&self, _: &Receiver, ray: &Ray, _: &LightHit) -> f64 {
        self.subtended_cap(ray.origin)
            .map_or(0.0, |(_, cos_radius, sin_radius)| 1.0 / cap::solid_angle(cos_radius, sin_radius))
    }

    fn intersect(&self, ray: &Ray) -> Option<LightHit> {
        let Self { centre, radius, radiance } = *self;
        let offset = centre - ray.origin;
        let along = offset.dot(ray.direction);
        // The distance from the centre to the ray, without cancellation for a far sphere.
        let across_squared = (offset - ray.direction * along).length_squared();
        if along <= 0.0 || across_squared > radius * radius || offset.length_squared() <= radius * radius {
            return None;
        }
        Some(LightHit { distance: along - (radius * radius - across_squared).sqrt(), radiance, triangle: None })
    }
}

/// The unit vector at an angle of the given cosine to `axis`, at the azimuth `2 pi turn`.
fn around(axis: DVec3, cosine: f64, turn: f64) -> DVec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (sin, cos) = libm::sincos(2.0 * PI * turn);
    Frame::around(axis).vector_to_world(DVec3::new(sine * cos, sine * sin, cosine))
}
