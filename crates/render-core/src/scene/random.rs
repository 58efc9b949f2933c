//! Random numbers for what scenes are computed from: SplitMix64 (Steele et al. 2014), by a counter.

use std::f64::consts::TAU;

/// A stream of random numbers.
pub(super) struct Random {
    state: u64,
}

impl Random {
    /// The stream with this number of those of a seed.
    pub(super) fn new(seed: u64, stream: u64) -> Self {
        Self { state: mix(mix(seed) ^ stream) }
    }

    /// Uniform between `from` and `to`.
    pub(super) fn between(&mut self, from: f64, to: f64) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let unit = (mix(self.state) >> 11) as f64 / (1_u64 << 53) as f64;
        from + (to - from) * unit
    }

    /// A random angle.
    pub(super) fn phase(&mut self) -> f64 {
        self.between(0.0, TAU)
    }
}

fn mix(value: u64) -> u64 {
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}
