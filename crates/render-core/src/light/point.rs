//! A point that shines equally in all directions.

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
use crate::settings::check::check_triple;
use crate::settings::limits::{MAX_EMISSION, MAX_LIGHT_COORDINATE};
use crate::settings::{Check, JsonPath, Triple};
use crate::texture::Bitmaps;

/// A point that shines equally in all directions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct PointLight {
    /// A short name, used in messages; no two lights share one.
    #[schemars(length(min = 1, max = 200))]
    pub name: String,
    /// Where it is.
    pub position: Triple,
    /// Radiant intensity, W/sr.
    #[schemars(inner(range(min = 0.0)))]
    pub intensity: Triple,
}

impl LightSettings for PointLight {
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
        check_triple(self.intensity, 0.0, MAX_EMISSION, &path.member("intensity"))
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<LightModel> {
        Some(LightModel::Point { position: self.position, intensity: self.intensity })
    }

    fn build(&self, _: &LightAssets) -> Arc<dyn Emitter> {
        Arc::new(Point { position: self.position.into(), intensity: self.intensity.into() })
    }
}

/// A point of equal intensity in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    position: DVec3,
    intensity: DVec3,
}

impl Emitter for Point {
    fn emission(&self) -> DVec3 {
        self.intensity
    }

    fn power(&self) -> f64 {
        4.0 * PI * (self.intensity.element_sum() / 3.0)
    }

    fn emission_cone(&self) -> EmissionCone {
        EmissionCone::EVERYWHERE
    }

    fn is_delta(&self) -> bool {
        true
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
        let (direction, _) = cap::sample(DVec3::Z, -1.0, 0.0, direction);
        let ray = Ray::new(self.position, direction);
        Some(Emission { ray, radiance: self.intensity, density: self.emission_density(&ray) })
    }

    fn emission_density(&self, _: &Ray) -> f64 {
        1.0 / (4.0 * PI)
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
        (distance > 0.0).then(|| LiSample {
            direction: offset / distance,
            distance,
            weight: self.intensity / (distance * distance),
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
