//! Whether a renderer's pictures agree with a reference, and how small a difference would have been noticed.
//!
//! The errors of an unbiased renderer average out. A bias test has to tell them from bias for estimators with heavy
//! tails: rare bright samples make most finite pictures too dark. The decisions here:
//!
//! - **Our error** comes from independently seeded replicates, and never from single samples. Means over cells of 4 x 4
//!   pixels or more are compared by Student's t.
//! - **The reference's error** comes from the difference of its two independent halves, because its pixels are
//!   anticorrelated. It is a multiple of the standard error layer, shared by the cells of a neighbourhood.
//! - **Heavy tails.** When a rare bright sample is missing, mean and spread are both too small. Then an ordinary t
//!   statistic exceeds its quantiles many times too often. So the variance of a cell is the larger one of its own and
//!   of that of its neighbourhood (relative to the reference). The own one protects where the cell has the rare sample,
//!   the neighbourhood's where it has not. For normal errors this costs 5 percent of the standard error.
//! - **Folds.** Cells that a fold of the caustic crosses have infinite variance. The fold may be that of a point light,
//!   or of any point of a light of which the method draws one. Such cells are pooled to one flux for each region of 32
//!   x 32 pixels. Unlit blocks are pooled to one cell.
//! - **Many tests at once** share one probability of a false alarm, [`SIGNIFICANCE`], by Bonferroni. They are the image
//!   mean in each channel, every cell, and the sum of squares over all cells.
//! - **Power** is part of the verdict: a test that could not have noticed a fault proves nothing.

use std::fmt;

use glam::DVec3;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

use crate::reference::{Image, Reference};

/// Edge of the smallest blocks, pixels.
pub const BLOCK: usize = 4;

/// Edge of a region in which blocks with folds are pooled, pixels.
pub const REGION: usize = 32;

/// Probability that a renderer without bias is rejected.
pub const SIGNIFICANCE: f64 = 1e-3;

/// Largest relative standard error of the image mean for which a verdict counts.
pub const MEAN_POWER: f64 = 0.001;

/// Largest relative standard error of a block, to be met by 95 percent of the lit blocks, for which a verdict counts.
pub const BLOCK_POWER: f64 = 0.01;

/// Blocks on each side that share a variance.
const NEIGHBOURS: isize = 2;

/// A lit block has at least this fraction of the median brightness.
const LIT: f64 = 0.1;

/// Rounding, relative to the image mean, that is no difference.
const ROUNDING: f64 = 1e-6;

const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// The result of a bias test.
#[derive(Clone, Debug)]
pub struct BiasReport {
    /// Number of replicates.
    pub replicates: usize,
    /// Mean of our picture over that of the reference, for each channel.
    pub mean_ratio: [f64; 3],
    /// Combined standard error of the image mean, relative to it: the largest over the channels.
    pub mean_error: f64,
    /// Smallest probability, over the channels, of a mean at least as far from the reference's without bias.
    pub mean_probability: f64,
    /// Number of lit blocks without fold, each tested by itself.
    pub blocks: usize,
    /// Combined standard error, relative to the block's value, that 95 percent of these blocks do not exceed.
    pub block_error: f64,
    /// Number of regions with folds, each tested as a pooled flux, with the number of their blocks.
    pub fold_regions: [usize; 2],
    /// Combined relative standard error that 95 percent of the regions do not exceed; 0 without regions.
    pub fold_error: f64,
    /// By how much the flux of a region differs, relative: the most of all regions.
    pub fold_deviation: f64,
    /// The cell that deviates most.
    pub worst: WorstCell,
    /// Sum over blocks and regions of squared standardised deviations, divided by their number: below 1 without bias.
    pub chi_square: f64,
    /// Probability of a sum at least as large without bias.
    pub chi_square_probability: f64,
    /// Number of cells.
    cells: usize,
}

/// The cell that deviates most from the reference.
#[derive(Clone, Debug)]
pub struct WorstCell {
    /// Top left pixel.
    pub corner: [usize; 2],
    /// Which kind of cell it is.
    pub kind: CellKind,
    /// Ours over the reference.
    pub ratio: f64,
    /// Student's t.
    pub t: f64,
    /// Probability of a t at least as far from 0 without bias, for this cell alone.
    pub probability: f64,
}

/// What a cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CellKind {
    /// A lit block.
    Block,
    /// The blocks of a region that folds cross.
    Fold,
    /// All unlit blocks.
    Dark,
}

impl BiasReport {
    /// Whether there is no sign of bias.
    pub fn agrees(&self) -> bool {
        let families =
            [self.mean_probability * 3.0, self.worst.probability * self.cells as f64, self.chi_square_probability];
        families.iter().all(|probability| probability * families.len() as f64 > SIGNIFICANCE)
    }

    /// Whether the test is sharp enough for its verdict to count: [`MEAN_POWER`] and [`BLOCK_POWER`].
    pub fn has_power(&self) -> bool {
        self.blocks > 0 && self.mean_error <= MEAN_POWER && self.block_error <= BLOCK_POWER
    }

    /// Largest deviation of a channel's mean from the reference's, as a ratio minus one.
    pub fn mean_deviation(&self) -> f64 {
        self.mean_ratio.iter().map(|ratio| (ratio - 1.0).abs()).fold(0.0, f64::max)
    }
}

impl fmt::Display for BiasReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {}: mean {:+.4} % (se {:.4} %, p {:.2}), {} blocks (se95 {:.2} %), {} fold regions of {} blocks (se95 \
             {:.2} %), chi2 {:.3} (p {:.2}), worst {:?} at {},{}: {:+.2} % (t {:+.1}, p {:.1e} of {} cells)",
            if self.agrees() { "agrees" } else { "BIASED" },
            if self.has_power() { "with power" } else { "without full power" },
            (self.mean_ratio.iter().sum::<f64>() / 3.0 - 1.0) * 100.0,
            self.mean_error * 100.0,
            self.mean_probability,
            self.blocks,
            self.block_error * 100.0,
            self.fold_regions[0],
            self.fold_regions[1],
            self.fold_error * 100.0,
            self.chi_square,
            self.chi_square_probability,
            self.worst.kind,
            self.worst.corner[0],
            self.worst.corner[1],
            (self.worst.ratio - 1.0) * 100.0,
            self.worst.t,
            self.worst.probability,
            self.cells,
        )
    }
}

/// Tests whether independently seeded `replicates` have the expectation that `reference` estimates.
///
/// `folds` says for each pixel whether a fold passes through or beside it; empty when there are none. `block` is the
/// edge of the blocks that are tested one by one, in pixels: [`BLOCK`] or a multiple that divides [`REGION`].
///
/// # Panics
///
/// With fewer than 32 replicates, pictures of different sizes, or another edge.
pub fn compare(replicates: &[Image], reference: &Reference, folds: &[bool], block: usize) -> BiasReport {
    assert!(
        block.is_multiple_of(BLOCK) && REGION.is_multiple_of(block),
        "blocks have 4, 8, 16 or 32 pixels, not {block}"
    );
    assert!(replicates.len() >= 32, "Student's t needs at least 32 replicates, not {}", replicates.len());
    let size = (reference.mean.width, reference.mean.height);
    assert!(replicates.iter().all(|r| (r.width, r.height) == size), "all pictures have the size of the reference");
    let cells = cells(reference, folds, block);
    let comparisons = compare_cells(&cells, replicates, reference, block);

    let reference_variance: f64 = cells
        .iter()
        .zip(&comparisons)
        .map(|(cell, c)| c.reference_variance * (cell.pixels.len() as f64 / reference.mean.pixels.len() as f64).powi(2))
        .sum();
    let mean_luminance = mean_of(&reference.mean, None, LUMINANCE);
    let means = [DVec3::X, DVec3::Y, DVec3::Z].map(|channel| {
        let ours: Vec<f64> = replicates.iter().map(|r| mean_of(r, None, channel)).collect();
        let expected = mean_of(&reference.mean, None, channel);
        let (mean, variance) = mean_and_variance(&ours);
        let reference_variance = reference_variance * (expected / mean_luminance).powi(2);
        let error = (variance + reference_variance).sqrt();
        let freedom = satterthwaite([(variance, ours.len() as f64 - 1.0), (reference_variance, cells.len() as f64)]);
        (mean / expected, error / expected, two_sided((mean - expected) / error, freedom))
    });

    let of_kind = |kind: CellKind| cells.iter().zip(&comparisons).filter(move |(cell, _)| cell.kind == kind);
    let relative_errors = |kind| of_kind(kind).map(|(_, c)| c.error / c.expected).collect::<Vec<_>>();
    let normal = Normal::standard();
    let squares: Vec<f64> = of_kind(CellKind::Block)
        .chain(of_kind(CellKind::Fold))
        .map(|(_, c)| normal.inverse_cdf((c.probability / 2.0).max(f64::MIN_POSITIVE)).powi(2))
        .collect();
    let chi_square: f64 = squares.iter().sum();
    let distribution = ChiSquared::new(squares.len().max(1) as f64).expect("a positive number of degrees of freedom");
    let (worst_cell, worst) = cells
        .iter()
        .zip(&comparisons)
        .min_by(|a, b| a.1.probability.total_cmp(&b.1.probability).then(b.1.t.abs().total_cmp(&a.1.t.abs())))
        .expect("a picture has a pixel");
    BiasReport {
        replicates: replicates.len(),
        mean_ratio: means.map(|m| m.0),
        mean_error: means.iter().map(|m| m.1).fold(0.0, f64::max),
        mean_probability: means.iter().map(|m| m.2).fold(1.0, f64::min),
        blocks: of_kind(CellKind::Block).count(),
        block_error: quantile(relative_errors(CellKind::Block), 0.95),
        fold_regions: [
            of_kind(CellKind::Fold).count(),
            of_kind(CellKind::Fold).map(|(cell, _)| cell.pixels.len()).sum::<usize>() / (block * block),
        ],
        fold_error: quantile(relative_errors(CellKind::Fold), 0.95),
        fold_deviation: of_kind(CellKind::Fold).map(|(_, c)| (c.ours / c.expected - 1.0).abs()).fold(0.0, f64::max),
        worst: WorstCell {
            corner: worst_cell.corner,
            kind: worst_cell.kind,
            ratio: worst.ours / worst.expected,
            t: worst.t,
            probability: worst.probability,
        },
        chi_square: chi_square / squares.len().max(1) as f64,
        chi_square_probability: distribution.sf(chi_square),
        cells: cells.len(),
    }
}

/// Pixels that are tested together.
struct Cell {
    kind: CellKind,
    corner: [usize; 2],
    pixels: Vec<usize>,
}

struct Comparison {
    ours: f64,
    expected: f64,
    /// Combined standard error.
    error: f64,
    reference_variance: f64,
    t: f64,
    probability: f64,
}

fn cells(reference: &Reference, folds: &[bool], edge: usize) -> Vec<Cell> {
    let (width, height) = (reference.mean.width, reference.mean.height);
    let blocks: Vec<Cell> = (0..height)
        .step_by(edge)
        .flat_map(|y| (0..width).step_by(edge).map(move |x| [x, y]))
        .map(|[x, y]| {
            let rows = y..(y + edge).min(height);
            let pixels = rows.flat_map(|y| (x..(x + edge).min(width)).map(move |x| y * width + x)).collect();
            Cell { kind: CellKind::Block, corner: [x, y], pixels }
        })
        .collect();
    let value = |cell: &Cell| mean_of(&reference.mean, Some(&cell.pixels), LUMINANCE);
    let brightest = blocks.iter().map(value).fold(0.0, f64::max);
    let median = quantile(blocks.iter().map(value).filter(|v| *v > 0.02 * brightest).collect(), 0.5);
    let mut cells = Vec::new();
    let mut pooled: Vec<Cell> = Vec::new();
    for block in blocks {
        let (kind, corner) = if block.pixels.iter().any(|i| folds.get(*i) == Some(&true)) {
            (CellKind::Fold, block.corner.map(|c| c / REGION * REGION))
        } else if value(&block) < LIT * median {
            (CellKind::Dark, [0, 0])
        } else {
            cells.push(block);
            continue;
        };
        match pooled.iter_mut().find(|cell| cell.kind == kind && cell.corner == corner) {
            Some(cell) => cell.pixels.extend(block.pixels),
            None => pooled.push(Cell { kind, corner, pixels: block.pixels }),
        }
    }
    cells.extend(pooled);
    cells
}

fn compare_cells(cells: &[Cell], replicates: &[Image], reference: &Reference, edge: usize) -> Vec<Comparison> {
    struct Own {
        expected: f64,
        mean: f64,
        relative_variance: f64,
        reference_difference: f64,
        reference_independent: f64,
    }
    let floor = (ROUNDING * mean_of(&reference.mean, None, LUMINANCE)).powi(2);
    let own: Vec<Own> = cells
        .iter()
        .map(|cell| {
            let value = |image: &Image| mean_of(image, Some(&cell.pixels), LUMINANCE);
            let expected = value(&reference.mean);
            let (mean, variance) = mean_and_variance(&replicates.iter().map(value).collect::<Vec<_>>());
            let half = (value(&reference.halves[0]) - value(&reference.halves[1])) / 2.0;
            let count = cell.pixels.len() as f64;
            let squares: f64 =
                cell.pixels.iter().map(|i| reference.standard_error.pixels[*i].dot(LUMINANCE).powi(2)).sum();
            Own {
                expected,
                mean,
                relative_variance: variance / (expected * expected).max(floor),
                reference_difference: half * half,
                reference_independent: squares / (count * count),
            }
        })
        .collect();
    cells
        .iter()
        .zip(&own)
        .map(|(cell, values)| {
            let near = |other: &Cell| {
                let distance = |axis: usize| (cell.corner[axis] as isize - other.corner[axis] as isize).abs();
                let block_distance = distance(0).max(distance(1)) / edge as isize;
                other.kind == cell.kind && (cell.kind != CellKind::Block || block_distance <= NEIGHBOURS)
            };
            let neighbours: Vec<&Own> =
                cells.iter().zip(&own).filter(|(other, _)| near(other)).map(|(_, values)| values).collect();
            let count = neighbours.len() as f64;
            let pooled = neighbours.iter().map(|n| n.relative_variance).sum::<f64>() / count;
            let variance = values.relative_variance.max(pooled) * (values.expected * values.expected).max(floor);
            let independent: f64 = neighbours.iter().map(|n| n.reference_independent).sum();
            let difference: f64 = neighbours.iter().map(|n| n.reference_difference).sum();
            let ratio = if independent > 0.0 { difference / independent } else { 1.0 };
            // Too few halves tell too little; the errors of the pixels, taken as independent, are then an upper bound.
            let ratio = if count < 8.0 { ratio.max(1.0) } else { ratio };
            let reference_variance = ratio * values.reference_independent;
            let error = (variance + reference_variance + floor).sqrt();
            let freedom = satterthwaite([(variance, replicates.len() as f64 - 1.0), (reference_variance, count)]);
            let t = (values.mean - values.expected) / error;
            Comparison {
                ours: values.mean,
                expected: values.expected,
                error,
                reference_variance,
                t,
                probability: two_sided(t, freedom),
            }
        })
        .collect()
}

/// Mean over some pixels (or all) of a linear function of the channels.
fn mean_of(image: &Image, pixels: Option<&[usize]>, weights: DVec3) -> f64 {
    let sum: DVec3 = match pixels {
        Some(pixels) => pixels.iter().map(|i| image.pixels[*i]).sum(),
        None => image.pixels.iter().sum(),
    };
    sum.dot(weights) / pixels.map_or(image.pixels.len(), <[usize]>::len) as f64
}

/// The mean, and the variance of the mean.
fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (count * (count - 1.0)))
}

/// Degrees of freedom of a sum of variances, each with its own (Welch 1947, Satterthwaite 1946).
fn satterthwaite(parts: [(f64, f64); 2]) -> f64 {
    let sum: f64 = parts.iter().map(|(variance, _)| variance).sum();
    let squares: f64 = parts.iter().map(|(variance, freedom)| variance * variance / freedom).sum();
    if squares > 0.0 { sum * sum / squares } else { parts[0].1 }
}

/// Probability that Student's t is at least as far from zero.
fn two_sided(t: f64, freedom: f64) -> f64 {
    let distribution = StudentsT::new(0.0, 1.0, freedom).expect("positive degrees of freedom");
    (2.0 * distribution.sf(t.abs())).min(1.0)
}

/// The smallest value that a fraction `q` of the values does not exceed; 0 without values.
fn quantile(mut values: Vec<f64>, q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get(((values.len() as f64 * q).ceil() as usize).saturating_sub(1).min(last)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const SIZE: usize = 64;

    /// A bright disc with a gradient, a shadow and a bright line.
    fn truth() -> Image {
        let mut image = Image::black(SIZE, SIZE);
        for y in 0..SIZE {
            for x in 0..SIZE {
                let lit = (x as f64 - 32.0).hypot(y as f64 - 30.0) < 26.0;
                let bright = if x / 4 == 9 { 3.0 } else { 1.0 };
                if lit {
                    image.pixels[y * SIZE + x] = DVec3::new(1.0, 0.8, 0.6) * (bright + 0.01 * y as f64);
                }
            }
        }
        image
    }

    /// Relative errors of zero mean.
    #[derive(Clone, Copy)]
    enum Noise {
        Gaussian,
        /// A few samples of a density with the tail of `1 / sqrt(distance to a fold)`: its variance is infinite.
        Pareto,
    }

    impl Noise {
        /// A strength with which the test has power.
        fn faint(self) -> f64 {
            match self {
                Self::Gaussian => 0.08,
                Self::Pareto => 0.015,
            }
        }

        fn draw(self, random: &mut Random) -> f64 {
            match self {
                Self::Gaussian => {
                    let radius = (-2.0 * libm::log(1.0 - random.uniform())).sqrt();
                    radius * libm::cos(2.0 * std::f64::consts::PI * random.uniform())
                }
                Self::Pareto => {
                    let heavy = random.uniform() < 0.1;
                    if heavy { 5.0 / (1.0 - random.uniform()).sqrt() - 9.1 } else { -0.1 }
                }
            }
        }
    }

    fn replicate(truth: &Image, noise: Noise, strength: f64, random: &mut Random) -> Image {
        let mut image = truth.clone();
        for pixel in &mut image.pixels {
            *pixel *= 1.0 + strength * noise.draw(random);
        }
        image
    }

    fn replicates(truth: &Image, noise: Noise, strength: f64, seed: u64) -> Vec<Image> {
        (0..32).map(|stream| replicate(truth, noise, strength, &mut Random::new(seed, stream))).collect()
    }

    /// A reference whose errors of neighbouring pixels cancel in part.
    fn reference(truth: &Image, strength: f64, seed: u64) -> Reference {
        let random = &mut Random::new(seed, 1000);
        let batches: Vec<Image> = (0..8)
            .map(|_| {
                let mut image = truth.clone();
                for y in 0..SIZE {
                    for x in (0..SIZE).step_by(2) {
                        let common = strength * Noise::Gaussian.draw(random);
                        for (x, error) in [(x, common), (x + 1, -0.8 * common)] {
                            let own = 0.3 * strength * Noise::Gaussian.draw(random);
                            image.pixels[y * SIZE + x] *= 1.0 + error + own;
                        }
                    }
                }
                image
            })
            .collect();
        Reference::from_batches(&batches)
    }

    fn rejections(noise: Noise, experiments: u64) -> usize {
        let truth = truth();
        (0..experiments)
            .filter(|seed| {
                let ours = replicates(&truth, noise, 0.2, *seed);
                !compare(&ours, &reference(&truth, 0.01, *seed), &[], BLOCK).agrees()
            })
            .count()
    }

    #[test]
    fn pictures_without_bias_and_with_normal_errors_are_seldom_rejected() {
        // More than 3 of 300 have a probability below 1e-3 at the stated rate of one in a thousand.
        assert!(rejections(Noise::Gaussian, 300) <= 3);
    }

    #[test]
    fn pictures_without_bias_and_with_infinite_variance_are_seldom_rejected() {
        assert!(rejections(Noise::Pareto, 300) <= 3);
    }

    #[track_caller]
    fn check_rejected(noise: Noise, spoil: impl Fn(&mut Image)) {
        let truth = truth();
        let mut spoilt = truth.clone();
        spoil(&mut spoilt);
        for seed in 0..20 {
            let ours = replicates(&truth, noise, noise.faint(), seed);
            let right = compare(&ours, &reference(&truth, 0.01, seed), &[], BLOCK);
            assert!(right.has_power() && right.agrees(), "{right}");
            let wrong = compare(&ours, &reference(&spoilt, 0.01, seed), &[], BLOCK);
            assert!(!wrong.agrees(), "{wrong}");
        }
    }

    #[test]
    fn half_a_percent_of_brightness_is_noticed() {
        for noise in [Noise::Gaussian, Noise::Pareto] {
            check_rejected(noise, |image| image.pixels.iter_mut().for_each(|pixel| *pixel *= 1.005));
        }
    }

    #[test]
    fn half_a_percent_of_one_channel_is_noticed() {
        check_rejected(Noise::Gaussian, |image| image.pixels.iter_mut().for_each(|pixel| pixel.z *= 1.005));
    }

    #[test]
    fn light_lost_in_a_few_blocks_and_found_in_others_is_noticed() {
        check_rejected(Noise::Gaussian, |image| {
            for y in 28..36 {
                for x in 20..28 {
                    image.pixels[y * SIZE + x] *= 1.06;
                    image.pixels[y * SIZE + x + 20] *= 0.94;
                }
            }
        });
    }

    #[test]
    fn light_in_the_dark_is_noticed() {
        check_rejected(Noise::Gaussian, |image| {
            image.pixels.iter_mut().filter(|pixel| pixel.x == 0.0).for_each(|pixel| *pixel = DVec3::splat(1e-3));
        });
    }

    #[test]
    fn light_lost_at_folds_is_noticed_in_their_pooled_flux() {
        let truth = truth();
        let folds: Vec<bool> = (0..SIZE * SIZE).map(|i| i % SIZE / 4 == 9).collect();
        let mut spoilt = truth.clone();
        for (pixel, _) in spoilt.pixels.iter_mut().zip(&folds).filter(|(_, fold)| **fold) {
            *pixel *= 0.95;
        }
        for seed in 0..20 {
            let ours = replicates(&truth, Noise::Pareto, Noise::Pareto.faint(), seed);
            let right = compare(&ours, &reference(&truth, 0.01, seed), &folds, BLOCK);
            assert!(right.has_power() && right.agrees() && right.fold_regions[1] > 0, "{right}");
            let wrong = compare(&ours, &reference(&spoilt, 0.01, seed), &folds, BLOCK);
            assert!(!wrong.agrees(), "{wrong}");
        }
    }

    #[test]
    fn noise_that_hides_faults_is_reported_as_lack_of_power() {
        let truth = truth();
        assert!(
            !compare(&replicates(&truth, Noise::Gaussian, 2.0, 1), &reference(&truth, 0.01, 1), &[], BLOCK).has_power()
        );
        assert!(
            !compare(&replicates(&truth, Noise::Gaussian, 0.01, 1), &reference(&truth, 0.5, 1), &[], BLOCK).has_power()
        );
    }
}
