//! The size of a picture, from the header of its file.

use std::io::Cursor;

use image::ImageDecoder;
use image::codecs::png::PngDecoder;

use super::error::AssetProblem;
use super::picture::check_size;
use crate::film::OpenExr;

/// What a header says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PictureSize {
    /// Number of pixels.
    pub(super) pixels: u64,
    /// Bytes that the pixels take as they are decoded.
    pub(super) decoded_bytes: u64,
}

/// Bytes of a pixel of an EXR file as it is decoded: four channels, and those of a file of 16 bits twice.
const EXR_PIXEL: u64 = 4 * 4 + 4;

/// Reads the header of a PNG or EXR file. A picture that is too large for any scene is an error, as when it is decoded.
pub(super) fn picture_size(bytes: &[u8]) -> Result<PictureSize, AssetProblem> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => {
            let decoder = PngDecoder::new(Cursor::new(bytes)).map_err(AssetProblem::malformed)?;
            let [width, height] = <[u32; 2]>::from(decoder.dimensions()).map(u64::from);
            check_size([width, height])?;
            Ok(PictureSize { pixels: width * height, decoded_bytes: decoder.total_bytes() })
        }
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
