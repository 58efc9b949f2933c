//! The merge tree of one tile. Accepted nodes go in, in any order. The image of any complete run of passes comes out
//! with the same bits.
//!
//! Siblings are merged as soon as both are there, so a tile with P passes is held as about log2(P) nodes. A round is an
//! image at a pass count that is known in advance. A parent that reached across it would make that image impossible to
//! compute. So such a parent is formed only after the round is released. Bits do not depend on when siblings are
//! merged, because a parent is the sum of the same two halves either way.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use thiserror::Error;

use super::address::{NodeAddress, PassRange, Tile};
use super::node::{BlockCounts, Node, NodeLayers, add, add_moments};
use super::sampling::Sampling;

/// The accepted nodes of one tile of one frame.
#[derive(Clone, Debug)]
pub struct FilmTile {
    frame: u32,
    tile_index: u32,
    tile: Tile,
    sampling: Sampling,
    /// By first pass; no two overlap.
    nodes: BTreeMap<u32, Node>,
    held: BTreeSet<u32>,
}

/// The sums of a tile over all passes from 0 up to a pass count.
#[derive(Clone, Debug, PartialEq)]
pub struct TileSum {
    /// The tile's number in its grid.
    pub tile_index: u32,
    /// Its pixels.
    pub tile: Tile,
    /// How its samples are grouped.
    pub sampling: Sampling,
    /// The number of passes.
    pub passes: u32,
    /// The sums. The moment is over whole blocks only and present when there is one; first-hit layers are those of the
    /// frame's first block.
    pub layers: NodeLayers,
}

/// Why a node is not taken into a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum InsertError {
    /// The node is of another frame or tile, or is grouped differently.
    #[error("node ({address}) does not belong to tile {tile_index} of frame {frame}")]
    OtherTile {
        /// The node.
        address: NodeAddress,
        /// The frame of this film tile.
        frame: u32,
        /// The number of this film tile.
        tile_index: u32,
    },
    /// The node, an ancestor or a descendant is already there.
    #[error("node ({address}) overlaps ({present}), which has already been accepted")]
    Overlap {
        /// The node.
        address: NodeAddress,
        /// The accepted node that it shares passes with.
        present: NodeAddress,
    },
    /// The node reaches across a pass count at which the image is wanted.
    #[error("node ({address}) reaches across pass {passes}, at which the image is wanted")]
    AcrossHeldPass {
        /// The node.
        address: NodeAddress,
        /// The held pass count.
        passes: u32,
    },
}

/// Why a sum over passes is not to be had.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SumError {
    /// No image has no samples.
    #[error("the sum over 0 passes is not an image")]
    NoPasses,
    /// Not all passes are there.
    #[error("the first {wanted} passes are wanted; {complete} are complete")]
    Incomplete {
        /// The passes asked for.
        wanted: u32,
        /// Passes that are complete.
        complete: u32,
    },
    /// A node reaches across the pass count, so that the passes before it are no longer apart from those after.
    #[error("the sum over {wanted} passes cannot be had: node {node:?} reaches across")]
    MergedAcross {
        /// The passes asked for.
        wanted: u32,
        /// The node in the way.
        node: NodeAddress,
    },
}

impl FilmTile {
    /// A tile without nodes.
    pub fn new(frame: u32, tile_index: u32, tile: Tile, sampling: Sampling) -> Self {
        Self { frame, tile_index, tile, sampling, nodes: BTreeMap::new(), held: BTreeSet::new() }
    }

    /// Takes in a node and merges it with its siblings as far up as they are there. Returns the address of the node
    /// that it is now part of: its own or that of an ancestor, all of whose descendants are no longer held.
    ///
    /// # Errors
    ///
    /// [`InsertError`] when the node is not of this tile, shares passes with an accepted node, or reaches across a
    /// held pass count; the tile is then unchanged.
    pub fn insert(&mut self, node: Node) -> Result<NodeAddress, InsertError> {
        let address = node.address();
        let (frame, tile_index) = (self.frame, self.tile_index);
        let same_tile = address.frame == frame && address.tile == tile_index;
        if !same_tile || node.tile() != self.tile || node.sampling() != self.sampling {
            return Err(InsertError::OtherTile { address, frame, tile_index });
        }
        if let Some(present) = self.overlapping(address) {
            return Err(InsertError::Overlap { address, present });
        }
        if let Some(passes) = self.first_held_inside(address) {
            return Err(InsertError::AcrossHeldPass { address, passes });
        }
        self.nodes.insert(address.passes().first, node);
        Ok(self.merge_upwards(address))
    }

    /// Keeps the image at this pass count: until it is released, no node is formed or taken that reaches across.
    ///
    /// # Errors
    ///
    /// [`SumError::MergedAcross`] when a node that is already there does.
    pub fn hold(&mut self, passes: u32) -> Result<(), SumError> {
        let before = self.nodes.range(..passes).next_back().map(|(_, node)| node);
        match before {
            Some(node) if end(node.address()) > u64::from(passes) => {
                Err(SumError::MergedAcross { wanted: passes, node: node.address() })
            }
            _ => {
                self.held.insert(passes);
                Ok(())
            }
        }
    }

    /// Ends a hold, and forms the nodes that waited for it. Returns the node that now reaches across the pass count,
    /// if there is one.
    pub fn release(&mut self, passes: u32) -> Option<NodeAddress> {
        self.held.remove(&passes);
        let left = self.nodes.range(..passes).next_back().map(|(_, node)| node.address())?;
        // Of the nodes next to the boundary only the smaller can have waited for its sibling.
        let right = self.nodes.get(&passes).map(Node::address)?;
        let smaller = if left.level < right.level { left } else { right };
        let merged = self.merge_upwards(smaller);
        (merged != smaller).then_some(merged)
    }

    /// The accepted nodes, merged as far as may be, by first pass.
    pub fn nodes(&self) -> impl Iterator<Item = &Node> {
        self.nodes.values()
    }

    /// The largest P such that all passes before P are there.
    pub fn complete_passes(&self) -> u32 {
        let mut complete = 0;
        for node in self.nodes.values() {
            if node.passes().first != complete {
                break;
            }
            complete += node.passes().count;
        }
        complete
    }

    /// The sums over the first `passes` passes: the largest aligned nodes that they consist of, added from left to
    /// right.
    ///
    /// # Errors
    ///
    /// [`SumError`] when passes are missing or have been merged with later ones.
    pub fn sum(&self, passes: u32) -> Result<TileSum, SumError> {
        let complete = self.complete_passes();
        if passes > complete {
            return Err(SumError::Incomplete { wanted: passes, complete });
        }
        let across = self.nodes.range(..passes).next_back().map(|(_, node)| node.address());
        if let Some(node) = across.filter(|&node| end(node) > u64::from(passes)) {
            return Err(SumError::MergedAcross { wanted: passes, node });
        }

        let mut sum: Option<TileSum> = None;
        for address in (PassRange { first: 0, count: passes }).maximal_nodes(self.frame, self.tile_index) {
            let node = self.assemble(address);
            match &mut sum {
                Some(sum) => sum.add(&node),
                None => {
                    sum = Some(TileSum {
                        tile_index: self.tile_index,
                        tile: self.tile,
                        sampling: self.sampling,
                        passes: node.passes().count,
                        layers: node.into_owned().into_layers(),
                    });
                }
            }
        }
        sum.ok_or(SumError::NoPasses)
    }

    /// The node at `address`, merged from its parts where a hold keeps them apart. All of its passes must be there and
    /// none of them merged with others.
    fn assemble(&self, address: NodeAddress) -> Cow<'_, Node> {
        if let Some(node) = self.nodes.get(&address.passes().first).filter(|node| node.address() == address) {
            return Cow::Borrowed(node);
        }
        let [left, right] = address.children().expect("a complete single pass is a node");
        let left = self.assemble(left).into_owned();
        Cow::Owned(Node::merge(left, &self.assemble(right)).expect("the halves of a node of one tile merge"))
    }

    fn merge_upwards(&mut self, from: NodeAddress) -> NodeAddress {
        let mut address = from;
        loop {
            let sibling = address.sibling();
            let parent = address.parent();
            let waiting = !parent.exists() || self.first_held_inside(parent).is_some();
            let left_first = address.passes().first.min(sibling.passes().first);
            let right_first = address.passes().first.max(sibling.passes().first);
            let sibling_is_there =
                self.nodes.get(&sibling.passes().first).is_some_and(|node| node.address() == sibling);
            if waiting || !sibling_is_there {
                return address;
            }
            if let (Some(left), Some(right)) = (self.nodes.remove(&left_first), self.nodes.remove(&right_first)) {
                let merged = Node::merge(left, &right).expect("siblings of one tile merge");
                self.nodes.insert(left_first, merged);
            }
            address = parent;
        }
    }

    fn overlapping(&self, address: NodeAddress) -> Option<NodeAddress> {
        let passes = address.passes();
        let before = self.nodes.range(..=passes.first).next_back();
        let after = self.nodes.range(passes.first..).next();
        before.into_iter().chain(after).map(|(_, node)| node.address()).find(|present| present.overlaps(&address))
    }

    fn first_held_inside(&self, address: NodeAddress) -> Option<u32> {
        let first = address.passes().first;
        self.held.range(first + 1..).next().copied().filter(|&passes| u64::from(passes) < end(address))
    }
}

/// The pass after the last of a node.
fn end(address: NodeAddress) -> u64 {
    u64::from(address.passes().first) + u64::from(address.passes().count)
}

impl TileSum {
    /// Samples in each pixel.
    pub fn samples(&self) -> u64 {
        u64::from(self.passes) * u64::from(self.sampling.samples_per_pass())
    }

    /// Whole blocks.
    pub fn blocks(&self) -> u32 {
        self.sampling.complete_blocks(self.passes)
    }

    /// The sums of a rectangle within it, without first-hit layers.
    #[must_use]
    pub fn cropped(&self, tile_index: u32, tile: Tile) -> Self {
        let crop = |layer: &[[f32; 3]]| {
            let lines = (tile.y.saturating_sub(self.tile.y)..).take(tile.height as usize).map(|line| {
                let first = line as usize * self.tile.width as usize + tile.x.saturating_sub(self.tile.x) as usize;
                layer.get(first..first + tile.width as usize).unwrap_or_default()
            });
            lines.collect::<Vec<_>>().concat()
        };
        let moment = self.layers.moment.as_deref().map(crop);
        let caustic = self.layers.caustic.as_deref().map(crop);
        let layers = NodeLayers { beauty: crop(&self.layers.beauty), moment, caustic, first_hit: None };
        Self { tile_index, tile, layers, ..*self }
    }

    /// Adds the next of the largest aligned nodes, which is smaller than all before it.
    fn add(&mut self, node: &Node) {
        let blocks = BlockCounts { left: self.blocks(), right: self.sampling.complete_blocks(node.passes().count) };
        let layers = node.layers();
        if let (Some(moment), Some(other)) = (&mut self.layers.moment, &layers.moment) {
            add_moments(moment, other, &self.layers.beauty, &layers.beauty, self.sampling, blocks);
        }
        add(self.layers.beauty.as_flattened_mut(), layers.beauty.as_flattened());
        if let (Some(caustic), Some(other)) = (&mut self.layers.caustic, &layers.caustic) {
            add(caustic.as_flattened_mut(), other.as_flattened());
        }
        if let (Some(first_hit), Some(other)) = (&mut self.layers.first_hit, &layers.first_hit) {
            first_hit.add(other);
        }
        self.passes += node.passes().count;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::address::TileGrid;
    use crate::test_nodes::noise_node;

    fn sampling() -> Sampling {
        Sampling::new(4, 16).unwrap()
    }

    fn address(level: u32, index: u32) -> NodeAddress {
        NodeAddress { frame: 0, tile: 0, level, index }
    }

    const TILE: Tile = Tile { has_caustic: true, ..Tile::new([3, 2], [4, 2]) };

    fn film_tile() -> FilmTile {
        FilmTile::new(0, 0, TILE, sampling())
    }

    fn node(level: u32, index: u32) -> Node {
        noise_node(address(level, index), TILE, sampling())
    }

    fn held_addresses(film: &FilmTile) -> Vec<(u32, u32)> {
        film.nodes().map(|node| (node.address().level, node.address().index)).collect()
    }

    #[track_caller]
    fn assert_same_bits(found: &TileSum, expected: &TileSum) {
        let bits = |sum: &TileSum| -> Vec<u32> {
            let NodeLayers { beauty, moment, caustic, first_hit } = &sum.layers;
            let triples = [Some(beauty), moment.as_ref(), caustic.as_ref()].into_iter().flatten();
            let triples = triples.chain(first_hit.iter().flat_map(|layers| [&layers.albedo, &layers.normal]));
            let depth = first_hit.iter().flat_map(|layers| &layers.depth);
            triples.flat_map(|layer| layer.as_flattened()).chain(depth).map(|value| value.to_bits()).collect()
        };
        assert_eq!((found.tile, found.passes), (expected.tile, expected.passes));
        assert!(bits(found) == bits(expected), "the sums differ in their bits");
    }

    /// What one process computes: one pass after the other.
    fn single_process_sum(tile_index: u32, tile: Tile, passes: u32) -> TileSum {
        let mut film = FilmTile::new(0, tile_index, tile, sampling());
        for pass in 0..passes {
            let address = NodeAddress { tile: tile_index, ..address(0, pass) };
            film.insert(noise_node(address, tile, sampling())).unwrap();
        }
        film.sum(passes).unwrap()
    }

    #[test]
    fn siblings_merge_upwards_and_the_insertion_says_into_what() {
        let mut film = film_tile();
        assert_eq!(film.insert(node(1, 1)).unwrap(), address(1, 1));
        assert_eq!(film.insert(node(0, 1)).unwrap(), address(0, 1));
        assert_eq!(film.complete_passes(), 0);
        assert_eq!(film.insert(node(0, 0)).unwrap(), address(2, 0));
        assert_eq!(film.complete_passes(), 4);
        assert_eq!(film.nodes().collect::<Vec<_>>(), [&node(2, 0)]);
    }

    #[test]
    fn a_node_that_shares_passes_with_an_accepted_one_is_refused() {
        let mut film = film_tile();
        film.insert(node(2, 1)).unwrap();
        for (level, index) in [(2, 1), (1, 2), (1, 3), (0, 5), (0, 7), (3, 0), (5, 0)] {
            let error = film.insert(node(level, index)).unwrap_err();
            assert_eq!(error, InsertError::Overlap { address: address(level, index), present: address(2, 1) });
        }
        assert_eq!(held_addresses(&film), [(2, 1)]);
        film.insert(node(1, 1)).unwrap();
        assert!(matches!(film.insert(node(2, 0)), Err(InsertError::Overlap { .. })));
    }

    #[test]
    fn a_node_of_another_tile_is_refused() {
        let mut film = film_tile();
        let others = [
            noise_node(NodeAddress { frame: 1, ..address(0, 0) }, TILE, sampling()),
            noise_node(NodeAddress { tile: 1, ..address(0, 0) }, TILE, sampling()),
            noise_node(address(0, 0), Tile { width: 5, ..TILE }, sampling()),
            noise_node(address(0, 0), TILE, Sampling::new(4, 32).unwrap()),
        ];
        for other in others {
            assert!(matches!(film.insert(other), Err(InsertError::OtherTile { .. })));
        }
    }

    #[test]
    fn a_held_pass_count_can_be_summed_although_later_passes_are_there() {
        let mut film = film_tile();
        film.hold(3).unwrap();
        film.hold(6).unwrap();
        for pass in [7, 2, 5, 0, 6, 3, 4, 1] {
            film.insert(node(0, pass)).unwrap();
        }
        assert_eq!(held_addresses(&film), [(1, 0), (0, 2), (0, 3), (1, 2), (1, 3)]);
        assert_same_bits(&film.sum(3).unwrap(), &single_process_sum(0, TILE, 3));
        assert_same_bits(&film.sum(6).unwrap(), &single_process_sum(0, TILE, 6));
        assert_same_bits(&film.sum(8).unwrap(), &single_process_sum(0, TILE, 8));

        assert_eq!(film.release(3), Some(address(2, 0)));
        assert_eq!(film.sum(3), Err(SumError::MergedAcross { wanted: 3, node: address(2, 0) }));
        assert_same_bits(&film.sum(6).unwrap(), &single_process_sum(0, TILE, 6));
        assert_eq!(film.release(6), Some(address(3, 0)));
        assert_eq!(held_addresses(&film), [(3, 0)]);
        assert_same_bits(&film.sum(8).unwrap(), &single_process_sum(0, TILE, 8));
        assert_eq!(film.hold(7), Err(SumError::MergedAcross { wanted: 7, node: address(3, 0) }));
    }

    #[test]
    fn a_node_across_a_held_pass_count_is_refused() {
        let mut film = film_tile();
        film.hold(6).unwrap();
        let error = film.insert(node(2, 1)).unwrap_err();
        assert_eq!(error, InsertError::AcrossHeldPass { address: address(2, 1), passes: 6 });
        film.insert(node(1, 2)).unwrap();
    }

    #[test]
    fn a_release_before_all_passes_are_there_merges_them_later() {
        let mut film = film_tile();
        film.hold(4).unwrap();
        film.insert(node(2, 0)).unwrap();
        film.insert(node(1, 2)).unwrap();
        assert_eq!(film.release(4), None);
        assert_eq!(film.insert(node(1, 3)).unwrap(), address(3, 0));
    }

    #[test]
    fn missing_passes_are_reported() {
        let mut film = film_tile();
        assert_eq!(film.sum(0), Err(SumError::NoPasses));
        film.insert(node(1, 0)).unwrap();
        film.insert(node(0, 3)).unwrap();
        assert_eq!(film.complete_passes(), 2);
        assert_eq!(film.sum(4), Err(SumError::Incomplete { wanted: 4, complete: 2 }));
    }

    #[test]
    fn moment_of_a_sum_is_over_whole_blocks() {
        // 15 passes of 4 samples: blocks of 4 passes [0,4) [4,8) [8,12), then 3 passes without a moment.
        let sum = single_process_sum(0, TILE, 15);
        assert_eq!(sum.blocks(), 3);
        let block_means: Vec<f64> =
            (0..3).map(|block| f64::from(node(2, block).layers().beauty[5][1]) / 16.0).collect();
        let mean = block_means.iter().sum::<f64>() / 3.0;
        let expected: f64 = block_means.iter().map(|block| (block - mean) * (block - mean)).sum();
        let found = f64::from(sum.layers.moment.unwrap()[5][1]);
        // A few roundings of a float each.
        assert!((found - expected).abs() < 1e-5 * expected, "{found} is not {expected}");
    }

    /// Cuts [0, passes) into aligned nodes: each maximal node is split in two wherever the next choice says so.
    fn cut(passes: u32, choices: &mut impl Iterator<Item = bool>) -> Vec<NodeAddress> {
        let mut open = (PassRange { first: 0, count: passes }).maximal_nodes(0, 0);
        let mut nodes = Vec::new();
        while let Some(address) = open.pop() {
            match address.children() {
                Some(children) if choices.next().unwrap_or(false) => open.extend(children),
                _ => nodes.push(address),
            }
        }
        nodes
    }

    proptest! {
        #![proptest_config(crate::test_nodes::fixed_seed(64))]

        #[test]
        fn any_cut_and_any_order_of_arrival_give_the_bits_of_a_single_process(
            passes in 1u32..40,
            choices in prop::collection::vec(any::<bool>(), 0..80),
            order in any::<u64>(),
            rounds in prop::collection::btree_set(1u32..40, 0..3),
        ) {
            let mut nodes = cut(passes, &mut choices.into_iter());
            // A held round may not be crossed by an accepted node, so rounds are at the ends of nodes.
            let rounds: Vec<u32> = rounds.into_iter().filter(|&round| nodes.iter().all(|node| {
                let range = node.passes();
                round <= range.first || round >= range.first + range.count
            })).collect();
            nodes.sort_by_key(|node| {
                let first = u64::from(node.passes().first);
                blake3::hash(&[order.to_le_bytes(), first.to_le_bytes()].concat()).to_hex()
            });
            let mut film = film_tile();
            for &round in &rounds {
                film.hold(round).unwrap();
            }
            for address in nodes {
                film.insert(noise_node(address, TILE, sampling())).unwrap();
            }
            prop_assert_eq!(film.complete_passes(), passes);
            for &round in rounds.iter().filter(|&&round| round <= passes) {
                assert_same_bits(&film.sum(round).unwrap(), &single_process_sum(0, TILE, round));
                film.release(round);
            }
            assert_same_bits(&film.sum(passes).unwrap(), &single_process_sum(0, TILE, passes));
        }
    }

    #[test]
    fn the_size_of_tiles_does_not_change_a_pixel() {
        let pixels = |tile_size: u32| {
            let grid = TileGrid::new(70, 20, tile_size);
            let mut image = vec![None; 70 * 20];
            for index in 0..grid.len() {
                let tile = grid.tile(index).unwrap();
                let sum = single_process_sum(index, tile, 11);
                let moment = sum.layers.moment.unwrap();
                let first_hit = sum.layers.first_hit.unwrap();
                for (pixel, &beauty) in sum.layers.beauty.iter().enumerate() {
                    let (x, y) = tile.pixel(pixel);
                    let value = (beauty, moment[pixel], first_hit.depth[pixel]);
                    assert_eq!(image[(y * 70 + x) as usize].replace(value), None, "pixel in two tiles");
                }
            }
            image.into_iter().map(|pixel| pixel.expect("pixel in no tile")).collect::<Vec<_>>()
        };
        let reference = pixels(64);
        assert_eq!(pixels(16), reference);
        assert_eq!(pixels(7), reference);
    }
}
