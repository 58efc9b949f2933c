//! The size of a picture, from the header of its file.

use super::picture::check_size;
use super::png_metadata::{Chunks, metadata_bytes, number};
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

/// Bytes of a pixel of an EXR file while it is decoded: four channels, and those of a file of 16 bits twice.
const EXR_PIXEL: u64 = 4 * 4 + 4;

/// Reads the header of a PNG or EXR file. A picture that is too large for any scene is an error, as when it is decoded.
pub(crate) fn picture_size(bytes: &[u8]) -> Result<PictureSize, AssetProblem> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => png_size(bytes),
        [0x76, 0x2f, 0x31, 0x01, ..] => {
            let file = OpenExr::open(bytes).map_err(AssetProblem::malformed)?;
            let [width, height] = file.parts().first().map_or([0; 2], |part| part.size);
            check_size([width, height])?;
            let pixels = width * height;
            Ok(PictureSize { pixels, decoded_bytes: pixels.saturating_mul(EXR_PIXEL) })
        }
        _ => Err(AssetProblem::malformed("is neither a PNG nor an OpenEXR file")),
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
