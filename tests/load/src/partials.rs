//! Partials of noise, in place of rendered ones.
//!
//! The coordinator checks every byte of a partial, including a hash over address and pixels. So each partial is encoded
//! by the same code as a real one. Only the rendering is saved: the pixels are drawn once and are equal in all nodes.

use clerestory_film::counters::Counters;
use clerestory_film::{
    FirstHitLayers, Node, NodeAddress, NodeError, NodeLayers, OpenExrError, PartialHeader, Rendered, Sampling,
    TileGrid, partial,
};

use crate::settings::BUILD;

/// Size of the sums at which the real worker uploads a partial.
const FULL_PARCEL_BYTES: usize = 8 << 20;

/// Why a partial of noise cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NoiseError {
    /// The lease has a tile that the image does not have.
    #[error("the lease has tile {tile}: expected one of the {tiles} of the image")]
    Tile {
        /// The tile.
        tile: u32,
        /// Tiles of the image.
        tiles: u32,
    },
    /// The lease has an impossible node.
    #[error("the lease has a node that cannot be")]
    Node(#[from] NodeError),
    /// It cannot be encoded.
    #[error("cannot encode a partial")]
    Encode(#[from] OpenExrError),
}

/// Pixels of noise for the nodes of all jobs of a run, whose tiles all have the same size.
#[derive(Debug)]
pub(crate) struct Noise {
    grid: TileGrid,
    sampling: Sampling,
    beauty: Vec<[f32; 3]>,
    moment: Vec<[f32; 3]>,
    first_hit: FirstHitLayers,
}

impl Noise {
    /// Noise for an image that its tiles divide without remainder.
    pub(crate) fn new(grid: TileGrid, sampling: Sampling) -> Self {
        let pixels = (grid.tile_size * grid.tile_size) as usize;
        let mut state = 1;
        let depth = (0..pixels).map(|_| uniform(&mut state) * 100.0).collect();
        let mut triples = || (0..pixels).map(|_| [0; 3].map(|_| uniform(&mut state))).collect::<Vec<_>>();
        let (beauty, moment) = (triples(), triples());
        let first_hit = FirstHitLayers { albedo: triples(), normal: triples(), depth };
        Self { grid, sampling, beauty, moment, first_hit }
    }

    /// Most nodes of a partial of the real worker, when all of them are ready.
    pub(crate) fn nodes_per_parcel(&self) -> usize {
        // Beauty, albedo and normal have three channels, depth one. Blocks, which have a moment, are rare.
        (FULL_PARCEL_BYTES / (self.beauty.len() * 10 * size_of::<f32>())).max(1)
    }

    /// The partial with these nodes of a job.
    ///
    /// # Errors
    ///
    /// [`NoiseError`] when they are none of the image.
    pub(crate) fn partial(
        &self,
        job: String,
        scene_hash: String,
        nodes: &[clerestory_api::NodeAddress],
    ) -> Result<Vec<u8>, NoiseError> {
        let rendered = nodes.iter().map(|node| self.node(node)).collect::<Result<Vec<_>, _>>()?;
        Ok(partial::encode(&rendered, &PartialHeader { job, scene_hash, build: BUILD.to_owned() }, &self.grid)?)
    }

    fn node(&self, address: &clerestory_api::NodeAddress) -> Result<Rendered, NoiseError> {
        let clerestory_api::NodeAddress { frame, tile, level, index } = *address;
        let address = NodeAddress { frame, tile, level, index };
        let place = self.grid.tile(tile).ok_or(NoiseError::Tile { tile, tiles: self.grid.len() })?;
        let layers = NodeLayers {
            beauty: self.beauty.clone(),
            moment: self.sampling.has_moment(address).then(|| self.moment.clone()),
            caustic: None,
            first_hit: self.sampling.has_first_hit(address, place.plane).then(|| self.first_hit.clone()),
        };
        let node = Node::from_layers(address, place, self.sampling, layers)?;
        let samples = node.samples() * place.pixels() as u64;
        Ok(Rendered { node, counters: Counters { samples, rays: samples, ..Counters::default() } })
    }
}

/// The next pseudorandom number, 0 to 1: Knuth's linear congruential generator.
fn uniform(state: &mut u64) -> f32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f32 / (1_u64 << 24) as f32
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clerestory_film::Expectation;

    use super::*;

    #[test]
    fn a_coordinator_accepts_the_partials_with_all_their_layers() {
        let grid = TileGrid::new(64, 32, 16);
        let sampling = Sampling::new(16, 256).unwrap();
        // A pass with first-hit layers, one past the first block, and a whole block.
        let addresses = [(0, 0, 3), (7, 0, 40), (2, 4, 0)];
        let node = |(tile, level, index)| NodeAddress { frame: 0, tile, level, index };
        let wire = |(tile, level, index)| clerestory_api::NodeAddress { frame: 0, tile, level, index };
        let (job, scene_hash) = ("job-7".to_owned(), "5ce7e".to_owned());
        let bytes = Noise::new(grid, sampling).partial(job.clone(), scene_hash.clone(), &addresses.map(wire)).unwrap();
        let expectation = Expectation {
            job,
            scene_hash,
            grid,
            sampling,
            allowed: addresses.map(node).into_iter().collect::<BTreeSet<_>>(),
        };
        let found = partial::decode(&bytes, &expectation, expectation.budget()).unwrap();
        let layers = found.iter().map(|rendered| rendered.node.layers());
        let present: Vec<_> = layers.map(|layers| (layers.moment.is_some(), layers.first_hit.is_some())).collect();
        assert_eq!(present, [(false, true), (false, false), (true, true)]);
        assert!(bytes.len() > 3 * 16 * 16 * 3 * 4, "noise does not get smaller");
    }

    #[test]
    fn a_tile_that_the_image_does_not_have_is_named() {
        let noise = Noise::new(TileGrid::new(32, 16, 16), Sampling::new(16, 256).unwrap());
        let address = clerestory_api::NodeAddress { frame: 0, tile: 2, level: 0, index: 0 };
        assert_eq!(
            noise.node(&address).unwrap_err().to_string(),
            "the lease has tile 2: expected one of the 2 of the image"
        );
    }
}
