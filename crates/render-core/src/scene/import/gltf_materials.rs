//! Materials of a glTF file as materials of the scene.

use std::collections::BTreeMap;

use glam::DAffine2;

use super::description::ImportDescription;
use super::gltf::{AlphaMode, GltfFile, ImageSource, Material, Texture};
use super::things::Expansion;
use crate::bsdf::{
    DielectricMaterial, MaterialDescription, MetallicRoughnessMaterial, RoughDielectricMaterial, ThinWallMaterial,
};
use crate::settings::Triple;
use crate::texture::{
    Channel, ColourDescription, Filter, TextureDescription, TextureTransform, ValueDescription, ValueTexture, Wrap,
};

/// Roughness below which glass is clear.
const CLEAR: f64 = 0.03;

/// Whether light goes through a material.
pub(super) fn is_transparent(material: &Material) -> bool {
    material.transmission > 0.0 || material.alpha == AlphaMode::Blend && material.base_colour[3] < 1.0
}

/// The materials of a file that are used so far.
pub(super) struct GltfMaterials<'f, 'a> {
    import: &'f ImportDescription,
    file: &'f GltfFile<'a>,
    /// Their names in the scene, by their numbers in the file.
    names: BTreeMap<Option<usize>, String>,
}

impl<'f, 'a> GltfMaterials<'f, 'a> {
    /// None yet.
    pub(super) fn new(import: &'f ImportDescription, file: &'f GltfFile<'a>) -> Self {
        Self { import, file, names: BTreeMap::new() }
    }

    /// The name of a material in the scene, to which it is added when it is used first.
    pub(super) fn name(&mut self, index: Option<usize>, expansion: &mut Expansion) -> String {
        if let Some(name) = self.names.get(&index) {
            return name.clone();
        }
        let default = Material::default();
        let material = index.and_then(|index| self.file.materials().get(index)).unwrap_or(&default);
        let mut taken = expansion.materials.keys().cloned().collect();
        let name = self.import.name_of(material.name.as_deref().unwrap_or("material"), &mut taken);
        let described = self.describe(material, &name, &mut expansion.notes);
        expansion.materials.insert(name.clone(), described);
        self.names.insert(index, name.clone());
        name
    }

    fn describe(&self, material: &Material, name: &str, notes: &mut Vec<String>) -> MaterialDescription {
        let mut note = |is_left_out: bool, what: &str| {
            if is_left_out {
                notes.push(format!("material {name}: {what}"));
            }
        };
        note(material.normal_texture.is_some(), "its normal map is left out");
        note(material.alpha != AlphaMode::Opaque, "its opacity is left out: it is opaque everywhere");
        note(material.emissive != [0.0; 3], "the light that it emits is left out");
        note(material.is_unlit, "it is lit as other surfaces are, though the file says it is not");
        let [red, green, blue, _] = material.base_colour;
        let base_colour = self.colour(material.base_colour_texture.as_ref(), [red, green, blue]);
        if material.transmission > 0.5 {
            note(material.transmission_texture.is_some(), "its picture of transmission is left out");
            note(material.transmission < 1.0, "it lets all light through that it does not reflect");
            let index_of_refraction = material.ior.clamp(1.0, 3.0);
            let is_body = material.volume.as_ref().is_some_and(|volume| volume.thickness > 0.0);
            if !is_body {
                note(material.roughness > CLEAR, "it is clear, though the file has it rough");
                return MaterialDescription::ThinWall(ThinWallMaterial { index_of_refraction, tint: base_colour });
            }
            let absorbs = material.volume.as_ref().is_some_and(|volume| volume.attenuation_distance.is_finite());
            note(absorbs, "what it absorbs is left out: it is a clear body");
            return if material.roughness > CLEAR {
                let roughness = material.roughness;
                MaterialDescription::RoughDielectric(RoughDielectricMaterial { index_of_refraction, roughness })
            } else {
                MaterialDescription::Dielectric(DielectricMaterial { index_of_refraction })
            };
        }
        note(material.transmission > 0.0, "the light that goes through it is left out");
        note(material.specular_texture.is_some(), "its picture of specular strength is left out");
        let data = |factor: f64, channel: Channel| match &material.metallic_roughness_texture {
            None => ValueDescription::Uniform(factor),
            Some(texture) => self.picture(texture, [factor; 3]).map_or(ValueDescription::Uniform(factor), |texture| {
                ValueDescription::Texture(Box::new(ValueTexture { texture, channel }))
            }),
        };
        let bounded = material.specular_colour.map(|channel| channel.min(1.0));
        MaterialDescription::MetallicRoughness(MetallicRoughnessMaterial {
            base_colour,
            metallic: data(material.metallic, Channel::Blue),
            roughness: data(material.roughness, Channel::Green),
            index_of_refraction: material.ior,
            specular: ValueDescription::Uniform(material.specular),
            specular_colour: self.colour(material.specular_colour_texture.as_ref(), bounded),
            ..MetallicRoughnessMaterial::default()
        })
    }

    fn colour(&self, texture: Option<&Texture>, factor: Triple) -> ColourDescription {
        let texture = texture.and_then(|texture| self.picture(texture, factor));
        texture.map_or(ColourDescription::Colour(factor), |texture| ColourDescription::Texture(Box::new(texture)))
    }

    /// A picture of the file on a surface.
    fn picture(&self, texture: &Texture, factor: Triple) -> Option<TextureDescription> {
        let files = self.import.source.files();
        let (file, image) = match self.file.image(texture.image)?.source {
            ImageSource::Embedded(_) => (files.file.clone(), Some(texture.image as u32)),
            ImageSource::File(name) => (files.beside(name), None),
        };
        let wrap = texture.wrap.map(|wrap| match wrap {
            super::gltf::Wrap::Repeat => Wrap::Repeat,
            super::gltf::Wrap::Mirror => Wrap::Mirror,
            super::gltf::Wrap::Clamp => Wrap::Clamp,
        });
        Some(TextureDescription {
            image,
            coordinates: texture.set as u32,
            wrap,
            filter: if texture.is_nearest { Filter::Nearest } else { Filter::Linear },
            transform: upwards(texture.transform),
            factor,
            ..TextureDescription::of_file(&file)
        })
    }
}

/// A transform of texture coordinates whose v points down, as one for coordinates whose v points up.
fn upwards(transform: super::gltf::TextureTransform) -> TextureTransform {
    let DAffine2 { matrix2, translation } = transform.affine();
    let [[a, c], [b, d]] = matrix2.to_cols_array_2d();
    TextureTransform([[a, -b, b + translation.x], [-c, d, 1.0 - d - translation.y]])
}
