//! How far an image is from a reference. Formulas and constants are also in `docs/film.md`.
//!
//! All sums are over the three channels of all pixels, in double precision and in one fixed order (rows from the top,
//! pixels from the left, red, green, blue), so the same images give the same numbers everywhere.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::image::FrameImage;

/// The constant of the relative error: the usual 0.01 for images whose mean is 1.
const RELATIVE_EPSILON: f64 = 0.01;

/// The difference between an image `x` and a reference `r`. With N numbers (three for each pixel):
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// `1/N sum (x - r)^2`, as in the FNEE paper (2023).
    pub mse: f64,
    /// `mse - 1/N sum e^2` with the reference's standard error `e`: an unbiased estimate of what `mse` would be against
    /// a reference without noise, and so sometimes below zero. The error of `x` is what is measured and stays in.
    /// `None` when the reference has no standard error.
    pub corrected_mse: Option<f64>,
    /// `1/N sum (x - r)^2 / (r^2 + 0.01 m^2)` with `m = 1/N sum |r|`, which makes it independent of the unit of light.
    /// `None` when the reference is black.
    pub rel_mse: Option<f64>,
    /// `10 log10(p^2 / mse)` decibels with the peak `p = max |r|`. `None` when `mse` or the peak is zero.
    pub psnr: Option<f64>,
    /// `sum x / sum r`. `None` when the sum over the reference is zero.
    pub mean_ratio: Option<f64>,
    /// `max |x - r|`.
    pub max_abs_diff: f64,
    /// Whether every number has the same bits.
    pub bit_identical: bool,
}

/// Why two images cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum CompareError {
    /// They have different numbers of pixels across or down.
    #[error(
        "the image has {} x {} pixels and the reference {} x {}; they must be the same",
        image[0], image[1], reference[0], reference[1]
    )]
    DifferentSizes {
        /// Pixels across and down the image.
        image: [u32; 2],
        /// Pixels across and down the reference.
        reference: [u32; 2],
    },
}

/// Compares the means of an image with those of a reference.
///
/// # Errors
///
/// [`CompareError`] when they are of different sizes.
pub fn compare(image: &FrameImage, reference: &FrameImage) -> Result<Metrics, CompareError> {
    let sizes = [image, reference].map(|image| [image.width(), image.height()]);
    if sizes[0] != sizes[1] {
        return Err(CompareError::DifferentSizes { image: sizes[0], reference: sizes[1] });
    }
    let image = image.layers().mean.as_flattened();
    let noise = mean_squared_standard_error(reference);
    let reference = reference.layers().mean.as_flattened();
    let count = reference.len() as f64;
    let mean_magnitude = reference.iter().map(|r| f64::from(r.abs())).sum::<f64>() / count;
    let epsilon = RELATIVE_EPSILON * mean_magnitude * mean_magnitude;

    let (mut squares, mut relative_squares) = (0.0, 0.0);
    let (mut image_sum, mut reference_sum) = (0.0, 0.0);
    let (mut max_abs_diff, mut peak) = (0.0f64, 0.0f64);
    let mut bit_identical = true;
    for (x, r) in image.iter().zip(reference) {
        bit_identical &= x.to_bits() == r.to_bits();
        let (x, r) = (f64::from(*x), f64::from(*r));
        let difference = x - r;
        squares += difference * difference;
        relative_squares += difference * difference / (r * r + epsilon);
        image_sum += x;
        reference_sum += r;
        max_abs_diff = max_abs_diff.max(difference.abs());
        peak = peak.max(r.abs());
    }
    let mse = squares / count;
    Ok(Metrics {
        mse,
        corrected_mse: noise.map(|noise| mse - noise),
        rel_mse: (epsilon > 0.0).then(|| relative_squares / count),
        psnr: (mse > 0.0 && peak > 0.0).then(|| 10.0 * libm::log10(peak * peak / mse)),
        mean_ratio: (reference_sum != 0.0).then(|| image_sum / reference_sum),
        max_abs_diff,
        bit_identical,
    })
}

/// `1/N sum e^2` with the standard error `e` of an image: what its mean squared error is expected to be, as far as the image
/// itself knows. `None` when it has no standard error.
pub fn mean_squared_standard_error(image: &FrameImage) -> Option<f64> {
    let errors = image.layers().standard_error.as_ref()?.as_flattened();
    let squares: f64 = errors.iter().map(|&error| f64::from(error) * f64::from(error)).sum();
    Some(squares / errors.len() as f64)
}

/// What the error of a reference adds to [`Metrics::rel_mse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeNoise {
    /// Its expectation, by the standard error `e`: `1/N sum e^2 / (r^2 + 0.01 m^2)`.
    pub mean: f64,
    /// Its standard deviation. Errors are taken to be normal, independent between pixels, and the same in all channels of one.
    pub deviation: f64,
}

/// What a reference's error adds to [`Metrics::rel_mse`]. `None` when it has no standard error or is black.
pub fn relative_noise(reference: &FrameImage) -> Option<RelativeNoise> {
    let errors = reference.layers().standard_error.as_ref()?;
    let values = &reference.layers().mean;
    let count = values.as_flattened().len() as f64;
    let mean_magnitude = values.as_flattened().iter().map(|r| f64::from(r.abs())).sum::<f64>() / count;
    let epsilon = RELATIVE_EPSILON * mean_magnitude * mean_magnitude;
    let of_pixel = |(errors, values): (&[f32; 3], &[f32; 3])| {
        let channels = errors.iter().zip(values).map(|(&error, &r)| (f64::from(error), f64::from(r)));
        channels.map(|(error, r)| error * error / (r * r + epsilon)).sum::<f64>()
    };
    let pixels: Vec<f64> = errors.iter().zip(values).map(of_pixel).collect();
    let fourth_powers: f64 = pixels.iter().map(|square| square * square).sum();
    (epsilon > 0.0).then(|| RelativeNoise {
        mean: pixels.iter().sum::<f64>() / count,
        deviation: (2.0 * fourth_powers).sqrt() / count,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::image::ImageLayers;
    use crate::film::sampler::{SampleStream, SamplerSettings};

    fn image(mean: Vec<[f32; 3]>, standard_error: Option<Vec<[f32; 3]>>) -> FrameImage {
        let width = mean.len() as u32;
        FrameImage::new(width, 1, ImageLayers { mean, standard_error, ..ImageLayers::default() }, None).unwrap()
    }

    #[test]
    fn metrics_of_two_pixels_are_those_worked_out_by_hand() {
        let reference = image(vec![[1.0, 2.0, 3.0], [0.0, 0.0, 6.0]], Some(vec![[0.5; 3]; 2]));
        let other = image(vec![[1.0, 2.0, 4.0], [0.0, 0.0, 3.0]], None);
        let metrics = compare(&other, &reference).unwrap();
        assert_eq!(metrics.mse, 10.0 / 6.0);
        assert_eq!(metrics.corrected_mse, Some(10.0 / 6.0 - 0.25));
        // m = 2, so epsilon is 0.04.
        let rel_mse = (1.0 / 9.04 + 9.0 / 36.04) / 6.0;
        assert!((metrics.rel_mse.unwrap() - rel_mse).abs() < 1e-15);
        let pixels = [1.0 / 1.04 + 1.0 / 4.04 + 1.0 / 9.04, 2.0 / 0.04 + 1.0 / 36.04].map(|sum: f64| 0.25 * sum);
        let noise = relative_noise(&reference).unwrap();
        assert!((noise.mean - (pixels[0] + pixels[1]) / 6.0).abs() < 1e-12);
        assert!((noise.deviation - std::f64::consts::SQRT_2 * libm::hypot(pixels[0], pixels[1]) / 6.0).abs() < 1e-12);
        assert_eq!(relative_noise(&other), None);
        // 10 log10(36 / (10/6)) = 10 log10(21.6).
        assert!((metrics.psnr.unwrap() - 13.344537511509307).abs() < 1e-12);
        assert_eq!(metrics.mean_ratio, Some(10.0 / 12.0));
        assert_eq!(metrics.max_abs_diff, 3.0);
        assert!(!metrics.bit_identical);
    }

    #[test]
    fn an_image_is_identical_to_itself_and_not_to_one_that_differs_in_the_sign_of_zero() {
        let reference = image(vec![[1.0, 0.0, 3.0]], None);
        let metrics = compare(&reference, &reference).unwrap();
        assert!(metrics.bit_identical);
        assert_eq!((metrics.mse, metrics.max_abs_diff, metrics.rel_mse), (0.0, 0.0, Some(0.0)));
        assert_eq!((metrics.psnr, metrics.corrected_mse), (None, None));
        let other = image(vec![[1.0, -0.0, 3.0]], None);
        let metrics = compare(&other, &reference).unwrap();
        assert!(!metrics.bit_identical && metrics.mse == 0.0);
    }

    #[test]
    fn relative_error_does_not_depend_on_the_unit_of_light() {
        let reference = vec![[1.0, 2.0, 3.0], [0.0, 0.5, 6.0]];
        let other = vec![[1.5, 2.0, 4.0], [0.25, 0.0, 3.0]];
        let rel_mse = |scale: f32| {
            let scaled = |pixels: &[[f32; 3]]| pixels.iter().map(|p| p.map(|value| value * scale)).collect();
            compare(&image(scaled(&other), None), &image(scaled(&reference), None)).unwrap().rel_mse.unwrap()
        };
        assert!((rel_mse(1.0 / 1024.0) - rel_mse(1.0)).abs() < 1e-14);
    }

    #[test]
    fn correction_takes_out_the_noise_of_the_reference() {
        // The image is off by 0.1 everywhere; the reference is 1 plus noise that is uniform in [-0.5, 0.5], whose
        // variance is 1/12.
        let pixels = 100_000;
        let settings = SamplerSettings { seed: 5, samples_per_block: 1 };
        let mut trials = SampleStream::new(&settings, 0, [0, 0], 0).trials();
        let reference = (0..pixels).map(|_| [0; 3].map(|_| (0.5 + trials.next_f64()) as f32)).collect();
        let standard_error = vec![[(1.0f32 / 12.0).sqrt(); 3]; pixels];
        let metrics = compare(&image(vec![[1.1; 3]; pixels], None), &image(reference, Some(standard_error))).unwrap();
        // Per number, (x - r)^2 has the variance 1/180 + 4 (0.1)^2 / 12 of e^2 + 0.2 e; five standard deviations.
        let tolerance = 5.0 * ((1.0 / 180.0 + 0.04 / 12.0) / (3.0 * pixels as f64)).sqrt();
        assert!((metrics.corrected_mse.unwrap() - 0.01).abs() < tolerance, "{metrics:?}, tolerance {tolerance}");
        assert!(metrics.mse > 0.09);
    }

    #[test]
    fn a_black_reference_has_no_relative_measures() {
        let metrics = compare(&image(vec![[1.0; 3]], None), &image(vec![[0.0; 3]], None)).unwrap();
        assert_eq!((metrics.rel_mse, metrics.psnr, metrics.mean_ratio), (None, None, None));
        assert_eq!(metrics.mse, 1.0);
    }

    #[test]
    fn images_of_different_sizes_are_refused() {
        let error = compare(&image(vec![[0.0; 3]; 2], None), &image(vec![[0.0; 3]; 3], None)).unwrap_err();
        assert_eq!(error.to_string(), "the image has 2 x 1 pixels and the reference 3 x 1; they must be the same");
    }
}
