//! The formats of mesh files.

use crate::settings::AssetProblem;
use clerestory_film::file_format::FileFormat;

/// The format that a scene file states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum MeshFormat {
    Obj,
    Ply,
}

impl MeshFormat {
    /// Its name in a scene file.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::Ply => "ply",
        }
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
