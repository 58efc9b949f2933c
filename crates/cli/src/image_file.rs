//! Image files that a user names.

use std::fs;
use std::path::Path;

use clerestory_film::{DecodeBudget, FrameImage, ImageMetadata};
use clerestory_render_core::scene::description::FilmDescription;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};

use crate::failure::Failure;

/// Memory that an image may take when it is decoded: 16384 x 16384 pixels of RGB.
pub(crate) const BUDGET: DecodeBudget = DecodeBudget { pixel_bytes: 16384 * 16384 * 3 * 4 };

/// Reads an OpenEXR image.
pub(crate) fn read(file: &Path) -> Result<FrameImage, Failure> {
    Ok(read_with_bytes(file)?.1)
}

/// Reads a reference for images of this size: the bytes of the file, and its image.
pub(crate) fn read_reference(file: &Path, film: FilmDescription) -> Result<(Vec<u8>, FrameImage), Failure> {
    let (bytes, image) = read_with_bytes(file)?;
    if (image.width(), image.height()) != (film.width, film.height) {
        return Err(Failure::Usage(format!(
            "the reference {} has {}x{} pixels, the image {}x{}: expected the same size, see --size",
            file.display(),
            image.width(),
            image.height(),
            film.width,
            film.height
        )));
    }
    Ok((bytes, image))
}

/// How an image of this program was made. The header of the file is enough.
pub(crate) fn metadata(head: &[u8]) -> Option<ImageMetadata> {
    let parts = MetaData::read_from_buffered(head, false).ok()?.headers;
    let name = Text::from("clerestory");
    match parts.iter().find_map(|part| part.own_attributes.other.get(&name))? {
        AttributeValue::Text(json) => serde_json::from_str(&json.to_string()).ok(),
        _ => None,
    }
}

fn read_with_bytes(file: &Path) -> Result<(Vec<u8>, FrameImage), Failure> {
    let bytes = fs::read(file).map_err(|source| Failure::Read { file: file.to_owned(), source })?;
    match FrameImage::decode(&bytes, BUDGET) {
        Ok(image) => Ok((bytes, image)),
        Err(source) => Err(Failure::Image { file: file.to_owned(), source }),
    }
}
