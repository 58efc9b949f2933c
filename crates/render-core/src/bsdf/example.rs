//! An example of a material of its own: parchment, which scatters light to both sides. `docs/extending.md` leads here;
//! only tests compile it.
//!
//! A material that is to stay also gets a line in `registry.rs`: `"parchment" => Parchment(ParchmentMaterial),`.

use std::f64::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Bsdf, BsdfSample, MaterialSettings, SampleKind, SurfacePoint};
use crate::geometry::Frame;
use crate::settings::check::check_triple;
use crate::settings::{Check, JsonPath, Triple};
use crate::texture::Bitmaps;

/// Lambertian reflection and transmission, of half the light each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub(super) struct ParchmentMaterial {
    /// Fraction of light that is scattered, to both sides together.
    pub(super) albedo: Triple,
}

impl MaterialSettings for ParchmentMaterial {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_triple(self.albedo, 0.0, 1.0, &path.member("albedo"))
    }

    fn is_delta(&self) -> bool {
        false
    }

    fn build(&self, _: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        Arc::new(Parchment { albedo: self.albedo.into() })
    }
}

/// The BSDF `albedo / (2 pi)` on both sides.
#[derive(Clone, Copy, Debug)]
struct Parchment {
    albedo: DVec3,
}

/// Half of the light goes to each side.
const SIDE: f64 = 0.5;

impl Bsdf for Parchment {
    fn transmits(&self) -> bool {
        true
    }

    fn albedo(&self, _: &SurfacePoint) -> DVec3 {
        self.albedo
    }

    fn scale(&self, _: &SurfacePoint) -> DVec3 {
        self.albedo * (SIDE * FRAC_1_PI)
    }

    fn eval(&self, at: &SurfacePoint, _: DVec3, outgoing: DVec3) -> DVec3 {
        DVec3::splat(outgoing.dot(at.normals.geometric).abs())
    }

    fn pdf(&self, at: &SurfacePoint, _: DVec3, outgoing: DVec3) -> f64 {
        outgoing.dot(at.normals.geometric).abs() * (SIDE * FRAC_1_PI)
    }

    fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample> {
        let (random, side) = (stream.next_2d(), stream.next_1d());
        let cosine = (1.0 - random.x).sqrt();
        let (sin, cos) = libm::sincos(2.0 * PI * random.y);
        let local = DVec3::new(random.x.sqrt() * cos, random.x.sqrt() * sin, cosine);
        let facing = at.normals.facing(incident);
        let normal = if side < SIDE { facing } else { -facing };
        (cosine > 0.0).then(|| BsdfSample {
            direction: Frame::around(normal).vector_to_world(local),
            weight: self.albedo,
            kind: SampleKind::Density(cosine * (SIDE * FRAC_1_PI)),
        })
    }
}
