//! A distant disc of uniform radiance: a direction with an angular radius.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    Body, EmissionCone, Emitter, LiSample, LightAssets, LightBounds, LightHit, LightSettings, Receiver, Source,
    SourceSample, cap,
};
use crate::exchange::LightModel;
use crate::geometry::Ray;
use crate::settings::check::{check_direction, check_range, check_triple};
use crate::settings::limits::MAX_EMISSION;
use crate::settings::{Check, JsonPath, Triple};
use crate::texture::Bitmaps;

/// A distant disc: a direction with an angular radius.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct SunLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Direction from the scene towards the sun.
    pub direction: Triple,
    /// Half the angle under which the disc is seen, degrees, 0.001 to 90; the real sun's is 0.267.
    #[schemars(range(min = 0.001, max = 90.0))]
    pub angular_radius: f64,
    /// Emitted radiance, W/(m2 sr).
    #[schemars(inner(range(min = 0.0)))]
    pub radiance: Triple,
}

impl LightSettings for SunLight {
    fn name(&self) -> &str {
        &self.name
    }

    fn place(&self) -> Option<&'static str> {
        None
    }

    fn direction(&self) -> Option<Triple> {
        Some(self.direction)
    }

    fn direction_mut(&mut self) -> Option<&mut Triple> {
        Some(&mut self.direction)
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_direction(self.direction, &path.member("direction"))?;
        check_range(self.angular_radius, 1e-3, 90.0, &path.member("angular_radius"))?;
        check_triple(self.radiance, 0.0, MAX_EMISSION, &path.member("radiance"))
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<LightModel> {
        Some(LightModel::Distant {
            direction: DVec3::from(self.direction).normalize().to_array(),
            angular_radius: self.angular_radius,
            radiance: self.radiance,
        })
    }

    fn build(&self, _: &LightAssets) -> Arc<dyn Emitter> {
        let (sin_radius, cos_radius) = libm::sincos(self.angular_radius.to_radians());
        Arc::new(Sun {
            direction: DVec3::from(self.direction).normalize(),
            cos_radius,
            sin_radius,
            radiance: self.radiance.into(),
        })
    }
}

/// A distant disc.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sun {
    /// Unit vector from the scene towards its middle.
    direction: DVec3,
    /// Cosine of the angular radius.
    cos_radius: f64,
    /// Sine of the angular radius.
    sin_radius: f64,
    radiance: DVec3,
}

impl Emitter for Sun {
    fn emission(&self) -> DVec3 {
        self.radiance
    }

    fn power(&self) -> f64 {
        cap::solid_angle(self.cos_radius, self.sin_radius) * (self.radiance.element_sum() / 3.0)
    }

    fn emission_cone(&self) -> EmissionCone {
        EmissionCone::EVERYWHERE
    }

    fn bounds(&self) -> LightBounds {
        LightBounds::Cap { direction: self.direction, sin_radius: self.sin_radius }
    }

    fn body(&self) -> Option<Body> {
        None
    }

    fn largest_solid_angle(&self, _: [DVec3; 2]) -> Option<f64> {
        Some(2.0 * std::f64::consts::PI * (1.0 - self.cos_radius))
    }

    fn sample_source(&self, _: DVec3, _: f64, random: DVec2) -> SourceSample {
        let (direction, solid_angle) = cap::sample(self.direction, self.cos_radius, self.sin_radius, random);
        SourceSample {
            source: Source::Direction(direction),
            normal: None,
            triangle: None,
            weight: self.radiance * solid_angle,
        }
    }

    fn source_density(&self, _: DVec3, _: f64, _: Source) -> f64 {
        1.0 / cap::solid_angle(self.cos_radius, self.sin_radius)
    }

    fn source_at(&self, ray: &Ray, _: &LightHit) -> (Source, f64) {
        (Source::Direction(ray.direction), 1.0)
    }

    fn normal_at(&self, _: Source, _: &LightHit) -> Option<DVec3> {
        None
    }

    fn sample_li(&self, _: &Receiver, random: DVec2) -> Option<LiSample> {
        let (direction, solid_angle) = cap::sample(self.direction, self.cos_radius, self.sin_radius, random);
        Some(LiSample {
            direction,
            distance: f64::INFINITY,
            weight: self.radiance * solid_angle,
            pdf: Some(1.0 / solid_angle),
        })
    }

    fn pdf_li(&self, _: &Receiver, _: &Ray, _: &LightHit) -> f64 {
        1.0 / cap::solid_angle(self.cos_radius, self.sin_radius)
    }

    fn intersect(&self, ray: &Ray) -> Option<LightHit> {
        // |r x d| is exact for small angles where the cosine is not.
        let sine_squared = ray.direction.cross(self.direction).length_squared();
        (ray.direction.dot(self.direction) > 0.0 && sine_squared <= self.sin_radius * self.sin_radius)
            .then_some(LightHit { distance: f64::INFINITY, radiance: self.radiance, triangle: None })
    }
}
