//! Pictures from PNG, JPEG, WebP and OpenEXR files. Sizes are bounded by the header before a pixel is decoded. An EXR
//! file of a few bytes may claim any size, and its decoder allocates the memory first.

use std::collections::BTreeMap;
use std::io::Cursor;

use image::codecs::jpeg::JpegDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{DynamicImage, ImageDecoder, ImageError, Limits};

use super::png_metadata::profile;
use crate::settings::AssetProblem;
use crate::settings::limits::{MAX_IMAGE_EDGE, MAX_PICTURE_BYTES};
use clerestory_film::file_format::FileFormat;
use clerestory_film::openexr::{ChannelKind, DecodeBudget, InputPart, OpenExr, OpenExrError, Plane};

/// The channels of EXR files that mean something here: colours, or one value, and opacity.
const CHANNELS: [&str; 5] = ["R", "G", "B", "Y", "A"];

/// Whether a channel of an EXR file means something here.
pub(super) fn is_wanted(channel: &str) -> bool {
    CHANNELS.contains(&channel)
}

/// A decoded picture; its first row is the top.
pub(crate) enum Picture {
    /// From a file of 8 or 16 bits.
    Coded(CodedPicture),
    /// From an EXR file.
    Exr(ExrPicture),
}

/// The pixels of a PNG, JPEG or WebP file.
pub(crate) struct CodedPicture {
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

    /// The colours of all pixels, row by row from the top, or the same grey in all three channels.
    ///
    /// # Errors
    ///
    /// When there are no such channels, or the colours are not those of Rec. 709.
    pub(crate) fn colours(&self) -> Result<Vec<[f32; 3]>, AssetProblem> {
        self.channels(true)
    }

    /// The same, of colours or of other numbers.
    pub(crate) fn channels(&self, are_colours: bool) -> Result<Vec<[f32; 3]>, AssetProblem> {
        let is_colour = ["R", "G", "B"].map(|name| self.has(name)) != [false; 3];
        // Y beside these is a part of a colour.
        let is_grey = !is_colour && !["X", "Z", "RY", "BY"].into_iter().any(|name| self.has(name));
        let channel = |name: &str| self.channel(if is_grey { "Y" } else { name });
        let (Some(red), Some(green), Some(blue)) = (channel("R"), channel("G"), channel("B")) else {
            return Err(self.other_channels("the channels R, G and B, or Y"));
        };
        if is_colour && are_colours {
            self.check_primaries()?;
        }
        Ok(red.iter().zip(green).zip(blue).map(|((&red, &green), &blue)| [red, green, blue]).collect())
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

/// The formats of pictures, by how their files begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PictureFormat {
    Png,
    Jpeg,
    WebP,
    Exr,
}

impl PictureFormat {
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            [0xff, 0xd8, 0xff, ..] => Some(Self::Jpeg),
            [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some(Self::WebP),
            [0x76, 0x2f, 0x31, 0x01, ..] => Some(Self::Exr),
            _ => None,
        }
    }
}

/// Decodes a picture; its first bytes tell the format.
pub(crate) fn decode_picture(bytes: &[u8]) -> Result<Picture, AssetProblem> {
    match PictureFormat::of(bytes) {
        Some(PictureFormat::Png) => decode_png(bytes).map(Picture::Coded),
        Some(PictureFormat::Jpeg) => {
            let malformed = |error| AssetProblem::malformed(format_args!("is not a readable JPEG file: {error}"));
            let decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(malformed)?;
            decode_coded(decoder, malformed).map(Picture::Coded)
        }
        Some(PictureFormat::WebP) => {
            let malformed = |error| AssetProblem::malformed(format_args!("is not a readable WebP file: {error}"));
            let decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(malformed)?;
            decode_coded(decoder, malformed).map(Picture::Coded)
        }
        Some(PictureFormat::Exr) => decode_exr(bytes).map(Picture::Exr),
        None => Err(not_a_picture(bytes)),
    }
}

/// That a file is of another format.
pub(super) fn not_a_picture(bytes: &[u8]) -> AssetProblem {
    let instead = FileFormat::of(bytes).map_or_else(String::new, |format| format!(": {}", format.instead_of_picture()));
    AssetProblem::malformed(format_args!("is no PNG, JPEG, WebP or OpenEXR file{instead}"))
}

fn decode_png(bytes: &[u8]) -> Result<CodedPicture, AssetProblem> {
    let malformed = |error| AssetProblem::malformed(format_args!("is not a readable PNG file: {error}"));
    let profile = profile(bytes)?;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_PICTURE_BYTES);
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(malformed)?;
    let CodedPicture { image, .. } = decode_coded(decoder, malformed)?;
    Ok(CodedPicture { image, profile })
}

/// Decodes a file of which the header is read.
fn decode_coded(
    mut decoder: impl ImageDecoder,
    malformed: impl Fn(ImageError) -> AssetProblem,
) -> Result<CodedPicture, AssetProblem> {
    let (width, height) = decoder.dimensions();
    check_size([u64::from(width), u64::from(height)])?;
    if decoder.total_bytes() > MAX_PICTURE_BYTES {
        let [found, limit] = [decoder.total_bytes(), MAX_PICTURE_BYTES].map(|bytes| format!("{bytes} bytes of pixels"));
        return Err(AssetProblem::TooLarge { found, limit });
    }
    let profile = decoder.icc_profile().map_err(&malformed)?;
    let image = DynamicImage::from_decoder(decoder).map_err(malformed)?;
    Ok(CodedPicture { image, profile })
}

/// Whether a picture says how opaque its pixels are, by the header of its file. One that cannot be read does not.
pub(crate) fn has_alpha(bytes: &[u8]) -> bool {
    match PictureFormat::of(bytes) {
        Some(PictureFormat::Png) => {
            let mut limits = Limits::no_limits();
            limits.max_alloc = Some(MAX_PICTURE_BYTES);
            let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits);
            decoder.is_ok_and(|decoder| decoder.color_type().has_alpha())
        }
        Some(PictureFormat::WebP) => {
            WebPDecoder::new(Cursor::new(bytes)).is_ok_and(|decoder| decoder.color_type().has_alpha())
        }
        Some(PictureFormat::Exr) => {
            OpenExr::open(bytes).is_ok_and(|file| file.parts().first().is_some_and(|part| part.has("A")))
        }
        Some(PictureFormat::Jpeg) | None => false,
    }
}

pub(super) fn malformed_exr(error: OpenExrError) -> AssetProblem {
    AssetProblem::malformed(format_args!("is not a readable OpenEXR file: {error}"))
}

pub(super) fn decode_exr(bytes: &[u8]) -> Result<ExrPicture, AssetProblem> {
    let file = OpenExr::open(bytes).map_err(malformed_exr)?;
    let parts = file.parts().len();
    let Some(header) = file.parts().first().cloned() else {
        return Err(AssetProblem::malformed("is an OpenEXR file without parts"));
    };
    check_size(header.size)?;
    header.check_windows().map_err(malformed_exr)?;
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
