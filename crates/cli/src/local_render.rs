//! Rendering in one process: the same passes, merged in the same tree, as on a farm, and so the same bits.
//!
//! Passes are taken one after another over all tiles, so that an image that is stopped early is about equally good
//! everywhere. A pass of a tile is complete or does not count.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use clerestory_film::adaptive::{noise, shares};
use clerestory_film::counters::Counters;
use clerestory_film::{
    Adaptation, FilmTile, FrameImage, ImageError, ImageMetadata, InsertError, NodeAddress, PILOT_ROUND, Rounds,
    Sampling, Share, SumError, TileGrid, TileSum,
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
    /// How they are shared out; `None` where each tile gets its own. All tiles then have the same of them.
    pub(crate) adaptation: Option<Adaptation>,
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
    /// Camera samples in all that is to be rendered, once it is known what that is.
    pub(crate) planned: AtomicU64,
}

impl Control {
    fn is_late(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

/// A complete round.
pub(crate) struct Round<'a> {
    /// Its number, from 0.
    pub(crate) number: u32,
    /// Passes in every tile, or in those that have most.
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
    /// Passes that it has.
    passes: u32,
    /// Passes that it is to get for now.
    wanted: u32,
}

impl PassPlan {
    /// Camera samples that it takes at most.
    pub(crate) fn samples(&self) -> u64 {
        let pilot_passes = self.adaptation.map_or(0, |adaptation| adaptation.pilot_passes());
        self.samples_of(&self.tile_passes).saturating_add(self.samples_of(&vec![pilot_passes; self.tile_passes.len()]))
    }

    fn samples_of(&self, tile_passes: &[u32]) -> u64 {
        let tiles = (0..).map_while(|index| self.grid.tile(index)).zip(tile_passes);
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
                (wanted > 0).then_some(LocalTile { index, film, passes: 0, wanted })
            })
            .collect();
        Self { scene, plan, tiles, counters: Counters::default() }
    }

    /// Renders one more pass of every tile that is to have more; says whether it is complete, or `control` said stop.
    pub(crate) fn render_pass(&mut self, control: &Control) -> Result<bool, LocalRenderError> {
        let Self { scene, plan, .. } = *self;
        let render_tile = |tile: &mut LocalTile| -> Result<Option<Counters>, LocalRenderError> {
            if tile.passes >= tile.wanted {
                return Ok(Some(Counters::default()));
            }
            if tile.passes > 0 && control.is_late() {
                return Ok(None);
            }
            let Some(Rendered { node, counters }) = render_leaf(scene, plan, tile.index, tile.passes, control)? else {
                return Ok(None);
            };
            tile.film.insert(node)?;
            tile.passes += 1;
            Ok(Some(counters))
        };
        let rendered: Vec<Option<Counters>> = self.tiles.par_iter_mut().map(render_tile).collect::<Result<_, _>>()?;
        rendered.iter().flatten().for_each(|tile| self.counters += *tile);
        Ok(rendered.iter().all(Option::is_some))
    }

    /// The sums over the complete passes of each tile; a tile without any is left out.
    pub(crate) fn sums(&self) -> Result<Vec<TileSum>, LocalRenderError> {
        let complete = self.tiles.iter().map(|tile| &tile.film).filter(|film| film.complete_passes() > 0);
        Ok(complete.map(|film| film.sum(film.complete_passes())).collect::<Result<_, _>>()?)
    }

    /// Renders every tile up to so many passes; says whether that is complete, or `control` said stop.
    fn render_up_to(&mut self, tile_passes: &[u32], control: &Control) -> Result<bool, LocalRenderError> {
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

/// Renders a pass of a tile; `None` when `control` said stop.
fn render_leaf(
    scene: &Scene,
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

/// What came out of a render.
pub(crate) struct Outcome {
    /// The sums over the complete passes of each tile; a tile without any is left out.
    pub(crate) sums: Vec<TileSum>,
    /// The work on the image, unfinished passes included.
    pub(crate) counters: Counters,
    /// The work on the pilot, which is not in the image.
    pub(crate) pilot: Counters,
    /// Whether all was rendered that was to be.
    pub(crate) is_complete: bool,
}

/// Renders on the current rayon pool until everything is complete, or `control` or `on_round` says stop.
pub(crate) fn render(
    scene: &Scene,
    plan: &PassPlan,
    control: &Control,
    mut on_round: impl FnMut(&Round<'_>) -> ControlFlow<()>,
) -> Result<Outcome, LocalRenderError> {
    let mut film = LocalFilm::new(scene, plan);
    let mut pilot = Counters::default();
    control.planned.store(plan.samples(), Ordering::Relaxed);
    let is_complete = render_rounds(&mut film, &mut pilot, control, &mut on_round)?;
    Ok(Outcome { sums: film.sums()?, counters: film.counters, pilot, is_complete })
}

fn render_rounds(
    film: &mut LocalFilm<'_>,
    pilot: &mut Counters,
    control: &Control,
    on_round: &mut impl FnMut(&Round<'_>) -> ControlFlow<()>,
) -> Result<bool, LocalRenderError> {
    let plan = film.plan;
    let mut shares: Option<Vec<Share>> = None;
    // A round is complete in every tile of the image, so one that gets no pass at all leaves no rounds.
    let rounds = Rounds::new(plan.tile_passes.iter().copied().min().unwrap_or(0));
    for (number, passes) in (0..).map_while(|number| Some((number, rounds.end(number)?))) {
        let in_tiles = match (&plan.adaptation, &shares) {
            (Some(adaptation), Some(shares)) => shares.iter().map(|share| adaptation.passes(*share, passes)).collect(),
            _ => vec![passes; plan.tile_passes.len()],
        };
        if !film.render_up_to(&in_tiles, control)? {
            return Ok(false);
        }
        if on_round(&Round { number, passes, sums: &film.sums()? }).is_break() {
            return Ok(false);
        }
        if let Some(adaptation) = plan.adaptation.filter(|_| number == PILOT_ROUND) {
            shares = render_pilot(film, &adaptation, pilot, control)?;
            let Some(shares) = &shares else { return Ok(false) };
            let most = plan.tile_passes.iter().zip(shares).map(|(passes, share)| adaptation.passes(*share, *passes));
            let planned = plan.samples_of(&most.collect::<Vec<_>>()).saturating_add(pilot.samples);
            control.planned.store(planned, Ordering::Relaxed);
        }
    }
    match shares {
        Some(_) => Ok(true),
        None => film.render_up_to(&plan.tile_passes, control),
    }
}

/// Renders the pilot and decides what each tile gets; `None` when `control` said stop.
fn render_pilot(
    film: &LocalFilm<'_>,
    adaptation: &Adaptation,
    counters: &mut Counters,
    control: &Control,
) -> Result<Option<Vec<Share>>, LocalRenderError> {
    let LocalFilm { scene, plan, .. } = film;
    let noise_of = |tile: u32| -> Result<Option<(f64, Counters)>, LocalRenderError> {
        let (mut nodes, mut counters) = (Vec::new(), Counters::default());
        for pass in adaptation.pilot() {
            let rendered = if control.is_late() { None } else { render_leaf(scene, plan, tile, pass, control)? };
            let Some(rendered) = rendered else { return Ok(None) };
            nodes.push(rendered.node);
            counters += rendered.counters;
        }
        Ok(Some((noise(&nodes), counters)))
    };
    let tiles: Vec<Option<_>> = (0..plan.grid.len()).into_par_iter().map(noise_of).collect::<Result<_, _>>()?;
    tiles.iter().flatten().for_each(|(_, tile)| *counters += *tile);
    let noise: Option<Vec<f64>> = tiles.into_iter().map(|tile| tile.map(|(noise, _)| noise)).collect();
    Ok(noise.map(|noise| shares(&plan.grid, &noise)))
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
        standard_error_tiles: None,
        build: BUILD.to_owned(),
        worker_builds: Vec::new(),
        missing_light: description.missing_light(),
        left_to_chance: scene.left_to_chance(),
        counters,
        elapsed_seconds: elapsed.map(|elapsed| elapsed.as_secs_f64()),
    };
    FrameImage::assemble(&plan.grid, sums, metadata)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clerestory_film::Targets;
    use clerestory_film::decomposition::{mean, standard_error};
    use clerestory_render_core::scene;
    use clerestory_render_core::scene::SceneBundle;
    use clerestory_render_core::scene::description::{FilmDescription, SamplingDescription};

    use super::*;

    const PASSES: u32 = 40;

    /// The caustic of a crown pane in a few pixels, with small blocks.
    fn bundle(seed: u64) -> SceneBundle {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/references/crown-sphere.json");
        let bundle = scene::load(&file).unwrap();
        let mut description = bundle.description().clone();
        description.seed = seed;
        description.film = FilmDescription { width: 16, height: 16 };
        description.sampling = SamplingDescription { samples_per_pass: 4, samples_per_block: 16 };
        bundle.with_description(description).unwrap()
    }

    /// Mean radiance of the image, with passes shared out or not, and passes of the tiles.
    fn light(scene: &Scene, is_adaptive: bool) -> (f64, Vec<u32>) {
        let grid = TileGrid { width: 16, height: 16, tile_size: 4 };
        let adaptation = is_adaptive.then(|| Targets::default().adaptation(scene.sampling(), PASSES).unwrap());
        let plan = PassPlan { grid, sampling: scene.sampling(), tile_passes: vec![PASSES; 16], adaptation };
        let control = Control::default();
        let outcome = render(scene, &plan, &control, |_| ControlFlow::Continue(())).unwrap();
        assert!(outcome.is_complete);
        assert_eq!(control.planned.into_inner(), outcome.counters.samples + outcome.pilot.samples);
        let image = image(scene, &plan, &outcome.sums, outcome.counters, None).unwrap();
        let numbers: Vec<f64> = image.layers().mean.as_flattened().iter().map(|number| f64::from(*number)).collect();
        (mean(&numbers), image.metadata().unwrap().tile_passes.clone())
    }

    #[test]
    fn passes_shared_out_bring_as_much_light_as_the_same_in_every_tile() {
        // The two share samples, so that their difference says more than each of them.
        let (mut differences, mut even) = (Vec::new(), Vec::new());
        for seed in 0..48 {
            let scene = Scene::build(&bundle(seed)).unwrap();
            let ((adaptive, passes), (same, _)) = (light(&scene, true), light(&scene, false));
            assert!(passes.contains(&PASSES) && passes.iter().any(|passes| *passes < PASSES * 3 / 4), "{passes:?}");
            differences.push(adaptive - same);
            even.push(same);
        }
        let (difference, error, light) = (mean(&differences), standard_error(&differences).unwrap(), mean(&even));
        assert!(error < 0.005 * light, "the test has no power: {difference} +- {error} of {light}");
        assert!(difference.abs() < 4.0 * error, "{difference} +- {error} of {light}");
    }
}
