//! What a render consists of: tiles and their passes.

use clerestory_film::{Adaptation, Sampling, TileGrid};

/// What to render.
pub struct PassPlan {
    /// The frame, which keys random numbers.
    pub frame: u32,
    /// How the image is cut into tiles.
    pub grid: TileGrid,
    /// How samples are grouped.
    pub sampling: Sampling,
    /// Passes of each tile, in the order of the tiles. Of an adaptive render, every tile has the same.
    pub tile_passes: Vec<u32>,
    /// How an adaptive render shares out its passes; `None` for one that renders all passes of every tile.
    pub adaptation: Option<Adaptation>,
}

impl PassPlan {
    /// The most samples that the render takes, of all planes.
    pub fn samples(&self) -> u64 {
        let pilot_passes = self.adaptation.map_or(0, |adaptation| adaptation.pilot_passes());
        let in_pilot = vec![pilot_passes; self.grid.camera_tiles() as usize];
        self.samples_of(&self.tile_passes).saturating_add(self.samples_of(&in_pilot))
    }

    /// Samples of some passes of each tile.
    pub(crate) fn samples_of(&self, tile_passes: &[u32]) -> u64 {
        let tiles = (0..).map_while(|index| self.grid.tile(index)).zip(tile_passes);
        let passes: u64 = tiles.map(|(tile, passes)| tile.pixels() as u64 * u64::from(*passes)).sum();
        passes * u64::from(self.sampling.samples_per_pass())
    }
}
