//! How the samples of a pixel are grouped: passes are the units of work, blocks the units of the error estimate.

use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::address::{NodeAddress, Plane};

/// Samples of a pixel in a pass, and in a block of samples that share one scramble.
///
/// A block is a power of two of passes, so that it is a node of the merge tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "UncheckedSampling")]
pub struct Sampling {
    samples_per_pass: u32,
    samples_per_block: u32,
}

/// Why two numbers are no [`Sampling`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SamplingError {
    /// A pass must have samples.
    #[error("samples_per_pass is 0; it must be at least 1")]
    EmptyPass,
    /// A block must be a node of the merge tree.
    #[error(
        "samples_per_block is {samples_per_block}; it must be a power of two times samples_per_pass \
         ({samples_per_pass})"
    )]
    BlockIsNoNode {
        /// Samples in a pass.
        samples_per_pass: u32,
        /// Samples in a block.
        samples_per_block: u32,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UncheckedSampling {
    samples_per_pass: u32,
    samples_per_block: u32,
}

impl TryFrom<UncheckedSampling> for Sampling {
    type Error = SamplingError;

    fn try_from(unchecked: UncheckedSampling) -> Result<Self, SamplingError> {
        Self::new(unchecked.samples_per_pass, unchecked.samples_per_block)
    }
}

impl fmt::Display for Sampling {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { samples_per_pass, samples_per_block } = self;
        write!(formatter, "{samples_per_pass} samples in a pass and {samples_per_block} in a block")
    }
}

impl Sampling {
    /// Groups of `samples_per_pass` and `samples_per_block`, the second a power of two times the first.
    ///
    /// # Errors
    ///
    /// [`SamplingError`] when they are no such numbers.
    pub fn new(samples_per_pass: u32, samples_per_block: u32) -> Result<Self, SamplingError> {
        if samples_per_pass == 0 {
            return Err(SamplingError::EmptyPass);
        }
        let passes = samples_per_block / samples_per_pass;
        if !samples_per_block.is_multiple_of(samples_per_pass) || !passes.is_power_of_two() {
            return Err(SamplingError::BlockIsNoNode { samples_per_pass, samples_per_block });
        }
        Ok(Self { samples_per_pass, samples_per_block })
    }

    /// Samples of a pixel in a pass.
    pub fn samples_per_pass(&self) -> u32 {
        self.samples_per_pass
    }

    /// Samples of a pixel in a block.
    pub fn samples_per_block(&self) -> u32 {
        self.samples_per_block
    }

    /// Passes in a block.
    pub fn passes_per_block(&self) -> u32 {
        self.samples_per_block / self.samples_per_pass
    }

    /// The level in the merge tree of a node that is one block.
    pub fn block_level(&self) -> u32 {
        self.passes_per_block().trailing_zeros()
    }

    /// Whether `pass` belongs to the frame's first block, over which first-hit layers are summed.
    pub fn is_in_first_block(&self, pass: u32) -> bool {
        pass < self.passes_per_block()
    }

    /// Whole blocks in the first `passes` passes of an aligned run.
    pub fn complete_blocks(&self, passes: u32) -> u32 {
        passes / self.passes_per_block()
    }

    /// Whether the node at `address` has at least one block, and so a second moment.
    pub fn has_moment(&self, address: NodeAddress) -> bool {
        address.level >= self.block_level()
    }

    /// Whether the node at `address` has passes of the frame's first block, and so first-hit layers, which only the
    /// camera plane has.
    pub fn has_first_hit(&self, address: NodeAddress, plane: Plane) -> bool {
        plane == Plane::Camera && self.is_in_first_block(address.passes().first)
    }

    /// Samples of the frame's first block among the first `passes` passes.
    pub fn first_hit_samples(&self, passes: u32) -> u32 {
        passes.min(self.passes_per_block()) * self.samples_per_pass
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_a_power_of_two_of_passes() {
        let sampling = Sampling::new(24, 96).unwrap();
        assert_eq!((sampling.passes_per_block(), sampling.block_level()), (4, 2));
        assert_eq!(Sampling::new(16, 16).unwrap().block_level(), 0);
        assert_eq!(Sampling::new(0, 256), Err(SamplingError::EmptyPass));
        for (pass, block) in [(16, 48), (16, 8), (16, 0), (16, 40)] {
            let expected = SamplingError::BlockIsNoNode { samples_per_pass: pass, samples_per_block: block };
            assert_eq!(Sampling::new(pass, block), Err(expected));
        }
    }

    #[test]
    fn an_impossible_grouping_is_not_read_from_json() {
        let read = |text| serde_json::from_str::<Sampling>(text);
        assert_eq!(
            read(r#"{"samples_per_pass":16,"samples_per_block":256}"#).unwrap(),
            Sampling::new(16, 256).unwrap()
        );
        let message = read(r#"{"samples_per_pass":16,"samples_per_block":40}"#).unwrap_err().to_string();
        assert!(message.contains("power of two times samples_per_pass (16)"), "{message}");
    }
}
