//! How far an image is from a reference. Formulas and constants are also in `docs/film.md`.
//!
//! All sums are over the three channels of all pixels, in double precision and in one fixed order. Within a tile: rows
//! from the top, pixels from the left, red, green, blue. Then the sums of the tiles, in their order. So the same images
//! give the same numbers everywhere, whether they are measured whole or a few rows at a time.

pub mod flip;

use std::ops::{AddAssign, Range};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::address::TileGrid;
use super::image::FrameImage;
use super::image_layers::ImageLayers;

/// Edge of the tiles in which an image is measured that does not say how it was cut.
const TILE_SIZE: u32 = 64;

/// The constant of the relative error: the usual 0.01 for images whose mean is 1.
pub const RELATIVE_EPSILON: f64 = 0.01;

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
    let grid = grid(image);
    let mut measure = ReferenceMeasure::new(grid);
    measure.add(0..grid.height, reference.layers());
    let mut comparison = Comparison::new(grid, measure.finish());
    comparison.add(0..grid.height, image.layers(), reference.layers());
    Ok(comparison.finish())
}

/// `1/N sum e^2` with the standard error `e` of an image: what its mean squared error is expected to be, as far as the
/// image itself knows. `None` when it has no standard error.
pub fn mean_squared_standard_error(image: &FrameImage) -> Option<f64> {
    image.layers().standard_error.as_ref()?;
    let mut measure = NoiseMeasure::new(grid(image));
    measure.add(0..image.height(), image.layers());
    Some(measure.finish())
}

/// How an image is cut into tiles, as far as it says.
fn grid(image: &FrameImage) -> TileGrid {
    let tile_size = image.metadata().map_or(TILE_SIZE, |metadata| metadata.tile_size);
    TileGrid::new(image.width(), image.height(), tile_size)
}

/// Sums over the pixels of an image, to which rows are added from the top to the bottom.
#[derive(Clone, Debug)]
struct TileSums<S> {
    grid: TileGrid,
    /// Of the tiles of the row that is not complete.
    tiles: Vec<S>,
    total: S,
}

impl<S: Clone + Default + AddAssign> TileSums<S> {
    fn new(grid: TileGrid) -> Self {
        Self { grid, tiles: vec![S::default(); grid.columns() as usize], total: S::default() }
    }

    /// Adds rows: `add` is told of a line of a tile as the pixels of these rows that it consists of.
    fn add(&mut self, rows: Range<u32>, add: impl Fn(&mut S, Range<usize>)) {
        let TileGrid { width, height, tile_size, .. } = self.grid;
        for y in rows.clone() {
            let line = (y - rows.start) as usize * width as usize;
            for (column, tile) in (0..).zip(&mut self.tiles) {
                let (x, end) = (column * tile_size, ((column + 1) * tile_size).min(width));
                add(tile, line + x as usize..line + end as usize);
            }
            if (y + 1).is_multiple_of(tile_size) || y + 1 == height {
                for tile in &mut self.tiles {
                    self.total += std::mem::take(tile);
                }
            }
        }
    }

    /// Numbers that the sums are over: three for each pixel.
    fn count(&self) -> f64 {
        3.0 * f64::from(self.grid.width) * f64::from(self.grid.height)
    }
}

/// Measures the standard error of an image that comes in rows, from the top to the bottom.
#[derive(Clone, Debug)]
pub struct NoiseMeasure(TileSums<f64>);

impl NoiseMeasure {
    /// A measure of an image that is cut in this way.
    pub fn new(grid: TileGrid) -> Self {
        Self(TileSums::new(grid))
    }

    /// Adds the next rows; pixels without a standard error count as zero.
    pub fn add(&mut self, rows: Range<u32>, layers: &ImageLayers) {
        let Some(errors) = &layers.standard_error else { return };
        self.0.add(rows, |sum, pixels| {
            for error in errors[pixels].as_flattened() {
                *sum += f64::from(*error) * f64::from(*error);
            }
        });
    }

    /// `1/N sum e^2`, once all rows have been added.
    pub fn finish(self) -> f64 {
        self.0.total / self.0.count()
    }
}

/// What has to be known of a whole reference before an image is compared with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceSummary {
    /// `1/N sum |r|`.
    pub mean_magnitude: f64,
    /// `max |r|`.
    pub peak: f64,
    /// `sum r`.
    pub sum: f64,
    /// `1/N sum e^2` with the standard error `e`, if it has one.
    pub noise: Option<f64>,
}

/// Measures a reference that comes in rows, from the top to the bottom.
#[derive(Clone, Debug)]
pub struct ReferenceMeasure {
    sums: TileSums<ReferenceSums>,
    noise: NoiseMeasure,
    has_noise: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct ReferenceSums {
    magnitude: f64,
    sum: f64,
    peak: f64,
}

impl AddAssign for ReferenceSums {
    fn add_assign(&mut self, other: Self) {
        self.magnitude += other.magnitude;
        self.sum += other.sum;
        self.peak = self.peak.max(other.peak);
    }
}

impl ReferenceMeasure {
    /// A measure of a reference for images that are cut in this way.
    pub fn new(grid: TileGrid) -> Self {
        Self { sums: TileSums::new(grid), noise: NoiseMeasure::new(grid), has_noise: false }
    }

    /// Adds the next rows.
    pub fn add(&mut self, rows: Range<u32>, layers: &ImageLayers) {
        self.has_noise |= layers.standard_error.is_some();
        self.noise.add(rows.clone(), layers);
        self.sums.add(rows, |sums, pixels| {
            for r in layers.mean[pixels].as_flattened() {
                let r = f64::from(*r);
                sums.magnitude += r.abs();
                sums.sum += r;
                sums.peak = sums.peak.max(r.abs());
            }
        });
    }

    /// What is known once all rows have been added.
    pub fn finish(self) -> ReferenceSummary {
        let ReferenceSums { magnitude, sum, peak } = self.sums.total;
        let mean_magnitude = magnitude / self.sums.count();
        ReferenceSummary { mean_magnitude, peak, sum, noise: self.has_noise.then(|| self.noise.finish()) }
    }
}

/// Compares an image with a reference, both of which come in rows, from the top to the bottom.
#[derive(Clone, Debug)]
pub struct Comparison {
    sums: TileSums<DifferenceSums>,
    reference: ReferenceSummary,
    /// What keeps the relative error of dark pixels finite.
    epsilon: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct DifferenceSums {
    squares: f64,
    relative_squares: f64,
    sum: f64,
    max_abs_diff: f64,
    differs: bool,
}

impl AddAssign for DifferenceSums {
    fn add_assign(&mut self, other: Self) {
        self.squares += other.squares;
        self.relative_squares += other.relative_squares;
        self.sum += other.sum;
        self.max_abs_diff = self.max_abs_diff.max(other.max_abs_diff);
        self.differs |= other.differs;
    }
}

impl Comparison {
    /// A comparison of an image that is cut in this way with the reference of which this is known.
    pub fn new(grid: TileGrid, reference: ReferenceSummary) -> Self {
        let epsilon = RELATIVE_EPSILON * reference.mean_magnitude * reference.mean_magnitude;
        Self { sums: TileSums::new(grid), reference, epsilon }
    }

    /// Adds the next rows.
    pub fn add(&mut self, rows: Range<u32>, image: &ImageLayers, reference: &ImageLayers) {
        let epsilon = self.epsilon;
        self.sums.add(rows, |sums, pixels| {
            let image = image.mean[pixels.clone()].as_flattened();
            for (x, r) in image.iter().zip(reference.mean[pixels].as_flattened()) {
                sums.differs |= x.to_bits() != r.to_bits();
                let (x, r) = (f64::from(*x), f64::from(*r));
                let difference = x - r;
                sums.squares += difference * difference;
                sums.relative_squares += difference * difference / (r * r + epsilon);
                sums.sum += x;
                sums.max_abs_diff = sums.max_abs_diff.max(difference.abs());
            }
        });
    }

    /// The difference, once all rows have been added.
    pub fn finish(self) -> Metrics {
        let DifferenceSums { squares, relative_squares, sum, max_abs_diff, differs } = self.sums.total;
        let (count, reference) = (self.sums.count(), self.reference);
        let mse = squares / count;
        let peak = reference.peak;
        Metrics {
            mse,
            corrected_mse: reference.noise.map(|noise| mse - noise),
            rel_mse: (self.epsilon > 0.0).then(|| relative_squares / count),
            psnr: (mse > 0.0 && peak > 0.0).then(|| 10.0 * libm::log10(peak * peak / mse)),
            mean_ratio: (reference.sum != 0.0).then(|| sum / reference.sum),
            max_abs_diff,
            bit_identical: !differs,
        }
    }
}

/// What the error of a reference adds to [`Metrics::rel_mse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeNoise {
    /// Its expectation, by the standard error `e`: `1/N sum e^2 / (r^2 + 0.01 m^2)`.
    pub mean: f64,
    /// Its standard deviation. Errors are taken to be normal, independent between pixels, and the same in all channels
    /// of one.
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
    use crate::image_layers::ImageLayers;
    use crate::sampler::{SampleStream, SamplerSettings};

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
    fn numbers_are_the_same_to_the_last_bit_whole_and_in_strips_of_any_height() {
        let grid = TileGrid::new(50, 37, 16);
        let settings = SamplerSettings { seed: 9, samples_per_block: 1 };
        let mut trials = SampleStream::new(&settings, 0, [0, 0], 0).trials();
        let mut noise = || (0..50 * 37).map(|_| [0; 3].map(|_| trials.next_f64() as f32)).collect::<Vec<_>>();
        let mut layers = || ImageLayers { mean: noise(), standard_error: Some(noise()), ..ImageLayers::default() };
        let [x, r] = [(); 2].map(|()| layers());
        let measured = |heights: &[u32]| {
            let strips = |height: u32| (0..37).step_by(height as usize).map(move |y| y..37_u32.min(y + height));
            let cut = |layers: &ImageLayers, rows: &Range<u32>| {
                let pixels = rows.start as usize * 50..rows.end as usize * 50;
                let standard_error = layers.standard_error.as_ref().map(|errors| errors[pixels.clone()].to_vec());
                ImageLayers { mean: layers.mean[pixels].to_vec(), standard_error, ..ImageLayers::default() }
            };
            heights
                .iter()
                .map(|height| {
                    let (mut reference, mut own) = (ReferenceMeasure::new(grid), NoiseMeasure::new(grid));
                    for rows in strips(*height) {
                        reference.add(rows.clone(), &cut(&r, &rows));
                        own.add(rows.clone(), &cut(&x, &rows));
                    }
                    let mut comparison = Comparison::new(grid, reference.finish());
                    strips(*height).for_each(|rows| comparison.add(rows.clone(), &cut(&x, &rows), &cut(&r, &rows)));
                    (comparison.finish(), own.finish().to_bits())
                })
                .collect::<Vec<_>>()
        };
        let all = measured(&[37, 1, 5, 16, 20, 32]);
        assert!(all.windows(2).all(|pair| pair[0] == pair[1]), "{all:?}");
        // The order is that of the tiles: with others, the last bits are others too.
        let [image, reference] = [&x, &r].map(|layers| FrameImage::new(50, 37, layers.clone(), None).unwrap());
        let metrics = compare(&image, &reference).unwrap();
        assert!((metrics.mse - all[0].0.mse).abs() < 1e-12 && metrics.mse != all[0].0.mse);
    }

    #[test]
    fn images_of_different_sizes_are_refused() {
        let error = compare(&image(vec![[0.0; 3]; 2], None), &image(vec![[0.0; 3]; 3], None)).unwrap_err();
        assert_eq!(error.to_string(), "the image has 2 x 1 pixels and the reference 3 x 1; they must be the same");
    }
}
