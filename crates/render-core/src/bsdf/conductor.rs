//! A metal, polished or rough.
//!
//! A metal whose facets spread less than [`MIN_ALPHA`] is a mirror: it scatters into single directions, and specular
//! methods search it. Schlick's approximation says nothing of polarisation, so it keeps that as an ideal mirror does.
//! Rougher metals scatter into a solid angle.

use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::dielectric::reflected;
use super::fresnel::schlick_weight;
use super::glossy::Glossy;
use super::microfacet::{Ggx, MIN_ALPHA};
use super::polarisation::{Fresnel, Polarisation};
use super::{
    Bsdf, BsdfSample, Crossing, DeltaBsdf, MaterialSettings, Mirrored, Normals, SurfacePoint, sample_delta, soft,
    textures,
};
use crate::exchange::{ColourModel, SurfaceModel, ValueModel};
use crate::settings::check::check_range;
use crate::settings::{Check, JsonPath};
use crate::texture::{Bitmaps, Colour, ColourDescription, TextureUse};

/// A metal on both sides, polished or rough.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct ConductorMaterial {
    /// Fraction of light reflected along the normal. More is reflected at grazing incidence (Schlick 1994).
    pub reflectance: ColourDescription,
    /// Roughness, 0 (a mirror) to 1. Its square is the width of the distribution of microfacets (GGX).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub roughness: f64,
    /// Whether light fades out smoothly where the triangles of a rounded mesh turn away from it.
    #[serde(default = "soft")]
    pub soft_terminator: bool,
}

impl ConductorMaterial {
    fn alpha(&self) -> f64 {
        self.roughness * self.roughness
    }
}

impl MaterialSettings for ConductorMaterial {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        self.reflectance.check(&path.member("reflectance"))?;
        check_range(self.roughness, 0.0, 1.0, &path.member("roughness"))
    }

    fn is_delta(&self) -> bool {
        self.alpha() < MIN_ALPHA
    }

    fn uses_normals(&self) -> bool {
        true
    }

    fn textures(&self) -> Vec<TextureUse<'_>> {
        textures(&[("reflectance", &self.reflectance)])
    }

    fn model(&self, bitmaps: &Bitmaps<'_>) -> Option<SurfaceModel> {
        let reflectance = ColourModel::of(&self.reflectance.build(bitmaps));
        Some(SurfaceModel::Metal { reflectance, roughness: ValueModel::Value(self.roughness) })
    }

    fn build(&self, bitmaps: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        let reflectance = self.reflectance.build(bitmaps);
        if self.is_delta() {
            return Arc::new(PolishedConductor { reflectance });
        }
        let facets = Ggx { alpha: self.alpha() };
        Arc::new(RoughConductor { reflectance, facets, soft_terminator: self.soft_terminator })
    }
}

/// A mirror of metal.
#[derive(Clone, Debug)]
struct PolishedConductor {
    reflectance: Colour,
}

impl DeltaBsdf for PolishedConductor {
    fn index_of_refraction(&self) -> Option<f64> {
        None
    }

    fn transmit(&self, _: DVec3, _: &Normals) -> Option<Crossing> {
        None
    }

    fn reflect(&self, direction: DVec3, at: &SurfacePoint) -> Option<Mirrored> {
        let reflected = reflected(direction, &at.normals)?;
        let reflectance = self.reflectance.at(at.texture);
        let weight = schlick_weight(direction.dot(at.normals.shading).abs());
        let colour = reflectance + (1.0 - reflectance) * weight;
        Some(Mirrored { direction: reflected, colour, fresnel: Fresnel::MIRROR })
    }
}

impl Bsdf for PolishedConductor {
    fn as_delta(&self) -> Option<&dyn DeltaBsdf> {
        Some(self)
    }

    fn transmits(&self) -> bool {
        false
    }

    fn albedo(&self, at: &SurfacePoint) -> DVec3 {
        self.reflectance.at(at.texture)
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

/// A metal of microfacets.
#[derive(Clone, Debug)]
struct RoughConductor {
    reflectance: Colour,
    facets: Ggx,
    soft_terminator: bool,
}

impl RoughConductor {
    fn surface(&self, at: &SurfacePoint) -> Glossy {
        Glossy {
            colour: self.reflectance.at(at.texture),
            metallic: 1.0,
            coat: DVec3::ZERO,
            coat_strength: 0.0,
            transmission: 0.0,
            facets: self.facets,
            soft_terminator: self.soft_terminator,
        }
    }
}

impl Bsdf for RoughConductor {
    fn transmits(&self) -> bool {
        false
    }

    fn albedo(&self, at: &SurfacePoint) -> DVec3 {
        self.surface(at).albedo()
    }

    fn scale(&self, _: &SurfacePoint) -> DVec3 {
        DVec3::ONE
    }

    fn eval(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> DVec3 {
        self.surface(at).eval(at, incident, outgoing)
    }

    fn pdf(&self, at: &SurfacePoint, incident: DVec3, outgoing: DVec3) -> f64 {
        self.surface(at).pdf(at, incident, outgoing)
    }

    fn sample(&self, at: &SurfacePoint, incident: DVec3, stream: &mut SampleStream) -> Option<BsdfSample> {
        self.surface(at).sample(at, incident, stream)
    }
}
