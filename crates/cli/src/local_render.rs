//! Rendering in one process: the same passes, merged in the same tree, as on a farm, and so the same bits.
//!
//! Passes are taken one after another over all tiles, so that an image that is stopped early is about equally good
//! everywhere. A pass of a tile is complete or does not count.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use clerestory_coordinator::Rounds;
use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{FilmTile, InsertError, NodeAddress, Sampling, SumError, TileGrid, TileSum};
use clerestory_render_core::integrator::{RenderError, Rendered, render_node};
use clerestory_render_core::scene::Scene;
use rayon::prelude::*;

/// The frame of a scene without animation.
const FRAME: u32 = 0;

/// What to render.
pub(crate) struct PassPlan {
    /// How the image is cut into tiles.
    pub(crate) grid: TileGrid,
    /// How samples are grouped.
    pub(crate) sampling: Sampling,
    /// Passes of each tile, in the order of the tiles.
    pub(crate) tile_passes: Vec<u32>,
}

/// How far a render is, and how it is stopped early. Shared between the threads that render and the one that watches.
#[derive(Default)]
pub(crate) struct Control {
    /// When to stop. The first pass of every tile is rendered in any case: an image has at least one.
    pub(crate) deadline: Option<Instant>,
    /// Whether to stop now.
    pub(crate) cancelled: AtomicBool,
    /// Camera samples rendered so far.
    pub(crate) samples: AtomicU64,
}

/// A complete round.
pub(crate) struct Round<'a> {
    /// Its number, from 0.
    pub(crate) number: u32,
    /// Passes in every tile.
    pub(crate) passes: u32,
    /// The sums of all tiles.
    pub(crate) sums: &'a [TileSum],
}

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LocalRenderError {
    #[error("cannot render pass {} of tile {}", address.index, address.tile)]
    Render { address: NodeAddress, source: RenderError },
    #[error("a node does not fit the film")]
    Insert(#[from] InsertError),
    #[error("the film cannot be summed")]
    Sum(#[from] SumError),
}

/// A tile that is being rendered.
struct LocalTile {
    index: u32,
    film: FilmTile,
    /// Passes that it is to get.
    wanted: u32,
}

impl PassPlan {
    /// Camera samples that it takes.
    pub(crate) fn samples(&self) -> u64 {
        let tiles = (0..).map_while(|index| self.grid.tile(index)).zip(&self.tile_passes);
        let passes: u64 = tiles.map(|(tile, passes)| tile.pixels() as u64 * u64::from(*passes)).sum();
        passes * u64::from(self.sampling.samples_per_pass())
    }
}

/// Renders on the current rayon pool until everything is complete or `control` says stop. Returns the sums over the
/// complete passes of each tile; a tile without any is left out.
pub(crate) fn render(
    scene: &Scene,
    plan: &PassPlan,
    control: &Control,
    counters: &mut Counters,
    mut on_round: impl FnMut(&Round<'_>),
) -> Result<Vec<TileSum>, LocalRenderError> {
    let mut tiles: Vec<LocalTile> = (0..)
        .zip(&plan.tile_passes)
        .filter_map(|(index, &wanted)| {
            let film = FilmTile::new(FRAME, index, plan.grid.tile(index)?, plan.sampling);
            (wanted > 0).then_some(LocalTile { index, film, wanted })
        })
        .collect();
    // A round is complete in every tile of the image, so one that gets no pass at all leaves no rounds.
    let fewest = plan.tile_passes.iter().copied().min().unwrap_or(0);
    let most = plan.tile_passes.iter().copied().max().unwrap_or(0);
    let rounds = Rounds::new(fewest);
    let mut round = 0;
    for pass in 0..most {
        let end = rounds.end(round);
        if let Some(end) = end {
            // The image is wanted there, so no node may grow across it before.
            tiles.iter_mut().try_for_each(|tile| tile.film.hold(end))?;
        }
        if !render_pass(scene, plan, pass, &mut tiles, control, counters)? {
            break;
        }
        if end == Some(pass + 1) {
            let sums = sums(&tiles, |_| pass + 1)?;
            on_round(&Round { number: round, passes: pass + 1, sums: &sums });
            for tile in &mut tiles {
                tile.film.release(pass + 1);
            }
            round += 1;
        }
    }
    sums(&tiles, FilmTile::complete_passes)
}

/// Renders one pass of every tile that is to have it; says whether it is complete.
fn render_pass(
    scene: &Scene,
    plan: &PassPlan,
    pass: u32,
    tiles: &mut [LocalTile],
    control: &Control,
    counters: &mut Counters,
) -> Result<bool, LocalRenderError> {
    let is_late = || pass > 0 && control.deadline.is_some_and(|deadline| Instant::now() >= deadline);
    let render_tile = |tile: &mut LocalTile| -> Result<Option<Counters>, LocalRenderError> {
        if pass >= tile.wanted {
            return Ok(Some(Counters::default()));
        }
        if is_late() {
            return Ok(None);
        }
        let address = NodeAddress { frame: FRAME, tile: tile.index, level: 0, index: pass };
        let Rendered { node, counters } = match render_node(scene, &plan.grid, address, &control.cancelled) {
            Ok(rendered) => rendered,
            Err(RenderError::Cancelled) => return Ok(None),
            Err(source) => return Err(LocalRenderError::Render { address, source }),
        };
        control.samples.fetch_add(counters.samples, Ordering::Relaxed);
        tile.film.insert(node)?;
        Ok(Some(counters))
    };
    let rendered: Vec<Option<Counters>> = tiles.par_iter_mut().map(render_tile).collect::<Result<_, _>>()?;
    rendered.iter().flatten().for_each(|tile| *counters += *tile);
    Ok(rendered.iter().all(Option::is_some))
}

fn sums(tiles: &[LocalTile], passes: impl Fn(&FilmTile) -> u32) -> Result<Vec<TileSum>, LocalRenderError> {
    let complete = tiles.iter().map(|tile| (&tile.film, passes(&tile.film))).filter(|(_, passes)| *passes > 0);
    Ok(complete.map(|(film, passes)| film.sum(passes)).collect::<Result<_, _>>()?)
}
