//! A point that shines into a cone: full intensity inside an inner angle, none outside an outer one.
//!
//! Between the two angles the intensity falls off as `KHR_lights_punctual` of glTF recommends. With θ the angle to the
//! axis, it is multiplied by
//!
//! ```text
//! t^2,    t = (cos θ - cos outer) / (cos inner - cos outer), clamped to 0..1
//! ```

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
use crate::geometry::Ray;
use crate::settings::check::{check_above, check_direction, check_range, check_triple};
use crate::settings::limits::{MAX_EMISSION, MAX_LIGHT_COORDINATE};
use crate::settings::{Check, JsonPath, Triple};
use crate::texture::Bitmaps;

/// The cone that bounds the light is wider by this angle, radians: rounding must not cut light off.
const SLACK: f64 = 1e-4;

/// A point that shines into a cone around `direction`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct SpotLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Where it is.
    pub position: Triple,
    /// Direction in which it shines.
    pub direction: Triple,
    /// Radiant intensity along `direction`, W/sr.
    #[schemars(inner(range(min = 0.0)))]
    pub intensity: Triple,
    /// Up to this angle from `direction` the intensity is full, degrees; 0 to `outer_angle`.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 90.0))]
    pub inner_angle: f64,
    /// From this angle on there is no light, degrees; more than 0, at most 90.
    #[schemars(range(max = 90.0), extend("exclusiveMinimum" = 0))]
    pub outer_angle: f64,
}

impl LightSettings for SpotLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        Some("position")
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_triple(self.position, -MAX_LIGHT_COORDINATE, MAX_LIGHT_COORDINATE, &path.member("position"))?;
        check_direction(self.direction, &path.member("direction"))?;
        check_triple(self.intensity, 0.0, MAX_EMISSION, &path.member("intensity"))?;
        check_above(self.outer_angle, 0.0, 90.0, &path.member("outer_angle"))?;
        check_range(self.inner_angle, 0.0, self.outer_angle, &path.member("inner_angle"))
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<LightModel> {
        Some(LightModel::Spot {
            position: self.position,
            direction: DVec3::from(self.direction).normalize().to_array(),
            intensity: self.intensity,
            inner_angle: self.inner_angle,
            outer_angle: self.outer_angle,
        })
    }

    fn build(&self, _: &LightAssets) -> Arc<dyn Emitter> {
        let [inner, outer] = [self.inner_angle, self.outer_angle].map(f64::to_radians);
        Arc::new(Spot {
            position: self.position.into(),
            axis: DVec3::from(self.direction).normalize(),
            intensity: self.intensity.into(),
            inner: one_minus_cos(inner),
            outer: one_minus_cos(outer),
            cone: EmissionCone {
                axis: DVec3::from(self.direction).normalize(),
                cos_normals: libm::cos(inner),
                cos_emission: libm::cos((outer - inner + SLACK).min(0.5 * PI)),
                has_both_sides: false,
            },
        })
    }
}

/// `1 - cos`, without cancellation.
fn one_minus_cos(angle: f64) -> f64 {
    let half = libm::sin(0.5 * angle);
    2.0 * half * half
}

/// A point that shines into a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spot {
    position: DVec3,
    /// Unit vector in which it shines.
    axis: DVec3,
    /// On the axis.
    intensity: DVec3,
    /// One minus the cosine of the inner and of the outer angle.
    inner: f64,
    outer: f64,
    cone: EmissionCone,
}

impl Emitter for Spot {
    fn emission(&self) -> DVec3 {
        self.intensity
    }

    fn power(&self) -> f64 {
        // The falloff is a square of a linear function of the cosine, whose mean is a third.
        2.0 * PI * (self.inner + (self.outer - self.inner) / 3.0) * (self.intensity.element_sum() / 3.0)
    }

    fn emission_cone(&self) -> EmissionCone {
        self.cone
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn falloff(&self, direction: DVec3) -> f64 {
        // The axis and the direction in which light leaves differ by a chord, whose square is 2 (1 - cos).
        let off = 0.5 * (direction + self.axis).length_squared();
        if off <= self.inner {
            return 1.0;
        }
        let part = (self.outer - off) / (self.outer - self.inner);
        if part > 0.0 { part * part } else { 0.0 }
    }

    fn bounds(&self) -> LightBounds {
        LightBounds::Ball { centre: self.position, radius: 0.0 }
    }

    fn body(&self) -> Option<Body> {
        Some(Body::Ball { centre: self.position, radius: 0.0 })
    }

    fn largest_solid_angle(&self, _: [DVec3; 2]) -> Option<f64> {
        None
    }

    fn sample_source(&self, _: DVec3, _: f64, _: DVec2) -> SourceSample {
        SourceSample { source: Source::Point(self.position), normal: None, triangle: None, weight: self.intensity }
    }

    fn emit(&self, _: DVec2, direction: DVec2) -> Option<Emission> {
        let cosine = 1.0 - self.outer;
        let (direction, _) = cap::sample(self.axis, cosine, (1.0 - cosine * cosine).max(0.0).sqrt(), direction);
        let ray = Ray::new(self.position, direction);
        let density = self.emission_density(&ray);
        Some(Emission { ray, radiance: self.intensity * self.falloff(-direction), density })
    }

    fn emission_density(&self, _: &Ray) -> f64 {
        1.0 / (2.0 * PI * self.outer)
    }

    fn source_density(&self, _: DVec3, _: f64, _: Source) -> f64 {
        1.0
    }

    fn source_at(&self, ray: &Ray, hit: &LightHit) -> (Source, f64) {
        (Source::Point(ray.at(hit.distance)), 1.0)
    }

    fn normal_at(&self, _: Source, _: &LightHit) -> Option<DVec3> {
        None
    }

    fn sample_li(&self, receiver: &Receiver, _: DVec2) -> Option<LiSample> {
        let offset = self.position - receiver.position;
        let distance = offset.length();
        let direction = offset / distance;
        let falloff = self.falloff(direction);
        (distance > 0.0 && falloff > 0.0).then(|| LiSample {
            direction,
            distance,
            weight: self.intensity * (falloff / (distance * distance)),
            pdf: None,
        })
    }

    fn pdf_li(&self, _: &Receiver, _: &Ray, _: &LightHit) -> f64 {
        0.0
    }

    fn intersect(&self, _: &Ray) -> Option<LightHit> {
        None
    }
}
