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
use super::{Bsdf, BsdfSample, MaterialSettings, Opacity, SurfacePoint, is_one, one, opacity, soft, textures};
use crate::exchange::{ColourModel, CoverModel, SurfaceModel, ValueModel};
use crate::settings::check::{Number, check_range};
use crate::settings::{Check, JsonPath, SceneError};
use crate::texture::{
    Bitmaps, Colour, ColourDescription, NormalMap, NormalMapDescription, TextureUse, Value, ValueDescription,
};

/// The core material of glTF 2.0 on both sides: a metal, a matt surface under a clear coat, or a mixture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct MetallicRoughnessMaterial {
    /// Colour of the metal and of the matt surface; the colours of the mesh's vertices multiply it.
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
    /// The part of the light that the coat leaves which goes through a thin wall, 0 to 1, in the colour of the base.
    #[serde(default = "zero", skip_serializing_if = "is_zero")]
    pub transmission: ValueDescription,
    /// A map of normals over the surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_map: Option<Box<NormalMapDescription>>,
    /// Whether light fades out smoothly where the triangles of a rounded mesh turn away from it.
    #[serde(default = "soft")]
    pub soft_terminator: bool,
    /// The part of the surface that is there, 0 to 1. As much of all light goes by it unchanged.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub opacity: ValueDescription,
    /// Opacity, 0 to 1, from which on all of the surface is there; below it there is none. Without it, parts are there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opacity_threshold: Option<f64>,
}

/// The largest index of refraction; glTF has no limit.
const MAX_INDEX: f64 = 1e6;

fn zero() -> ValueDescription {
    ValueDescription::number(0.0)
}

fn is_zero(value: &ValueDescription) -> bool {
    *value == zero()
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
            transmission: zero(),
            normal_map: None,
            soft_terminator: soft(),
            opacity: one(),
            opacity_threshold: None,
        }
    }
}

impl MetallicRoughnessMaterial {
    /// What an uncoloured coat reflects along its normal.
    fn coat(&self) -> f64 {
        let ratio = (self.index_of_refraction - 1.0) / (self.index_of_refraction + 1.0);
        ratio * ratio
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
        self.specular_colour.check(&path.member("specular_colour"))?;
        self.transmission.check(0.0, 1.0, &path.member("transmission"))?;
        self.normal_map.iter().try_for_each(|map| map.check(&path.member("normal_map")))?;
        opacity::check(&self.opacity, self.opacity_threshold, path)
    }

    fn is_delta(&self) -> bool {
        false
    }

    fn uses_normals(&self) -> bool {
        true
    }

    fn normal_map(&self) -> Option<&NormalMapDescription> {
        self.normal_map.as_deref()
    }

    fn uses_colours(&self) -> bool {
        true
    }

    fn textures(&self) -> Vec<TextureUse<'_>> {
        let mut all = textures(&[("base_colour", &self.base_colour), ("specular_colour", &self.specular_colour)]);
        let values = [
            ("metallic", &self.metallic),
            ("roughness", &self.roughness),
            ("specular", &self.specular),
            ("transmission", &self.transmission),
            ("opacity", &self.opacity),
        ];
        all.extend(values.into_iter().filter_map(|(member, value)| value.texture(member)));
        all.extend(self.normal_map.as_ref().map(|map| map.texture("normal_map")));
        all
    }

    fn opacity(&self, bitmaps: &Bitmaps<'_>) -> Option<Opacity> {
        Opacity::build(&self.opacity, self.opacity_threshold, bitmaps)
    }

    fn model(&self, bitmaps: &Bitmaps<'_>) -> Option<SurfaceModel> {
        let colour = ColourModel::of(&self.base_colour.build(bitmaps));
        let value = |value: &ValueDescription| ValueModel::of(&value.build(bitmaps));
        let (metallic, coat_strength) = (value(&self.metallic), value(&self.specular));
        Some(match (&metallic, &coat_strength) {
            (ValueModel::Value(1.0), _) => {
                SurfaceModel::Metal { reflectance: colour, roughness: value(&self.roughness) }
            }
            (ValueModel::Value(0.0), ValueModel::Value(0.0)) => SurfaceModel::Diffuse { reflectance: colour },
            _ => SurfaceModel::Coated {
                colour,
                metallic,
                roughness: value(&self.roughness),
                coat: self.coat(),
                coat_colour: ColourModel::of(&self.specular_colour.build(bitmaps)),
                coat_strength,
            },
        })
    }

    fn cover(&self, bitmaps: &Bitmaps<'_>) -> CoverModel {
        let cover = CoverModel::of_opacity(&self.opacity.build(bitmaps), self.opacity_threshold);
        match &self.normal_map {
            Some(map) => cover.with_normals(&map.build(bitmaps)),
            None => cover,
        }
    }

    fn beyond_model(&self) -> Vec<&'static str> {
        let all = [
            (!is_zero(&self.transmission), "it lets no light through"),
            (self.normal_map.as_ref().is_some_and(|map| map.strength != 1.0), "its normal map has the strength 1"),
        ];
        all.into_iter().filter(|(has, _)| *has).map(|(_, what)| what).collect()
    }

    fn build(&self, bitmaps: &Bitmaps<'_>) -> Arc<dyn Bsdf> {
        Arc::new(MetallicRoughness {
            base_colour: self.base_colour.build(bitmaps),
            metallic: self.metallic.build(bitmaps),
            roughness: self.roughness.build(bitmaps),
            reflectance: self.coat(),
            specular: self.specular.build(bitmaps),
            specular_colour: self.specular_colour.build(bitmaps),
            transmission: self.transmission.build(bitmaps),
            transmits: !is_zero(&self.transmission),
            normal_map: self.normal_map.as_ref().map(|map| map.build(bitmaps)),
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
    transmission: Value,
    transmits: bool,
    normal_map: Option<NormalMap>,
    soft_terminator: bool,
}

impl MetallicRoughness {
    fn surface(&self, at: &SurfacePoint) -> Glossy {
        let roughness = self.roughness.at(at.texture);
        Glossy {
            colour: at.colour * self.base_colour.at(at.texture),
            metallic: self.metallic.at(at.texture),
            coat: (self.reflectance * self.specular_colour.at(at.texture)).min(DVec3::ONE),
            coat_strength: self.specular.at(at.texture),
            transmission: self.transmission.at(at.texture),
            // Never a mirror: so one kind of vertex stands for all places of a picture of roughness.
            facets: Ggx { alpha: (roughness * roughness).max(MIN_ALPHA) },
            soft_terminator: self.soft_terminator,
        }
    }
}

impl Bsdf for MetallicRoughness {
    fn normal_map(&self) -> Option<&NormalMap> {
        self.normal_map.as_ref()
    }

    fn transmits(&self) -> bool {
        self.transmits
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
