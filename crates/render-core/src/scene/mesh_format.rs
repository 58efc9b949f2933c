//! Files that are taken for meshes and are something else.

use crate::settings::AssetProblem;
use clerestory_film::file_format::FileFormat;

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
