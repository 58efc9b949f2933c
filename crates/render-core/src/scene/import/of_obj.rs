//! An OBJ file with its material libraries as things of the scene.

use std::collections::BTreeSet;

use super::description::{ImportDescription, ImportFiles};
use super::things::{Assembly, Corners, Emission, Expansion, Thing};
use crate::bsdf::{DiffuseMaterial, MaterialDescription, MetallicRoughnessMaterial, ThinWallMaterial};
use crate::scene::Assets;
use crate::scene::assets::asset_bytes;
use crate::scene::description::MeshSource;
use crate::scene::obj::{MtlFile, MtlMap, MtlMaterial, ObjFile};
use crate::settings::check::is_asset_name;
use crate::settings::{AssetProblem, Triple};
use crate::texture::picture::has_alpha;
use crate::texture::{
    Channel, ColourDescription, TextureDescription, TextureTransform, ValueDescription, ValueTexture, Wrap,
};

/// Opacity below which light goes through a material.
const CLEAR: f64 = 0.9;

/// Reflectance of what has no material.
const GREY: Triple = [0.7; 3];

/// The files that an OBJ file refers to: its material libraries that are there, and their pictures.
pub(super) fn files(files: &ImportFiles, assets: &Assets) -> Result<Vec<String>, AssetProblem> {
    let libraries = ObjFile::open(asset_bytes(assets, &files.file)?)?.material_libraries()?;
    let mut names: Vec<String> = libraries.iter().map(|library| files.beside(library)).collect();
    let mut names_of_pictures = Vec::new();
    for library in &names {
        let Some(asset) = assets.get(library) else { continue };
        for material in &MtlFile::read(asset.bytes())?.materials {
            names_of_pictures.extend(pictures(material).map(|map| beside(library, &map.file)));
        }
    }
    names.extend(names_of_pictures);
    let mut seen = BTreeSet::new();
    // A name that no scene may have is that of no file.
    names.retain(|name| is_asset_name(name) && seen.insert(name.clone()));
    Ok(names)
}

/// The name of a file that is beside another.
fn beside(file: &str, name: &str) -> String {
    ImportFiles { file: file.to_owned(), files: Vec::new() }.beside(name)
}

pub(super) fn expand(import: &ImportDescription, assets: &Assets) -> Result<Expansion, AssetProblem> {
    let files = import.source.files();
    let file = ObjFile::open(asset_bytes(assets, &files.file)?)?;
    let mut assembly = Assembly::new(import);
    let expansion = &mut assembly.expansion;
    let libraries = libraries(files, &file, assets, &mut expansion.notes)?;
    let lines = file.lines_and_points();
    if lines > 0 {
        expansion.notes.push(format!("{}: lines and points are left out (statements: {lines})", files.file));
    }
    let parts = file.parts()?;
    let mut meshes = None;
    let mut materials = BTreeSet::new();
    for (number, part) in parts.iter().enumerate() {
        let found = part
            .material
            .as_ref()
            .and_then(|name| libraries.iter().find_map(|(library, content)| Some((library, content.material(name)?))));
        let name = part.material.clone().unwrap_or_else(|| "no material".to_owned());
        let scene_name = format!("{}/{name}", import.name);
        if materials.insert(scene_name.clone()) {
            if found.is_none() {
                assembly.expansion.notes.push(format!("{}: material {name} is not described: it is grey", files.file));
            }
            let material = found.map_or_else(grey, |(library, material)| {
                note_absent_pictures(library, material, assets, &mut assembly.expansion.notes);
                describe(library, material, assets)
            });
            assembly.expansion.materials.insert(scene_name.clone(), material);
        }
        let thing = Thing {
            name: if part.name.is_empty() { name.clone() } else { part.name.clone() },
            mesh: None,
            material_in_file: part.material.clone(),
            to_scene: import.to_scene(),
            source: MeshSource::Obj { file: files.file.clone(), part: Some(number as u32) },
            material: scene_name,
            is_transparent: found.is_some_and(|(_, material)| is_transparent(material)),
            emission: found.and_then(|(library, material)| emission(library, material, assets)),
            pane: None,
            tags: Vec::new(),
        };
        let corners = || -> Result<Corners, AssetProblem> {
            if meshes.is_none() {
                meshes = Some(file.decode_parts()?);
            }
            let mesh = meshes.as_ref().and_then(|meshes: &Vec<_>| meshes.get(number));
            Ok(mesh.map_or_else(Corners::default, |mesh| (mesh.positions.clone(), mesh.triangles.clone())))
        };
        assembly.add(thing, corners)?;
    }
    Ok(assembly.finish())
}

/// The material libraries that were supplied, with their names.
fn libraries(
    files: &ImportFiles,
    file: &ObjFile<'_>,
    assets: &Assets,
    notes: &mut Vec<String>,
) -> Result<Vec<(String, MtlFile)>, AssetProblem> {
    let mut libraries = Vec::new();
    for library in file.material_libraries()? {
        let name = files.beside(&library);
        match assets.get(&name) {
            Some(asset) => {
                let content = MtlFile::read(asset.bytes())
                    .map_err(|problem| AssetProblem::malformed(format_args!("names {name}, which {problem}")))?;
                for (statement, count) in &content.left_out {
                    notes.push(format!("{name}: statements {statement} are left out ({count})"));
                }
                libraries.push((name, content));
            }
            None => notes.push(format!("{}: its material library {name} is not there", files.file)),
        }
    }
    Ok(libraries)
}

/// Notes the pictures of a material that were not supplied.
fn note_absent_pictures(library: &str, material: &MtlMaterial, assets: &Assets, notes: &mut Vec<String>) {
    for file in pictures(material).map(|map| beside(library, &map.file)) {
        if !assets.contains_key(&file) {
            notes.push(format!("{library}: the picture {file} of material {} is not there", material.name));
        }
    }
}

/// The pictures of a material that count.
fn pictures(material: &MtlMaterial) -> impl Iterator<Item = &MtlMap> {
    let maps = [
        &material.diffuse_map,
        &material.emission_map,
        &material.roughness_map,
        &material.metallic_map,
        &material.opacity_map,
    ];
    maps.into_iter().flatten()
}

fn is_transparent(material: &MtlMaterial) -> bool {
    let is_clear = material.opacity.is_some_and(|opacity| opacity < CLEAR);
    // A picture cuts leaves out, not glass.
    is_clear && material.opacity_map.is_none()
        || matches!(material.illumination, Some(4 | 6 | 7 | 9))
        || material.transmission.is_some_and(|share| share != [1.0; 3] && share.iter().sum::<f64>() > 0.0)
}

fn grey() -> MaterialDescription {
    MaterialDescription::Diffuse(DiffuseMaterial { reflectance: ColourDescription::Colour(GREY) })
}

/// A picture of a library on a surface; none where it is not there, which leaves the colour.
fn texture(library: &str, map: Option<&MtlMap>, factor: Triple, assets: &Assets) -> Option<TextureDescription> {
    let map = map?;
    let file = beside(library, &map.file);
    assets.contains_key(&file).then(|| TextureDescription {
        wrap: [if map.is_clamped { Wrap::Clamp } else { Wrap::Repeat }; 2],
        transform: TextureTransform([[map.scale[0], 0.0, map.offset[0]], [0.0, map.scale[1], map.offset[1]]]),
        factor,
        ..TextureDescription::of_file(&file)
    })
}

/// The light that a material emits. The format has no unit: it is taken for W/(m2 sr). A picture alone has the factor
/// 1.
fn emission(library: &str, material: &MtlMaterial, assets: &Assets) -> Option<Emission> {
    let texture = texture(library, material.emission_map.as_ref(), [1.0; 3], assets);
    let without_colour = if texture.is_some() { [1.0; 3] } else { [0.0; 3] };
    let radiance = material.emission.unwrap_or(without_colour).map(|channel| channel.max(0.0));
    (radiance != [0.0; 3]).then_some(Emission { radiance, texture })
}

fn describe(library: &str, material: &MtlMaterial, assets: &Assets) -> MaterialDescription {
    let part = |colour: Triple| colour.map(|channel| channel.clamp(0.0, 1.0));
    let texture = |map: &Option<MtlMap>, factor: Triple| texture(library, map.as_ref(), factor, assets);
    let diffuse = part(material.diffuse.unwrap_or(GREY));
    if is_transparent(material) {
        let tint = part(material.transmission.unwrap_or(diffuse));
        return MaterialDescription::ThinWall(ThinWallMaterial {
            index_of_refraction: material.ior.unwrap_or(1.5).clamp(1.0, 3.0),
            tint: ColourDescription::Colour(tint),
            ..ThinWallMaterial::default()
        });
    }
    let part_there = material.opacity.unwrap_or(1.0).clamp(0.0, 1.0);
    let opacity = texture(&material.opacity_map, [part_there; 3]).map(|texture| {
        // One picture may have both, colours and opacity. One of opacity alone is grey.
        let has_alpha = assets.get(&texture.file).is_some_and(|asset| has_alpha(asset.bytes()));
        let channel = if has_alpha { Channel::Alpha } else { Channel::Red };
        ValueDescription::Texture(Box::new(ValueTexture { texture, channel }))
    });
    let opacity = opacity.unwrap_or_else(|| ValueDescription::number(part_there));
    let base_colour = texture(&material.diffuse_map, diffuse);
    let base_colour =
        base_colour.map_or(ColourDescription::Colour(diffuse), |texture| ColourDescription::Texture(Box::new(texture)));
    if material.roughness.is_none() && material.metallic.is_none() {
        if opacity == ValueDescription::number(1.0) {
            return MaterialDescription::Diffuse(DiffuseMaterial { reflectance: base_colour });
        }
        return MaterialDescription::MetallicRoughness(MetallicRoughnessMaterial {
            base_colour,
            metallic: ValueDescription::number(0.0),
            specular: ValueDescription::number(0.0),
            opacity,
            ..MetallicRoughnessMaterial::default()
        });
    }
    let value = |number: Option<f64>, map: &Option<MtlMap>, usual: f64| {
        let number = number.unwrap_or(usual).clamp(0.0, 1.0);
        texture(map, [number; 3]).map_or(ValueDescription::Uniform(number), |texture| {
            ValueDescription::Texture(Box::new(ValueTexture { texture, channel: Channel::Red }))
        })
    };
    MaterialDescription::MetallicRoughness(MetallicRoughnessMaterial {
        base_colour,
        metallic: value(material.metallic, &material.metallic_map, 0.0),
        roughness: value(material.roughness, &material.roughness_map, 0.5),
        opacity,
        ..MetallicRoughnessMaterial::default()
    })
}
