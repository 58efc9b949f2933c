//! `clerestory convert`: makes a PNG of an OpenEXR image.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use clerestory_film::{Exposure, Layer, LayerKind, PreviewSettings, ToneCurve, encode_pixels, read_layer};

use crate::failure::Failure;
use crate::image_file::BUDGET;
use crate::output::print_line;
use crate::output_file::{check_outputs, check_png_name, is_standard_output, write};
use crate::preview::{CurveName, parse_exposure};
use crate::progress::Progress;
use crate::text::counted;

/// Options of `clerestory convert`.
#[derive(Debug, Args)]
pub(crate) struct ConvertArguments {
    /// The OpenEXR image, of this or another program.
    image: PathBuf,
    /// The PNG to write.
    output: PathBuf,
    /// Exposure: `auto`, stops over it such as `auto+1.5`, or a number of stops; 0 shows radiance 1 as white
    /// [default: auto].
    #[arg(long, value_name = "STOPS|auto", value_parser = parse_exposure, allow_negative_numbers = true)]
    exposure: Option<Exposure>,
    /// Tone curve [default: filmic].
    #[arg(long, value_enum, value_name = "NAME")]
    curve: Option<CurveName>,
    /// Show a part of the image: its width and height in pixels, and the column and row of its top left corner.
    #[arg(long, value_name = "WxH+X+Y")]
    crop: Option<Crop>,
    /// Show another layer than the picture, such as caustic, albedo, depth or stderr.
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
}

/// A part of an image, written `640x480+10+20`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Crop {
    /// Width and height.
    size: [u32; 2],
    /// Column and row of its top left corner.
    place: [u32; 2],
}

impl FromStr for Crop {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.parse().ok().filter(|_| text.bytes().all(|byte| byte.is_ascii_digit()));
        let crop = text.split_once('+').and_then(|(size, place)| {
            let (width, height) = size.split_once(['x', 'X'])?;
            let (x, y) = place.split_once('+')?;
            Some(Self { size: [number(width)?, number(height)?], place: [number(x)?, number(y)?] })
        });
        crop.ok_or_else(|| "expected width, height, column and row in pixels, for instance 640x480+10+20".to_owned())
    }
}

pub(crate) fn run(arguments: &ConvertArguments) -> Result<(), Failure> {
    let ConvertArguments { image, output, crop, layer, .. } = arguments;
    check_png_name(output)?;
    check_outputs(&[("the PNG", Some(output.as_path()))], &[("the image", Some(image.as_path()))])?;
    let file = File::open(image).map_err(|source| Failure::Read { file: image.clone(), source })?;
    let mut layer = read_layer(BufReader::new(file), layer.as_deref(), BUDGET)
        .map_err(|source| Failure::Layer { file: image.clone(), source })?;
    let settings = settings(arguments, &mut layer)?;
    let shown = match crop {
        None => layer,
        Some(crop) => cropped(&layer, *crop, image)?,
    };
    let not_finite = shown.not_finite() as u64;
    if not_finite > 0 {
        let pixels = counted(not_finite, "pixel has", "pixels have");
        Progress::new().note(&format!("{pixels} an infinite value or one that is not a number"));
    }
    let Layer { width, height, ref pixels, .. } = shown;
    write(output, &encode_pixels(width, height, pixels, &settings).map_err(Failure::Preview)?)?;
    let exposure = match settings.exposure {
        Exposure::Stops(stops) if shown.kind != LayerKind::Vector => format!(", exposure {stops:.2}"),
        _ => String::new(),
    };
    let line = format!("Wrote {}: {width}x{height} pixels{exposure}", output.display());
    if is_standard_output(output) {
        // The PNG is on standard output, and nothing else belongs there.
        Progress::new().note(&line);
        return Ok(());
    }
    print_line(&line)
}

/// How a layer is shown. The exposure is that of the whole layer, so that a part of it looks as it does in the whole.
/// The values of vectors are replaced by those that show them.
fn settings(arguments: &ConvertArguments, layer: &mut Layer) -> Result<PreviewSettings, Failure> {
    let ConvertArguments { exposure, curve, .. } = arguments;
    if layer.kind != LayerKind::Vector {
        let stops = exposure.unwrap_or(Exposure::Automatic).stops(&layer.pixels);
        let curve = curve.unwrap_or(CurveName::Filmic).curve();
        return Ok(PreviewSettings { exposure: Exposure::Stops(stops), curve });
    }
    let given = [("--exposure", exposure.is_some()), ("--curve", curve.is_some())];
    if let Some((option, _)) = given.into_iter().find(|(_, is_given)| *is_given) {
        return Err(Failure::Usage(format!(
            "{option} does not go with a layer of vectors, whose coordinates from -1 to 1 are shown as colours: \
             expected no {option}"
        )));
    }
    layer.show_coordinates();
    Ok(PreviewSettings { exposure: Exposure::Stops(0.0), curve: ToneCurve::Srgb })
}

fn cropped(layer: &Layer, crop: Crop, image: &Path) -> Result<Layer, Failure> {
    layer.crop(crop.size, crop.place).ok_or_else(|| {
        let Crop { size: [width, height], place: [x, y] } = crop;
        Failure::Usage(format!(
            "--crop {width}x{height}+{x}+{y} does not lie in {}, which has {}x{} pixels: expected a width and a height \
             of at least 1, x + width of at most {} and y + height of at most {}",
            image.display(),
            layer.width,
            layer.height,
            layer.width,
            layer.height
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crop_is_a_size_and_a_place() {
        assert_eq!("640x480+10+20".parse(), Ok(Crop { size: [640, 480], place: [10, 20] }));
        for text in ["640x480", "640x480+1", "640x480+1+2+3", "640+480+1+2", "-6x4+1+2", "6x4+-1+2", "6x4++1+2", ""] {
            assert!(text.parse::<Crop>().is_err_and(|message| message.contains("640x480+10+20")), "{text}");
        }
    }
}
