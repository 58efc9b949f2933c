//! The formats of mesh files, and which part of which file a mesh is.

use super::description::{GltfSource, MeshSource};
use crate::settings::check::check_asset_name;
use crate::settings::{AssetProblem, Check, JsonPath};
use clerestory_film::file_format::FileFormat;

/// The format that a scene file states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum MeshFormat {
    Obj,
    Ply,
    Gltf,
}

impl MeshFormat {
    /// Its name in a scene file.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Gltf => "gltf",
        }
    }
}

/// A part of a mesh file, by the numbers that its format has for it; all of the file without any.
pub(super) type MeshPart = Option<[u32; 2]>;

/// A mesh from a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct FileMesh<'a> {
    pub(super) format: MeshFormat,
    pub(super) file: &'a str,
    pub(super) part: MeshPart,
    /// Other files that the file refers to.
    others: &'a [String],
}

impl MeshSource {
    /// Whether it is a part of a file with many: what is wrong with one part is no reason to refuse a building.
    pub(super) fn is_of_building(&self) -> bool {
        matches!(self, Self::Gltf(_) | Self::Obj { part: Some(_), .. })
    }

    /// The file from which it comes.
    pub(super) fn file(&self) -> Option<FileMesh<'_>> {
        let alone = |format, file, part| Some(FileMesh { format, file, part, others: &[] });
        match self {
            Self::Ply { file } => alone(MeshFormat::Ply, file, None),
            Self::Obj { file, part } => alone(MeshFormat::Obj, file, part.map(|part| [part, 0])),
            Self::Gltf(GltfSource { file, files, mesh, primitive }) => {
                Some(FileMesh { format: MeshFormat::Gltf, file, part: Some([*mesh, *primitive]), others: files })
            }
            Self::Inline { .. } | Self::Waves(_) => None,
        }
    }
}

impl<'a> FileMesh<'a> {
    /// The place of its file below the source.
    pub(super) fn place(&self) -> String {
        format!("{}.file", self.format.name())
    }

    /// All files that it needs, with their places below the source.
    pub(super) fn files(self) -> Vec<(String, &'a str)> {
        let others = self.others.iter().enumerate();
        let others = others.map(|(index, file)| (format!("{}.files[{index}]", self.format.name()), file.as_str()));
        std::iter::once((self.place(), self.file)).chain(others).collect()
    }

    /// Checks the names of its files.
    pub(super) fn check(&self, source: &JsonPath<'_>) -> Check {
        let settings = source.member(self.format.name());
        check_asset_name(self.file, &settings.member("file"))?;
        let files = settings.member("files");
        self.others.iter().enumerate().try_for_each(|(index, file)| check_asset_name(file, &files.element(index)))
    }
}

/// Refuses a file that is known to be of another format than the one of this name.
pub(super) fn refuse_other_formats(bytes: &[u8], expected: &'static str) -> Result<(), AssetProblem> {
    match FileFormat::of(bytes) {
        Some(format) if !format.is_mesh(expected) => {
            let instead = format.instead_of_mesh();
            Err(AssetProblem::malformed(format_args!("is not a readable {expected} file: {instead}")))
        }
        _ => Ok(()),
    }
}
