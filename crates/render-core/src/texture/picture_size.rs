//! The size of a picture, from the header of its file.

use std::io::Cursor;

use image::ImageReader;

use super::picture::{PictureFormat, check_size};
use super::png_metadata::{Chunks, metadata_bytes, number};
use super::radiance_file::{RadianceHeader, is_radiance};
use crate::settings::AssetProblem;
use clerestory_film::openexr::OpenExr;

/// What a header says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PictureSize {
    /// Number of pixels.
    pub(crate) pixels: u64,
    /// Bytes that the file takes while it is decoded.
    pub(crate) decoded_bytes: u64,
}

/// Bytes of a pixel of an EXR file while it is decoded: five channels, and those of a file of 16 bits twice.
const EXR_PIXEL: u64 = 5 * 4 + 4;

/// Bytes of a pixel of a JPEG or WebP file while it is decoded: what it decodes to, and coefficients of a progressive
/// file for three channels.
const CODED_PIXEL: u64 = 4 + 3 * 2 + 4;

/// Reads the header of a picture. One that is too large for any scene is an error, as when it is decoded.
pub(crate) fn picture_size(bytes: &[u8]) -> Result<PictureSize, AssetProblem> {
    match PictureFormat::of(bytes) {
        Some(PictureFormat::Png) => png_size(bytes),
        Some(PictureFormat::Jpeg | PictureFormat::WebP) => {
            let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(AssetProblem::malformed)?;
            let (width, height) = reader.into_dimensions().map_err(AssetProblem::malformed)?;
            check_size([width, height].map(u64::from))?;
            let pixels = u64::from(width) * u64::from(height);
            Ok(PictureSize { pixels, decoded_bytes: pixels * CODED_PIXEL + bytes.len() as u64 })
        }
        Some(PictureFormat::Exr) => {
            let file = OpenExr::open(bytes).map_err(AssetProblem::malformed)?;
            let [width, height] = file.parts().first().map_or([0; 2], |part| part.size);
            check_size([width, height])?;
            let pixels = width * height;
            Ok(PictureSize { pixels, decoded_bytes: pixels.saturating_mul(EXR_PIXEL) })
        }
        None if is_radiance(bytes) => {
            let [width, height] = RadianceHeader::read(bytes)?.size;
            // Its texels are kept as they are decoded.
            Ok(PictureSize { pixels: width * height, decoded_bytes: 0 })
        }
        None => Err(AssetProblem::malformed("is no PNG, JPEG, WebP or OpenEXR file")),
    }
}

/// Reads the header alone: what follows it may be compressed.
fn png_size(png: &[u8]) -> Result<PictureSize, AssetProblem> {
    let malformed = || AssetProblem::malformed("is a PNG file without a header");
    let header = Chunks::of(png).next().filter(|chunk| chunk.name == *b"IHDR").ok_or_else(malformed)?.content;
    let edge = |place: usize| number(header, place).map(u64::from).ok_or_else(malformed);
    let [width, height] = [edge(0)?, edge(4)?];
    check_size([width, height])?;
    let Some(&[depth, colour_type]) = header[8..].first_chunk() else { return Err(malformed()) };
    let opacity = u64::from(Chunks::of(png).find_content(b"tRNS").is_some());
    // Palettes become colours, and fewer bits than eight become eight.
    let samples = match colour_type {
        0 => 1 + opacity,
        2 | 3 => 3 + opacity,
        4 => 2,
        _ => 4,
    };
    let pixels = width * height;
    let sample_bytes = u64::from(depth).div_ceil(8);
    Ok(PictureSize { pixels, decoded_bytes: pixels * samples * sample_bytes + metadata_bytes(png) })
}
