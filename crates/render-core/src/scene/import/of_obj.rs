//! An OBJ file with its material libraries as things of the scene.

use std::collections::{BTreeMap, BTreeSet};

use super::description::{ImportDescription, ImportFiles};
use super::obj_materials::{ObjSurface, beside, pictures};
use super::things::{Assembly, Corners, Expansion, Thing};
use crate::scene::Assets;
use crate::scene::assets::asset_bytes;
use crate::scene::description::MeshSource;
use crate::scene::obj::{MtlFile, ObjFile, ObjPart};
use crate::settings::AssetProblem;
use crate::settings::check::is_asset_name;

/// The files that an OBJ file refers to: its material libraries that are there, and their pictures.
pub(super) fn files(files: &ImportFiles, assets: &Assets) -> Result<Vec<String>, AssetProblem> {
    let libraries = ObjFile::open(asset_bytes(assets, &files.file)?)?.material_libraries()?;
    let mut names: Vec<String> = libraries.iter().map(|library| files.beside(library)).collect();
    let mut names_of_pictures = Vec::new();
    for library in &names {
        let Some(asset) = assets.get(library) else { continue };
        for material in &read_library(library, asset.bytes())?.materials {
            names_of_pictures.extend(pictures(material).map(|map| beside(library, &map.file)));
        }
    }
    names.extend(names_of_pictures);
    let mut seen = BTreeSet::new();
    // A name that no scene may have is that of no file.
    names.retain(|name| is_asset_name(name) && seen.insert(name.clone()));
    Ok(names)
}

/// Reads a material library. What is wrong with it goes on after the name of the OBJ file.
fn read_library(name: &str, bytes: &[u8]) -> Result<MtlFile, AssetProblem> {
    MtlFile::read(bytes).map_err(|problem| AssetProblem::malformed(format_args!("names {name}, which {problem}")))
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
    let has_colours = file.has_colours();
    let parts = file.parts()?;
    let mut meshes = None;
    let mut surfaces: BTreeMap<String, ObjSurface> = BTreeMap::new();
    let mut faces_without = FacesWithout::default();
    for (number, part) in parts.iter().enumerate() {
        let name = part.material.as_deref().unwrap_or("no material");
        let scene_name = format!("{}/{name}", import.name);
        let surface = surfaces.entry(scene_name.clone()).or_insert_with(|| {
            let found = part.material.as_deref().and_then(|name| {
                libraries.iter().find_map(|(library, content)| Some((library, content.material(name)?)))
            });
            let notes = &mut assembly.expansion.notes;
            match found {
                Some((library, material)) => ObjSurface::of(library, material, has_colours, assets, notes),
                None => {
                    let what = match (&part.material, has_colours) {
                        (Some(name), true) => {
                            format!("material {name} is not described: it has the colours of its vertices")
                        }
                        (Some(name), false) => format!("material {name} is not described: it is grey"),
                        (None, true) => "some faces have no material, but the colours of their vertices".to_owned(),
                        (None, false) => "some faces have no material: they are grey".to_owned(),
                    };
                    notes.push(format!("{}: {what}", files.file));
                    ObjSurface::unknown(has_colours)
                }
            }
        });
        assembly.expansion.materials.entry(scene_name.clone()).or_insert_with(|| surface.material.clone());
        faces_without.add(part, surface);
        let thing = Thing {
            name: if part.name.is_empty() { name.to_owned() } else { part.name.clone() },
            mesh: None,
            material_in_file: part.material.clone(),
            to_scene: import.to_scene(),
            source: MeshSource::Obj { file: files.file.clone(), part: Some(number as u32) },
            material: scene_name,
            is_transparent: surface.is_transparent,
            emission: surface.emission.clone(),
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
    faces_without.note(&files.file, &mut assembly.expansion.notes);
    Ok(assembly.finish())
}

/// Faces that lack what is needed, or what other faces of their part have.
#[derive(Default)]
struct FacesWithout {
    texture_coordinates: usize,
    normals: usize,
}

impl FacesWithout {
    fn add(&mut self, part: &ObjPart, surface: &ObjSurface) {
        if part.texture_coordinates.is_any || surface.has_pictures() {
            self.texture_coordinates += part.texture_coordinates.faces_without;
        }
        if part.normals.is_any {
            self.normals += part.normals.faces_without;
        }
    }

    fn note(&self, file: &str, notes: &mut Vec<String>) {
        let Self { texture_coordinates, normals } = self;
        if *texture_coordinates > 0 {
            notes.push(format!(
                "{file}: corners without texture coordinates have those of the lower left corner of a picture (faces: \
                 {texture_coordinates})"
            ));
        }
        if *normals > 0 {
            notes.push(format!("{file}: corners without normals have that of their triangle (faces: {normals})"));
        }
    }
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
                let content = read_library(&name, asset.bytes())?;
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
