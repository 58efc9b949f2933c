//! The core material of glTF 2.0: a metal, a coated matt surface, or a mixture (glTF 2.0 specification, appendix B).
//!
//! The reflection of metal and of coated base is mixed, not their colours (see `glossy`). `KHR_materials_ior` and
//! `KHR_materials_specular` give the reflectance of the coat along its normal:
//! `min(((n - 1) / (n + 1))^2 specular_colour, 1)`.

use std::sync::Arc;

use clerestory_film::SampleStream;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::glossy::Glossy;
use super::microfacet::{Ggx, MIN_ALPHA};
use super::{Bsdf, BsdfSample, MaterialSettings, SurfacePoint, soft, textures};
use crate::settings::check::{Number, check_range};
use crate::settings::{Check, JsonPath, SceneError};
use crate::texture::{Bitmaps, Colour, ColourDescription, TextureUse, Value, ValueDescription};

/// The core material of glTF 2.0 on both sides: a metal, a matt surface under a clear coat, or a mixture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct MetallicRoughnessMaterial {
    /// Colour of the metal and of the matt surface.
    #[serde(default = "ColourDescription::white")]
    pub base_colour: ColourDescription,
    /// The part that is metal, 0 to 1.
    #[serde(default = "one")]
    pub metallic: ValueDescription,
    /// Roughness, 0 to 1. Its square is the width of the distribution of microfacets (GGX), at least 0.001.
    #[serde(default = "one")]
    pub roughness: ValueDescription,
    /// Index of refraction of the coat: 1 or more, or 0 for a coat that reflects all light.
    #[serde(default = "usual_index")]
    #[schemars(range(min = 0.0, max = MAX_INDEX))]
    pub index_of_refraction: f64,
    /// Strength of the coat, 0 to 1.
    #[serde(default = "one")]
    pub specular: ValueDescription,
    /// Colour of what the coat reflects along the normal.
    #[serde(default = "ColourDescription::white")]
    pub specular_colour: ColourDescription,
    /// Whether light fades out smoothly where the triangles of a rounded mesh turn away from it.
    #[serde(default = "soft")]
    pub soft_terminator: bool,
}

/// The largest index of refraction; glTF has no limit.
const MAX_INDEX: f64 = 1e6;

fn one() -> ValueDescription {
    ValueDescription::number(1.0)
}

fn usual_index() -> f64 {
    1.5
}

impl Default for MetallicRoughnessMaterial {
    fn default() -> Self {
        Self {
            base_colour: ColourDescription::white(),
            metallic: one(),
            roughness: one(),
            index_of_refraction: usual_index(),
            specular: one(),
            specular_colour: ColourDescription::white(),
            soft_terminator: soft(),
        }
    }
}

impl MaterialSettings for MetallicRoughnessMaterial {
    fn check(&self, path: &JsonPath<'_>) -> Check {
        self.base_colour.check(&path.member("base_colour"))?;
        self.metallic.check(0.0, 1.0, &path.member("metallic"))?;
        self.roughness.check(0.0, 1.0, &path.member("roughness"))?;
        let index = path.member("index_of_refraction");
        check_range(self.index_of_refraction, 0.0, MAX_INDEX, &index)?;
        if self.index_of_refraction > 0.0 && self.index_of_refraction < 1.0 {
            return Err(SceneError::value(&index, Number(self.index_of_refraction), "0, or 1 and more"));
        }
        self.specular.check(0.0, 1.0, &path.member("specular"))?;
        self.specular_colour.check(&path.member("specular_colour"))
    }

    fn is_delta(&self) -> bool {
        false
    }

    fn uses_normals(&self) -> bool {
        true
    }

    fn textures(&self) -> Vec<TextureUse<'_>> {
        let mut all = textures(&[("base_colour", &self.base_colour), ("specular_colour", &self.specular_colour)]);
        let values = [("metallic", &self.metallic), ("roughness", &self.roughness), ("specular", &self.specular)];
        all.extend(values.into_iter().filter_map(|(member, value)| value.texture(member)));
        all
    }

    fn build(&self, bitmaps: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        let ratio = (self.index_of_refraction - 1.0) / (self.index_of_refraction + 1.0);
        Arc::new(MetallicRoughness {
            base_colour: self.base_colour.build(bitmaps),
            metallic: self.metallic.build(bitmaps),
            roughness: self.roughness.build(bitmaps),
            reflectance: ratio * ratio,
            specular: self.specular.build(bitmaps),
            specular_colour: self.specular_colour.build(bitmaps),
            soft_terminator: self.soft_terminator,
        })
    }
}

#[derive(Clone, Debug)]
struct MetallicRoughness {
    base_colour: Colour,
    metallic: Value,
    roughness: Value,
    /// Of an uncoloured coat, along its normal.
    reflectance: f64,
    specular: Value,
    specular_colour: Colour,
    soft_terminator: bool,
}

impl MetallicRoughness {
    fn surface(&self, at: &SurfacePoint) -> Glossy {
        let roughness = self.roughness.at(at.texture);
        Glossy {
            colour: self.base_colour.at(at.texture),
            metallic: self.metallic.at(at.texture),
            coat: (self.reflectance * self.specular_colour.at(at.texture)).min(DVec3::ONE),
            coat_strength: self.specular.at(at.texture),
            // Never a mirror: so one kind of vertex stands for all places of a picture of roughness.
            facets: Ggx { alpha: (roughness * roughness).max(MIN_ALPHA) },
            soft_terminator: self.soft_terminator,
        }
    }
}

impl Bsdf for MetallicRoughness {
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
