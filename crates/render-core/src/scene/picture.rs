//! Pictures from PNG and OpenEXR files. Sizes are bounded by the header before a pixel is decoded: an EXR file of a few
//! bytes may claim any size, and its decoder takes the memory first.

use std::collections::BTreeMap;
use std::io::Cursor;

use image::codecs::png::PngDecoder;
use image::{DynamicImage, ImageDecoder, Limits};

use super::error::AssetProblem;
use super::limits::{MAX_IMAGE_EDGE, MAX_PICTURE_BYTES};
use crate::film::{DecodeBudget, OpenExr, Plane};

/// The channels of EXR files that mean something here: colours, or one value.
const CHANNELS: [&str; 4] = ["R", "G", "B", "Y"];

/// A decoded picture; its first row is the top.
pub(super) enum Picture {
    /// From a PNG file.
    Png(DynamicImage),
    /// From an EXR file.
    Exr(ExrPicture),
}

/// Colours or values of the first part of an EXR file.
pub(super) struct ExrPicture {
    /// Pixels across.
    pub(super) width: usize,
    /// Pixels down.
    pub(super) height: usize,
    channels: BTreeMap<String, Vec<f32>>,
}

impl ExrPicture {
    /// The values of a channel, row by row; `None` when there is no such channel.
    pub(super) fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.get(name).map(Vec::as_slice)
    }
}

/// Decodes a PNG or EXR file; its first bytes tell which.
pub(super) fn decode_picture(bytes: &[u8]) -> Result<Picture, AssetProblem> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => decode_png(bytes).map(Picture::Png),
        [0x76, 0x2f, 0x31, 0x01, ..] => decode_exr(bytes).map(Picture::Exr),
        _ => Err(AssetProblem::malformed("is neither a PNG nor an OpenEXR file")),
    }
}

fn decode_png(bytes: &[u8]) -> Result<DynamicImage, AssetProblem> {
    let malformed = |error| AssetProblem::malformed(format_args!("is not a readable PNG file: {error}"));
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_PICTURE_BYTES);
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(malformed)?;
    let (width, height) = decoder.dimensions();
    check_size([u64::from(width), u64::from(height)])?;
    if decoder.total_bytes() > MAX_PICTURE_BYTES {
        let [found, limit] = [decoder.total_bytes(), MAX_PICTURE_BYTES].map(|bytes| format!("{bytes} bytes of pixels"));
        return Err(AssetProblem::TooLarge { found, limit });
    }
    DynamicImage::from_decoder(decoder).map_err(malformed)
}

fn decode_exr(bytes: &[u8]) -> Result<ExrPicture, AssetProblem> {
    let malformed = |error| AssetProblem::malformed(format_args!("is not a readable OpenEXR file: {error}"));
    let file = OpenExr::open(bytes).map_err(malformed)?;
    let [width, height] = file.parts().first().map_or([0, 0], |part| part.size);
    check_size([width, height])?;
    let budget = DecodeBudget { pixel_bytes: MAX_PICTURE_BYTES };
    let parts = file.decode(budget, |part, name| part == 0 && CHANNELS.contains(&name)).map_err(malformed)?;
    let values = |plane| match plane {
        Plane::Float(values) => values,
        Plane::Integer(values) => values.into_iter().map(|value| value as f32).collect(),
    };
    let channels = parts.into_iter().take(1).flatten().map(|(name, plane)| (name, values(plane))).collect();
    Ok(ExrPicture { width: width as usize, height: height as usize, channels })
}

fn check_size([width, height]: [u64; 2]) -> Result<(), AssetProblem> {
    if width == 0 || height == 0 {
        return Err(AssetProblem::malformed(format_args!("has {width} x {height} pixels, must have some")));
    }
    if width.max(height) <= u64::from(MAX_IMAGE_EDGE) {
        return Ok(());
    }
    Err(AssetProblem::TooLarge {
        found: format!("{width} x {height} pixels"),
        limit: format!("{MAX_IMAGE_EDGE} x {MAX_IMAGE_EDGE} pixels"),
    })
}
