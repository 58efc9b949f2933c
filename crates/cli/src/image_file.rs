//! Image files that a user names.

use std::fs;
use std::path::Path;

use clerestory_render_core::film::{DecodeBudget, FrameImage};

use crate::failure::Failure;

/// Memory that an image may take when it is decoded: 16384 x 16384 pixels of RGB.
const BUDGET: DecodeBudget = DecodeBudget { pixel_bytes: 16384 * 16384 * 3 * 4 };

/// Reads an OpenEXR image.
pub(crate) fn read(file: &Path) -> Result<FrameImage, Failure> {
    let bytes = fs::read(file).map_err(|source| Failure::Read { file: file.to_owned(), source })?;
    FrameImage::decode(&bytes, BUDGET).map_err(|source| Failure::Image { file: file.to_owned(), source })
}
