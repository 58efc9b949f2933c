//! Random numbers of a piece: SplitMix64 (Steele et al. 2014), started from the seed and the place of the piece. A
//! piece keeps its numbers when other pieces come or go.

/// A stream of random numbers.
pub(crate) struct Random {
    state: u64,
}

impl Random {
    /// The stream of a place, whose parts are `key`.
    pub(crate) fn new(seed: u64, key: &[u64]) -> Self {
        Self { state: key.iter().fold(mix(seed ^ 0x6c65_6164), |state, &part| mix(state ^ mix(part))) }
    }

    /// Uniform in `[0, 1)`.
    pub(crate) fn unit(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix(self.state) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Normal with unit variance, cut off at three standard deviations.
    pub(crate) fn normal(&mut self) -> f64 {
        let (radius, angle) = (1.0 - self.unit(), self.unit());
        // Box and Muller (1958).
        let normal = (-2.0 * libm::log(radius)).sqrt() * libm::cos(std::f64::consts::TAU * angle);
        normal.clamp(-3.0, 3.0)
    }
}

fn mix(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_uniform_and_normal() {
        let mut random = Random::new(7, &[1, 2]);
        let count = 20_000;
        let mean = (0..count).map(|_| random.unit()).sum::<f64>() / f64::from(count);
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        let square = (0..count).map(|_| random.normal().powi(2)).sum::<f64>() / f64::from(count);
        assert!((square - 1.0).abs() < 0.05, "{square}");
    }

    #[test]
    fn streams_differ_by_seed_and_key() {
        let first = |seed, key: &[u64]| Random::new(seed, key).unit();
        assert_eq!(first(1, &[2, 3]), first(1, &[2, 3]));
        assert_ne!(first(1, &[2, 3]), first(1, &[3, 2]));
        assert_ne!(first(1, &[2, 3]), first(2, &[2, 3]));
    }
}
