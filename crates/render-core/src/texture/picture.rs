//! Pictures from PNG and OpenEXR files. Sizes are bounded by the header before a pixel is decoded. An EXR file of a few
//! bytes may claim any size, and its decoder allocates the memory first.

use std::collections::BTreeMap;
use std::io::Cursor;

use image::codecs::png::PngDecoder;
use image::{DynamicImage, ImageDecoder, Limits};

use super::png_metadata::profile;
use crate::settings::AssetProblem;
use crate::settings::limits::{MAX_IMAGE_EDGE, MAX_PICTURE_BYTES};
use clerestory_film::file_format::FileFormat;
use clerestory_film::openexr::{ChannelKind, DecodeBudget, InputPart, OpenExr, OpenExrError, Plane};

/// The channels of EXR files that mean something here: colours, or one value.
const CHANNELS: [&str; 4] = ["R", "G", "B", "Y"];

/// A decoded picture; its first row is the top.
pub(crate) enum Picture {
    /// From a PNG file.
    Png(PngPicture),
    /// From an EXR file.
    Exr(ExrPicture),
}

/// The pixels of a PNG file.
pub(crate) struct PngPicture {
    pub(crate) image: DynamicImage,
    /// Its colour profile.
    pub(crate) profile: Option<Vec<u8>>,
}

/// Colours or values of the first part of an EXR file.
pub(crate) struct ExrPicture {
    /// Pixels across.
    pub(crate) width: usize,
    /// Pixels down.
    pub(crate) height: usize,
    channels: BTreeMap<String, Vec<f32>>,
    header: InputPart,
    /// Parts of the file.
    parts: usize,
}

impl ExrPicture {
    /// The values of a channel, row by row; `None` when there is no such channel.
    pub(crate) fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.get(name).map(Vec::as_slice)
    }

    /// Whether the file has a channel, of any meaning.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.header.has(name)
    }

    /// Checks that colours are linear Rec. 709.
    pub(crate) fn check_primaries(&self) -> Result<(), AssetProblem> {
        self.header.check_primaries().map_err(malformed_exr)
    }

    /// That the channels are not those that are needed.
    pub(crate) fn other_channels(&self, expected: &str) -> AssetProblem {
        let names: Vec<&str> = self.header.channel_names().collect();
        let part = if self.parts > 1 { " in its first part, which alone is read" } else { "" };
        AssetProblem::malformed(format_args!("has the channels {}{part}, must have {expected}", names.join(", ")))
    }
}

/// Decodes a PNG or EXR file; its first bytes tell which.
pub(crate) fn decode_picture(bytes: &[u8]) -> Result<Picture, AssetProblem> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => decode_png(bytes).map(Picture::Png),
        [0x76, 0x2f, 0x31, 0x01, ..] => decode_exr(bytes).map(Picture::Exr),
        _ => {
            let instead =
                FileFormat::of(bytes).map_or_else(String::new, |format| format!(": {}", format.instead_of_picture()));
            Err(AssetProblem::malformed(format_args!("is neither a PNG nor an OpenEXR file{instead}")))
        }
    }
}

fn decode_png(bytes: &[u8]) -> Result<PngPicture, AssetProblem> {
    let malformed = |error| AssetProblem::malformed(format_args!("is not a readable PNG file: {error}"));
    let profile = profile(bytes)?;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_PICTURE_BYTES);
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(malformed)?;
    let (width, height) = decoder.dimensions();
    check_size([u64::from(width), u64::from(height)])?;
    if decoder.total_bytes() > MAX_PICTURE_BYTES {
        let [found, limit] = [decoder.total_bytes(), MAX_PICTURE_BYTES].map(|bytes| format!("{bytes} bytes of pixels"));
        return Err(AssetProblem::TooLarge { found, limit });
    }
    let image = DynamicImage::from_decoder(decoder).map_err(malformed)?;
    Ok(PngPicture { image, profile })
}

fn malformed_exr(error: OpenExrError) -> AssetProblem {
    AssetProblem::malformed(format_args!("is not a readable OpenEXR file: {error}"))
}

fn decode_exr(bytes: &[u8]) -> Result<ExrPicture, AssetProblem> {
    let file = OpenExr::open(bytes).map_err(malformed_exr)?;
    let parts = file.parts().len();
    let Some(header) = file.parts().first().cloned() else {
        return Err(AssetProblem::malformed("is an OpenEXR file without parts"));
    };
    check_size(header.size)?;
    header.check_windows().map_err(malformed_exr)?;
    let is_wanted = |name: &str| CHANNELS.contains(&name);
    if let Some((name, _)) =
        header.channels.iter().find(|(name, kind)| is_wanted(name) && *kind == ChannelKind::Integer)
    {
        return Err(AssetProblem::malformed(format_args!("has whole numbers in channel {name}, must have floats")));
    }
    let budget = DecodeBudget { pixel_bytes: MAX_PICTURE_BYTES };
    let planes = file.decode(budget, |part, name| part == 0 && is_wanted(name)).map_err(malformed_exr)?;
    let channels = planes.into_iter().take(1).flatten().filter_map(|(name, plane)| match plane {
        Plane::Float(values) => Some((name, values)),
        Plane::Integer(_) => None,
    });
    let [width, height] = header.size.map(|edge| edge as usize);
    Ok(ExrPicture { width, height, channels: channels.collect(), header, parts })
}

/// Refuses pictures without pixels, and with more along an edge than any scene has.
pub(crate) fn check_size([width, height]: [u64; 2]) -> Result<(), AssetProblem> {
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

#[cfg(test)]
mod tests;
