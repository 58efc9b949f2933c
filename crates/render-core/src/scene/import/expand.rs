//! From a file of another program to things of the scene.

use super::description::{ImportDescription, ImportSource};
use super::things::Expansion;
use super::{of_gltf, of_obj};
use crate::scene::Assets;
use crate::settings::{AssetProblem, JsonPath, SceneError};

/// What is in the file of an import, as things of the scene.
///
/// # Errors
///
/// When the file, or one that it needs, cannot be read.
pub(crate) fn expand(
    import: &ImportDescription,
    assets: &Assets,
    path: &JsonPath<'_>,
) -> Result<Expansion, SceneError> {
    let files = import.source.files();
    let opened = match &import.source {
        ImportSource::Gltf(_) => of_gltf::expand(import, assets),
        ImportSource::Obj(_) => of_obj::expand(import, assets),
    };
    opened.map_err(|problem| {
        let source = path.member("source");
        let format = source.member(import.source.format());
        SceneError::Asset { path: format.member("file").to_string(), name: files.file.clone(), problem }
    })
}

/// The files that the file of an import refers to.
///
/// # Errors
///
/// When it cannot be read.
pub fn files_of(source: &ImportSource, assets: &Assets) -> Result<Vec<String>, AssetProblem> {
    match source {
        ImportSource::Gltf(files) => of_gltf::files(files, assets),
        ImportSource::Obj(files) => of_obj::files(files, assets),
    }
}
