//! Renders for a time or for numbers of samples, with their cost.

use std::ops::ControlFlow;

use clerestory_film::{Targets, smallest_tile};
use clerestory_local_render::{self as local_render, Clocks, LocalFilm, Outcome, PassPlan, Provenance, Spent};
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::description::FilmDescription;
use clerestory_render_core::scene::{Asset, SceneError};

use crate::error::ExperimentError;
use crate::farm::{self, TILE};
use crate::host::Amount;
use crate::scenes::changed;
use crate::session::Session;
use crate::snapshot::Snapshot;
use crate::variant::Variant;

/// Renders until each of the times, in seconds. This process renders whole passes of one render. A farm renders one job
/// for each time, and measures its error against the reference.
pub(crate) fn until(
    session: &mut Session,
    bundle: &SceneBundle,
    times: &[f64],
    reference: &Asset,
) -> Result<Vec<Snapshot>, ExperimentError> {
    if farm::is_there(session) {
        let job = |&time: &f64| farm::render(session, bundle, Amount::Seconds(time), Some(reference));
        return times.iter().map(job).collect();
    }
    let longest = times.last().copied().unwrap_or(0.0);
    let scene = build(session, bundle)?;
    let plan = plan(&scene, u32::MAX);
    let mut render = Render::new(&scene, &plan);
    let mut snapshots = Vec::new();
    for &time in times {
        while render.passes == 0 || render.spent.wall.as_secs_f64() < time {
            render.pass(session)?;
            session.advance(render.spent.wall.as_secs_f64() / longest);
        }
        snapshots.push(render.snapshot(session)?);
    }
    Ok(snapshots)
}

/// Renders ascending numbers of samples in each pixel, until `core_seconds` are spent; the first number is always
/// rendered. This process renders whole passes of one render, and a farm one job for each number.
///
/// The time to build the scene does not count; [`preparation_seconds`] measures it.
pub(crate) fn counts(
    session: &mut Session,
    bundle: &SceneBundle,
    counts: &[u32],
    core_seconds: f64,
    reference: &Asset,
) -> Result<Vec<Snapshot>, ExperimentError> {
    let mut snapshots: Vec<Snapshot> = Vec::new();
    let is_over = |snapshots: &[Snapshot]| snapshots.last().is_some_and(|last| last.core_seconds >= core_seconds);
    if farm::is_there(session) {
        for &count in counts {
            if is_over(&snapshots) {
                break;
            }
            snapshots.push(farm::render(session, bundle, Amount::Samples(count), Some(reference))?);
        }
        return Ok(snapshots);
    }
    let most = counts.last().copied().unwrap_or(1);
    let scene = build(session, bundle)?;
    let plan = plan(&scene, u32::MAX);
    let mut render = Render::new(&scene, &plan);
    for &count in counts {
        if is_over(&snapshots) {
            break;
        }
        while render.samples() < u64::from(count) {
            render.pass(session)?;
            session.advance(render.samples() as f64 / f64::from(most));
        }
        snapshots.push(render.snapshot(session)?);
    }
    Ok(snapshots)
}

/// Renders `samples` samples in each pixel, rounded up to whole passes.
pub(crate) fn samples(session: &mut Session, bundle: &SceneBundle, samples: u32) -> Result<Snapshot, ExperimentError> {
    if farm::is_there(session) {
        return farm::render(session, bundle, Amount::Samples(samples), None);
    }
    let scene = build(session, bundle)?;
    let passes = samples.div_ceil(scene.sampling().samples_per_pass()).max(1);
    let plan = plan(&scene, passes);
    let mut render = Render::new(&scene, &plan);
    for pass in 1..=passes {
        render.pass(session)?;
        session.advance(f64::from(pass) / f64::from(passes));
    }
    render.snapshot(session)
}

/// How passes are shared out among tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sharing {
    /// Every tile gets the same.
    Even,
    /// By the noise of a pilot.
    ByNoise,
}

/// Edge of a tile in an adaptive render, in pixels: a small picture then has as many tiles as a large one.
const SHARED_TILE: u32 = 8;

/// Renders `samples` samples in each pixel, or in the noisiest tiles, in this process. The time includes the pilot.
pub(crate) fn shared(
    session: &Session,
    bundle: &SceneBundle,
    samples: u32,
    sharing: Sharing,
) -> Result<Snapshot, ExperimentError> {
    let scene = build(session, bundle)?;
    let sampling = scene.sampling();
    let passes = samples.div_ceil(sampling.samples_per_pass()).max(1);
    let FilmDescription { width, height } = scene.description().film;
    let grid = scene.description().grid(SHARED_TILE.max(smallest_tile(width, height)));
    let adaptation = match sharing {
        Sharing::Even => None,
        Sharing::ByNoise => Targets::default().adaptation(sampling, passes).ok(),
    };
    let plan = PassPlan { frame: 0, grid, sampling, tile_passes: vec![passes; grid.len() as usize], adaptation };
    let clocks = Clocks::now();
    let control = &*session.control;
    let render = || local_render::render(&scene, &plan, control, |_| ControlFlow::Continue(()));
    let outcome = session.pool.install(render);
    let Outcome { sums, counters, is_complete, .. } = outcome.map_err(ExperimentError::Render)?;
    if !is_complete {
        return Err(session.interrupted());
    }
    let Spent { wall, core } = clocks.spent(session.settings.threads.get());
    let provenance = Provenance { build: session.build, counters, elapsed: Some(wall), assumptions: &[] };
    let image = local_render::image(&scene, &plan, &sums, &provenance).map_err(ExperimentError::BadImage)?;
    Ok(Snapshot {
        samples: u64::from(passes) * u64::from(sampling.samples_per_pass()),
        wall_seconds: wall.as_secs_f64(),
        core_seconds: core.as_secs_f64(),
        counters,
        image,
    })
}

/// Core seconds to build a scene: the work of an animation for each frame before it renders.
pub(crate) fn build_seconds(session: &Session, bundle: &SceneBundle) -> Result<f64, ExperimentError> {
    let clocks = Clocks::now();
    let build_scene = session.build_scene;
    let built = session.pool.install(|| build_scene(bundle).map(drop));
    built.map_err(|source| scene_error(bundle, source))?;
    Ok(clocks.spent(session.settings.threads.get()).core.as_secs_f64())
}

/// Repetitions of a build whose time is measured.
const BUILDS: u32 = 5;

/// Core seconds in which an integrator prepares its search, such as the tree of `conic`, once for each frame. It is the
/// difference to a build for path tracing alone, by the shortest of several builds in turn.
pub(crate) fn preparation_seconds(session: &Session, bundle: &SceneBundle) -> Result<f64, ExperimentError> {
    let description = bundle.description();
    let path = Variant::path().integrator(&description.integrator);
    let without = changed(bundle, path, description.seed, description.sampling)
        .map_err(|source| ExperimentError::scene(description.name.as_ref(), source))?;
    let mut shortest = [f64::INFINITY; 2];
    for _ in 0..BUILDS {
        for (shortest, bundle) in shortest.iter_mut().zip([bundle, &without]) {
            *shortest = shortest.min(build_seconds(session, bundle)?);
        }
    }
    let [with, without] = shortest;
    Ok((with - without).max(0.0))
}

fn build(session: &Session, bundle: &SceneBundle) -> Result<PreparedScene, ExperimentError> {
    (session.build_scene)(bundle).map_err(|source| scene_error(bundle, source))
}

fn scene_error(bundle: &SceneBundle, source: SceneError) -> ExperimentError {
    ExperimentError::scene(bundle.description().name.as_ref(), source)
}

/// A plan of so many passes of every tile.
pub(crate) fn plan(scene: &PreparedScene, passes: u32) -> PassPlan {
    let film = scene.description().film;
    let tile_size = TILE.max(smallest_tile(film.width, film.height));
    let grid = scene.description().grid(tile_size);
    let tile_passes = vec![passes; grid.len() as usize];
    PassPlan { frame: 0, grid, sampling: scene.sampling(), tile_passes, adaptation: None }
}

struct Render<'a> {
    scene: &'a PreparedScene,
    plan: &'a PassPlan,
    film: LocalFilm<'a>,
    passes: u32,
    /// Time of passes, without the time of snapshots.
    spent: Spent,
}

impl<'a> Render<'a> {
    fn new(scene: &'a PreparedScene, plan: &'a PassPlan) -> Self {
        Self { scene, plan, film: LocalFilm::new(scene, plan), passes: 0, spent: Spent::default() }
    }

    /// Samples in each pixel.
    fn samples(&self) -> u64 {
        u64::from(self.passes) * u64::from(self.plan.sampling.samples_per_pass())
    }

    fn pass(&mut self, session: &Session) -> Result<(), ExperimentError> {
        let clocks = Clocks::now();
        let (film, control) = (&mut self.film, &*session.control);
        let is_complete = session.pool.install(|| film.render_pass(control)).map_err(ExperimentError::Render)?;
        if !is_complete {
            return Err(session.interrupted());
        }
        self.passes += 1;
        let spent = clocks.spent(session.settings.threads.get());
        self.spent = Spent { wall: self.spent.wall + spent.wall, core: self.spent.core + spent.core };
        Ok(())
    }

    fn snapshot(&self, session: &Session) -> Result<Snapshot, ExperimentError> {
        let sums = self.film.sums().map_err(ExperimentError::Render)?;
        let Spent { wall, core } = self.spent;
        let provenance =
            Provenance { build: session.build, counters: self.film.counters, elapsed: Some(wall), assumptions: &[] };
        let image = local_render::image(self.scene, self.plan, &sums, &provenance);
        Ok(Snapshot {
            samples: self.samples(),
            wall_seconds: wall.as_secs_f64(),
            core_seconds: core.as_secs_f64(),
            counters: self.film.counters,
            image: image.map_err(ExperimentError::BadImage)?,
        })
    }
}
