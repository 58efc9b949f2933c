//! Whether two sets of pictures can be of the same light: total mean, means of blocks, and chi-square over blocks.

use std::fmt;

use super::pictures::Pictures;
use crate::estimate::Estimate;

/// Edge of a block, pixels.
const BLOCK: usize = 16;

/// Largest difference of the total means beside noise. Both round to single precision in many places.
const TOTAL: f64 = 1e-3;

/// Standard errors that total means may differ by.
const TOTAL_ERRORS: f64 = 3.0;

/// Standard errors that the means of a block may differ by.
const BLOCK_ERRORS: f64 = 4.5;

/// Standard deviations by which chi-square may exceed what is expected.
const CHI_SQUARE_ERRORS: f64 = 4.0;

/// The outcome of a comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parity {
    /// Our total mean over theirs.
    pub ratio: f64,
    /// Standard error of that ratio.
    pub error: f64,
    /// Number of blocks.
    pub blocks: usize,
    /// Largest difference of the means of a block in one channel, standard errors.
    pub worst: f64,
    /// By how many standard deviations the sum of the squared differences of the blocks exceeds what is expected.
    pub chi_square: f64,
    /// Median of the differences of blocks, relative.
    pub median: f64,
}

impl Parity {
    /// Compares pictures.
    ///
    /// # Panics
    ///
    /// When they are of different sizes, or not several.
    pub fn of(ours: &Pictures, theirs: &Pictures) -> Self {
        assert_eq!((ours.width, ours.height), (theirs.width, theirs.height));
        assert!(ours.pictures.len() >= 6 && theirs.pictures.len() >= 6, "noise is estimated from several pictures");
        let grey = |pixel: &[f32; 3]| pixel.iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0;
        let [our_total, their_total] = [ours, theirs].map(|pictures| {
            let mean = |picture: &Vec<[f32; 3]>| picture.iter().map(grey).sum::<f64>() / picture.len() as f64;
            Estimate::of(&pictures.pictures.iter().map(mean).collect::<Vec<f64>>())
        });
        let errors = [our_total.relative_error(), their_total.relative_error()];
        let [our_blocks, their_blocks] = [ours, theirs].map(|pictures| blocks(pictures, grey));
        let pairs = || our_blocks.iter().zip(&their_blocks);
        let mut differences: Vec<f64> =
            pairs().map(|(ours, theirs)| (ours.mean / theirs.mean.max(f64::MIN_POSITIVE) - 1.0).abs()).collect();
        differences.sort_by(f64::total_cmp);
        let worst = (0..3).flat_map(|channel| {
            let value = move |pixel: &[f32; 3]| f64::from(pixel[channel]);
            let [ours, theirs] = [ours, theirs].map(|pictures| blocks(pictures, value));
            ours.into_iter().zip(theirs).map(|(ours, theirs)| ours.deviates(&theirs).abs()).collect::<Vec<f64>>()
        });
        Self {
            ratio: our_total.mean / their_total.mean,
            error: (errors[0] * errors[0] + errors[1] * errors[1]).sqrt(),
            blocks: our_blocks.len(),
            worst: worst.fold(0.0, f64::max),
            chi_square: chi_square(pairs()),
            median: differences[differences.len() / 2],
        }
    }

    /// Whether nothing speaks against both being of the same light.
    pub fn holds(&self) -> bool {
        (self.ratio - 1.0).abs() <= TOTAL + TOTAL_ERRORS * self.error
            && self.worst <= BLOCK_ERRORS
            && self.chi_square <= CHI_SQUARE_ERRORS
    }
}

impl fmt::Display for Parity {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "ratio {:.5} +- {:.5}, worst of {} blocks {:.2}, chi-square {:+.2}, median difference {:.2} %",
            self.ratio,
            self.error,
            self.blocks,
            self.worst,
            self.chi_square,
            100.0 * self.median
        )
    }
}

/// Means over blocks.
fn blocks(pictures: &Pictures, value: impl Fn(&[f32; 3]) -> f64) -> Vec<Estimate> {
    let across = pictures.width.div_ceil(BLOCK);
    let mut values = vec![Vec::new(); across * pictures.height.div_ceil(BLOCK)];
    for picture in &pictures.pictures {
        let mut sums = vec![(0.0, 0.0); values.len()];
        for (index, pixel) in picture.iter().enumerate() {
            let (sum, count) = &mut sums[index / pictures.width / BLOCK * across + index % pictures.width / BLOCK];
            *sum += value(pixel);
            *count += 1.0;
        }
        values.iter_mut().zip(sums).for_each(|(values, (sum, count))| values.push(sum / count));
    }
    values.iter().map(|values| Estimate::of(values)).collect()
}

/// By how many standard deviations the sum of the squared differences exceeds what is expected. Each is the square of
/// Student's t with d degrees of freedom: mean d/(d-2), variance 2 d^2 (d-1)/((d-2)^2 (d-4)).
fn chi_square<'a>(pairs: impl Iterator<Item = (&'a Estimate, &'a Estimate)>) -> f64 {
    let (mut sum, mut variance) = (0.0, 0.0);
    for (ours, theirs) in pairs {
        let degrees = ours.plus(theirs).degrees.min(1e6);
        let mean = degrees / (degrees - 2.0);
        sum += ours.deviates(theirs).powi(2) - mean;
        variance += 2.0 * mean * mean * (degrees - 1.0) / (degrees - 4.0);
    }
    sum / variance.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Pictures of a ramp with noise, times a factor in the lower half.
    fn pictures(seed: u64, factor: f32) -> Pictures {
        let mut random = Random::new(seed, 0);
        let mut picture = |_| {
            let pixel = |index: usize| {
                let light = (1.0 + index as f32 / 2048.0) * if index < 2048 { 1.0 } else { factor };
                [0, 1, 2].map(|_| light * (0.5 + random.uniform() as f32))
            };
            (0..64 * 64).map(pixel).collect()
        };
        Pictures { width: 64, height: 64, pictures: (0..16).map(&mut picture).collect() }
    }

    #[test]
    fn pictures_of_one_scene_agree_and_a_difference_of_a_hundredth_is_noticed() {
        let reference = pictures(1, 1.0);
        let agreement = Parity::of(&pictures(2, 1.0), &reference);
        assert!(agreement.holds() && agreement.blocks == 16, "{agreement}");
        let difference = Parity::of(&pictures(3, 1.01), &reference);
        assert!(!difference.holds(), "{difference}");
    }

    #[test]
    fn a_difference_that_the_total_hides_is_found_in_the_blocks() {
        let mut ours = pictures(4, 1.0);
        // The light is in other places by one part in twenty.
        ours.pictures.iter_mut().flatten().enumerate().for_each(|(index, pixel)| {
            let factor = if index % 64 < 32 { 1.05 } else { 0.95 };
            *pixel = pixel.map(|value| value * factor);
        });
        let parity = Parity::of(&ours, &pictures(5, 1.0));
        assert!((parity.ratio - 1.0).abs() < 2e-3 && parity.chi_square > 10.0, "{parity}");
    }
}
