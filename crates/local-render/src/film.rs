//! The passes of an image that have been rendered.
//!
//! Passes are rendered one after another over all tiles, so that an image that is stopped early is about equally good
//! everywhere. A pass of a tile is complete or does not count.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use clerestory_film::counters::Counters;
use clerestory_film::{FilmTile, NodeAddress, Rendered, TileSum};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::integrator::{RenderError, render_nodes};
use rayon::prelude::*;

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

impl LocalTile {
    fn lacks_passes(&self) -> bool {
        self.passes < self.wanted
    }
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
                let film = FilmTile::new(plan.frame, index, plan.grid.tile(index)?, plan.sampling);
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
        let strips = plan.grid.light_tiles();
        let of_camera = self.tiles.partition_point(|tile| tile.index < strips.start);
        let (camera, light) = self.tiles.split_at_mut(of_camera);
        let (light, camera) = rayon::join(
            || -> Result<Vec<_>, LocalRenderError> {
                let alike = light.chunk_by_mut(|a, b| (a.passes, a.lacks_passes()) == (b.passes, b.lacks_passes()));
                alike.map(|strips| render_one_more(scene, plan, strips, control)).collect()
            },
            || {
                let each = camera.par_iter_mut().map(std::slice::from_mut);
                each.map(|tile| render_one_more(scene, plan, tile, control)).collect::<Result<Vec<_>, _>>()
            },
        );
        let rendered: Vec<Option<Counters>> = camera?.into_iter().chain(light?).collect();
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
        while self.tiles.iter().any(LocalTile::lacks_passes) {
            if !self.render_pass(control)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Renders one more pass of tiles that have equally many: of one tile, or of strips of the light plane. `None` when
/// `control` stopped it.
fn render_one_more(
    scene: &PreparedScene,
    plan: &PassPlan,
    tiles: &mut [LocalTile],
    control: &Control,
) -> Result<Option<Counters>, LocalRenderError> {
    let Some(first) = tiles.first().filter(|tile| tile.lacks_passes()) else { return Ok(Some(Counters::default())) };
    // A pass of the light plane is one long piece of work.
    if first.passes > 0 && control.is_late_after(first.last) {
        return Ok(None);
    }
    let begun = Instant::now();
    let indices: Vec<u32> = tiles.iter().map(|tile| tile.index).collect();
    let Some(rendered) = render_leaves(scene, plan, &indices, first.passes, control)? else { return Ok(None) };
    let mut counters = Counters::default();
    for (tile, rendered) in tiles.iter_mut().zip(rendered) {
        tile.film.insert(rendered.node)?;
        tile.passes += 1;
        if plan.grid.light_tiles().contains(&tile.index) {
            tile.last = begun.elapsed();
        }
        counters += rendered.counters;
    }
    Ok(Some(counters))
}

/// Renders a pass of tiles; `None` when `control` stopped it.
pub(crate) fn render_leaves(
    scene: &PreparedScene,
    plan: &PassPlan,
    tiles: &[u32],
    pass: u32,
    control: &Control,
) -> Result<Option<Vec<Rendered>>, LocalRenderError> {
    let address = |tile: &u32| NodeAddress { frame: plan.frame, tile: *tile, level: 0, index: pass };
    let addresses: Vec<NodeAddress> = tiles.iter().map(address).collect();
    match render_nodes(scene, &plan.grid, &addresses, &control.cancelled) {
        Ok(rendered) => {
            let samples = rendered.iter().map(|rendered| rendered.counters.samples).sum();
            control.samples.fetch_add(samples, Ordering::Relaxed);
            Ok(Some(rendered))
        }
        Err(RenderError::Cancelled) => Ok(None),
        Err(source) => Err(LocalRenderError::Render { address: address(&tiles[0]), source }),
    }
}
