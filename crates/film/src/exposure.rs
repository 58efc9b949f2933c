//! The automatic exposure of previews and of FLIP. It is measured by reading the image twice, so that the image need
//! not fit into memory:
//!
//! ```text
//! MeanLuminance --finish--> LogLuminance --finish--> stops
//! ```
//!
//! The log-average luminance becomes a middle grey (Reinhard et al. 2002, "Photographic Tone Reproduction for Digital
//! Images", equation 1). Pixels darker than a thousandth of the mean luminance are left out of it, so that black
//! surroundings do not count. In whatever pieces an image comes, the bits are the same.

/// What the log-average luminance becomes.
const MIDDLE_GREY: f64 = 0.18;

/// The darkest luminance that counts, relative to the mean.
const DARKEST: f64 = 1e-3;

/// Relative luminances whose product is a finite number: each is [`DARKEST`] or more, and at most the number of pixels.
/// One logarithm of it stands for theirs, which would take longer than all else that is done for a preview.
const FACTORS: u32 = 16;

/// The first reading.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeanLuminance {
    sum: f64,
    pixels: usize,
}

impl MeanLuminance {
    /// A measure of nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the next pixels, in rows from the top left: radiance, W/(m2 sr). What is not finite counts as black.
    pub fn add(&mut self, pixels: &[[f32; 3]]) {
        self.sum = luminances(pixels).fold(self.sum, |sum, luminance| sum + luminance);
        self.pixels += pixels.len();
    }

    /// The second reading, once all pixels have been added.
    pub fn finish(self) -> LogLuminance {
        let mean = self.sum / self.pixels.max(1) as f64;
        LogLuminance { mean, per_mean: 1.0 / mean, product: 1.0, factors: 0, sum: 0.0, count: 0 }
    }
}

/// The second of two readings.
#[derive(Clone, Copy, Debug)]
pub struct LogLuminance {
    mean: f64,
    per_mean: f64,
    /// Product of the last relative luminances.
    product: f64,
    /// Number of luminances in the product.
    factors: u32,
    /// Sum of the logarithms of the earlier products.
    sum: f64,
    count: u64,
}

impl LogLuminance {
    /// Adds the next pixels: the same, in the same order, as in the first reading.
    pub fn add(&mut self, pixels: &[[f32; 3]]) {
        let per_mean = self.per_mean;
        for relative in luminances(pixels).map(|luminance| luminance * per_mean).filter(|relative| *relative >= DARKEST)
        {
            self.product *= relative;
            self.factors += 1;
            self.count += 1;
            if self.factors == FACTORS {
                self.sum += libm::log(self.product);
                (self.product, self.factors) = (1.0, 0);
            }
        }
    }

    /// The automatic exposure in stops, once all pixels have been added; 0 for an image that is black.
    pub fn finish(self) -> f64 {
        libm::log2(self.scale())
    }

    /// The same as what radiance is multiplied by.
    pub(super) fn scale(self) -> f64 {
        if self.count == 0 {
            return 1.0;
        }
        let mean_log = (self.sum + libm::log(self.product)) / self.count as f64;
        MIDDLE_GREY / (self.mean * libm::exp(mean_log))
    }
}

/// The luminances, linear Rec. 709, of the pixels that have one.
fn luminances(pixels: &[[f32; 3]]) -> impl Iterator<Item = f64> {
    pixels.iter().map(|pixel| luminance(*pixel)).filter(|luminance| *luminance > 0.0 && luminance.is_finite())
}

/// Luminance of linear Rec. 709.
pub(super) fn luminance([red, green, blue]: [f32; 3]) -> f64 {
    0.2126 * f64::from(red) + 0.7152 * f64::from(green) + 0.0722 * f64::from(blue)
}
