//! Lambertian reflection on both sides.

use std::f64::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Bsdf, BsdfSample, MaterialSettings, SampleKind, SurfacePoint, textures};
use crate::exchange::{ColourModel, SurfaceModel};
use crate::geometry::Frame;
use crate::settings::{Check, JsonPath};
use crate::texture::{Bitmaps, Colour, ColourDescription, TextureUse};

/// Lambertian reflection on both sides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct DiffuseMaterial {
    /// Fraction of light reflected.
    pub reflectance: ColourDescription,
}

impl MaterialSettings for DiffuseMaterial {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        self.reflectance.check(&path.member("reflectance"))
    }

    fn is_delta(&self) -> bool {
        false
    }

    fn textures(&self) -> Vec<TextureUse<'_>> {
        textures(&[("reflectance", &self.reflectance)])
    }

    fn model(&self, bitmaps: &Bitmaps<'_>) -> Option<SurfaceModel> {
        Some(SurfaceModel::Diffuse { reflectance: ColourModel::of(&self.reflectance.build(bitmaps)) })
    }

    fn build(&self, bitmaps: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        Arc::new(Diffuse { reflectance: self.reflectance.build(bitmaps) })
    }
}

/// The BSDF `reflectance / pi`.
#[derive(Debug)]
struct Diffuse {
    reflectance: Colour,
}

impl Bsdf for Diffuse {
    fn transmits(&self) -> bool {
        false
    }

    fn albedo(&self, at: &SurfacePoint) -> DVec3 {
        self.reflectance.at(at.texture)
    }

    fn scale(&self, at: &SurfacePoint) -> DVec3 {
        self.reflectance.at(at.texture) * FRAC_1_PI
    }

    fn eval(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> DVec3 {
        DVec3::splat(outgoing.dot(at.normals.facing(incident)).max(0.0))
    }

    fn pdf(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> f64 {
        outgoing.dot(at.normals.facing(incident)).max(0.0) * FRAC_1_PI
    }

    fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample> {
        let random = stream.next_2d();
        let cosine = (1.0 - random.x).sqrt();
        let (sin, cos) = libm::sincos(2.0 * PI * random.y);
        let sine = random.x.sqrt();
        let local = DVec3::new(sine * cos, sine * sin, cosine);
        (cosine > 0.0).then(|| BsdfSample {
            direction: Frame::around(at.normals.facing(incident)).vector_to_world(local),
            weight: self.reflectance.at(at.texture),
            kind: SampleKind::Density(cosine * FRAC_1_PI),
        })
    }
}
