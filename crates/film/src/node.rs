//! Nodes of the merge tree: the sums of a tile over an aligned run of passes.
//!
//! A node holds sums over its samples, one number for each pixel and channel in 32-bit float. A single pass makes a
//! leaf. Every larger node is the sum of its two halves, left plus right. So its bits do not depend on who computed the
//! halves. Adding in pairs keeps the rounding error at O(log n).
//!
//! The error of an image is estimated from the spread of its block means (never from single samples, which a
//! low-discrepancy sequence makes dependent). So a node of one block or more also carries the second moment of its
//! block means, for beauty. It is the sum of `(block mean - mean)^2`. Moments are joined by the pairwise update of
//! Chan, Golub and LeVeque (1979). With equal counts of `n` blocks, `s` samples in each, and sums `A` and `B`, it reads
//! `M = M_A + M_B + (B - A)^2 / (2 n s^2)`.
//!
//! Where the scene has glass, a node also has the sums of the layer `caustic`, a part of beauty. It has no moment.
//!
//! The first hit of a camera ray (albedo, normal, depth) is needed for denoising only and converges fast. So it is
//! summed over the samples of the frame's first block only.

use glam::DVec3;
use thiserror::Error;

use super::address::{NodeAddress, PassRange, Tile};
use super::sampling::Sampling;

/// What the camera rays of one pass met first, summed over the samples of each pixel. A sample that meets nothing adds
/// zero to each.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstHitSums {
    /// Diffuse reflectance, for each pixel of the tile in rows from the top left.
    pub albedo: Vec<DVec3>,
    /// Unit normal in world space.
    pub normal: Vec<DVec3>,
    /// Distance along the camera ray, metres.
    pub depth: Vec<f64>,
}

/// The sums over the samples of one pass, for each pixel of the tile in rows from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct PassSums {
    /// Radiance, W/(m2 sr).
    pub beauty: Vec<DVec3>,
    /// The part of it that is caustic; present exactly where the tile has the layer ([`Tile::has_caustic`]).
    pub caustic: Option<Vec<DVec3>>,
    /// What the camera rays met first; present exactly for the passes of the camera plane in the frame's first block
    /// ([`Sampling::is_in_first_block`]).
    pub first_hit: Option<FirstHitSums>,
}

/// The first-hit layers of a node: sums over its samples in the frame's first block.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstHitLayers {
    /// Diffuse reflectance.
    pub albedo: Vec<[f32; 3]>,
    /// Unit normal in world space.
    pub normal: Vec<[f32; 3]>,
    /// Distance along the camera ray, metres.
    pub depth: Vec<f32>,
}

/// The layers of a node, one entry for each pixel of the tile in rows from the top left.
///
/// All values are finite: sums saturate at the largest float.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeLayers {
    /// Sums of radiance, W/(m2 sr).
    pub beauty: Vec<[f32; 3]>,
    /// Sums of squared differences between the block means of beauty and their mean; present for nodes of at least one
    /// block, and zero for exactly one.
    pub moment: Option<Vec<[f32; 3]>>,
    /// Sums of the part of the radiance that is caustic; present where the tile has the layer.
    pub caustic: Option<Vec<[f32; 3]>>,
    /// Present for nodes with passes of the frame's first block.
    pub first_hit: Option<FirstHitLayers>,
}

/// One tile over an aligned run of passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    address: NodeAddress,
    tile: Tile,
    sampling: Sampling,
    layers: NodeLayers,
}

/// Why layers do not make a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NodeError {
    /// The address has more passes than a frame can have, or a leaf was built for more than one pass.
    #[error("no such node: level {level}, index {index}")]
    NoSuchNode {
        /// Binary logarithm of the number of passes.
        level: u32,
        /// Which run of that length.
        index: u32,
    },
    /// A layer has too few or too many pixels.
    #[error("layer {layer} has {found} pixels; the tile has {expected}")]
    WrongPixelCount {
        /// The layer.
        layer: &'static str,
        /// Pixels in it.
        found: usize,
        /// Pixels of the tile.
        expected: usize,
    },
    /// The passes say that there is a layer and it is missing, or the other way round.
    #[error("layer {layer} is {found}; for these passes it must be {expected}")]
    WrongLayer {
        /// The layer.
        layer: &'static str,
        /// `present` or `absent`.
        found: &'static str,
        /// `present` or `absent`.
        expected: &'static str,
    },
    /// A value is infinite or not a number.
    #[error("layer {layer} has the value {value} at pixel ({x}, {y}); every value must be finite")]
    NotFinite {
        /// The layer.
        layer: &'static str,
        /// `NaN`, `inf` or `-inf`.
        value: NonFinite,
        /// Column of the pixel in the image.
        x: u32,
        /// Row of the pixel in the image.
        y: u32,
    },
    /// A sum of squares is negative.
    #[error("layer moment is negative at pixel ({x}, {y}); a sum of squares is at least 0")]
    NegativeMoment {
        /// Column of the pixel in the image.
        x: u32,
        /// Row of the pixel in the image.
        y: u32,
    },
}

/// A floating-point value that is no number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NonFinite {
    /// Not a number.
    NaN,
    /// Above every number.
    Infinity,
    /// Below every number.
    NegativeInfinity,
}

impl std::fmt::Display for NonFinite {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::NaN => "NaN",
            Self::Infinity => "inf",
            Self::NegativeInfinity => "-inf",
        })
    }
}

impl NonFinite {
    /// What `value` is; `None` for a number.
    pub fn of(value: f64) -> Option<Self> {
        match value {
            _ if value.is_finite() => None,
            _ if value.is_nan() => Some(Self::NaN),
            _ if value > 0.0 => Some(Self::Infinity),
            _ => Some(Self::NegativeInfinity),
        }
    }
}

/// Why two nodes do not merge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum MergeError {
    /// They are not the two halves of one node, or in the wrong order.
    #[error("nodes {left:?} and {right:?} are not the left and right half of one node")]
    NotSiblings {
        /// The node given as left.
        left: NodeAddress,
        /// The node given as right.
        right: NodeAddress,
    },
    /// They have different pixels or different numbers of samples in a pass or block.
    #[error("nodes {left:?} and {right:?} have different tiles or samplings")]
    DifferentGrids {
        /// The left node.
        left: NodeAddress,
        /// The right node.
        right: NodeAddress,
    },
}

impl Node {
    /// The leaf made of one pass. Sums are rounded once, to the nearest float.
    ///
    /// # Errors
    ///
    /// [`NodeError`] when the address is no leaf, a layer is missing or of the wrong size, or a value is not finite.
    pub fn leaf(address: NodeAddress, tile: Tile, sampling: Sampling, sums: &PassSums) -> Result<Self, NodeError> {
        if address.level != 0 {
            return Err(NodeError::NoSuchNode { level: address.level, index: address.index });
        }
        let triples = |layer, sums: &[DVec3]| -> Result<Vec<[f32; 3]>, NodeError> {
            for (pixel, sum) in sums.iter().enumerate() {
                for value in sum.to_array() {
                    check_finite(value, layer, &tile, pixel)?;
                }
            }
            Ok(sums.iter().map(|sum| sum.to_array().map(saturate)).collect())
        };
        let first_hit = match &sums.first_hit {
            None => None,
            Some(first_hit) => {
                for (pixel, &depth) in first_hit.depth.iter().enumerate() {
                    check_finite(depth, "depth", &tile, pixel)?;
                }
                Some(FirstHitLayers {
                    albedo: triples("albedo", &first_hit.albedo)?,
                    normal: triples("normal", &first_hit.normal)?,
                    depth: first_hit.depth.iter().copied().map(saturate).collect(),
                })
            }
        };
        let beauty = triples("beauty", &sums.beauty)?;
        let caustic = sums.caustic.as_ref().map(|caustic| triples("caustic", caustic)).transpose()?;
        let moment = (sampling.block_level() == 0).then(|| vec![[0.0; 3]; beauty.len()]);
        Self::from_layers(address, tile, sampling, NodeLayers { beauty, moment, caustic, first_hit })
    }

    /// The node with these layers, as they come from a file; everything that a node promises is checked.
    ///
    /// # Errors
    ///
    /// [`NodeError`] when the layers are not those of a node at `address`, or a value is impossible.
    pub fn from_layers(
        address: NodeAddress,
        tile: Tile,
        sampling: Sampling,
        layers: NodeLayers,
    ) -> Result<Self, NodeError> {
        if !address.exists() {
            return Err(NodeError::NoSuchNode { level: address.level, index: address.index });
        }
        check_presence("moment", layers.moment.is_some(), sampling.has_moment(address))?;
        check_presence("caustic", layers.caustic.is_some(), tile.has_caustic)?;
        check_presence("first hit", layers.first_hit.is_some(), sampling.has_first_hit(address, tile.plane))?;

        check_layer("beauty", layers.beauty.as_flattened(), 3, &tile)?;
        if let Some(moment) = &layers.moment {
            check_layer("moment", moment.as_flattened(), 3, &tile)?;
            if let Some(index) = moment.as_flattened().iter().position(|&value| value < 0.0) {
                let (x, y) = tile.pixel(index / 3);
                return Err(NodeError::NegativeMoment { x, y });
            }
        }
        if let Some(caustic) = &layers.caustic {
            check_layer("caustic", caustic.as_flattened(), 3, &tile)?;
        }
        if let Some(first_hit) = &layers.first_hit {
            check_layer("albedo", first_hit.albedo.as_flattened(), 3, &tile)?;
            check_layer("normal", first_hit.normal.as_flattened(), 3, &tile)?;
            check_layer("depth", &first_hit.depth, 1, &tile)?;
        }
        Ok(Self { address, tile, sampling, layers })
    }

    /// The parent of two halves: left plus right.
    ///
    /// # Errors
    ///
    /// [`MergeError`] when they are not the left and right half of one node.
    pub fn merge(left: Self, right: &Self) -> Result<Self, MergeError> {
        if !left.address.index.is_multiple_of(2) || left.address.sibling() != right.address {
            return Err(MergeError::NotSiblings { left: left.address, right: right.address });
        }
        if left.tile != right.tile || left.sampling != right.sampling {
            return Err(MergeError::DifferentGrids { left: left.address, right: right.address });
        }

        let address = left.address.parent();
        let Self { tile, sampling, layers: NodeLayers { mut beauty, moment, caustic, first_hit }, .. } = left;
        let moment = match (moment, &right.layers.moment) {
            (Some(mut moment), Some(right_moment)) => {
                let blocks = sampling.complete_blocks(right.address.passes().count);
                let joined = BlockCounts { left: blocks, right: blocks };
                add_moments(&mut moment, right_moment, &beauty, &right.layers.beauty, sampling, joined);
                Some(moment)
            }
            // Two halves of one block.
            _ => sampling.has_moment(address).then(|| vec![[0.0; 3]; beauty.len()]),
        };
        add(beauty.as_flattened_mut(), right.layers.beauty.as_flattened());
        let caustic = caustic.map(|mut left| {
            if let Some(right) = &right.layers.caustic {
                add(left.as_flattened_mut(), right.as_flattened());
            }
            left
        });
        let first_hit = first_hit.map(|mut left| {
            if let Some(right) = &right.layers.first_hit {
                left.add(right);
            }
            left
        });
        Ok(Self { address, tile, sampling, layers: NodeLayers { beauty, moment, caustic, first_hit } })
    }

    /// Which node it is.
    pub fn address(&self) -> NodeAddress {
        self.address
    }

    /// Its passes.
    pub fn passes(&self) -> PassRange {
        self.address.passes()
    }

    /// Its pixels.
    pub fn tile(&self) -> Tile {
        self.tile
    }

    /// How its samples are grouped.
    pub fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// Its sums.
    pub fn layers(&self) -> &NodeLayers {
        &self.layers
    }

    /// Gives up the address for the sums.
    pub fn into_layers(self) -> NodeLayers {
        self.layers
    }

    /// Samples in each pixel.
    pub fn samples(&self) -> u64 {
        u64::from(self.passes().count) * u64::from(self.sampling.samples_per_pass())
    }

    /// Bytes of its layers in memory.
    pub fn bytes(&self) -> usize {
        let first_hit = if self.layers.first_hit.is_some() { 7 } else { 0 };
        let moment = if self.layers.moment.is_some() { 3 } else { 0 };
        let caustic = if self.layers.caustic.is_some() { 3 } else { 0 };
        self.tile.pixels() * 4 * (3 + moment + caustic + first_hit)
    }
}

impl FirstHitLayers {
    /// Adds the sums of `other`.
    pub(super) fn add(&mut self, other: &Self) {
        add(self.albedo.as_flattened_mut(), other.albedo.as_flattened());
        add(self.normal.as_flattened_mut(), other.normal.as_flattened());
        add(&mut self.depth, &other.depth);
    }
}

/// Numbers of blocks in two runs that are joined.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockCounts {
    pub(super) left: u32,
    pub(super) right: u32,
}

/// Adds `other` to `sums`. The result saturates, so that finite sums stay finite.
pub(super) fn add(sums: &mut [f32], other: &[f32]) {
    for (sum, other) in sums.iter_mut().zip(other) {
        *sum = (*sum + other).clamp(f32::MIN, f32::MAX);
    }
}

/// Joins the second moments of two runs of blocks, given the beauty sums over both runs before they are added (Chan,
/// Golub and LeVeque 1979, equation 2.1b).
pub(super) fn add_moments(
    moment: &mut [[f32; 3]],
    other_moment: &[[f32; 3]],
    beauty: &[[f32; 3]],
    other_beauty: &[[f32; 3]],
    sampling: Sampling,
    blocks: BlockCounts,
) {
    let (left, right) = (f64::from(blocks.left), f64::from(blocks.right));
    let samples_per_block = f64::from(sampling.samples_per_block());
    let left_scale = 1.0 / (left * samples_per_block);
    let right_scale = 1.0 / (right * samples_per_block);
    let weight = left * right / (left + right);

    let moments = moment.as_flattened_mut().iter_mut().zip(other_moment.as_flattened());
    let sums = beauty.as_flattened().iter().zip(other_beauty.as_flattened());
    for ((moment, &other_moment), (&sum, &other_sum)) in moments.zip(sums) {
        let difference = f64::from(other_sum) * right_scale - f64::from(sum) * left_scale;
        let joined = f64::from(*moment) + f64::from(other_moment) + difference * difference * weight;
        *moment = (joined as f32).min(f32::MAX);
    }
}

fn saturate(sum: f64) -> f32 {
    (sum as f32).clamp(f32::MIN, f32::MAX)
}

fn check_presence(layer: &'static str, found: bool, expected: bool) -> Result<(), NodeError> {
    let word = |present: bool| if present { "present" } else { "absent" };
    if found != expected {
        return Err(NodeError::WrongLayer { layer, found: word(found), expected: word(expected) });
    }
    Ok(())
}

fn check_layer(layer: &'static str, values: &[f32], channels: usize, tile: &Tile) -> Result<(), NodeError> {
    if values.len() != tile.pixels() * channels {
        return Err(NodeError::WrongPixelCount { layer, found: values.len() / channels, expected: tile.pixels() });
    }
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => check_finite(f64::from(values[index]), layer, tile, index / channels),
    }
}

fn check_finite(value: f64, layer: &'static str, tile: &Tile, pixel: usize) -> Result<(), NodeError> {
    match NonFinite::of(value) {
        None => Ok(()),
        Some(value) => {
            let (x, y) = tile.pixel(pixel);
            Err(NodeError::NotFinite { layer, value, x, y })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_nodes::{noise_node, noise_pass};

    const TILE: Tile = Tile::new([10, 20], [5, 3]);

    fn address(level: u32, index: u32) -> NodeAddress {
        NodeAddress { frame: 0, tile: 0, level, index }
    }

    fn sampling() -> Sampling {
        Sampling::new(16, 64).unwrap()
    }

    fn constant_leaf(pass: u32, value: f64) -> Node {
        let sums = PassSums { beauty: vec![DVec3::splat(value); TILE.pixels()], caustic: None, first_hit: None };
        Node::leaf(address(0, pass), TILE, sampling(), &sums).unwrap()
    }

    #[test]
    fn moment_is_the_sum_of_squared_differences_of_block_means() {
        // Blocks of four passes, 64 samples: sums over blocks 64, 192, 0, 320, so means 1, 3, 0, 5 about 2.25.
        let means = [1.0, 3.0, 0.0, 5.0];
        let sampling = sampling();
        let passes: Vec<Node> = (0..16).map(|pass| constant_leaf(16 + pass, means[pass as usize / 4] * 16.0)).collect();
        let merge_level = |nodes: Vec<Node>| -> Vec<Node> {
            nodes.chunks(2).map(|pair| Node::merge(pair[0].clone(), &pair[1]).unwrap()).collect()
        };
        let halves = merge_level(passes);
        assert!(halves.iter().all(|node| node.layers().moment.is_none()), "a node below a block has no moment");
        let blocks = merge_level(halves);
        assert!(blocks.iter().all(|node| node.layers().moment.as_ref().unwrap().iter().all(|m| *m == [0.0; 3])));
        let pairs = merge_level(blocks);
        assert_eq!(pairs[0].layers().moment.as_ref().unwrap()[0], [2.0; 3]);
        assert_eq!(pairs[1].layers().moment.as_ref().unwrap()[0], [12.5; 3]);
        let all = merge_level(pairs).remove(0);
        let expected: f64 = means.iter().map(|mean| (mean - 2.25) * (mean - 2.25)).sum();
        assert_eq!(all.layers().moment.as_ref().unwrap()[7], [expected as f32; 3]);
        assert_eq!(all.layers().beauty[7], [(64.0 + 192.0 + 320.0) as f32; 3]);
        assert_eq!((all.address(), all.samples()), (address(4, 1), 256));
        assert_eq!(all.sampling(), sampling);
    }

    #[test]
    fn first_hit_layers_are_summed_over_the_first_block_only() {
        let node = noise_node(address(4, 0), TILE, sampling());
        let block = noise_node(address(2, 0), TILE, sampling());
        assert_eq!(node.layers().first_hit, block.layers().first_hit);
        assert!(noise_node(address(2, 1), TILE, sampling()).layers().first_hit.is_none());
        assert!(noise_node(address(0, 3), TILE, sampling()).layers().first_hit.is_some());

        let passes = [0, 1, 2, 3].map(|pass| noise_pass(address(0, pass), TILE, sampling()));
        let depth = passes.each_ref().map(|node| node.layers().first_hit.as_ref().unwrap().depth[4]);
        let sum = (depth[0] + depth[1]) + (depth[2] + depth[3]);
        assert_eq!(block.layers().first_hit.as_ref().unwrap().depth[4], sum);
    }

    #[test]
    fn only_the_left_and_right_half_of_one_node_merge() {
        let node = |level, index| noise_node(address(level, index), TILE, sampling());
        assert!(Node::merge(node(1, 2), &node(1, 3)).is_ok());
        for (left, right) in [((1, 3), (1, 2)), ((1, 1), (1, 2)), ((1, 2), (0, 3)), ((1, 2), (1, 2))] {
            let error = Node::merge(node(left.0, left.1), &node(right.0, right.1)).unwrap_err();
            assert!(matches!(error, MergeError::NotSiblings { .. }), "{left:?} {right:?}: {error}");
        }
        let other_frame = noise_node(NodeAddress { frame: 1, ..address(1, 3) }, TILE, sampling());
        assert!(matches!(Node::merge(node(1, 2), &other_frame), Err(MergeError::NotSiblings { .. })));
        let other_sampling = noise_node(address(1, 3), TILE, Sampling::new(16, 128).unwrap());
        assert!(matches!(Node::merge(node(1, 2), &other_sampling), Err(MergeError::DifferentGrids { .. })));
        let other_tile = noise_node(address(1, 3), Tile { x: 0, ..TILE }, sampling());
        assert!(matches!(Node::merge(node(1, 2), &other_tile), Err(MergeError::DifferentGrids { .. })));
    }

    #[test]
    fn impossible_layers_are_refused_by_name() {
        let good = noise_node(address(2, 0), TILE, sampling());
        let check = |address, change: &dyn Fn(&mut NodeLayers), expected: &str| {
            let mut layers = good.layers().clone();
            change(&mut layers);
            let message = Node::from_layers(address, TILE, sampling(), layers).unwrap_err().to_string();
            assert!(message.contains(expected), "{message:?} does not say {expected:?}");
        };
        let at = address(2, 0);
        assert_eq!(Node::from_layers(at, TILE, sampling(), good.layers().clone()).unwrap(), good);
        check(at, &|layers| layers.beauty[8][1] = f32::NAN, "layer beauty has the value NaN at pixel (13, 21)");
        check(at, &|layers| layers.beauty[0][2] = f32::NEG_INFINITY, "the value -inf at pixel (10, 20)");
        check(at, &|layers| layers.moment.as_mut().unwrap()[14][0] = -1e-30, "moment is negative at pixel (14, 22)");
        check(at, &|layers| layers.moment = None, "layer moment is absent; for these passes it must be present");
        check(at, &|layers| layers.first_hit = None, "layer first hit is absent");
        check(at, &|layers| _ = layers.beauty.pop(), "layer beauty has 14 pixels; the tile has 15");
        check(at, &|layers| layers.first_hit.as_mut().unwrap().depth.push(0.0), "depth has 16 pixels");
        check(address(2, 1), &|_| (), "layer first hit is present; for these passes it must be absent");
        check(address(1, 0), &|_| (), "layer moment is present; for these passes it must be absent");
        check(address(32, 0), &|_| (), "no such node: level 32, index 0");
        check(address(31, 2), &|_| (), "no such node: level 31, index 2");
    }

    #[test]
    fn a_leaf_refuses_a_value_that_is_no_number() {
        let mut sums = PassSums { beauty: vec![DVec3::ONE; TILE.pixels()], caustic: None, first_hit: None };
        sums.beauty[6].z = f64::NAN;
        let error = Node::leaf(address(0, 9), TILE, sampling(), &sums).unwrap_err();
        assert_eq!(error, NodeError::NotFinite { layer: "beauty", value: NonFinite::NaN, x: 11, y: 21 });
    }

    #[test]
    fn sums_too_large_for_a_float_stay_finite() {
        let mut nodes = Vec::new();
        for (pass, value) in [1e300, -1e300, 3e38, 3e38].into_iter().enumerate() {
            let sampling = Sampling::new(1, 1).unwrap();
            let sums = PassSums { beauty: vec![DVec3::splat(value); TILE.pixels()], caustic: None, first_hit: None };
            nodes.push(Node::leaf(address(0, 4 + pass as u32), TILE, sampling, &sums).unwrap());
        }
        let [a, b, c, d] = nodes.try_into().unwrap();
        let left = Node::merge(a, &b).unwrap();
        let right = Node::merge(c, &d).unwrap();
        let all = Node::merge(left, &right).unwrap();
        assert_eq!(all.layers().beauty[0], [f32::MAX; 3]);
        assert_eq!(all.layers().moment.as_ref().unwrap()[0], [f32::MAX; 3]);
    }
}
