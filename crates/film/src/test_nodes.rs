//! Nodes for tests, and property tests with a fixed seed.

use glam::DVec3;
use proptest::test_runner::{Config, RngSeed};

use super::address::{NodeAddress, Tile};
use super::node::{FirstHitLayers, FirstHitSums, Node, NodeLayers, PassSums};
use super::sampler::{SampleStream, SamplerSettings};
use super::sampling::Sampling;

/// A run of `cases` cases that is the same every time.
pub(crate) fn fixed_seed(cases: u32) -> Config {
    Config { cases, rng_seed: RngSeed::Fixed(0x6c61_7373), failure_persistence: None, ..Config::default() }
}

/// A pass of noise that is a pure function of (tile, pass, pixel), as a renderer's is; seldom very bright.
pub(super) fn noise_pass(address: NodeAddress, tile: Tile, sampling: Sampling) -> Node {
    let pass = address.index;
    let mut beauty = Vec::new();
    let (mut albedo, mut normal, mut depth) = (Vec::new(), Vec::new(), Vec::new());
    for pixel in 0..tile.pixels() {
        let (x, y) = tile.pixel(pixel);
        let settings = SamplerSettings { seed: 1, samples_per_block: 1 };
        let mut trials = SampleStream::new(&settings, address.frame, [x, y], pass).trials();
        let mut triple = || DVec3::new(trials.next_f64(), trials.next_f64(), trials.next_f64());
        let bright = triple();
        beauty.push(triple() * 16.0 / (bright + 1e-3));
        albedo.push(triple());
        normal.push(triple() - 0.5);
        depth.push(triple().x * 100.0);
    }
    // A part of beauty that differs from channel to channel.
    let part = |beauty: &DVec3| *beauty * DVec3::new(0.25, 0.7, 0.1);
    let caustic = tile.has_caustic.then(|| beauty.iter().map(part).collect());
    let first_hit = sampling.has_first_hit(address, tile.plane).then_some(FirstHitSums { albedo, normal, depth });
    Node::leaf(address, tile, sampling, &PassSums { beauty, caustic, first_hit }).unwrap()
}

/// The node at `address`, computed as a worker does: from all of its passes, in the order of the tree.
pub(super) fn noise_node(address: NodeAddress, tile: Tile, sampling: Sampling) -> Node {
    match address.children() {
        None => noise_pass(address, tile, sampling),
        Some([left, right]) => {
            let [left, right] = [left, right].map(|child| noise_node(child, tile, sampling));
            Node::merge(left, &right).unwrap()
        }
    }
}

/// A node with all layers, whose values are subnormal, negative zero, and the largest and smallest floats.
pub(super) fn odd_node() -> Node {
    let tile = Tile { has_caustic: true, ..Tile::new([8, 4], [4, 2]) };
    let odd = [1e-45, -0.0, f32::MIN, f32::MAX, f32::MIN_POSITIVE, -1e-40, 0.0, f32::EPSILON];
    let triples = |shift: usize| (0..8).map(|i| [0, 1, 2].map(|j| odd[(i * 3 + j + shift) % 8])).collect::<Vec<_>>();
    let layers = NodeLayers {
        beauty: triples(0),
        moment: Some(triples(1).into_iter().map(|triple: [f32; 3]| triple.map(f32::abs)).collect()),
        caustic: Some(triples(4)),
        first_hit: Some(FirstHitLayers { albedo: triples(2), normal: triples(3), depth: odd.to_vec() }),
    };
    let address = NodeAddress { frame: 0, tile: 1, level: 3, index: 0 };
    Node::from_layers(address, tile, Sampling::new(4, 16).unwrap(), layers).unwrap()
}

/// Every bit of the layers of a node, to tell -0 from 0.
pub(super) fn bits(node: &Node) -> Vec<u32> {
    let NodeLayers { beauty, moment, caustic, first_hit } = node.layers();
    let mut values = beauty.as_flattened().to_vec();
    values.extend(moment.iter().chain(caustic).flat_map(|layer| layer.as_flattened()));
    if let Some(FirstHitLayers { albedo, normal, depth }) = first_hit {
        values.extend(albedo.as_flattened().iter().chain(normal.as_flattened()).chain(depth));
    }
    values.into_iter().map(f32::to_bits).collect()
}
