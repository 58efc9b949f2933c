//! The passes of an image that have been rendered.
//!
//! Passes are rendered one after another over all tiles, so that an image that is stopped early is about equally good
//! everywhere. A pass of a tile is complete or does not count.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use clerestory_film::counters::Counters;
use clerestory_film::{FilmTile, NodeAddress, TileSum};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::integrator::{RenderError, Rendered, render_node};
use rayon::prelude::*;

use crate::FRAME;
use crate::control::Control;
use crate::error::LocalRenderError;
use crate::plan::PassPlan;

/// A tile that is being rendered.
struct LocalTile {
    index: u32,
    film: FilmTile,
    /// Complete passes.
    passes: u32,
    /// Passes that the tile is to have for now.
    wanted: u32,
    /// How long the last of them took, of the light plane.
    last: Duration,
}

/// The passes of an image that have been rendered. They are rendered on the current rayon pool.
pub struct LocalFilm<'a> {
    pub(crate) scene: &'a PreparedScene,
    pub(crate) plan: &'a PassPlan,
    tiles: Vec<LocalTile>,
    /// The work so far, unfinished passes included.
    pub counters: Counters,
}

impl<'a> LocalFilm<'a> {
    /// A film without passes.
    pub fn new(scene: &'a PreparedScene, plan: &'a PassPlan) -> Self {
        let tiles = (0..)
            .zip(&plan.tile_passes)
            .filter_map(|(index, &wanted)| {
                let film = FilmTile::new(FRAME, index, plan.grid.tile(index)?, plan.sampling);
                (wanted > 0).then_some(LocalTile { index, film, passes: 0, wanted, last: Duration::ZERO })
            })
            .collect();
        Self { scene, plan, tiles, counters: Counters::default() }
    }

    /// Renders one more pass of every tile that lacks passes. Returns `false` when `control` stopped it.
    ///
    /// # Errors
    ///
    /// When a pass cannot be rendered.
    pub fn render_pass(&mut self, control: &Control) -> Result<bool, LocalRenderError> {
        let Self { scene, plan, .. } = *self;
        let render_tile = |tile: &mut LocalTile| -> Result<Option<Counters>, LocalRenderError> {
            if tile.passes >= tile.wanted {
                return Ok(Some(Counters::default()));
            }
            // A pass of the light plane is one long piece of work.
            if tile.passes > 0 && control.is_late_after(tile.last) {
                return Ok(None);
            }
            let begun = Instant::now();
            let Some(Rendered { node, counters }) = render_leaf(scene, plan, tile.index, tile.passes, control)? else {
                return Ok(None);
            };
            tile.film.insert(node)?;
            tile.passes += 1;
            if Some(tile.index) == plan.grid.light_tile() {
                tile.last = begun.elapsed();
            }
            Ok(Some(counters))
        };
        let rendered: Vec<Option<Counters>> = self.tiles.par_iter_mut().map(render_tile).collect::<Result<_, _>>()?;
        rendered.iter().flatten().for_each(|tile| self.counters += *tile);
        Ok(rendered.iter().all(Option::is_some))
    }

    /// The sums over the complete passes of each tile, without tiles that have none.
    ///
    /// # Errors
    ///
    /// When the nodes of a tile have no sum.
    pub fn sums(&self) -> Result<Vec<TileSum>, LocalRenderError> {
        let complete = self.tiles.iter().map(|tile| &tile.film).filter(|film| film.complete_passes() > 0);
        Ok(complete.map(|film| film.sum(film.complete_passes())).collect::<Result<_, _>>()?)
    }

    /// Renders every tile up to its number of passes. Returns `false` when `control` stopped it.
    pub(crate) fn render_up_to(&mut self, tile_passes: &[u32], control: &Control) -> Result<bool, LocalRenderError> {
        for tile in &mut self.tiles {
            tile.wanted = tile_passes.get(tile.index as usize).copied().unwrap_or(0);
        }
        while self.tiles.iter().any(|tile| tile.passes < tile.wanted) {
            if !self.render_pass(control)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Renders a pass of a tile; `None` when `control` stopped it.
pub(crate) fn render_leaf(
    scene: &PreparedScene,
    plan: &PassPlan,
    tile: u32,
    pass: u32,
    control: &Control,
) -> Result<Option<Rendered>, LocalRenderError> {
    let address = NodeAddress { frame: FRAME, tile, level: 0, index: pass };
    match render_node(scene, &plan.grid, address, &control.cancelled) {
        Ok(rendered) => {
            control.samples.fetch_add(rendered.counters.samples, Ordering::Relaxed);
            Ok(Some(rendered))
        }
        Err(RenderError::Cancelled) => Ok(None),
        Err(source) => Err(LocalRenderError::Render { address, source }),
    }
}
