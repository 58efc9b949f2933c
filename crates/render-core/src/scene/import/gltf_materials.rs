//! Materials of a glTF file as materials of the scene.

use std::collections::BTreeMap;

use glam::DAffine2;

use super::description::ImportDescription;
use super::gltf::{AlphaMode, GltfFile, Material, Texture, Volume};
use super::things::{Emission, Expansion, Names};
use super::windows::is_called_window;
use crate::bsdf::{
    DielectricMaterial, MaterialDescription, MetallicRoughnessMaterial, RoughDielectricMaterial, ThinWallMaterial,
};
use crate::settings::Triple;
use crate::texture::{
    Channel, ColourDescription, Filter, NormalMapDescription, TextureDescription, TextureTransform, ValueDescription,
    ValueTexture, Wrap,
};

/// Roughness below which glass is clear.
const CLEAR: f64 = 0.03;

/// Luminous efficacy with which programs turn watts into lumens for glTF, lm/W.
pub(super) const LUMENS_FOR_A_WATT: f64 = 683.0;

/// How the generator of files is called that writes emitted light in W/(m2 sr), though it writes lamps in lumens.
const BLENDER: &str = "Khronos glTF Blender I/O";

/// A body lets no less light through over its distance than this.
const DARKEST: f64 = 1e-9;

/// Largest absorption of a body, per metre.
const MOST_ABSORBED: f64 = 1e6;

fn is_white(colour: &ColourDescription) -> bool {
    matches!(colour, ColourDescription::Colour([red, green, blue]) if red.min(*green).min(*blue) > 0.999)
}

/// Roughness up to which a surface that blends with what is behind it is taken for glass, whatever it is called.
const POLISHED: f64 = 0.3;

/// Opacity from which on such a surface is none.
const NEARLY_OPAQUE: f64 = 0.9;

/// Whether a material is glass for a program that can only blend: one opacity everywhere, and smooth or called glass.
fn is_blended_glass(material: &Material) -> bool {
    let is_smooth = material.roughness <= POLISHED && material.metallic <= 0.5;
    let is_even = material.base_colour_texture.is_none() && material.metallic_roughness_texture.is_none();
    let is_called_so = material.name.as_deref().is_some_and(is_called_window);
    material.alpha == AlphaMode::Blend
        && material.base_colour[3] < NEARLY_OPAQUE
        && is_even
        && (is_smooth || is_called_so)
}

/// Said of glass whose surface is drawn into a picture.
const RELIEF_LEFT_OUT: &str = "its normal map is left out, since its glass is smooth; --glaze makes old panes of it";

/// Whether a material is that of a body that light goes through.
pub(super) fn is_body(material: &Material) -> bool {
    material.transmission > 0.5 && material.volume.as_ref().is_some_and(|volume| volume.thickness > 0.0)
}

/// Whether light goes through a material.
pub(super) fn is_transparent(material: &Material) -> bool {
    material.transmission > 0.0 || material.alpha == AlphaMode::Blend && material.base_colour[3] < 1.0
}

/// The materials of a file that are used so far.
pub(super) struct GltfMaterials<'f, 'a> {
    import: &'f ImportDescription,
    file: &'f GltfFile<'a>,
    /// Their names in the scene, by their numbers in the file, and whether their surfaces are closed.
    names: BTreeMap<(Option<usize>, bool), String>,
    taken: Names,
}

impl<'f, 'a> GltfMaterials<'f, 'a> {
    /// None yet.
    pub(super) fn new(import: &'f ImportDescription, file: &'f GltfFile<'a>) -> Self {
        Self { import, file, names: BTreeMap::new(), taken: Names::default() }
    }

    /// The name of a material in the scene, to which it is added when it is used first. A surface that is not closed
    /// has no body.
    pub(super) fn name(&mut self, index: Option<usize>, is_closed: bool, expansion: &mut Expansion) -> String {
        if let Some(name) = self.names.get(&(index, is_closed)) {
            return name.clone();
        }
        let default = Material::default();
        let material = index.and_then(|index| self.file.materials().get(index)).unwrap_or(&default);
        let name = self.taken.name(self.import, material.name.as_deref().unwrap_or("material"));
        let described = self.describe(material, &name, is_closed, &mut expansion.notes);
        expansion.materials.insert(name.clone(), described);
        self.names.insert((index, is_closed), name.clone());
        name
    }

    /// The light that a material emits. glTF has cd/m2.
    pub(super) fn emission(&self, material: &Material) -> Option<Emission> {
        let is_of_blender = self.file.generator().starts_with(BLENDER);
        let strength = material.emissive_strength / if is_of_blender { 1.0 } else { LUMENS_FOR_A_WATT };
        let radiance = material.emissive.map(|channel| channel * strength);
        let texture = || self.picture(material.emissive_texture.as_ref()?, [1.0; 3]);
        (radiance != [0.0; 3]).then(|| Emission { radiance, texture: texture() })
    }

    fn describe(
        &self,
        material: &Material,
        name: &str,
        is_closed: bool,
        notes: &mut Vec<String>,
    ) -> MaterialDescription {
        let mut note = |is_left_out: bool, what: &str| {
            if is_left_out {
                notes.push(format!("material {name}: {what}"));
            }
        };
        note(material.is_unlit, "it is lit as other surfaces are, though the file says it is not");
        let [red, green, blue, alpha] = material.base_colour;
        let body = material.volume.as_ref().filter(|_| is_body(material));
        // What a body of this thickness lets through, where the surface is that of a sheet.
        let kept = body.filter(|_| !is_closed).map_or([1.0; 3], |body| {
            let thickness = body.thickness * self.import.metres_per_unit;
            self.absorption(body).map(|coefficient| libm::exp(-coefficient * thickness))
        });
        note(body.is_some() && !is_closed, "it is a sheet with the colour of its body, since its surface is open");
        let coloured = [red * kept[0], green * kept[1], blue * kept[2]];
        let base_colour = self.colour(material.base_colour_texture.as_ref(), coloured);
        let index_of_refraction = material.ior.clamp(1.0, 3.0);
        let (opacity, opacity_threshold) = self.opacity(material);
        if material.transmission <= 0.5 && is_blended_glass(material) {
            note(true, "it is window glass: the file blends it with what is behind it");
            note(material.normal_texture.is_some(), RELIEF_LEFT_OUT);
            let tint = [red, green, blue].map(|channel| 1.0 - alpha + alpha * channel);
            return MaterialDescription::ThinWall(ThinWallMaterial {
                index_of_refraction,
                tint: ColourDescription::Colour(tint),
                ..ThinWallMaterial::default()
            });
        }
        if let Some(body) = body.filter(|_| is_closed) {
            note(material.normal_texture.is_some(), RELIEF_LEFT_OUT);
            note(material.metallic_roughness_texture.is_some(), "its picture of roughness is left out");
            note(material.transmission_texture.is_some(), "its picture of transmission is left out");
            note(material.transmission < 1.0, "it lets all light through that it does not reflect");
            note(!is_white(&base_colour), "its base colour is left out: a body has the colour of what it absorbs");
            note(material.alpha != AlphaMode::Opaque, "its opacity is left out: all of the body is there");
            let absorption = self.absorption(body);
            let roughness = material.roughness;
            return if roughness > CLEAR {
                MaterialDescription::RoughDielectric(RoughDielectricMaterial {
                    index_of_refraction,
                    roughness,
                    absorption,
                    priority: 0,
                })
            } else {
                MaterialDescription::Dielectric(DielectricMaterial { index_of_refraction, absorption, priority: 0 })
            };
        }
        let is_clear = material.roughness <= CLEAR && material.metallic_roughness_texture.is_none();
        if material.transmission == 1.0 && material.transmission_texture.is_none() && is_clear {
            note(material.normal_texture.is_some(), RELIEF_LEFT_OUT);
            return MaterialDescription::ThinWall(ThinWallMaterial {
                index_of_refraction,
                tint: base_colour,
                opacity,
                opacity_threshold,
            });
        }
        let data = |texture: Option<&Texture>, factor: f64, channel: Channel| match texture {
            None => ValueDescription::Uniform(factor),
            Some(texture) => self.picture(texture, [factor; 3]).map_or(ValueDescription::Uniform(factor), |texture| {
                ValueDescription::Texture(Box::new(ValueTexture { texture, channel }))
            }),
        };
        let surface = material.metallic_roughness_texture.as_ref();
        let transmission = material.transmission_texture.as_ref();
        let bounded = material.specular_colour.map(|channel| channel.min(1.0));
        note(bounded != material.specular_colour, "its specular colour is at most 1, though the file has more");
        MaterialDescription::MetallicRoughness(MetallicRoughnessMaterial {
            base_colour,
            metallic: data(surface, material.metallic, Channel::Blue),
            roughness: data(surface, material.roughness, Channel::Green),
            index_of_refraction: material.ior,
            specular: data(material.specular_texture.as_ref(), material.specular, Channel::Alpha),
            specular_colour: self.colour(material.specular_colour_texture.as_ref(), bounded),
            transmission: data(transmission, material.transmission, Channel::Red),
            normal_map: self.normal_map(material),
            opacity,
            opacity_threshold,
            ..MetallicRoughnessMaterial::default()
        })
    }

    /// What a body absorbs, per metre.
    fn absorption(&self, body: &Volume) -> Triple {
        let distance = body.attenuation_distance * self.import.metres_per_unit;
        body.attenuation_colour.map(|kept| {
            let absorbed = -libm::log(kept.max(DARKEST)) / distance;
            if absorbed.is_finite() { absorbed.clamp(0.0, MOST_ABSORBED) } else { 0.0 }
        })
    }

    fn normal_map(&self, material: &Material) -> Option<Box<NormalMapDescription>> {
        let texture = self.picture(material.normal_texture.as_ref()?, [1.0; 3])?;
        Some(Box::new(NormalMapDescription { texture, strength: material.normal_scale }))
    }

    /// The part of a surface that is there, and from which opacity on all of it is.
    fn opacity(&self, material: &Material) -> (ValueDescription, Option<f64>) {
        let threshold = match material.alpha {
            AlphaMode::Opaque => return (ValueDescription::number(1.0), None),
            AlphaMode::Mask { cutoff } if cutoff > 1.0 => return (ValueDescription::number(0.0), None),
            AlphaMode::Mask { cutoff } => Some(cutoff),
            AlphaMode::Blend => None,
        };
        let factor = material.base_colour[3];
        let picture = material.base_colour_texture.as_ref().and_then(|texture| self.picture(texture, [factor; 3]));
        let opacity = picture.map_or(ValueDescription::number(factor), |texture| {
            ValueDescription::Texture(Box::new(ValueTexture { texture, channel: Channel::Alpha }))
        });
        (opacity, threshold)
    }

    fn colour(&self, texture: Option<&Texture>, factor: Triple) -> ColourDescription {
        let texture = texture.and_then(|texture| self.picture(texture, factor));
        texture.map_or(ColourDescription::Colour(factor), |texture| ColourDescription::Texture(Box::new(texture)))
    }

    /// A picture of the file on a surface.
    fn picture(&self, texture: &Texture, factor: Triple) -> Option<TextureDescription> {
        // By its number, also where it is a file of its own: colours in glTF files are sRGB whatever a file states.
        self.file.image(texture.image)?;
        let (file, image) = (self.import.source.files().file.clone(), Some(texture.image as u32));
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
