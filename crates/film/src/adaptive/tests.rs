use glam::DVec3;

use super::*;
use crate::address::NodeAddress;
use crate::decomposition::{mean, standard_error};
use crate::node::{FirstHitSums, PassSums};
use crate::sampler::{SampleStream, SamplerSettings};
use crate::tree::FilmTile;

/// Four passes in a block.
fn sampling() -> Sampling {
    Sampling::new(2, 8).unwrap()
}

/// A row of tiles of four pixels.
const GRID: TileGrid = TileGrid::new(16, 2, 2);

/// A pass of a tile, all of whose pixels and channels have a sum each.
fn leaf(tile: u32, pass: u32, sums: impl FnMut([u32; 2]) -> f64) -> Node {
    let pixels = GRID.tile(tile).unwrap();
    let places = (0..pixels.pixels()).map(|index| pixels.pixel(index)).map(|(x, y)| [x, y]);
    let beauty: Vec<DVec3> = places.map(sums).map(DVec3::splat).collect();
    let first_hit = sampling().is_in_first_block(pass).then(|| FirstHitSums {
        albedo: vec![DVec3::ZERO; beauty.len()],
        normal: vec![DVec3::ZERO; beauty.len()],
        depth: vec![0.0; beauty.len()],
    });
    let address = NodeAddress { frame: 0, tile, level: 0, index: pass };
    Node::leaf(address, pixels, sampling(), &PassSums { beauty, caustic: None, first_hit }).unwrap()
}

fn units(shares: &[Share]) -> Vec<u32> {
    shares.iter().map(|share| share.units()).collect()
}

#[test]
fn noise_is_the_variance_between_passes() {
    let pilot = [1.0, 4.0, 7.0].map(|sum| leaf(0, 100 + sum as u32, |_| sum));
    assert_eq!(noise(&pilot), 9.0);
    // What differs between pixels is no noise.
    let still = [8, 9].map(|pass| leaf(0, pass, |[x, y]| f64::from(x + 10 * y)));
    assert_eq!(noise(&still), 0.0);
}

#[test]
fn shares_are_in_proportion_to_the_standard_deviation() {
    let grid = TileGrid::new(10, 1, 2);
    // Neighbours of equal noise do not change it.
    let found = units(&shares(&grid, &[4.0, 4.0, 4.0, 4.0, 4.0]));
    assert_eq!(found, [Share::ALL; 5]);
    let found = units(&shares(&grid, &[16.0, 1.0, 1.0, 1.0, 4.0]));
    // The second counts as noisy as the three around it together, and so does the fourth.
    let around = |noise: f64| (f64::from(Share::ALL) * (noise / 16.0).sqrt()).ceil() as u32;
    assert_eq!(found, [Share::ALL, around(6.0), Share::ALL / 4, around(2.0), Share::ALL / 2]);
}

#[test]
fn a_quiet_tile_gets_an_eighth_and_what_shows_no_noise_gets_all() {
    let mut noise = [0.0; 8];
    assert_eq!(units(&shares(&GRID, &noise)), [Share::ALL; 8]);
    noise[0] = 1e30;
    let found = units(&shares(&GRID, &noise));
    assert_eq!((found[0], found[2]), (Share::ALL, Share::ALL / 8));
    assert!(found[1] > Share::ALL / 2, "{found:?}");
    // Sums near the largest float have squares that a double holds.
    noise = [f64::from(f32::MAX).powi(2); 8];
    assert_eq!(units(&shares(&GRID, &noise)), [Share::ALL; 8]);
}

#[test]
fn tiles_at_the_border_count_by_their_pixels() {
    // Two columns, the second of a single pixel's width.
    let grid = TileGrid::new(5, 4, 4);
    let found = units(&shares(&grid, &[1.0, 16.0]));
    let around = (f64::from(Share::ALL) * (4.0f64 / 16.0).sqrt()).ceil() as u32;
    assert_eq!(found, [around, Share::ALL], "(16 * 1 + 4 * 16) / 20 = 4");
}

#[test]
fn passes_grow_from_round_to_round_in_whole_blocks() {
    let adaptation = Adaptation::new(sampling(), 1000, 2).unwrap();
    for units in [1, Share::ALL / 8, 9000, Share::ALL / 2, Share::ALL - 1, Share::ALL] {
        let share = Share::new(units).unwrap();
        let mut before = 0;
        for round in 0..1000 {
            let passes = adaptation.passes(share, round);
            assert!(passes >= before && passes <= round, "{units} units of {round}: {passes} after {before}");
            assert!(passes == round || passes.is_multiple_of(4), "{units} units of {round}: {passes}");
            assert!(f64::from(passes) >= f64::from(round) * f64::from(units) / f64::from(Share::ALL));
            assert!(passes >= round.min(8));
            before = passes;
        }
        assert!(units < Share::ALL || before == 999);
    }
    assert_eq!(adaptation.passes(Share::new(Share::ALL / 4).unwrap(), 100), 28);
    assert_eq!([0, Share::ALL + 1].map(Share::new), [None; 2]);
}

#[test]
fn nothing_is_shared_out_where_all_get_the_fewest() {
    for (passes, blocks, is_some) in [(8, 2, false), (9, 2, true), (16, 4, false), (17, 4, true)] {
        assert_eq!(Adaptation::new(sampling(), passes, blocks).is_some(), is_some, "{passes} passes, {blocks} blocks");
    }
}

#[test]
fn no_pass_of_a_pilot_is_one_of_an_image_or_of_the_same_block_as_another() {
    for (per_pass, per_block) in [(1, 1), (2, 8), (16, 256), (24, 96), (1, 1 << 16), (1 << 16, 1 << 16), (3, 3 << 14)] {
        let sampling = Sampling::new(per_pass, per_block).unwrap();
        for passes in [3, 64, 1 << 8, 1 << 24] {
            let Some(adaptation) = Adaptation::new(sampling, passes, 2) else { continue };
            let pilot: Vec<u32> = adaptation.pilot().collect();
            assert_eq!(pilot.len() as u32, adaptation.pilot_passes());
            assert_eq!(adaptation.pilot_passes(), (passes / 16).clamp(2, 8));
            for &pass in &pilot {
                let node = NodeAddress { frame: 0, tile: 0, level: 0, index: pass };
                // An image has at most 2^24 samples in a pixel; the sampler counts in 32 bits.
                assert!(node.exists() && u64::from(pass) * u64::from(per_pass) >= 1 << 31);
                assert!((u64::from(pass) + 1) * u64::from(per_pass) < 1 << 32);
                assert!(
                    pass.is_multiple_of(sampling.passes_per_block()),
                    "a pass has the place in its block of the first"
                );
                assert!(!pilot.contains(&node.sibling().index), "no two merge");
            }
            let mut blocks: Vec<u32> = pilot.iter().map(|pass| pass / sampling.passes_per_block()).collect();
            blocks.dedup();
            assert_eq!(blocks.len(), pilot.len());
        }
    }
}

/// Light that one sample in fifty meets, of mean 1.
fn rare_light(seed: u64, pixel: [u32; 2], pass: u32) -> f64 {
    let settings = SamplerSettings { seed, samples_per_block: 1 };
    let sample = |sample| SampleStream::new(&settings, 0, pixel, pass * 2 + sample).trials().next_f64();
    [0, 1].map(|number| if sample(number) < 0.02 { 50.0 } else { 0.0 }).iter().sum()
}

/// The mean light of an image whose passes are shared out by what some of its own passes, or others, say.
fn light(seed: u64, adaptation: &Adaptation, deciding: &[u32]) -> f64 {
    let pass = |tile, pass| leaf(tile, pass, |pixel| rare_light(seed, pixel, pass));
    let tiles = 0..GRID.len();
    let noise: Vec<f64> = tiles
        .clone()
        .map(|tile| noise(&deciding.iter().map(|&number| pass(tile, number)).collect::<Vec<_>>()))
        .collect();
    let of_tile = |(tile, share)| {
        let passes = adaptation.passes(share, PASSES);
        let mut film = FilmTile::new(0, tile, GRID.tile(tile).unwrap(), sampling());
        for number in 0..passes {
            film.insert(pass(tile, number)).unwrap();
        }
        let sum = film.sum(passes).unwrap();
        let numbers = sum.layers.beauty.as_flattened();
        numbers.iter().map(|sum| f64::from(*sum)).sum::<f64>() / (numbers.len() as f64 * sum.samples() as f64)
    };
    mean(&tiles.zip(shares(&GRID, &noise)).map(of_tile).collect::<Vec<_>>())
}

const PASSES: u32 = 64;

#[test]
fn images_shared_out_by_a_pilot_have_no_bias_and_those_by_their_own_passes_have() {
    let adaptation = Adaptation::new(sampling(), PASSES, 2).unwrap();
    let pilot: Vec<u32> = adaptation.pilot().collect();
    let own: Vec<u32> = (0..pilot.len() as u32).collect();
    let [by_pilot, by_own] = [pilot, own].map(|deciding| {
        let light: Vec<f64> = (0..1500).map(|seed| light(seed, &adaptation, &deciding)).collect();
        (mean(&light), standard_error(&light).unwrap())
    });
    let (light, error) = by_pilot;
    assert!(error < 0.02, "the test has no power: {light} +- {error}");
    assert!((light - 1.0).abs() < 4.0 * error, "{light} +- {error}");
    let (light, error) = by_own;
    assert!((light - 1.0).abs() > 10.0 * error, "the planted fault is not seen: {light} +- {error}");
}
