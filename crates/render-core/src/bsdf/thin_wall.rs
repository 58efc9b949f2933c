//! Window glass without a thickness: light goes straight on, or is mirrored.
//!
//! A sheet of glass has two faces. With R the reflectance of one face, light that is reflected back and forth between
//! them adds up to `2R / (1 + R)`. This holds for each polarisation by itself, and unpolarised light is reflected by
//! the mean of both. Both faces are parallel, so that transmitted light leaves in its old direction.
//!
//! Several walls in a row carry the polarisation from one to the next. Shadow rays and paths do so in the same order,
//! from the diffuse vertex on, so that both find the same light.
//!
//! Shadow rays go straight through it. Specular methods do not search it, because light that is not bent has no
//! stationary path. So mirrored light, and light that other glass bends as well, is found by chance alone.

use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::dielectric::{crown_glass, reflected};
use super::fresnel::fresnel;
use super::polarisation::{Mueller, Polarisation};
use super::{
    Bsdf, BsdfSample, MaterialSettings, Opacity, SampleKind, SpecularEvent, StraightBsdf, SurfacePoint, is_one, one,
    opacity, textures,
};
use crate::exchange::{ColourModel, CoverModel, SurfaceModel};
use crate::settings::check::check_range;
use crate::settings::{Check, JsonPath};
use crate::texture::{Bitmaps, Colour, ColourDescription, TextureUse, ValueDescription};

/// A clear sheet without a thickness, such as window glass: light goes straight on or is mirrored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct ThinWallMaterial {
    /// Index of refraction of the sheet, 1 to 3.
    #[serde(default = "crown_glass")]
    #[schemars(range(min = 1.0, max = 3.0))]
    pub index_of_refraction: f64,
    /// Fraction of the light that enters the sheet and leaves it on the other side.
    #[serde(default = "ColourDescription::white")]
    pub tint: ColourDescription,
    /// The part of the surface that is there, 0 to 1. As much of all light goes by it unchanged.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub opacity: ValueDescription,
    /// Opacity, 0 to 1, from which on all of the surface is there; below it there is none. Without it, parts are there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity_threshold: Option<f64>,
}

impl Default for ThinWallMaterial {
    fn default() -> Self {
        Self {
            index_of_refraction: crown_glass(),
            tint: ColourDescription::white(),
            opacity: one(),
            opacity_threshold: None,
        }
    }
}

impl MaterialSettings for ThinWallMaterial {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_range(self.index_of_refraction, 1.0, 3.0, &path.member("index_of_refraction"))?;
        self.tint.check(&path.member("tint"))?;
        opacity::check(&self.opacity, self.opacity_threshold, path)
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn makes_caustics(&self) -> bool {
        true
    }

    fn is_searched(&self) -> bool {
        false
    }

    fn is_straight(&self) -> bool {
        true
    }

    fn textures(&self) -> Vec<TextureUse<'_>> {
        let tint = textures(&[("tint", &self.tint)]);
        tint.into_iter().chain(self.opacity.texture("opacity")).collect()
    }

    fn opacity(&self, bitmaps: &Bitmaps<'_>) -> Option<Opacity> {
        Opacity::build(&self.opacity, self.opacity_threshold, bitmaps)
    }

    fn model(&self, bitmaps: &Bitmaps<'_>) -> Option<SurfaceModel> {
        let tint = ColourModel::of(&self.tint.build(bitmaps));
        Some(SurfaceModel::ThinSheet { index_of_refraction: self.index_of_refraction, tint })
    }

    fn cover(&self, bitmaps: &Bitmaps<'_>) -> CoverModel {
        CoverModel::of_opacity(&self.opacity.build(bitmaps), self.opacity_threshold)
    }

    fn build(&self, bitmaps: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        Arc::new(ThinWall { index_of_refraction: self.index_of_refraction, tint: self.tint.build(bitmaps) })
    }
}

/// A sheet of two parallel faces in one place.
#[derive(Clone, Debug)]
struct ThinWall {
    index_of_refraction: f64,
    tint: Colour,
}

impl ThinWall {
    /// What both faces do to light together: transmission and reflection.
    fn sheet(&self, at: &SurfacePoint, direction: DVec3) -> [Mueller; 2] {
        fresnel(direction.dot(at.normals.shading).abs(), self.index_of_refraction).sheet()
    }
}

impl StraightBsdf for ThinWall {
    fn transmittance(&self, at: &SurfacePoint, direction: DVec3, polarisation: &mut Polarisation) -> DVec3 {
        let [through, _] = self.sheet(at, direction);
        let (part, behind) = polarisation.incident(direction, at.normals.shading).after(through);
        *polarisation = behind;
        self.tint.at(at.texture) * part
    }
}

impl Bsdf for ThinWall {
    fn as_straight(&self) -> Option<&dyn StraightBsdf> {
        Some(self)
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn transmits(&self) -> bool {
        true
    }

    fn albedo(&self, at: &SurfacePoint) -> DVec3 {
        self.tint.at(at.texture)
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
        self.sample_polarised(at, incident, &mut { Polarisation::NONE }, stream)
    }

    fn sample_polarised(
        &self,
        at: &SurfacePoint,
        incident: DVec3,
        polarisation: &mut Polarisation,
        stream: &mut SampleStream,
    ) -> Option<BsdfSample> {
        let [through, back] = self.sheet(at, incident);
        let light = polarisation.incident(incident, at.normals.shading);
        let (reflectance, before) = light.after(back);
        if stream.next_1d() < reflectance {
            *polarisation = before;
            let direction = reflected(incident, &at.normals)?;
            let kind = SampleKind::Delta(SpecularEvent::Reflection);
            return Some(BsdfSample { direction, weight: DVec3::ONE, kind });
        }
        (_, *polarisation) = light.after(through);
        let kind = SampleKind::Delta(SpecularEvent::Transmission);
        Some(BsdfSample { direction: incident, weight: self.tint.at(at.texture), kind })
    }
}
