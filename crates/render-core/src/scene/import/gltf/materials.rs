//! Materials: the metallic-roughness model and its extensions, as plain data.

use serde::Deserialize;
use serde_json::Value;

use super::extensions::{EMISSIVE_STRENGTH, IOR, SPECULAR, TRANSMISSION, UNLIT, VOLUME};
use super::fault::{check_range, check_ranges, fault};
use super::notes::Notes;
use super::schema::{self, Document, TextureInfo, extension};
use super::textures::{self, Texture};
use crate::settings::AssetProblem;

/// A material of glTF 2.0. Colours are linear; a texture multiplies the factor before it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Material {
    /// Its name, as written.
    pub(crate) name: Option<String>,
    /// What other programs stored with it; null without.
    pub(crate) extras: Value,
    /// Red, green, blue and opacity, 0 to 1.
    pub(crate) base_colour: [f64; 4],
    /// In sRGB, with opacity.
    pub(crate) base_colour_texture: Option<Texture>,
    /// 0 (dielectric) to 1 (metal).
    pub(crate) metallic: f64,
    /// 0 to 1: the square root of the alpha of GGX.
    pub(crate) roughness: f64,
    /// Metallic in blue, roughness in green, both linear.
    pub(crate) metallic_roughness_texture: Option<Texture>,
    /// Normals in tangent space.
    pub(crate) normal_texture: Option<Texture>,
    /// Factor of x and y of these normals.
    pub(crate) normal_scale: f64,
    /// Emitted light, 0 to 1.
    pub(crate) emissive: [f64; 3],
    /// Factor of emitted light: 1 is 1 cd/m2.
    pub(crate) emissive_strength: f64,
    /// In sRGB.
    pub(crate) emissive_texture: Option<Texture>,
    /// What opacity means.
    pub(crate) alpha: AlphaMode,
    /// Whether its back is seen.
    pub(crate) is_double_sided: bool,
    /// Whether it shows its base colour whatever the light.
    pub(crate) is_unlit: bool,
    /// The part of light that is not reflected and goes through, 0 to 1.
    pub(crate) transmission: f64,
    /// In red, linear.
    pub(crate) transmission_texture: Option<Texture>,
    /// Index of refraction, at least 1; 0 reflects all light.
    pub(crate) ior: f64,
    /// What lies behind the surface, if it bounds a body.
    pub(crate) volume: Option<Volume>,
    /// Strength of specular reflection, 0 to 1.
    pub(crate) specular: f64,
    /// In alpha, linear.
    pub(crate) specular_texture: Option<Texture>,
    /// Colour of specular reflection at normal incidence; may be above 1.
    pub(crate) specular_colour: [f64; 3],
    /// In sRGB.
    pub(crate) specular_colour_texture: Option<Texture>,
}

/// What opacity means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum AlphaMode {
    /// Nothing.
    Opaque,
    /// Where it is below the cutoff there is no surface.
    Mask {
        /// At least 0.
        cutoff: f64,
    },
    /// The part of the surface that is there.
    Blend,
}

/// What a body is made of.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Volume {
    /// Thickness below the surface in the coordinates of the mesh; 0 is a thin wall.
    pub(crate) thickness: f64,
    /// In green, linear.
    pub(crate) thickness_texture: Option<Texture>,
    /// The distance at which white light has the attenuation colour, metres; infinite by default.
    pub(crate) attenuation_distance: f64,
    /// 0 to 1.
    pub(crate) attenuation_colour: [f64; 3],
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: None,
            extras: Value::Null,
            base_colour: [1.0; 4],
            base_colour_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emissive: [0.0; 3],
            emissive_strength: 1.0,
            emissive_texture: None,
            alpha: AlphaMode::Opaque,
            is_double_sided: false,
            is_unlit: false,
            transmission: 0.0,
            transmission_texture: None,
            ior: 1.5,
            volume: None,
            specular: 1.0,
            specular_texture: None,
            specular_colour: [1.0; 3],
            specular_colour_texture: None,
        }
    }
}

impl Material {
    /// Its textures.
    pub(super) fn textures(&self) -> impl Iterator<Item = &Texture> {
        let thickness = self.volume.as_ref().and_then(|volume| volume.thickness_texture.as_ref());
        [
            self.base_colour_texture.as_ref(),
            self.metallic_roughness_texture.as_ref(),
            self.normal_texture.as_ref(),
            self.emissive_texture.as_ref(),
            self.transmission_texture.as_ref(),
            thickness,
            self.specular_texture.as_ref(),
            self.specular_colour_texture.as_ref(),
        ]
        .into_iter()
        .flatten()
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Strength {
    #[serde(default)]
    emissive_strength: Option<f64>,
}

#[derive(Deserialize)]
struct Ior {
    #[serde(default)]
    ior: Option<f64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Transmission {
    #[serde(default)]
    transmission_factor: f64,
    #[serde(default)]
    transmission_texture: Option<TextureInfo>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct StoredVolume {
    #[serde(default)]
    thickness_factor: f64,
    #[serde(default)]
    thickness_texture: Option<TextureInfo>,
    #[serde(default)]
    attenuation_distance: Option<f64>,
    #[serde(default)]
    attenuation_color: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Specular {
    #[serde(default)]
    specular_factor: Option<f64>,
    #[serde(default)]
    specular_texture: Option<TextureInfo>,
    #[serde(default)]
    specular_color_factor: Option<[f64; 3]>,
    #[serde(default)]
    specular_color_texture: Option<TextureInfo>,
}

/// Reads all materials.
pub(super) fn read(document: &Document<'_>, notes: &mut Notes) -> Result<Vec<Material>, AssetProblem> {
    let mut materials = Vec::with_capacity(document.materials.len());
    for (index, stored) in document.materials.iter().enumerate() {
        let place = format!("materials[{index}]");
        let mut reader = MaterialReader { document, stored, place: &place, notes };
        let mut material = reader.base()?;
        reader.light(&mut material)?;
        reader.transmission(&mut material)?;
        reader.specular(&mut material)?;
        materials.push(material);
    }
    Ok(materials)
}

/// Factors that are parts of a whole.
const PART: std::ops::RangeInclusive<f64> = 0.0..=1.0;

/// Factors that may be of any size.
const AT_LEAST_0: std::ops::RangeInclusive<f64> = 0.0..=f64::INFINITY;

/// Reads one material.
struct MaterialReader<'r, 'a> {
    document: &'r Document<'a>,
    stored: &'r schema::Material,
    place: &'r str,
    notes: &'r mut Notes,
}

impl MaterialReader<'_, '_> {
    fn texture(&mut self, info: Option<&TextureInfo>, member: &str) -> Result<Option<Texture>, AssetProblem> {
        textures::read(self.document, info, &format!("{}.{member}", self.place), self.notes)
    }

    /// An extension of the material, and its place.
    fn extension<T: serde::de::DeserializeOwned>(&self, name: &str) -> Result<Option<(T, String)>, AssetProblem> {
        let found = extension(&self.stored.extensions, name, self.place)?;
        Ok(found.map(|extension| (extension, format!("extensions.{name}"))))
    }

    /// The metallic-roughness model and what is beside it.
    fn base(&mut self) -> Result<Material, AssetProblem> {
        let Self { stored, place, .. } = *self;
        let pbr = &stored.pbr_metallic_roughness;
        let pbr_place = format!("{place}.pbrMetallicRoughness");
        let factor = |name: &str, factor: Option<f64>| {
            check_range(format_args!("{pbr_place}.{name}"), factor.unwrap_or(1.0), PART)
        };
        let base_colour = pbr.base_color_factor.unwrap_or([1.0; 4]);
        let alpha = match stored.alpha_mode.as_deref() {
            None | Some("OPAQUE") => AlphaMode::Opaque,
            Some("BLEND") => AlphaMode::Blend,
            Some("MASK") => {
                let cutoff = stored.alpha_cutoff.unwrap_or(0.5);
                AlphaMode::Mask { cutoff: check_range(format_args!("{place}.alphaCutoff"), cutoff, AT_LEAST_0)? }
            }
            Some(mode) => {
                let message = format!("found \"{mode}\", must be \"OPAQUE\", \"MASK\" or \"BLEND\"");
                return Err(fault(format_args!("{place}.alphaMode"), message));
            }
        };
        Ok(Material {
            name: stored.name.clone(),
            extras: stored.extras.clone(),
            base_colour: check_ranges(&format!("{pbr_place}.baseColorFactor"), base_colour, PART)?,
            metallic: factor("metallicFactor", pbr.metallic_factor)?,
            roughness: factor("roughnessFactor", pbr.roughness_factor)?,
            base_colour_texture: self
                .texture(pbr.base_color_texture.as_ref(), "pbrMetallicRoughness.baseColorTexture")?,
            metallic_roughness_texture: self
                .texture(pbr.metallic_roughness_texture.as_ref(), "pbrMetallicRoughness.metallicRoughnessTexture")?,
            normal_scale: stored.normal_texture.as_ref().and_then(|normals| normals.scale).unwrap_or(1.0),
            normal_texture: self.texture(stored.normal_texture.as_ref(), "normalTexture")?,
            alpha,
            is_double_sided: stored.double_sided,
            is_unlit: stored.extensions.contains_key(UNLIT),
            ..Material::default()
        })
    }

    /// Emitted light.
    fn light(&mut self, material: &mut Material) -> Result<(), AssetProblem> {
        let Self { stored, place, .. } = *self;
        material.emissive = check_ranges(&format!("{place}.emissiveFactor"), stored.emissive_factor, PART)?;
        material.emissive_texture = self.texture(stored.emissive_texture.as_ref(), "emissiveTexture")?;
        if let Some((Strength { emissive_strength }, member)) = self.extension(EMISSIVE_STRENGTH)? {
            let strength = emissive_strength.unwrap_or(1.0);
            material.emissive_strength =
                check_range(format_args!("{place}.{member}.emissiveStrength"), strength, AT_LEAST_0)?;
        }
        Ok(())
    }

    /// Light that goes through.
    fn transmission(&mut self, material: &mut Material) -> Result<(), AssetProblem> {
        let place = self.place;
        if let Some((Ior { ior }, member)) = self.extension(IOR)? {
            let ior = ior.unwrap_or(1.5);
            if ior != 0.0 {
                check_range(format_args!("{place}.{member}.ior"), ior, 1.0..=f64::INFINITY)?;
            }
            material.ior = ior;
        }
        if let Some((stored, member)) = self.extension::<Transmission>(TRANSMISSION)? {
            let factor = stored.transmission_factor;
            material.transmission = check_range(format_args!("{place}.{member}.transmissionFactor"), factor, PART)?;
            let info = stored.transmission_texture.as_ref();
            material.transmission_texture = self.texture(info, &format!("{member}.transmissionTexture"))?;
        }
        if let Some((stored, member)) = self.extension::<StoredVolume>(VOLUME)? {
            let factor =
                |name: &str, factor: f64, range| check_range(format!("{place}.{member}.{name}"), factor, range);
            let attenuation_distance = match stored.attenuation_distance {
                Some(distance) => factor("attenuationDistance", distance, f64::MIN_POSITIVE..=f64::INFINITY)?,
                None => f64::INFINITY,
            };
            let colour = stored.attenuation_color.unwrap_or([1.0; 3]);
            let thickness = factor("thicknessFactor", stored.thickness_factor, AT_LEAST_0)?;
            let attenuation_colour = check_ranges(&format!("{place}.{member}.attenuationColor"), colour, PART)?;
            let info = stored.thickness_texture.as_ref();
            let thickness_texture = self.texture(info, &format!("{member}.thicknessTexture"))?;
            material.volume = Some(Volume { thickness, thickness_texture, attenuation_distance, attenuation_colour });
        }
        Ok(())
    }

    /// Specular reflection of dielectrics.
    fn specular(&mut self, material: &mut Material) -> Result<(), AssetProblem> {
        let Some((stored, member)) = self.extension::<Specular>(SPECULAR)? else { return Ok(()) };
        let place = format!("{}.{member}", self.place);
        let factor = stored.specular_factor.unwrap_or(1.0);
        let colour = stored.specular_color_factor.unwrap_or([1.0; 3]);
        material.specular = check_range(format_args!("{place}.specularFactor"), factor, PART)?;
        material.specular_colour = check_ranges(&format!("{place}.specularColorFactor"), colour, AT_LEAST_0)?;
        let info = stored.specular_texture.as_ref();
        material.specular_texture = self.texture(info, &format!("{member}.specularTexture"))?;
        let info = stored.specular_color_texture.as_ref();
        material.specular_colour_texture = self.texture(info, &format!("{member}.specularColorTexture"))?;
        Ok(())
    }
}
