//! Whether a picture can be read, as far as its header says. Its pixels are not decoded: that takes memory.

use std::io::Cursor;

use image::codecs::jpeg::JpegDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::webp::WebPDecoder;
use image::{ImageDecoder, ImageError, Limits};

use super::Encoding;
use super::picture::{PictureFormat, is_wanted, malformed_exr, not_a_picture};
use super::picture_size::picture_size;
use super::png_colour;
use super::png_metadata::{number, profile};
use crate::settings::AssetProblem;
use crate::settings::limits::MAX_PICTURE_BYTES;
use clerestory_film::openexr::{ChannelKind, InputPart, OpenExr};

/// What is wrong with a picture and what to do about it, as a phrase that goes on after its name; `None` of one that
/// can be read as far as its header says.
pub(crate) fn unreadable(bytes: &[u8], encoding: Encoding) -> Option<String> {
    let problem = check(bytes, encoding).err()?;
    let way_out = match (&problem, PictureFormat::of(bytes)) {
        (AssetProblem::TooLarge { .. }, _) => "make it smaller",
        (_, Some(_)) => "save it again as PNG in sRGB",
        (_, None) => "convert it to PNG",
    };
    Some(format!("{problem}; {way_out}"))
}

fn check(bytes: &[u8], encoding: Encoding) -> Result<(), AssetProblem> {
    let format = PictureFormat::of(bytes).ok_or_else(|| not_a_picture(bytes))?;
    picture_size(bytes)?;
    let malformed = |error: ImageError| AssetProblem::malformed(format_args!("is not a readable picture: {error}"));
    match format {
        PictureFormat::Png => {
            let profile = profile(bytes)?;
            let mut limits = Limits::no_limits();
            limits.max_alloc = Some(MAX_PICTURE_BYTES);
            let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(malformed)?;
            if !is_whole_png(bytes) {
                return Err(AssetProblem::malformed("is a PNG file that ends too early"));
            }
            check_colours(bytes, profile, &decoder, encoding)
        }
        PictureFormat::Jpeg => {
            let mut decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(malformed)?;
            check_colours(bytes, decoder.icc_profile().map_err(malformed)?, &decoder, encoding)
        }
        PictureFormat::WebP => {
            let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(malformed)?;
            check_colours(bytes, decoder.icc_profile().map_err(malformed)?, &decoder, encoding)
        }
        PictureFormat::Exr => {
            let file = OpenExr::open(bytes).map_err(malformed_exr)?;
            file.parts().first().map_or(Ok(()), |part| check_channels(part, encoding))
        }
    }
}

fn check_colours(
    bytes: &[u8],
    profile: Option<Vec<u8>>,
    decoder: &impl ImageDecoder,
    encoding: Encoding,
) -> Result<(), AssetProblem> {
    match encoding {
        Encoding::Colour => png_colour::check(bytes, profile.as_deref(), !decoder.color_type().has_color()),
        Encoding::Data | Encoding::Opacity => Ok(()),
    }
}

fn check_channels(part: &InputPart, encoding: Encoding) -> Result<(), AssetProblem> {
    part.check_windows().map_err(malformed_exr)?;
    let is_wrong = |(name, kind): &(String, ChannelKind)| is_wanted(name) && *kind == ChannelKind::Integer;
    if part.channels.iter().any(is_wrong) {
        return Err(AssetProblem::malformed("has whole numbers in a channel, must have floats"));
    }
    let are_colours = ["R", "G", "B"].iter().all(|name| part.has(name));
    if encoding != Encoding::Opacity && !are_colours && !part.has("Y") {
        return Err(AssetProblem::malformed("has neither the channels R, G and B nor Y"));
    }
    if encoding == Encoding::Colour && are_colours {
        part.check_primaries().map_err(malformed_exr)?;
    }
    Ok(())
}

/// Whether a PNG file has its last chunk.
fn is_whole_png(bytes: &[u8]) -> bool {
    let mut rest = bytes.get(8..).unwrap_or_default();
    while let (Some(length), Some(name)) = (number(rest, 0), rest.get(4..8)) {
        if name == b"IEND" {
            return true;
        }
        // A length, a name, the content and a checksum.
        rest = rest.get((length as usize).saturating_add(12)..).unwrap_or_default();
    }
    false
}

#[cfg(test)]
mod tests {
    use image::ImageFormat;

    use super::super::picture_samples::{encode_exr, encode_png};
    use super::*;

    #[test]
    fn pictures_that_decode_pass() {
        let picture = image::DynamicImage::new_rgb8(2, 2);
        let encoded = |format: ImageFormat| {
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, format).unwrap();
            bytes.into_inner()
        };
        for bytes in [
            encode_png(picture.clone()),
            encoded(ImageFormat::Jpeg),
            encoded(ImageFormat::WebP),
            encode_exr(1, 1, &[("Y", &[0.5])]),
        ] {
            for encoding in [Encoding::Colour, Encoding::Data, Encoding::Opacity] {
                assert_eq!(unreadable(&bytes, encoding), None);
            }
        }
    }

    #[test]
    fn what_is_wrong_comes_with_a_way_out() {
        let tga = [&[0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0][..], &[9; 3]].concat();
        let png = encode_png(image::DynamicImage::new_rgb8(2, 2));
        let exr = encode_exr(1, 1, &[("Z", &[0.5])]);
        for (bytes, expected) in [
            (&tga[..], ["is no PNG, JPEG, WebP or OpenEXR file", "; convert it to PNG"]),
            (b"", ["it is an empty file", "; convert it to PNG"]),
            (&png[..png.len() - 8], ["ends too early", "; save it again as PNG"]),
            (&png[..20], ["PNG", "; save it again as PNG"]),
            (&exr, ["neither the channels R, G and B nor Y", "; save it again as PNG"]),
        ] {
            let problem = unreadable(bytes, Encoding::Colour).unwrap();
            assert!(expected.iter().all(|part| problem.contains(part)), "{problem}");
        }
    }
}
