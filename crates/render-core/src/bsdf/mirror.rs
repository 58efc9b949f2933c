//! A mirror on both sides. It reflects all polarisations alike, and mirrors them.

use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::dielectric::reflected;
use super::polarisation::{Fresnel, Polarisation};
use super::{Bsdf, BsdfSample, Crossing, DeltaBsdf, MaterialSettings, Mirrored, Normals, SurfacePoint, sample_delta};
use crate::exchange::SurfaceModel;
use crate::settings::check::check_triple;
use crate::settings::{Check, JsonPath, Triple};
use crate::texture::Bitmaps;

/// A mirror on both sides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct MirrorMaterial {
    /// Fraction of light reflected; each channel between 0 and 1.
    #[serde(default = "white")]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub reflectance: Triple,
}

fn white() -> Triple {
    [1.0; 3]
}

impl MaterialSettings for MirrorMaterial {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_triple(self.reflectance, 0.0, 1.0, &path.member("reflectance"))
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn model(&self, _: &Bitmaps<'_>) -> Option<SurfaceModel> {
        Some(SurfaceModel::Mirror { reflectance: self.reflectance })
    }

    fn build(&self, _: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        Arc::new(Mirror { reflectance: self.reflectance.into() })
    }
}

/// A mirror of a colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mirror {
    pub(super) reflectance: DVec3,
}

impl DeltaBsdf for Mirror {
    fn index_of_refraction(&self) -> Option<f64> {
        None
    }

    fn transmit(&self, _: DVec3, _: &Normals) -> Option<Crossing> {
        None
    }

    fn reflect(&self, direction: DVec3, at: &SurfacePoint) -> Option<Mirrored> {
        let direction = reflected(direction, &at.normals)?;
        Some(Mirrored { direction, colour: self.reflectance, fresnel: Fresnel::MIRROR })
    }
}

impl Bsdf for Mirror {
    fn as_delta(&self) -> Option<&dyn DeltaBsdf> {
        Some(self)
    }

    fn transmits(&self) -> bool {
        false
    }

    fn albedo(&self, _: &SurfacePoint) -> DVec3 {
        self.reflectance
    }

    fn scale(&self, _: &SurfacePoint) -> DVec3 {
        DVec3::ONE
    }

    fn eval(&self, _: &SurfacePoint, _: DVec3, _: DVec3) -> DVec3 {
        DVec3::ZERO
    }

    fn pdf(&self, _: &SurfacePoint, _: DVec3, _: DVec3) -> f64 {
        0.0
    }

    fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample> {
        sample_delta(self, at, incident, &mut { Polarisation::NONE }, stream)
    }
}
