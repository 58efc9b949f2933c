//! The automatic exposure of previews and of FLIP. It is measured by reading the image twice, so that the image need
//! not fit into memory:
//!
//! ```text
//! MeanLuminance --finish--> AutomaticExposure --finish--> stops
//! ```
//!
//! The log-average luminance becomes a middle grey (Reinhard et al. 2002, "Photographic Tone Reproduction for Digital
//! Images", equation 1). Pixels darker than a thousandth of the mean luminance are left out of it, so that black
//! surroundings do not count.
//!
//! Luminance knows nothing of colour. A patch of red light in a dark hall would be exposed until its weaker channels
//! are white, too. So a percentile of the channels limits the exposure. Of each pixel it takes the largest channel
//! above the smallest, which is its colour without its grey. Of 99 in 100 pixels that stays below white. A bright grey
//! window has no colour, so it does not darken the room around it.
//!
//! In whatever pieces an image comes, the bits are the same.

/// What the log-average luminance becomes.
const MIDDLE_GREY: f64 = 0.18;

/// The darkest luminance that counts, relative to the mean.
const DARKEST: f64 = 1e-3;

/// The fraction of the pixels whose colour may be brighter than white.
const BRIGHTER_THAN_WHITE: f64 = 0.01;

/// Most by which colours darken a picture: 4 stops. The room around a small coloured lamp stays visible.
const MOST_DARKENED: f64 = 16.0;

/// Relative luminances whose product is a finite number: each is [`DARKEST`] or more, and at most the number of pixels.
/// One logarithm of it stands for theirs, which would take longer than all else that is done for a preview.
const FACTORS: u32 = 16;

/// Bits of a colour that do not tell its cell: there are 64 cells from each power of two to the next.
const BITS_IN_A_CELL: u32 = 17;

/// Cells up to infinity.
const CELLS: usize = (f32::INFINITY.to_bits() >> BITS_IN_A_CELL) as usize + 1;

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
        self.sum = lit(pixels).fold(self.sum, |sum, (_, luminance)| sum + luminance);
        self.pixels += pixels.len();
    }

    /// The second reading, once all pixels have been added.
    pub fn finish(self) -> AutomaticExposure {
        let mean = self.sum / self.pixels.max(1) as f64;
        let per_mean = 1.0 / mean;
        AutomaticExposure { mean, per_mean, product: 1.0, factors: 0, sum: 0.0, count: 0, colours: vec![0; CELLS] }
    }
}

/// The second of two readings.
#[derive(Clone, Debug)]
pub struct AutomaticExposure {
    mean: f64,
    per_mean: f64,
    /// Product of the last relative luminances.
    product: f64,
    /// Number of luminances in the product.
    factors: u32,
    /// Sum of the logarithms of the earlier products.
    sum: f64,
    count: u64,
    /// Pixels by their colour relative to the mean luminance. Numbers are ordered as their bits are.
    colours: Vec<u64>,
}

impl AutomaticExposure {
    /// Adds the next pixels: the same, in the same order, as in the first reading.
    pub fn add(&mut self, pixels: &[[f32; 3]]) {
        let per_mean = self.per_mean;
        for (pixel, luminance) in lit(pixels) {
            let relative = luminance * per_mean;
            if relative < DARKEST {
                continue;
            }
            self.product *= relative;
            self.factors += 1;
            self.count += 1;
            if self.factors == FACTORS {
                self.sum += libm::log(self.product);
                (self.product, self.factors) = (1.0, 0);
            }
            let colour = (colour(pixel) * per_mean) as f32;
            if let Some(pixels) = self.colours.get_mut((colour.to_bits() >> BITS_IN_A_CELL) as usize) {
                *pixels += 1;
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
        let by_luminance = MIDDLE_GREY / (self.mean * libm::exp(mean_log));
        let by_colour = 1.0 / (self.mean * self.brightest_colour());
        by_luminance.min(by_colour.max(by_luminance / MOST_DARKENED))
    }

    /// The colour, relative to the mean luminance, above which no more pixels are than may be; rounded to a cell.
    fn brightest_colour(&self) -> f64 {
        let may_be = (self.count as f64 * BRIGHTER_THAN_WHITE) as u64;
        let above = |brighter: &mut u64, (cell, pixels): (usize, &u64)| {
            *brighter += pixels;
            (*brighter <= may_be).then_some(cell)
        };
        // The last cell that may be above it is the border.
        let border = (0..CELLS).zip(&self.colours).rev().scan(0, above).last().unwrap_or(CELLS - 1);
        f64::from(f32::from_bits((border as u32) << BITS_IN_A_CELL))
    }
}

/// The pixels that have a luminance, with it.
fn lit(pixels: &[[f32; 3]]) -> impl Iterator<Item = ([f32; 3], f64)> {
    let with_luminance = pixels.iter().map(|pixel| (*pixel, luminance(*pixel)));
    with_luminance.filter(|(_, luminance)| *luminance > 0.0 && luminance.is_finite())
}

/// The largest channel above the smallest: what a pixel has beyond grey. What is darker than black counts as black.
fn colour([red, green, blue]: [f32; 3]) -> f64 {
    let [red, green, blue] = [red, green, blue].map(|channel| f64::from(channel.max(0.0)));
    red.max(green).max(blue) - red.min(green).min(blue)
}

/// Luminance of linear Rec. 709.
pub(super) fn luminance([red, green, blue]: [f32; 3]) -> f64 {
    0.2126 * f64::from(red) + 0.7152 * f64::from(green) + 0.0722 * f64::from(blue)
}
