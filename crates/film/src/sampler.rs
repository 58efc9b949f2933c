//! Random numbers: a pure function of (seed, frame, pixel, sample, dimension).
//!
//! A camera sample draws its numbers from one point of an Owen-scrambled Sobol sequence, one dimension for each number.
//! The crate `sobol_burley` implements it (Burley 2020, "Practical Hash-based Owen Scrambling"). Every aligned block of
//! samples has a scramble of its own. So the means of the blocks are independent, and their spread measures the error
//! of the image. Solvers need an unknown number of random numbers: seeds of Newton's method, trials of an inverse
//! probability. They draw from a [`TrialStream`], which never ends and is independent of the Sobol point.
//!
//! Keys are mixed by Philox4x32-10 (Salmon et al. 2011, "Parallel Random Numbers: As Easy as 1, 2, 3"), the standard
//! counter-based generator. It is a bijection of 128-bit counters under a 64-bit key. Every bit of the output depends
//! on every bit of the input. The faster PCG4D was rejected because its low bits do not depend on the high bits of its
//! input.

use glam::DVec2;
use sobol_burley::{NUM_DIMENSIONS, sample_4d};

/// The longest run of samples that the Sobol sequence covers.
const SOBOL_SAMPLES: u32 = 1 << 16;

/// Tells the keys of the light plane from those of pixels.
const LIGHT_PLANE: u32 = 1;

/// What seeds the random numbers of a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplerSettings {
    /// Seed of the scene.
    pub seed: u64,
    /// Samples that share one scramble; 0 is taken as 1.
    pub samples_per_block: u32,
}

/// What a number drawn from the counter hash is for; keeps the streams apart.
#[derive(Clone, Copy)]
enum Purpose {
    Scramble,
    Trials,
    LateDimension,
    Sibling,
}

/// The random numbers of one camera sample.
#[derive(Clone, Debug)]
pub struct SampleStream {
    pixel_key: [u32; 2],
    sample: u32,
    sobol_index: u32,
    sobol_seed: u32,
    dimension: u32,
    /// The four Sobol dimensions that `dimension` lies in, once its first has been drawn.
    sobol_values: [f32; 4],
    sobol_set: Option<u32>,
}

impl SampleStream {
    /// The numbers of sample `sample` at `pixel` (column, row) of `frame`.
    #[inline]
    pub fn new(settings: &SamplerSettings, frame: u32, pixel: [u32; 2], sample: u32) -> Self {
        let seed_key = [settings.seed as u32, (settings.seed >> 32) as u32];
        let [key_low, key_high, ..] = philox(seed_key, [pixel[0], pixel[1], frame, 0]);
        let pixel_key = [key_low, key_high];

        let samples_per_block = settings.samples_per_block.max(1);
        let block = sample / samples_per_block;
        let index_in_block = sample % samples_per_block;
        // A block longer than the sequence is cut into runs, each with its own scramble.
        let run = index_in_block / SOBOL_SAMPLES;
        let [sobol_seed, ..] = philox(pixel_key, counter(block, run, 0, Purpose::Scramble));

        Self {
            pixel_key,
            sample,
            sobol_index: index_in_block % SOBOL_SAMPLES,
            sobol_seed,
            dimension: 0,
            sobol_values: [0.0; 4],
            sobol_set: None,
        }
    }

    /// The numbers of a light subpath, the `number`-th of a pass of the light plane of `frame`. A pass is a sequence of
    /// its own, so that passes are independent.
    #[inline]
    pub fn of_light(seed: u64, frame: u32, pass: u32, number: u64) -> Self {
        let [key_low, key_high, ..] =
            philox([seed as u32, (seed >> 32) as u32], [pass, (number >> 32) as u32, frame, LIGHT_PLANE]);
        let number = number as u32;
        let pixel_key = [key_low, key_high];
        let [sobol_seed, ..] = philox(pixel_key, counter(number / SOBOL_SAMPLES, 0, 0, Purpose::Scramble));
        let sobol_index = number % SOBOL_SAMPLES;
        Self {
            pixel_key,
            sample: number,
            sobol_index,
            sobol_seed,
            dimension: 0,
            sobol_values: [0.0; 4],
            sobol_set: None,
        }
    }

    /// The next dimension, in [0, 1).
    #[inline]
    pub fn next_1d(&mut self) -> f64 {
        let dimension = self.take_dimension();
        if dimension >= NUM_DIMENSIONS {
            let words = philox(self.pixel_key, counter(self.sample, dimension, 0, Purpose::LateDimension));
            return unit_interval(words[0], words[1]);
        }
        let set = dimension / 4;
        if self.sobol_set != Some(set) {
            self.sobol_values = sample_4d(self.sobol_index, set, self.sobol_seed);
            self.sobol_set = Some(set);
        }
        f64::from(self.sobol_values[dimension as usize % 4])
    }

    /// The next two dimensions, each in [0, 1).
    #[inline]
    pub fn next_2d(&mut self) -> DVec2 {
        let x = self.next_1d();
        DVec2::new(x, self.next_1d())
    }

    /// An endless stream of its own, which takes one dimension whatever is drawn from it.
    #[inline]
    pub fn trials(&mut self) -> TrialStream {
        TrialStream {
            pixel_key: self.pixel_key,
            sample: self.sample,
            dimension: self.take_dimension(),
            drawn: 0,
            words: [0; 4],
        }
    }

    /// The numbers of a second walk of the same sample, independent of these, with a Sobol point of their own.
    #[inline]
    #[must_use]
    pub fn sibling(&self) -> Self {
        let [key_low, key_high, ..] = philox(self.pixel_key, counter(0, 0, 0, Purpose::Sibling));
        let pixel_key = [key_low, key_high];
        let [sobol_seed, ..] = philox(pixel_key, counter(self.sobol_seed, 0, 0, Purpose::Scramble));
        Self { pixel_key, sobol_seed, dimension: 0, sobol_set: None, ..self.clone() }
    }

    fn take_dimension(&mut self) -> u32 {
        let dimension = self.dimension;
        self.dimension += 1;
        dimension
    }
}

/// Independent uniform numbers without end, keyed by (seed, frame, pixel, sample, dimension).
#[derive(Clone, Debug)]
pub struct TrialStream {
    pixel_key: [u32; 2],
    sample: u32,
    dimension: u32,
    drawn: u64,
    words: [u32; 4],
}

impl TrialStream {
    /// The next number, in [0, 1), with 53 random bits.
    #[inline]
    pub fn next_f64(&mut self) -> f64 {
        let [first, second] = if self.drawn.is_multiple_of(2) {
            let count = self.drawn / 2;
            self.words = philox(self.pixel_key, counter(self.sample, self.dimension, count, Purpose::Trials));
            [self.words[0], self.words[1]]
        } else {
            [self.words[2], self.words[3]]
        };
        self.drawn += 1;
        unit_interval(first, second)
    }
}

/// The counter of the `count`-th draw for (`index`, `dimension`); distinct for distinct arguments up to 2^62 draws.
fn counter(index: u32, dimension: u32, count: u64, purpose: Purpose) -> [u32; 4] {
    [index, dimension, count as u32, ((count >> 32) as u32) << 2 | purpose as u32]
}

/// The number in [0, 1) whose 53 bits are the highest of the two words.
fn unit_interval(high: u32, low: u32) -> f64 {
    const SCALE: f64 = 1.0 / (1u64 << 53) as f64;
    ((u64::from(high) << 32 | u64::from(low)) >> 11) as f64 * SCALE
}

/// Philox4x32-10 (Salmon et al. 2011, section 3.3 and table 2).
fn philox(key: [u32; 2], counter: [u32; 4]) -> [u32; 4] {
    const MULTIPLIERS: [u64; 2] = [0xD251_1F53, 0xCD9E_8D57];
    const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
    let mut key = key;
    let mut words = counter;
    for _ in 0..10 {
        let product0 = MULTIPLIERS[0] * u64::from(words[0]);
        let product1 = MULTIPLIERS[1] * u64::from(words[2]);
        words = [
            (product1 >> 32) as u32 ^ words[1] ^ key[0],
            product1 as u32,
            (product0 >> 32) as u32 ^ words[3] ^ key[1],
            product0 as u32,
        ];
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: SamplerSettings = SamplerSettings { seed: 7, samples_per_block: 256 };

    /// Pearson's statistic of `values` in [0, 1) over `bins` equal bins.
    fn chi_square(values: impl Iterator<Item = f64>, bins: usize) -> f64 {
        let mut counts = vec![0u64; bins];
        for value in values {
            assert!((0.0..1.0).contains(&value), "{value} is outside [0, 1)");
            counts[(value * bins as f64) as usize] += 1;
        }
        let expected = counts.iter().sum::<u64>() as f64 / bins as f64;
        counts.iter().map(|&count| (count as f64 - expected) * (count as f64 - expected) / expected).sum()
    }

    /// Six standard deviations above the mean of the chi-square distribution with `bins - 1` degrees of freedom.
    fn chi_square_limit(bins: usize) -> f64 {
        let degrees = (bins - 1) as f64;
        degrees + 6.0 * (2.0 * degrees).sqrt()
    }

    #[test]
    fn a_sibling_is_as_even_and_independent() {
        let settings = SamplerSettings { seed: 5, samples_per_block: 256 };
        let (mut cells, mut joint) = ([0_u32; 16], [0_u32; 64]);
        for sample in 0..256 {
            let mut stream = SampleStream::new(&settings, 0, [3, 4], sample);
            let mut sibling = stream.sibling();
            let (own, other) = (stream.next_1d(), sibling.next_2d());
            cells[(other.x * 4.0) as usize * 4 + (other.y * 4.0) as usize] += 1;
            joint[(own * 8.0) as usize * 8 + (other.x * 8.0) as usize] += 1;
        }
        assert_eq!(cells, [16; 16]);
        // Not as even as a Sobol point in two dimensions, and not on a line: Pearson's statistic of 64 cells.
        let pearson: f64 = joint.iter().map(|count| (f64::from(*count) - 4.0).powi(2) / 4.0).sum();
        assert!((10.0..140.0).contains(&pearson), "{pearson}");
    }

    #[test]
    fn light_subpaths_of_a_pass_are_even_and_those_of_passes_independent() {
        let numbers = |pass| (0..1 << 16).map(move |number| SampleStream::of_light(7, 0, pass, number).next_2d());
        for (cells, edge) in [(256, 16.0), (4096, 64.0)] {
            let cell = |point: DVec2| ((point.x * edge).floor() * edge + (point.y * edge).floor()) / f64::from(cells);
            assert_eq!(chi_square(numbers(3).map(cell), cells as usize), 0.0);
        }
        let pairs = numbers(0).zip(numbers(1)).map(|(a, b)| ((a.x * 16.0).floor() + b.x) / 16.0);
        assert!(chi_square(pairs, 256) < chi_square_limit(256));
        let long = SampleStream::of_light(7, 0, 0, u64::MAX).next_1d();
        assert!((0.0..1.0).contains(&long));
        let [near, far] = [9, 9 + (1 << 32)].map(|number| SampleStream::of_light(7, 0, 0, number).next_2d());
        assert_ne!(near, far);
    }

    #[test]
    fn philox_gives_the_known_answers_of_random123() {
        assert_eq!(philox([0; 2], [0; 4]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([!0; 2], [!0; 4]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        assert_eq!(
            philox([0xa409_3822, 0x299f_31d0], [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344]),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn the_same_key_gives_the_same_numbers() {
        let draw = || {
            let mut stream = SampleStream::new(&SETTINGS, 3, [11, 5], 1000);
            let mut numbers: Vec<f64> = (0..300).map(|_| stream.next_1d()).collect();
            let mut trials = stream.trials();
            numbers.extend((0..100).map(|_| trials.next_f64()));
            numbers
        };
        assert_eq!(draw(), draw());
    }

    #[test]
    fn first_number_is_uniform_over_pixels_frames_samples_and_seeds() {
        let first = |seed, frame, pixel, sample| {
            SampleStream::new(&SamplerSettings { seed, ..SETTINGS }, frame, pixel, sample).next_1d()
        };
        let limit = chi_square_limit(256);
        assert!(chi_square((0..1 << 16).map(|i| first(1, 0, [i % 256, i / 256], 0)), 256) < limit);
        assert!(chi_square((0..1 << 16).map(|i| first(1, i, [0, 0], 0)), 256) < limit);
        assert!(chi_square((0..1 << 16).map(|i| first(1, 0, [0, 0], i * 256)), 256) < limit);
        assert!(chi_square((0..1u64 << 16).map(|i| first(i, 0, [0, 0], 0)), 256) < limit);
        assert!(chi_square((0..1u64 << 16).map(|i| first(i << 48, 0, [0, 0], 0)), 256) < limit);
    }

    #[test]
    fn pairs_of_dimensions_are_uniform_in_the_square_over_pixels() {
        for skipped in [0, 1, 2, 63, 254, 255, 256, 400] {
            let pairs = (0..1 << 16).map(|i| {
                let mut stream = SampleStream::new(&SETTINGS, 0, [i % 256, i / 256], 3);
                for _ in 0..skipped {
                    stream.next_1d();
                }
                let pair = stream.next_2d();
                ((pair.x * 16.0).floor() + pair.y) / 16.0
            });
            assert!(chi_square(pairs, 256) < chi_square_limit(256), "dimensions {skipped} and the next");
        }
    }

    #[test]
    fn a_block_is_stratified_in_every_dimension_and_in_the_first_pair() {
        for block in 0..4 {
            let points: Vec<Vec<f64>> = (0..256)
                .map(|i| {
                    let mut stream = SampleStream::new(&SETTINGS, 0, [4, 9], block * 256 + i);
                    (0..256).map(|_| stream.next_1d()).collect()
                })
                .collect();
            for dimension in 0..256 {
                let statistic = chi_square(points.iter().map(|point| point[dimension]), 256);
                assert_eq!(statistic, 0.0, "dimension {dimension} does not have one sample in each 256th");
            }
            let cells = points.iter().map(|point| ((point[0] * 16.0).floor() + point[1]) / 16.0);
            assert_eq!(chi_square(cells, 256), 0.0, "one sample in each cell of 16 x 16");
        }
    }

    #[test]
    fn means_of_blocks_are_uncorrelated() {
        // Of a function that is no sum of one-dimensional parts; correlation of n pairs has standard deviation n^-1/2.
        let block_mean = |pixel: u32, block: u32| {
            let sum: f64 = (0..16)
                .map(|i| {
                    let settings = SamplerSettings { samples_per_block: 16, ..SETTINGS };
                    let point = SampleStream::new(&settings, 0, [pixel, 0], block * 16 + i).next_2d();
                    if point.x * point.y < 0.3 { 1.0 } else { 0.0 }
                })
                .sum();
            sum / 16.0
        };
        let pairs: Vec<[f64; 2]> = (0..20_000).map(|pixel| [block_mean(pixel, 0), block_mean(pixel, 1)]).collect();
        let count = pairs.len() as f64;
        let mean = [0, 1].map(|side| pairs.iter().map(|pair| pair[side]).sum::<f64>() / count);
        let covariance = |a: usize, b: usize| {
            pairs.iter().map(|pair| (pair[a] - mean[a]) * (pair[b] - mean[b])).sum::<f64>() / count
        };
        let correlation = covariance(0, 1) / (covariance(0, 0) * covariance(1, 1)).sqrt();
        assert!(correlation.abs() < 5.0 / count.sqrt(), "correlation {correlation}");
    }

    #[test]
    fn samples_past_the_end_of_the_sobol_sequence_are_uniform() {
        let settings = SamplerSettings { samples_per_block: 1 << 20, ..SETTINGS };
        let values = (0..1 << 18).map(|i| SampleStream::new(&settings, 0, [0, 0], (1 << 16) - 1000 + i).next_1d());
        assert!(chi_square(values, 256) < chi_square_limit(256));
    }

    #[test]
    fn a_flipped_bit_of_any_key_flips_half_of_the_bits_of_a_trial() {
        let bits = |seed: u64, key: [u32; 5]| {
            let mut stream = SampleStream::new(&SamplerSettings { seed, ..SETTINGS }, key[0], [key[1], key[2]], key[3]);
            stream.dimension = key[4];
            (stream.trials().next_f64() * (1u64 << 53) as f64) as u64
        };
        let trials = 256;
        for bit in 0..224 {
            let flipped: u32 = (0..trials)
                .map(|i| {
                    let [a, b, c, d] = philox([1, 2], [i, 0, 0, 0]);
                    let key = [a, b, c, d, i];
                    let seed = u64::from(d) << 32 | u64::from(a);
                    let mut other = key;
                    let mut other_seed = seed;
                    match bit {
                        0..64 => other_seed ^= 1 << bit,
                        _ => other[(bit - 64) / 32] ^= 1 << (bit % 32),
                    }
                    (bits(seed, key) ^ bits(other_seed, other)).count_ones()
                })
                .sum();
            let count = f64::from(trials) * 53.0;
            let deviation = (f64::from(flipped) - count / 2.0) / (count / 4.0).sqrt();
            assert!(deviation.abs() < 6.0, "input bit {bit}: {flipped} of {count} output bits flipped");
        }
    }

    #[test]
    fn trials_are_uniform_and_independent_of_the_sobol_draws() {
        let mut trials = SampleStream::new(&SETTINGS, 0, [1, 2], 3).trials();
        assert!(chi_square((0..1 << 18).map(|_| trials.next_f64()), 1024) < chi_square_limit(1024));

        let pairs = (0..1 << 16).map(|i| {
            let mut stream = SampleStream::new(&SETTINGS, 0, [i % 256, i / 256], 3);
            let draw = stream.next_1d();
            ((draw * 16.0).floor() + stream.trials().next_f64()) / 16.0
        });
        assert!(chi_square(pairs, 256) < chi_square_limit(256));
    }

    #[test]
    fn drawing_trials_does_not_change_the_later_dimensions() {
        let after = |draws: usize| {
            let mut stream = SampleStream::new(&SETTINGS, 0, [8, 8], 40);
            let mut trials = stream.trials();
            for _ in 0..draws {
                trials.next_f64();
            }
            stream.next_1d()
        };
        assert_eq!(after(0), after(17));
    }

    #[test]
    fn no_two_trial_streams_of_a_tile_start_alike() {
        let mut starts: Vec<u64> = Vec::new();
        for sample in 0..16 {
            for i in 0..64 * 64 {
                let mut stream = SampleStream::new(&SETTINGS, 0, [i % 64, i / 64], sample);
                starts.extend([stream.trials(), stream.trials()].map(|mut trials| trials.next_f64().to_bits()));
            }
        }
        let count = starts.len();
        starts.sort_unstable();
        starts.dedup();
        // 2^17 draws of 53 bits: a chance of 2^-20 that two agree.
        assert_eq!(starts.len(), count);
    }
}
