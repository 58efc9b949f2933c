//! The files that a scene names, with the places that name them, and the pictures in them.

use std::borrow::Cow;

use super::assets::{Assets, asset_bytes, beside};
use super::description::ProfileDescription;
use super::import::ImportFiles;
use super::import::gltf::{GltfFile, ImageSource};
use super::mesh_format::FileMesh;
use super::paint::PaintDescription;
use super::parts::SceneParts;
use super::sheet::{face_name, profile_uses};
use crate::settings::{AssetProblem, JsonPath};
use crate::texture::PictureKey;

/// The bytes of a picture: a file, or one of the pictures in a glTF file.
pub(super) fn picture_bytes<'a>(
    assets: &'a Assets,
    file: &str,
    image: Option<u32>,
) -> Result<Cow<'a, [u8]>, AssetProblem> {
    let bytes = asset_bytes(assets, file)?;
    match image {
        None => Ok(Cow::Borrowed(bytes)),
        Some(number) => {
            let opened = GltfFile::open(bytes, &|uri| beside(assets, file, uri))?;
            let missing = || AssetProblem::malformed(format_args!("has no picture {number} that a material uses"));
            match opened.image(number as usize).ok_or_else(missing)?.source {
                ImageSource::Embedded(bytes) => Ok(Cow::Owned(bytes.to_vec())),
                ImageSource::File(name) => {
                    let bytes = beside(assets, file, name).ok_or(AssetProblem::Missing)?;
                    Ok(Cow::Borrowed(bytes))
                }
            }
        }
    }
}

/// All members that name a file, with their places, in the order of the scene file.
pub(crate) fn asset_uses(parts: SceneParts<'_>) -> Vec<(String, &str)> {
    let meshes = parts.meshes.iter().enumerate().flat_map(|(index, mesh)| {
        let files = mesh.source.file().map_or(Vec::new(), FileMesh::files);
        files.into_iter().map(move |(place, file)| (format!("meshes[{index}].source.{place}"), file))
    });
    let profiles = profile_uses(&parts).filter_map(|(place, profile, _)| match profile {
        ProfileDescription::HeightMap { file, .. } => Some((format!("{place}.height_map.file"), file.as_str())),
        _ => None,
    });
    let of_windows = parts.windows.iter().enumerate().flat_map(|(index, window)| {
        let sheets = window.own_sheets().into_iter();
        sheets.map(move |(place, sheet)| (format!("windows[{index}].{place}"), sheet))
    });
    let of_imports = parts.imports.iter().enumerate().flat_map(|(index, import)| {
        import.lead.iter().enumerate().flat_map(move |(rule, leading)| {
            let sheets = leading.own_sheets().into_iter();
            sheets.map(move |(place, sheet)| (format!("imports[{index}].lead[{rule}].{place}"), sheet))
        })
    });
    let own_sheets = of_windows.chain(of_imports).flat_map(|(place, sheet)| {
        sheet.faces().into_iter().filter_map(move |(face, profile)| match profile {
            ProfileDescription::HeightMap { file, .. } => {
                Some((format!("{place}.{}.height_map.file", face_name(face)), file.as_str()))
            }
            _ => None,
        })
    });
    let textures = texture_uses(parts).map(|(path, picture)| (path, picture.file));
    let imports = parts.imports.iter().enumerate().flat_map(|(index, import)| {
        let place = format!("imports[{index}].source.{}", import.source.format());
        let ImportFiles { file, files } = import.source.files();
        let others = files.iter().enumerate().map(|(number, file)| (format!("{place}.files[{number}]"), file.as_str()));
        std::iter::once((format!("{place}.file"), file.as_str())).chain(others).collect::<Vec<_>>()
    });
    let profiles = profiles.chain(own_sheets);
    textures.chain(meshes).chain(profiles).chain(environment_uses(parts)).chain(imports).collect()
}

/// The files of all pictures that are lights, with their places.
pub(super) fn environment_uses(parts: SceneParts<'_>) -> impl Iterator<Item = (String, &str)> {
    parts.lights.iter().enumerate().filter_map(|(index, light)| {
        let (path, file) = light.picture()?;
        let root = JsonPath::Root;
        let lights = root.member("lights");
        let place = lights.element(index);
        Some((format!("{}.{path}", place.member(light.kind())), file))
    })
}

/// The pictures of a paint, with the places of their files.
fn paint_uses(place: String, paint: &PaintDescription) -> impl Iterator<Item = (String, PictureKey<'_>)> {
    let uses = paint.textures().into_iter();
    uses.map(move |texture| (format!("{place}.{}.file", texture.place), texture.picture()))
}

/// The pictures of all textures of materials, lights and paints, with the places of their files.
pub(super) fn texture_uses(parts: SceneParts<'_>) -> impl Iterator<Item = (String, PictureKey<'_>)> {
    let of_lights = parts.lights.iter().enumerate().filter_map(|(index, light)| {
        let texture = light.texture()?;
        let root = JsonPath::Root;
        let lights = root.member("lights");
        let place = lights.element(index);
        Some((format!("{}.{}.file", place.member(light.kind()), texture.place), texture.picture()))
    });
    let of_materials = parts.materials.iter().flat_map(|(name, material)| {
        material.textures().into_iter().map(move |texture| {
            let root = JsonPath::Root;
            let materials = root.member("materials");
            let place = materials.member(name);
            (format!("{}.{}.file", place.member(material.kind()), texture.place), texture.picture())
        })
    });
    let of_windows = parts.windows.iter().enumerate().flat_map(|(index, window)| {
        let paints = window.paints().into_iter();
        paints.flat_map(move |(place, paint)| paint_uses(format!("windows[{index}].{place}"), paint))
    });
    let of_imports = parts.imports.iter().enumerate().flat_map(|(index, import)| {
        import.lead.iter().enumerate().flat_map(move |(rule, leading)| {
            let place = format!("imports[{index}].lead[{rule}]");
            let paints = leading.paints().into_iter();
            paints.flat_map(move |(below, paint)| paint_uses(format!("{place}.{below}"), paint))
        })
    });
    let of_panes = parts.panes.iter().enumerate().flat_map(|(index, pane)| {
        let paint = pane.paint.as_deref().into_iter();
        paint.flat_map(move |paint| paint_uses(format!("panes[{index}].paint"), paint))
    });
    of_materials.chain(of_lights).chain(of_windows).chain(of_imports).chain(of_panes)
}
