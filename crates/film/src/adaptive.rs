//! Adaptive sampling: which part of the passes each tile of an image gets, decided by passes that no image contains.
//!
//! The noise of a tile is measured in a pilot: a few passes far beyond those of any image. A sample is a pure function
//! of its place, and blocks are independent. So the pilot is independent of every sample that is kept. Whatever it
//! decides, each pixel is the mean of a fixed number of samples, without bias. A decision by samples that are kept
//! would be biased. A tile whose first samples have missed the light looks quiet, gets no more samples, and stays dark.
//!
//! The squared error of an image whose tile t has N passes of variance V is the sum of V/N over its pixels. For a given
//! sum of N it is least when N is proportional to sqrt(V) (Neyman 1934). So a tile gets the share sqrt(V / V of the
//! noisiest tile) of the passes that a round has. The pilot is itself noisy, and it may miss rare light. So the share
//! of a tile is at least 1/`MOST_SAVED`, and a tile counts as no quieter than its neighbourhood.

use std::borrow::Borrow;

use super::address::TileGrid;
use super::node::Node;
use super::sampling::Sampling;

/// The first sample of the pilot, and so the first that no image may contain: more than an image has, and half of all.
const FIRST_PILOT_SAMPLE: u32 = 1 << 31;

/// The round whose work the pilot is: the second, so that an image of one pass comes before it.
pub const PILOT_ROUND: u32 = 1;

/// Most passes of a pilot. More would cost more than they tell.
const MOST_PILOT_PASSES: u32 = 8;

/// Passes of an image to one of its pilot.
const PASSES_TO_PILOT_PASS: u32 = 16;

/// The noisiest tile gets at most this many times the passes of a tile that looks quiet.
const MOST_SAVED: u32 = 8;

/// The part of the passes that a tile gets, more than nothing and at most all, in units of 1/[`Share::ALL`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Share(u32);

impl Share {
    /// All passes, in units.
    pub const ALL: u32 = 1 << 16;

    /// A share of this many units; `None` for no unit and for more than [`Self::ALL`].
    pub fn new(units: u32) -> Option<Self> {
        (1..=Self::ALL).contains(&units).then_some(Self(units))
    }

    /// How many units it is.
    pub fn units(self) -> u32 {
        self.0
    }
}

/// How the passes of a job are shared out among the tiles of its images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adaptation {
    sampling: Sampling,
    fewest_passes: u32,
    pilot_passes: u32,
}

impl Adaptation {
    /// For images of at most `passes` passes, in which each pixel has at least `fewest_blocks` blocks. `None` where
    /// that is all of them, so that there is nothing to share out.
    pub fn new(sampling: Sampling, passes: u32, fewest_blocks: u32) -> Option<Self> {
        let fewest_passes = sampling.passes_per_block().saturating_mul(fewest_blocks);
        let pilot_passes = (passes / PASSES_TO_PILOT_PASS).clamp(2, MOST_PILOT_PASSES);
        (fewest_passes < passes).then_some(Self { sampling, fewest_passes, pilot_passes })
    }

    /// Passes that every tile gets before any gets more.
    pub fn fewest_passes(&self) -> u32 {
        self.fewest_passes
    }

    /// How many passes the pilot has.
    pub fn pilot_passes(&self) -> u32 {
        self.pilot_passes
    }

    /// The passes of the pilot: each the first of a block, and no two in neighbouring blocks, so that they are
    /// independent and never merge.
    pub fn pilot(&self) -> impl Iterator<Item = u32> + use<> {
        let (first, passes_per_block) = (first_pilot_pass(&self.sampling), self.sampling.passes_per_block());
        (0..self.pilot_passes).map(move |number| first + 2 * number * passes_per_block)
    }

    /// Passes of a tile at a round of `round_passes`: its share in whole blocks, so that every sample counts in the
    /// standard error, but all of them while they are few.
    pub fn passes(&self, share: Share, round_passes: u32) -> u32 {
        let per_block = u64::from(self.sampling.passes_per_block());
        let own = (u64::from(round_passes) * u64::from(share.0)).div_ceil(u64::from(Share::ALL));
        let whole = u32::try_from(own.next_multiple_of(per_block)).unwrap_or(u32::MAX);
        whole.max(self.fewest_passes).min(round_passes)
    }
}

/// The first pass that no image may contain.
pub fn first_pilot_pass(sampling: &Sampling) -> u32 {
    FIRST_PILOT_SAMPLE.div_ceil(sampling.samples_per_block()) * sampling.passes_per_block()
}

/// The noise of a tile: the variance of the sums of a pass, of which there are at least two, mean over its pixels and
/// channels.
pub fn noise(pilot: &[impl Borrow<Node>]) -> f64 {
    let passes: Vec<&[f32]> = pilot.iter().map(|node| node.borrow().layers().beauty.as_flattened()).collect();
    let numbers = passes.first().map_or(0, |pass| pass.len());
    let count = passes.len() as f64;
    let mut squares = 0.0;
    for index in 0..numbers {
        let value = |pass: &&[f32]| f64::from(pass[index]);
        let mean = passes.iter().map(value).sum::<f64>() / count;
        squares += passes.iter().map(value).map(|value| (value - mean) * (value - mean)).sum::<f64>();
    }
    squares / ((count - 1.0).max(1.0) * numbers.max(1) as f64)
}

/// The share of each tile of a frame, in the order of the tiles, from the noise of each tile of the camera plane. All
/// of them get all passes where no noise has been seen: a pilot that has met no light does not know where it falls. The
/// light plane gets all passes in any case.
pub fn shares(grid: &TileGrid, noise: &[f64]) -> Vec<Share> {
    let noise: Vec<f64> = (0..grid.camera_tiles()).map(|tile| cautious(grid, noise, tile)).collect();
    let most = noise.iter().copied().fold(0.0, f64::max);
    let share = |noise: f64| {
        let units = f64::from(Share::ALL) * (noise / most).sqrt();
        // A most of zero makes it no number, which is no lower bound.
        Share(if units < f64::from(Share::ALL) {
            (units.ceil() as u32).max(Share::ALL / MOST_SAVED)
        } else {
            Share::ALL
        })
    };
    let light = grid.light_tiles().map(|_| Share(Share::ALL));
    noise.into_iter().map(share).chain(light).collect()
}

/// The noise of a tile, but no less than that of the tile and its neighbours together.
fn cautious(grid: &TileGrid, noise: &[f64], tile: u32) -> f64 {
    let of = |tile: u32| noise.get(tile as usize).copied().unwrap_or(0.0);
    let (column, row) = (tile % grid.columns(), tile / grid.columns());
    let around = |place: u32, count: u32| place.saturating_sub(1)..(place + 2).min(count);
    let (mut sum, mut pixels) = (0.0, 0.0);
    for row in around(row, grid.rows()) {
        for column in around(column, grid.columns()) {
            let neighbour = row * grid.columns() + column;
            let own = grid.tile(neighbour).map_or(0, |tile| tile.pixels()) as f64;
            sum += of(neighbour) * own;
            pixels += own;
        }
    }
    of(tile).max(sum / pixels)
}

#[cfg(test)]
mod tests;
