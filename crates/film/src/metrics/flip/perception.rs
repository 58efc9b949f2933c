//! What the eye makes of an image that a screen shows: colors as far as it can resolve them, edges and points.

use std::collections::VecDeque;
use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::preview::{ToneCurve, filmic};

/// Metres from the eye to the screen.
const VIEWING_DISTANCE: f64 = 0.7;

/// Width of the screen in metres.
const SCREEN_WIDTH: f64 = 0.7;

/// Pixels across the screen.
const SCREEN_PIXELS: f64 = 3840.0;

/// Pixels in a degree of what the eye sees, 67.02: `p`.
pub(super) const PIXELS_PER_DEGREE: f64 = VIEWING_DISTANCE * SCREEN_PIXELS / SCREEN_WIDTH * PI / 180.0;

/// How finely the eye resolves lightness: the filter is `exp(-pi^2 x^2 / b)` over x degrees, with this b, in square
/// degrees. (Its Fourier transform is the sensitivity to contrast.)
pub(super) const LIGHTNESS_SPREAD: f64 = 0.0047;

/// The same for red against green.
pub(super) const RED_GREEN_SPREAD: f64 = 0.0053;

/// The same for blue against yellow: the sum of `a sqrt(pi / b) exp(-pi^2 x^2 / b)` over these pairs of a and b.
pub(super) const BLUE_YELLOW: [(f64, f64); 2] = [(34.1, 0.04), (13.5, 0.025)];

/// Degrees from the peak to the trough of the filter with which the eye finds edges, two of its standard deviations:
/// `w`.
pub(super) const EDGE_WIDTH: f64 = 0.082;

/// How far the filters for color reach, in pixels: three standard deviations, `sqrt(b / (2 pi^2))` degrees, of the
/// widest, rounded up.
pub(super) const RADIUS: usize = 10;

/// How far the filters for edges and points reach, in pixels: three standard deviations, rounded up.
pub(super) const FEATURE_RADIUS: usize = 9;

const TAPS: usize = 2 * RADIUS + 1;

/// A filter along a row or a column: the weights of the pixels from `-RADIUS` to `RADIUS`.
type Kernel = [f64; TAPS];

/// Beyond this, every curve shows white; below, none overflows.
const BRIGHTEST: f64 = 1e6;

/// Linear Rec. 709 to CIE XYZ, in rows, each with a scale of its own. White is D65, the sum of a row, and values are
/// taken relative to it.
const TRISTIMULUS: [[f64; 3]; 3] = [
    [10_135_552.0, 8_788_810.0, 4_435_075.0],
    [2_613_072.0, 8_788_810.0, 887_015.0],
    [1_425_312.0, 8_788_810.0, 70_074_185.0],
];

/// A pixel as the eye sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Perceived {
    /// Its color, filtered: L*, and a* and b* adjusted for the Hunt effect.
    pub(super) color: [f64; 3],
    /// How much of an edge it is: the length of the filtered gradient.
    pub(super) edge: f64,
    /// How much of a point it is: the length of the filtered second derivatives.
    pub(super) point: f64,
}

/// An eye before a screen.
#[derive(Clone, Debug)]
pub(super) struct Observer {
    scale: f64,
    curve: ToneCurve,
    filters: Filters,
    tristimulus: DMat3,
    linear: DMat3,
}

#[derive(Clone, Debug)]
struct Filters {
    lightness: Kernel,
    red_green: Kernel,
    blue_yellow: [Kernel; 2],
    /// How much of each of the two is in their sum.
    blue_yellow_parts: [f64; 2],
    smooth: Kernel,
    edge: Kernel,
    point: Kernel,
}

/// Values of a pixel in a [`FilteredRow`].
pub(super) const SIGNALS: usize = 7;

/// A row of an image, filtered along the row.
#[derive(Clone, Debug)]
pub(super) struct FilteredRow {
    lightness: Vec<f64>,
    red_green: Vec<f64>,
    blue_yellow: [Vec<f64>; 2],
    smooth: Vec<f64>,
    edge: Vec<f64>,
    point: Vec<f64>,
}

/// The rows of an image that are needed at the moment.
#[derive(Clone, Debug, Default)]
pub(super) struct Window {
    /// The number of the first of them.
    first: usize,
    rows: VecDeque<FilteredRow>,
}

impl Window {
    /// Adds the next rows.
    pub(super) fn push(&mut self, rows: Vec<FilteredRow>) {
        self.rows.extend(rows);
    }

    /// Rows that the image has so far.
    pub(super) fn end(&self) -> usize {
        self.first + self.rows.len()
    }

    /// Lets go of the rows before this one.
    pub(super) fn forget(&mut self, first: usize) {
        while self.first < first && self.rows.pop_front().is_some() {
            self.first += 1;
        }
    }

    /// A row of a signal, filtered along the columns. Beyond the first and the last row the image goes on as they are.
    fn filtered(&self, row: usize, signal: fn(&FilteredRow) -> &[f64], kernel: &Kernel) -> Vec<f64> {
        let last = self.end().saturating_sub(1);
        let rows = (0..TAPS).map(|tap| &self.rows[(row + tap).saturating_sub(RADIUS).min(last) - self.first]);
        weighted_sum(rows.map(signal), kernel)
    }
}

impl Observer {
    /// An observer of images at an exposure in stops.
    pub(super) fn new(stops: f64, curve: ToneCurve) -> Self {
        let tristimulus = tristimulus();
        let linear = tristimulus.inverse();
        Self { scale: libm::exp2(stops), curve, filters: Filters::new(), tristimulus, linear }
    }

    /// Rows of `width` pixels, filtered along the rows.
    pub(super) fn filter(&self, pixels: &[[f32; 3]], width: usize) -> Vec<FilteredRow> {
        pixels.par_chunks_exact(width).map(|row| self.filter_row(row)).collect()
    }

    fn filter_row(&self, row: &[[f32; 3]]) -> FilteredRow {
        let opponents: Vec<[f64; 3]> = row.iter().map(|pixel| self.opponents(*pixel)).collect();
        // Beyond its ends a row goes on as it ends.
        let padded: [Vec<f64>; 3] = std::array::from_fn(|channel| {
            let places = (0..row.len() + 2 * RADIUS).map(|place| place.saturating_sub(RADIUS).min(row.len() - 1));
            places.map(|place| opponents[place][channel]).collect()
        });
        let along = |channel: usize, kernel: &Kernel| weighted_sum(padded[channel].windows(row.len()), kernel);
        let filters = &self.filters;
        FilteredRow {
            lightness: along(0, &filters.lightness),
            red_green: along(1, &filters.red_green),
            blue_yellow: [along(2, &filters.blue_yellow[0]), along(2, &filters.blue_yellow[1])],
            smooth: along(0, &filters.smooth),
            edge: along(0, &filters.edge),
            point: along(0, &filters.point),
        }
    }

    /// What the screen shows of a radiance, linear: 0 for black to 1 for white.
    pub(super) fn shown(&self, radiance: f32) -> f64 {
        let exposed = f64::from(radiance) * self.scale;
        // Also where it is not a number.
        let exposed = if exposed > 0.0 { exposed.min(BRIGHTEST) } else { 0.0 };
        let shown = match self.curve {
            ToneCurve::Srgb => exposed,
            ToneCurve::Filmic => filmic(exposed),
        };
        shown.min(1.0)
    }

    /// Y, X - Y and Y - Z of a pixel, relative to white.
    ///
    /// The color space of the paper, YyCxCz, has them as `116 Y - 16`, `500 (X - Y)` and `200 (Y - Z)`. Filters whose
    /// weights sum to 1 keep such factors and offsets, and they are taken out again afterwards; so is the paper's
    /// `(Yy + 16) / 116`, in which it looks for edges and points.
    fn opponents(&self, pixel: [f32; 3]) -> [f64; 3] {
        let [x, y, z] = (self.tristimulus * DVec3::from_array(pixel.map(|radiance| self.shown(radiance)))).to_array();
        [y, x - y, y - z]
    }

    /// How the eye sees a row, around which the window has all rows of the image that there are within [`RADIUS`].
    pub(super) fn perceive(&self, window: &Window, row: usize) -> Vec<Perceived> {
        let filters = &self.filters;
        let lightness = window.filtered(row, |row| &row.lightness, &filters.lightness);
        let red_green = window.filtered(row, |row| &row.red_green, &filters.red_green);
        let blue_yellow = [
            window.filtered(row, |row| &row.blue_yellow[0], &filters.blue_yellow[0]),
            window.filtered(row, |row| &row.blue_yellow[1], &filters.blue_yellow[1]),
        ];
        let edges = [
            window.filtered(row, |row| &row.edge, &filters.smooth),
            window.filtered(row, |row| &row.smooth, &filters.edge),
        ];
        let points = [
            window.filtered(row, |row| &row.point, &filters.smooth),
            window.filtered(row, |row| &row.smooth, &filters.point),
        ];
        let length = |[across, down]: &[Vec<f64>; 2], column: usize| {
            (across[column] * across[column] + down[column] * down[column]).sqrt()
        };
        let parts = filters.blue_yellow_parts;
        let see = |column: usize| {
            let y = lightness[column];
            let blue_yellow = parts[0] * blue_yellow[0][column] + parts[1] * blue_yellow[1][column];
            let linear = self.linear * DVec3::new(y + red_green[column], y, y - blue_yellow);
            // Filtered colors can lie outside those of the screen.
            let color = adjusted_lab(self.tristimulus * linear.clamp(DVec3::ZERO, DVec3::ONE));
            Perceived { color, edge: length(&edges, column), point: length(&points, column) }
        };
        (0..lightness.len()).map(see).collect()
    }
}

impl Filters {
    fn new() -> Self {
        let of_spread = |spread: f64| gaussian(PI * PI / (spread * PIXELS_PER_DEGREE * PIXELS_PER_DEGREE), RADIUS);
        let blue_yellow = BLUE_YELLOW.map(|(_, spread)| of_spread(spread));
        // The sum of a filter over the plane is the square of that over a line.
        let weights: [f64; 2] = std::array::from_fn(|part| {
            let (amplitude, spread) = BLUE_YELLOW[part];
            let sum: f64 = blue_yellow[part].iter().sum();
            amplitude * (PI / spread).sqrt() * sum * sum
        });
        let deviation = 0.5 * EDGE_WIDTH * PIXELS_PER_DEGREE;
        let smooth = gaussian(0.5 / (deviation * deviation), FEATURE_RADIUS);
        let edge: Kernel = std::array::from_fn(|tap| -offset(tap) * smooth[tap]);
        let point: Kernel = std::array::from_fn(|tap| {
            let x = offset(tap) / deviation;
            (x * x - 1.0) * smooth[tap]
        });
        Self {
            lightness: normalized(of_spread(LIGHTNESS_SPREAD)),
            red_green: normalized(of_spread(RED_GREEN_SPREAD)),
            blue_yellow: blue_yellow.map(normalized),
            blue_yellow_parts: weights.map(|weight| weight / (weights[0] + weights[1])),
            smooth: normalized(smooth),
            edge: normalized(edge),
            point: normalized(point),
        }
    }
}

/// Linear Rec. 709 to X, Y and Z relative to white.
fn tristimulus() -> DMat3 {
    let rows = TRISTIMULUS.map(|row| row.map(|value| value / (row[0] + row[1] + row[2])));
    DMat3::from_cols_array_2d(&rows).transpose()
}

/// A color of the screen, linear Rec. 709 from 0 to 1, as the eye sees it where nothing else is: see
/// [`Perceived::color`].
pub(super) fn perceived_color(linear: [f64; 3]) -> [f64; 3] {
    adjusted_lab(tristimulus() * DVec3::from_array(linear))
}

/// CIE L*a*b* of a color relative to white. The Hunt effect: colors look the more vivid, the lighter they are.
fn adjusted_lab(relative: DVec3) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let [x, y, z] = relative.to_array().map(|value| {
        let is_dark = value <= DELTA * DELTA * DELTA;
        if is_dark { value / (3.0 * DELTA * DELTA) + 4.0 / 29.0 } else { libm::cbrt(value) }
    });
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// Pixels from the middle of a kernel.
fn offset(tap: usize) -> f64 {
    tap as f64 - RADIUS as f64
}

/// `exp(-rate x^2)` over x pixels, as far as the radius.
fn gaussian(rate: f64, radius: usize) -> Kernel {
    std::array::from_fn(|tap| match offset(tap) {
        x if x.abs() > radius as f64 => 0.0,
        x => libm::exp(-rate * x * x),
    })
}

/// The kernel with positive weights that sum to 1, and negative ones, where there are any, to -1.
fn normalized(kernel: Kernel) -> Kernel {
    let positive: f64 = kernel.iter().filter(|weight| **weight > 0.0).sum();
    let negative: f64 = kernel.iter().filter(|weight| **weight < 0.0).sum();
    kernel.map(|weight| if weight < 0.0 { weight / negative.abs() } else { weight / positive })
}

/// The sum of lines of numbers with the weights of a kernel, added in its order.
fn weighted_sum<'a>(lines: impl Iterator<Item = &'a [f64]>, kernel: &Kernel) -> Vec<f64> {
    let mut sums = Vec::new();
    for (line, weight) in lines.zip(kernel) {
        sums.resize(line.len(), 0.0);
        for (sum, value) in sums.iter_mut().zip(line) {
            *sum += weight * value;
        }
    }
    sums
}
