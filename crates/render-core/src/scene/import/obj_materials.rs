//! Materials of the libraries of an OBJ file as materials of the scene.
//!
//! MTL files say little of what they mean, and exporters fill in what they do not know. So a material is taken for
//! glass only where its opacity says so, or where its illumination model refracts light.

use super::description::ImportFiles;
use super::things::Emission;
use crate::bsdf::{DiffuseMaterial, MaterialDescription, MetallicRoughnessMaterial, ThinWallMaterial};
use crate::scene::Assets;
use crate::scene::obj::{MtlMap, MtlMaterial};
use crate::settings::Triple;
use crate::texture::picture::has_alpha;
use crate::texture::{
    Channel, ColourDescription, Encoding, NormalMapDescription, TextureDescription, TextureTransform, ValueDescription,
    ValueTexture, Wrap, unreadable,
};

/// Opacity below which light goes through a material.
const CLEAR: f64 = 0.9;

/// Reflectance of what has no material.
const GREY: Triple = [0.7; 3];

const BLACK: Triple = [0.0; 3];
const WHITE: Triple = [1.0; 3];

/// Index of refraction of glass.
const GLASS: f64 = 1.5;

/// Roughness of a highlight of which the file does not say how wide it is.
const USUAL_ROUGHNESS: f64 = 0.5;

/// Largest strength of a normal map.
const MAX_STRENGTH: f64 = 1e3;

/// A material of an OBJ file in the scene.
pub(super) struct ObjSurface {
    pub(super) material: MaterialDescription,
    /// Whether light goes through it.
    pub(super) is_transparent: bool,
    pub(super) emission: Option<Emission>,
}

impl ObjSurface {
    /// A material of a library. Its file may have colours of vertices.
    pub(super) fn of(
        library: &str,
        material: &MtlMaterial,
        has_colours: bool,
        assets: &Assets,
        notes: &mut Vec<String>,
    ) -> Self {
        let material = with_readable_pictures(library, material, assets, notes);
        let reader = Reader { library, material: &material, assets };
        let tint = glass_tint(&material);
        let mut note = |what: &str| notes.push(format!("{library}: material {}: {what}", material.name));
        if material.bump_map.is_some() {
            note("its bump map is left out: bake it into a normal map (norm)");
        }
        if tint.is_some() {
            note("it is taken for window glass");
            if material.diffuse_map.is_some() {
                note("its picture (map_Kd) tints the light that goes through");
            }
            if material.normal_map.is_some() {
                note("its normal map is left out, as glass has none");
            }
        }
        Self {
            material: tint.map_or_else(|| reader.opaque(has_colours), |tint| reader.glass(tint)),
            is_transparent: tint.is_some(),
            emission: reader.emission(),
        }
    }

    /// What no library describes: grey, or in the colours of its vertices.
    pub(super) fn unknown(has_colours: bool) -> Self {
        let material = if has_colours {
            MaterialDescription::MetallicRoughness(matt(ColourDescription::Colour(WHITE)))
        } else {
            MaterialDescription::Diffuse(DiffuseMaterial { reflectance: ColourDescription::Colour(GREY) })
        };
        Self { material, is_transparent: false, emission: None }
    }

    /// Whether it needs texture coordinates.
    pub(super) fn has_pictures(&self) -> bool {
        !self.material.textures().is_empty() || self.emission.as_ref().is_some_and(|light| light.texture.is_some())
    }
}

/// The pictures of a material that count.
pub(super) fn pictures(material: &MtlMaterial) -> impl Iterator<Item = &MtlMap> {
    let maps = [
        &material.diffuse_map,
        &material.emission_map,
        &material.roughness_map,
        &material.metallic_map,
        &material.opacity_map,
        &material.normal_map,
    ];
    maps.into_iter().flatten()
}

/// The material without the pictures that are missing or cannot be read. Notes say which, and what to do.
fn with_readable_pictures(
    library: &str,
    material: &MtlMaterial,
    assets: &Assets,
    notes: &mut Vec<String>,
) -> MtlMaterial {
    let mut material = material.clone();
    let name = material.name.clone();
    for statement in &material.unnamed {
        notes
            .push(format!("{library}: {statement} of material {name} names no file beside it: name one, or delete it"));
    }
    for (map, encoding) in [
        (&mut material.diffuse_map, Encoding::Colour),
        (&mut material.emission_map, Encoding::Colour),
        (&mut material.roughness_map, Encoding::Data),
        (&mut material.metallic_map, Encoding::Data),
        (&mut material.opacity_map, Encoding::Data),
        (&mut material.normal_map, Encoding::Data),
    ] {
        let Some(file) = map.as_ref().map(|map| beside(library, &map.file)) else { continue };
        let problem = match assets.get(&file) {
            None => "is not there: put it beside the library".to_owned(),
            Some(asset) => match unreadable(asset.bytes(), encoding) {
                None => continue,
                Some(problem) => format!("is left out: it {problem}"),
            },
        };
        notes.push(format!("{library}: the picture {file} of material {name} {problem}"));
        *map = None;
    }
    material
}

/// The name of a file that is beside another.
pub(super) fn beside(file: &str, name: &str) -> String {
    ImportFiles { file: file.to_owned(), files: Vec::new() }.beside(name)
}

fn part(colour: Triple) -> Triple {
    colour.map(|channel| channel.clamp(0.0, 1.0))
}

fn diffuse(material: &MtlMaterial) -> Triple {
    part(material.diffuse.unwrap_or(GREY))
}

/// The tint of glass; `None` of what is opaque.
///
/// - An opacity below 0.9 is glass.
/// - The illumination models 6, 7 and 9 are glass where light is bent (`Ni` above 1), whatever the opacity.
/// - Model 4 is glass where light is bent, no opacity is given, and the filter (`Tf`) is neither white nor black. Maya
///   writes this model with a white filter for opaque things, and with a black one for clear things.
/// - Elsewhere a filter means nothing: some programs write one for every material.
fn glass_tint(material: &MtlMaterial) -> Option<Triple> {
    let filter = material.transmission.map(part).filter(|filter| ![BLACK, WHITE].contains(filter));
    let is_bent = material.ior.is_some_and(|index| index > 1.0);
    let refracts = match material.illumination {
        Some(6 | 7 | 9) => is_bent,
        Some(4) => is_bent && material.opacity.is_none() && filter.is_some(),
        _ => false,
    };
    // A picture cuts leaves out, not glass.
    let opacity = material.opacity.filter(|opacity| *opacity < CLEAR && material.opacity_map.is_none());
    let blended = opacity.map(|opacity| {
        let opacity = opacity.max(0.0);
        diffuse(material).map(|channel| 1.0 - opacity + opacity * channel)
    });
    match (refracts, filter, blended) {
        (true, Some(filter), _) => Some(filter),
        (_, _, Some(blended)) => Some(blended),
        (true, None, None) => Some(WHITE),
        (false, _, None) => None,
    }
}

/// A matt surface that takes colours of vertices, a normal map and an opacity.
fn matt(base_colour: ColourDescription) -> MetallicRoughnessMaterial {
    MetallicRoughnessMaterial {
        base_colour,
        metallic: ValueDescription::number(0.0),
        specular: ValueDescription::number(0.0),
        ..MetallicRoughnessMaterial::default()
    }
}

/// The reflectance of the highlight, which the illumination models 0 and 1 do not have.
fn highlight(material: &MtlMaterial) -> Option<Triple> {
    let specular = part(material.specular?);
    (!matches!(material.illumination, Some(0 | 1)) && specular != BLACK).then_some(specular)
}

/// The roughness of a highlight. Phong's exponent n is as wide as microfacets of alpha = (2 / (n + 2))^(1/2). The
/// roughness is the root of alpha.
fn roughness(material: &MtlMaterial) -> f64 {
    material.shininess.map_or(USUAL_ROUGHNESS, |exponent| (2.0 / (exponent.max(0.0) + 2.0)).sqrt().sqrt())
}

/// A material whose pictures can be read.
struct Reader<'a> {
    library: &'a str,
    material: &'a MtlMaterial,
    assets: &'a Assets,
}

impl Reader<'_> {
    /// A picture on a surface, multiplied by a colour.
    fn texture(&self, map: Option<&MtlMap>, factor: Triple) -> Option<TextureDescription> {
        map.map(|map| TextureDescription {
            wrap: [if map.is_clamped { Wrap::Clamp } else { Wrap::Repeat }; 2],
            transform: TextureTransform([[map.scale[0], 0.0, map.offset[0]], [0.0, map.scale[1], map.offset[1]]]),
            factor,
            ..TextureDescription::of_file(&beside(self.library, &map.file))
        })
    }

    /// The picture of the material (`map_Kd`) multiplied by a colour, or the colour alone.
    fn colour(&self, factor: Triple) -> ColourDescription {
        let texture = self.texture(self.material.diffuse_map.as_ref(), factor);
        texture.map_or(ColourDescription::Colour(factor), |texture| ColourDescription::Texture(Box::new(texture)))
    }

    /// The light that a material emits. The format has no unit: it is taken for W/(m2 sr). A picture alone has the
    /// factor 1.
    fn emission(&self) -> Option<Emission> {
        let texture = self.texture(self.material.emission_map.as_ref(), WHITE);
        let without_colour = if texture.is_some() { WHITE } else { BLACK };
        let radiance = self.material.emission.unwrap_or(without_colour).map(|channel| channel.max(0.0));
        (radiance != BLACK).then_some(Emission { radiance, texture })
    }

    /// Index of refraction. Programs write 1 where they do not know it.
    fn index_of_refraction(&self) -> f64 {
        self.material.ior.filter(|index| *index > 1.0).map_or(GLASS, |index| index.min(3.0))
    }

    /// A sheet of glass.
    fn glass(&self, tint: Triple) -> MaterialDescription {
        let opacity = self.opacity_map(1.0).unwrap_or_else(|| ValueDescription::number(1.0));
        MaterialDescription::ThinWall(ThinWallMaterial {
            index_of_refraction: self.index_of_refraction(),
            tint: self.colour(tint),
            opacity,
            ..ThinWallMaterial::default()
        })
    }

    fn opacity_map(&self, factor: f64) -> Option<ValueDescription> {
        let texture = self.texture(self.material.opacity_map.as_ref(), [factor; 3])?;
        // One picture may have both, colours and opacity. One of opacity alone is grey.
        let has_alpha = self.assets.get(&texture.file).is_some_and(|asset| has_alpha(asset.bytes()));
        let channel = if has_alpha { Channel::Alpha } else { Channel::Red };
        Some(ValueDescription::Texture(Box::new(ValueTexture { texture, channel })))
    }

    fn normal_map(&self) -> Option<Box<NormalMapDescription>> {
        let map = self.material.normal_map.as_ref()?;
        let texture = self.texture(Some(map), WHITE)?;
        Some(Box::new(NormalMapDescription { texture, strength: map.multiplier.clamp(-MAX_STRENGTH, MAX_STRENGTH) }))
    }

    /// A number with a picture, which multiplies it. A picture alone has the factor 1.
    fn value(&self, number: Option<f64>, map: &Option<MtlMap>, usual: f64) -> ValueDescription {
        let number = number.unwrap_or(if map.is_some() { 1.0 } else { usual }).clamp(0.0, 1.0);
        self.texture(map.as_ref(), [number; 3]).map_or(ValueDescription::Uniform(number), |texture| {
            ValueDescription::Texture(Box::new(ValueTexture { texture, channel: Channel::Red }))
        })
    }

    /// A surface that is no glass: of the metallic-roughness model where the library has that, else with a highlight
    /// where it has one, else matt.
    fn opaque(&self, has_colours: bool) -> MaterialDescription {
        let material = self.material;
        let part_there = material.opacity.unwrap_or(1.0).clamp(0.0, 1.0);
        let surface = MetallicRoughnessMaterial {
            opacity: self.opacity_map(part_there).unwrap_or_else(|| ValueDescription::number(part_there)),
            normal_map: self.normal_map(),
            ..matt(self.colour(diffuse(material)))
        };
        let has_model = material.roughness.is_some()
            || material.metallic.is_some()
            || material.roughness_map.is_some()
            || material.metallic_map.is_some();
        if has_model {
            return MaterialDescription::MetallicRoughness(MetallicRoughnessMaterial {
                metallic: self.value(material.metallic, &material.metallic_map, 0.0),
                roughness: self.value(material.roughness, &material.roughness_map, USUAL_ROUGHNESS),
                specular: ValueDescription::number(1.0),
                ..surface
            });
        }
        if let Some(specular) = highlight(material) {
            return MaterialDescription::MetallicRoughness(self.with_highlight(surface, specular));
        }
        let is_plain = surface.opacity == ValueDescription::number(1.0) && surface.normal_map.is_none() && !has_colours;
        if is_plain {
            return MaterialDescription::Diffuse(DiffuseMaterial { reflectance: surface.base_colour });
        }
        MaterialDescription::MetallicRoughness(surface)
    }

    /// A matt surface under a clear coat of this strength and colour. Where nothing is matt and the illumination model
    /// mirrors, it is a metal.
    fn with_highlight(&self, surface: MetallicRoughnessMaterial, specular: Triple) -> MetallicRoughnessMaterial {
        let roughness = ValueDescription::number(roughness(self.material));
        let is_mirror = matches!(self.material.illumination, Some(3 | 5 | 8));
        if is_mirror && surface.base_colour == ColourDescription::Colour(BLACK) {
            let base_colour = ColourDescription::Colour(specular);
            return MetallicRoughnessMaterial {
                base_colour,
                metallic: ValueDescription::number(1.0),
                roughness,
                ..surface
            };
        }
        let strength = specular.into_iter().fold(0.0, f64::max);
        MetallicRoughnessMaterial {
            roughness,
            index_of_refraction: self.index_of_refraction(),
            specular: ValueDescription::number(strength),
            specular_colour: ColourDescription::Colour(specular.map(|channel| channel / strength)),
            ..surface
        }
    }
}
