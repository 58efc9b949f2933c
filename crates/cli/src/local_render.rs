//! Rendering in one process: the same passes, merged in the same tree, as on a farm, and so the same bits.
//!
//! Passes are taken one after another over all tiles, so that an image that is stopped early is about equally good
//! everywhere. A pass of a tile is complete or does not count.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use clerestory_coordinator::Rounds;
use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{
    FilmTile, FrameImage, ImageError, ImageMetadata, InsertError, NodeAddress, Sampling, SumError, TileGrid, TileSum,
};
use clerestory_render_core::integrator::{RenderError, Rendered, render_node};
use clerestory_render_core::scene::Scene;
use rayon::prelude::*;

use crate::commands::worker::BUILD;

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

/// The passes of an image that have been rendered, on the current rayon pool.
pub(crate) struct LocalFilm<'a> {
    scene: &'a Scene,
    plan: &'a PassPlan,
    tiles: Vec<LocalTile>,
    /// What was done so far, unfinished passes included.
    pub(crate) counters: Counters,
}

impl<'a> LocalFilm<'a> {
    /// Nothing rendered yet.
    pub(crate) fn new(scene: &'a Scene, plan: &'a PassPlan) -> Self {
        let tiles = (0..)
            .zip(&plan.tile_passes)
            .filter_map(|(index, &wanted)| {
                let film = FilmTile::new(FRAME, index, plan.grid.tile(index)?, plan.sampling);
                (wanted > 0).then_some(LocalTile { index, film, wanted })
            })
            .collect();
        Self { scene, plan, tiles, counters: Counters::default() }
    }

    /// Renders one pass of every tile that is to have it; says whether it is complete, or `control` said stop.
    pub(crate) fn render_pass(&mut self, pass: u32, control: &Control) -> Result<bool, LocalRenderError> {
        let is_late = || pass > 0 && control.deadline.is_some_and(|deadline| Instant::now() >= deadline);
        let Self { scene, plan, .. } = *self;
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
        let rendered: Vec<Option<Counters>> = self.tiles.par_iter_mut().map(render_tile).collect::<Result<_, _>>()?;
        rendered.iter().flatten().for_each(|tile| self.counters += *tile);
        Ok(rendered.iter().all(Option::is_some))
    }

    /// The sums over the complete passes of each tile; a tile without any is left out.
    pub(crate) fn sums(&self) -> Result<Vec<TileSum>, LocalRenderError> {
        self.sums_over(FilmTile::complete_passes)
    }

    fn sums_over(&self, passes: impl Fn(&FilmTile) -> u32) -> Result<Vec<TileSum>, LocalRenderError> {
        let complete = self.tiles.iter().map(|tile| (&tile.film, passes(&tile.film)));
        let complete = complete.filter(|(_, passes)| *passes > 0);
        Ok(complete.map(|(film, passes)| film.sum(passes)).collect::<Result<_, _>>()?)
    }
}

/// Renders on the current rayon pool until everything is complete, or `control` or `on_round` says stop. Returns the sums over
/// the complete passes of each tile; a tile without any is left out.
pub(crate) fn render(
    scene: &Scene,
    plan: &PassPlan,
    control: &Control,
    counters: &mut Counters,
    mut on_round: impl FnMut(&Round<'_>) -> ControlFlow<()>,
) -> Result<Vec<TileSum>, LocalRenderError> {
    let mut film = LocalFilm::new(scene, plan);
    // A round is complete in every tile of the image, so one that gets no pass at all leaves no rounds.
    let fewest = plan.tile_passes.iter().copied().min().unwrap_or(0);
    let most = plan.tile_passes.iter().copied().max().unwrap_or(0);
    let rounds = Rounds::new(fewest);
    let mut round = 0;
    for pass in 0..most {
        let end = rounds.end(round);
        if let Some(end) = end {
            // The image is wanted there, so no node may grow across it before.
            film.tiles.iter_mut().try_for_each(|tile| tile.film.hold(end))?;
        }
        if !film.render_pass(pass, control)? {
            break;
        }
        if end == Some(pass + 1) {
            let sums = film.sums_over(|_| pass + 1)?;
            if on_round(&Round { number: round, passes: pass + 1, sums: &sums }).is_break() {
                break;
            }
            for tile in &mut film.tiles {
                tile.film.release(pass + 1);
            }
            round += 1;
        }
    }
    *counters += film.counters;
    film.sums()
}

/// The image that these sums make, with how it was made.
pub(crate) fn image(
    scene: &Scene,
    plan: &PassPlan,
    sums: &[TileSum],
    counters: Counters,
    elapsed: Option<Duration>,
) -> Result<FrameImage, ImageError> {
    let description = scene.description();
    let metadata = ImageMetadata {
        scene_hash: scene.hash().to_string(),
        frame: FRAME,
        seed: description.seed,
        integrator: serde_json::to_value(&description.integrator).expect("settings have a form in JSON"),
        sampling: plan.sampling,
        tile_size: plan.grid.tile_size,
        tile_passes: Vec::new(),
        build: BUILD.to_owned(),
        worker_builds: Vec::new(),
        missing_light: description.missing_light(),
        counters,
        elapsed_seconds: elapsed.map(|elapsed| elapsed.as_secs_f64()),
    };
    FrameImage::assemble(&plan.grid, sums, metadata)
}
