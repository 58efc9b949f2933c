//! Previews: an image as an 8-bit PNG.
//!
//! Radiance is scaled by the exposure, put through the tone curve, and encoded as sRGB (IEC 61966-2-1). The same image
//! gives the same bytes on every machine.

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::exposure::MeanLuminance;
use super::image::FrameImage;

/// How bright a preview is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Exposure {
    /// Radiance is multiplied by 2 to this power; 0 shows radiance 1 as white.
    Stops(f64),
    /// That at which the average is a middle grey and [coloured light keeps its colour](super::exposure).
    Automatic,
    /// So many stops brighter than the automatic one.
    OverAutomatic(f64),
}

/// How radiance becomes brightness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToneCurve {
    /// None: what is brighter than 1 is cut off.
    Srgb,
    /// Highlights are rolled off by a fit to the ACES film curve (Narkowicz 2015, "ACES Filmic Tone Mapping Curve"):
    /// `x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14)`.
    Filmic,
}

/// How a preview is made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PreviewSettings {
    /// How bright.
    pub exposure: Exposure,
    /// The tone curve.
    pub curve: ToneCurve,
}

/// Why there is no preview.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PreviewError {
    /// The PNG could not be written.
    #[error("the preview cannot be written as PNG: {0}")]
    Png(String),
}

/// The PNG of an image.
///
/// # Errors
///
/// [`PreviewError`] when the image is too large for the format.
pub fn encode_png(image: &FrameImage, settings: &PreviewSettings) -> Result<Vec<u8>, PreviewError> {
    encode_pixels(image.width(), image.height(), &image.layers().mean, settings)
}

/// The PNG of pixels in rows from the top left.
///
/// # Errors
///
/// [`PreviewError`] when they are not those of such a size, or the image is too large for the format.
pub fn encode_pixels(
    width: u32,
    height: u32,
    pixels: &[[f32; 3]],
    settings: &PreviewSettings,
) -> Result<Vec<u8>, PreviewError> {
    let codes = Codes::new(settings.exposure.scale(pixels), settings.curve);
    let codes: Vec<[u8; 3]> = pixels.par_iter().map(|pixel| pixel.map(|radiance| codes.of(radiance))).collect();
    let mut png = Vec::new();
    // The encoder panics at another number of bytes.
    let expected = width as usize * height as usize;
    if codes.len() != expected {
        return Err(PreviewError::Png(format!("found {} pixels, expected {expected}", codes.len())));
    }
    PngEncoder::new(&mut png)
        .write_image(codes.as_flattened(), width, height, ExtendedColorType::Rgb8)
        .map_err(|error| PreviewError::Png(error.to_string()))?;
    Ok(png)
}

/// The filmic curve: what is shown of a brightness that has been exposed.
pub(super) fn filmic(x: f64) -> f64 {
    x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
}

/// What [`Exposure::Automatic`] is for this image, in stops: to show others as bright.
pub fn automatic_stops(image: &FrameImage) -> f64 {
    libm::log2(automatic_scale(&image.layers().mean))
}

impl Exposure {
    /// What it is for these pixels, in stops: to show others, or a part of them, as bright.
    pub fn stops(self, pixels: &[[f32; 3]]) -> f64 {
        match self {
            Self::Stops(stops) => stops,
            _ => libm::log2(self.scale(pixels)),
        }
    }

    /// What radiance is multiplied by.
    fn scale(self, pixels: &[[f32; 3]]) -> f64 {
        match self {
            Self::Stops(stops) => libm::exp2(stops),
            Self::Automatic => automatic_scale(pixels),
            Self::OverAutomatic(stops) => automatic_scale(pixels) * libm::exp2(stops),
        }
    }
}

fn automatic_scale(pixels: &[[f32; 3]]) -> f64 {
    let mut mean = MeanLuminance::new();
    mean.add(pixels);
    let mut exposure = mean.finish();
    exposure.add(pixels);
    exposure.scale()
}

/// Bits of a radiance that do not tell its cell: there are 256 cells from each power of two to the next, so that two
/// thresholds, unless the radiance is next to nothing, never lie in one.
const BITS_IN_A_CELL: u32 = 15;

/// What each radiance is shown as: looked up, that is many times as fast as computed.
struct Codes {
    /// The bits of the radiances from which on each code but 0 is shown, and a number that none has. Radiances are
    /// ordered as their bits are.
    thresholds: [u32; 256],
    /// The code at the beginning of each cell.
    first: Vec<u8>,
}

impl Codes {
    fn new(scale: f64, curve: ToneCurve) -> Self {
        let infinity = f32::INFINITY.to_bits();
        let shown = |bits| code(f32::from_bits(bits), scale, curve);
        let mut thresholds = [u32::MAX; 256];
        let mut start = 0;
        for (threshold, code) in thresholds[..255].iter_mut().zip(0_u8..) {
            let (mut below, mut from) = (start, infinity + 1);
            while below < from {
                let middle = below.midpoint(from);
                if shown(middle) <= code { below = middle + 1 } else { from = middle }
            }
            if from <= infinity {
                *threshold = from;
            }
            start = from;
        }
        let first = |cell: u32| thresholds.partition_point(|threshold| *threshold <= cell << BITS_IN_A_CELL) as u8;
        Self { first: (0..=infinity >> BITS_IN_A_CELL).map(first).collect(), thresholds }
    }

    fn of(&self, radiance: f32) -> u8 {
        // What is no number, or less than nothing, is shown as nothing.
        let bits = if radiance > 0.0 { radiance.to_bits() } else { 0 };
        let mut code = self.first[(bits >> BITS_IN_A_CELL) as usize];
        while self.thresholds[usize::from(code)] <= bits {
            code += 1;
        }
        code
    }
}

/// What a radiance is shown as: the code nearest to the sRGB encoding of its brightness.
fn code(radiance: f32, scale: f64, curve: ToneCurve) -> u8 {
    let exposed = (f64::from(radiance) * scale).clamp(0.0, 1e6);
    let linear = match curve {
        ToneCurve::Srgb => exposed,
        ToneCurve::Filmic => filmic(exposed),
    };
    let encoded = if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_layers::ImageLayers;

    fn image(mean: Vec<[f32; 3]>) -> FrameImage {
        let width = mean.len() as u32;
        FrameImage::new(width, 1, ImageLayers { mean, ..ImageLayers::default() }, None).unwrap()
    }

    fn codes(image: &FrameImage, exposure: Exposure, curve: ToneCurve) -> Vec<[u8; 3]> {
        let png = encode_png(image, &PreviewSettings { exposure, curve }).unwrap();
        let decoded = image::load_from_memory(&png).unwrap().into_rgb8();
        assert_eq!(decoded.dimensions(), (image.width(), image.height()));
        decoded.pixels().map(|pixel| pixel.0).collect()
    }

    #[test]
    fn linear_values_become_the_codes_of_the_srgb_standard() {
        // 0.18 is 118, 0.5 is 188 (tables of IEC 61966-2-1); what is out of range is cut off.
        let picture = image(vec![[0.0, 0.18, 0.5], [1.0, 2.0, -1.0], [0.002, f32::MAX, f32::MIN]]);
        let found = codes(&picture, Exposure::Stops(0.0), ToneCurve::Srgb);
        assert_eq!(found, [[0, 118, 188], [255, 255, 0], [7, 255, 0]]);
    }

    #[test]
    fn looked_up_codes_are_those_that_are_computed() {
        for (scale, curve) in
            [(0.4, ToneCurve::Filmic), (1.0, ToneCurve::Srgb), (1e-30, ToneCurve::Filmic), (1e44, ToneCurve::Srgb)]
        {
            let codes = Codes::new(scale, curve);
            let shown = 1.0 / scale as f32;
            let spread = (0..20_000).map(|number| shown * number as f32 / 15_000.0);
            let edges = codes
                .thresholds
                .iter()
                .filter(|bits| **bits < u32::MAX)
                .flat_map(|bits| [*bits - 1, *bits, *bits + 1])
                .map(f32::from_bits);
            let cells = (0..codes.first.len() as u32).map(|cell| f32::from_bits(cell << BITS_IN_A_CELL));
            for radiance in spread.chain(edges).chain(cells) {
                assert_eq!(codes.of(radiance), code(radiance, scale, curve), "{radiance} by {scale}, {curve:?}");
            }
            assert_eq!([f32::NAN, -1.0, f32::NEG_INFINITY, -0.0].map(|radiance| codes.of(radiance)), [0; 4]);
        }
    }

    #[test]
    fn a_stop_doubles_the_light() {
        let picture = image(vec![[0.1, 0.2, 0.4]]);
        let brighter = codes(&picture, Exposure::Stops(1.0), ToneCurve::Srgb);
        assert_eq!(brighter, codes(&image(vec![[0.2, 0.4, 0.8]]), Exposure::Stops(0.0), ToneCurve::Srgb));
    }

    #[test]
    fn the_filmic_curve_keeps_detail_that_the_plain_one_cuts_off() {
        let picture = image(vec![[0.0, 1.0, 4.0]]);
        let [[black, white, bright]] = codes(&picture, Exposure::Stops(0.0), ToneCurve::Filmic)[..] else { panic!() };
        // (2.51 + 0.03) / (2.43 + 0.59 + 0.14) = 0.8038 is 232.
        assert_eq!((black, white), (0, 232));
        assert!(bright > white && bright < 255);
    }

    #[test]
    fn automatic_exposure_shows_the_lit_part_as_middle_grey_in_any_unit() {
        for unit in [1e-6, 1.0, 1e6] {
            let mut pixels = vec![[0.0; 3]; 50];
            pixels.extend(vec![[unit; 3]; 10]);
            let found = codes(&image(pixels), Exposure::Automatic, ToneCurve::Srgb);
            assert_eq!((found[0], found[55]), ([0; 3], [118; 3]));
        }
    }

    #[test]
    fn automatic_exposure_shows_the_geometric_mean_of_what_is_lit_as_middle_grey() {
        // Over many more orders of magnitude than a product could hold.
        let radiance: Vec<f32> = (0..1000).map(|number| libm::exp2(f64::from(number % 9)) as f32).collect();
        let mean = radiance.iter().map(|radiance| libm::log2(f64::from(*radiance))).sum::<f64>() / 1000.0;
        let mut pixels: Vec<[f32; 3]> = radiance.iter().map(|radiance| [*radiance; 3]).collect();
        pixels.push([1e-4; 3]);
        let stops = automatic_stops(&image(pixels));
        assert!((stops - (libm::log2(0.18) - mean)).abs() < 1e-9, "{stops}");
    }

    /// A grey hall of radiance 1 and 100 of 1000 pixels of other light.
    fn hall(light: [f32; 3]) -> FrameImage {
        let mut pixels = vec![[1.0; 3]; 900];
        pixels.extend([light; 100]);
        image(pixels)
    }

    #[test]
    fn automatic_exposure_keeps_the_colour_of_bright_light_in_a_dark_hall() {
        // Glass lets some of the other colours through.
        for (light, strongest) in [([60.0, 4.0, 3.0], 0), ([5.0, 50.0, 8.0], 1), ([4.0, 9.0, 80.0], 2)] {
            for curve in [ToneCurve::Filmic, ToneCurve::Srgb] {
                let shown = codes(&hall(light), Exposure::Automatic, curve)[999];
                let others = (0..3).filter(|channel| *channel != strongest).map(|channel| shown[channel]);
                assert!(shown[strongest] > 200 && others.max() < Some(150), "{light:?} is shown as {shown:?}");
            }
        }
    }

    #[test]
    fn automatic_exposure_of_a_hall_is_not_that_of_its_bright_windows_and_fireflies() {
        let [dark, white] = [[1.0; 3], [200.0; 3]].map(|light| automatic_stops(&hall(light)));
        let by_average = 0.1 * libm::log2(200.0);
        assert!((dark - white - by_average).abs() < 1e-9, "the windows count as any other light: {dark}, {white}");
        let mut fireflies = vec![[1.0; 3]; 1000];
        fireflies[..10].fill([1e2, 0.0, 0.0]);
        let stops = automatic_stops(&image(fireflies));
        // One in a hundred moves the average of the logarithms a little.
        assert!(stops < dark && stops > dark - 0.1, "{stops}");
    }

    #[test]
    fn a_coloured_lamp_does_not_make_its_room_black() {
        let [dark, lamp] = [[1.0; 3], [1e3, 1e2, 0.0]].map(hall);
        let by_average = 0.1 * libm::log2(0.2126e3 + 0.7152e2);
        let darkened = automatic_stops(&dark) - by_average - automatic_stops(&lamp);
        assert!((darkened - 4.0).abs() < 1e-9, "{darkened} stops");
    }

    #[test]
    fn an_exposure_over_the_automatic_one_is_brighter_by_its_stops() {
        let picture = image(vec![[0.1, 0.2, 0.4], [0.3, 0.1, 0.0]]);
        let stops = automatic_stops(&picture) + 1.5;
        let found = codes(&picture, Exposure::OverAutomatic(1.5), ToneCurve::Filmic);
        assert_eq!(found, codes(&picture, Exposure::Stops(stops), ToneCurve::Filmic));
    }

    #[test]
    fn a_black_image_has_a_black_preview() {
        assert_eq!(codes(&image(vec![[0.0; 3]; 3]), Exposure::Automatic, ToneCurve::Filmic), [[0; 3]; 3]);
        let png = encode_png(
            &image(vec![[0.0; 3]]),
            &PreviewSettings { exposure: Exposure::Stops(f64::NAN), curve: ToneCurve::Srgb },
        );
        assert!(png.is_ok());
    }
}
