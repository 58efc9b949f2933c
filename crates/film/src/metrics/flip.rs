//! FLIP: how different an image and its reference look to someone who alternates between them.
//!
//! Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", Proceedings of the ACM on Computer Graphics
//! and Interactive Techniques 3 (2), 2020 (LDR-FLIP). Radiance becomes what a preview shows, the eye's filters find
//! colors, edges and points in both images, and a pixel's difference is
//!
//! ```text
//! color ^ (1 - feature)            0: none; 1: the largest
//! ```
//!
//! Images come in rows, from the top to the bottom, of which only those are kept that the filters still need. All
//! numbers are in double precision and in one order. The same images give the same bits, whatever the height of the
//! strips and the number of threads. Formulas and constants are also in `docs/film.md`.

mod perception;
#[cfg(test)]
mod tests;

use rayon::prelude::*;
use thiserror::Error;

use self::perception::{Observer, Perceived, RADIUS, SIGNALS, Window, perceived_color};
use super::CompareError;
use crate::image::FrameImage;
use crate::preview::{ToneCurve, automatic_stops};

/// The exponent of the difference in color, `q_c`.
const COLOR_EXPONENT: f64 = 0.7;

/// Colors that differ by this part of the largest difference, `p_c`, ...
const COLOR_KNEE: f64 = 0.4;

/// ... have this difference, `p_t`: what is larger shares out the rest.
const COLOR_KNEE_DIFFERENCE: f64 = 0.95;

/// The exponent of the difference in edges and points, `q_f`.
const FEATURE_EXPONENT: f64 = 0.5;

/// Rows that are filtered at once: enough for the threads of a machine, few enough to keep.
const BATCH_ROWS: usize = 32;

/// Why rows cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{image} pixels of the image and {reference} of the reference are not as many whole rows of {width}")]
pub struct FlipError {
    /// Pixels of the image.
    pub image: usize,
    /// Pixels of the reference.
    pub reference: usize,
    /// Pixels in a row.
    pub width: usize,
}

/// Compares an image with a reference, both of which come in rows, from the top to the bottom.
#[derive(Clone, Debug)]
pub struct FlipComparison {
    width: usize,
    observer: Observer,
    image: Window,
    reference: Window,
    /// Rows whose differences have been added.
    done: usize,
    /// The sum of the differences of the pixels: of each row from the left, then of the rows from the top.
    total: f64,
    largest_color_difference: f64,
}

impl FlipComparison {
    /// A comparison of images `width` pixels wide (at least 1), both shown at an exposure of `stops` and with a tone
    /// curve.
    ///
    /// The stops should be those of the reference alone ([`MeanLuminance`](crate::MeanLuminance), [`automatic_stops`]):
    /// images of one scene can then be compared.
    pub fn new(width: u32, stops: f64, curve: ToneCurve) -> Self {
        Self {
            width: width.max(1) as usize,
            observer: Observer::new(stops, curve),
            image: Window::default(),
            reference: Window::default(),
            done: 0,
            total: 0.0,
            largest_color_difference: largest_color_difference(),
        }
    }

    /// Bytes that it keeps, at most, of images of this width: rows of both, as far as the filters reach.
    pub fn bytes(width: u32) -> u64 {
        let row_bytes = u64::from(width) * (SIGNALS * size_of::<f64>()) as u64;
        2 * (BATCH_ROWS + 2 * RADIUS) as u64 * row_bytes
    }

    /// Adds the next rows of both images, as many of one as of the other: radiance, W/(m2 sr), in rows from the top
    /// left. What is not a number or negative is black, and what is infinite as bright as can be.
    ///
    /// # Errors
    ///
    /// [`FlipError`] when they are not the same number of whole rows; nothing is added then.
    pub fn add(&mut self, image: &[[f32; 3]], reference: &[[f32; 3]]) -> Result<(), FlipError> {
        let width = self.width;
        if image.len() != reference.len() || !image.len().is_multiple_of(width) {
            return Err(FlipError { image: image.len(), reference: reference.len(), width });
        }
        self.add_rows(image, reference);
        Ok(())
    }

    /// The mean difference of the pixels, 0 to 1, once all rows have been added. `None` where there are none.
    pub fn finish(mut self) -> Option<f64> {
        let rows = self.image.end();
        self.measure(rows);
        (rows > 0).then(|| self.total / (rows as f64 * self.width as f64))
    }

    fn add_rows(&mut self, image: &[[f32; 3]], reference: &[[f32; 3]]) {
        let width = self.width;
        let (image, reference) = (image.chunks(BATCH_ROWS * width), reference.chunks(BATCH_ROWS * width));
        for (image, reference) in image.zip(reference) {
            let observer = &self.observer;
            let (image, reference) =
                rayon::join(|| observer.filter(image, width), || observer.filter(reference, width));
            self.image.push(image);
            self.reference.push(reference);
            // Of the rows below, the filters do not reach those that are still to come.
            self.measure(self.image.end().saturating_sub(RADIUS));
        }
    }

    /// Adds the differences of the rows before `end`, and lets go of what is not needed any more.
    fn measure(&mut self, end: usize) {
        let of_row = |row: usize| {
            let [image, reference] = [&self.image, &self.reference].map(|window| self.observer.perceive(window, row));
            let pixels = image.iter().zip(&reference);
            pixels.map(|(image, reference)| difference(image, reference, self.largest_color_difference)).sum::<f64>()
        };
        let sums: Vec<f64> = (self.done..end).into_par_iter().map(of_row).collect();
        for sum in sums {
            self.total += sum;
        }
        self.done = self.done.max(end);
        for window in [&mut self.image, &mut self.reference] {
            window.forget(self.done.saturating_sub(RADIUS));
        }
    }
}

/// The mean FLIP of an image and its reference, 0 to 1, at the reference's automatic exposure.
///
/// # Errors
///
/// [`CompareError`] when they are of different sizes.
pub fn mean_flip(image: &FrameImage, reference: &FrameImage, curve: ToneCurve) -> Result<f64, CompareError> {
    let sizes = [image, reference].map(|image| [image.width(), image.height()]);
    if sizes[0] != sizes[1] {
        return Err(CompareError::DifferentSizes { image: sizes[0], reference: sizes[1] });
    }
    let mut comparison = FlipComparison::new(reference.width(), automatic_stops(reference), curve);
    comparison.add_rows(&image.layers().mean, &reference.layers().mean);
    Ok(comparison.finish().unwrap_or_default())
}

/// The difference of a pixel, 0 to 1.
fn difference(image: &Perceived, reference: &Perceived, largest_color_difference: f64) -> f64 {
    let color = redistributed(color_difference(image.color, reference.color) / largest_color_difference);
    let edge = (image.edge - reference.edge).abs();
    let point = (image.point - reference.point).abs();
    // Each is at most the square root of 2: both derivatives 1.
    let feature = libm::pow((edge.max(point) / std::f64::consts::SQRT_2).min(1.0), FEATURE_EXPONENT);
    libm::pow(color, 1.0 - feature)
}

/// The distance HyAB of two colors, to the power of its exponent.
fn color_difference(image: [f64; 3], reference: [f64; 3]) -> f64 {
    let [lightness, a, b]: [f64; 3] = std::array::from_fn(|channel| image[channel] - reference[channel]);
    libm::pow(lightness.abs() + (a * a + b * b).sqrt(), COLOR_EXPONENT)
}

/// The difference of the two colors that are farthest apart, green and blue: `c_max`.
fn largest_color_difference() -> f64 {
    color_difference(perceived_color([0.0, 1.0, 0.0]), perceived_color([0.0, 0.0, 1.0]))
}

/// Differences in color, as parts of the largest, spread over 0 to 1 as the eye tells them apart.
fn redistributed(part: f64) -> f64 {
    if part < COLOR_KNEE {
        COLOR_KNEE_DIFFERENCE / COLOR_KNEE * part
    } else {
        let above = (part - COLOR_KNEE) / (1.0 - COLOR_KNEE);
        (COLOR_KNEE_DIFFERENCE + above * (1.0 - COLOR_KNEE_DIFFERENCE)).min(1.0)
    }
}
