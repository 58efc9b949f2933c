//! Renders for a time of one core. Several run at once, each on a thread of its own.
//!
//! The clock is that of the thread. So other processes and pauses of the machine do not count, and no thread waits for
//! another one.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use clerestory_local_render::{self as local_render, Clocks, Control, LocalFilm, Provenance};
use clerestory_render_core::document::SceneBundle;
use rayon::ThreadPoolBuilder;

use crate::error::ExperimentError;
use crate::measure::plan;
use crate::session::{BuildScene, Session};
use crate::snapshot::Snapshot;

/// A render for a time of one core.
pub(crate) struct Job {
    /// What tells the user of it.
    pub(crate) name: String,
    pub(crate) bundle: SceneBundle,
}

/// What a thread needs to render.
struct Surroundings<'a> {
    control: &'a Control,
    build_scene: BuildScene,
    build: &'static str,
    core_seconds: f64,
}

/// Renders all jobs for `core_seconds` each, as many at once as the session has threads. `done` takes each snapshot
/// with the number of its job, and makes the line that stays.
pub(crate) fn render_all(
    session: &mut Session,
    jobs: &[Job],
    core_seconds: f64,
    mut done: impl FnMut(usize, &Snapshot) -> Result<String, ExperimentError>,
) -> Result<(), ExperimentError> {
    let threads = session.settings.threads.get().min(jobs.len().max(1));
    let control = session.control.clone();
    let surroundings =
        Surroundings { control: &control, build_scene: session.build_scene, build: session.build, core_seconds };
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            let (next, surroundings, sender) = (&next, &surroundings, sender.clone());
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(job) = jobs.get(index) else { break };
                    let result = render(surroundings, job);
                    let is_last = !matches!(result, Ok(Some(_)));
                    if sender.send((index, result)).is_err() || is_last {
                        break;
                    }
                }
            });
        }
        drop(sender);
        for (index, result) in receiver {
            let Some(snapshot) = result? else { return Err(session.interrupted()) };
            session.begin(jobs[index].name.clone());
            let line = done(index, &snapshot)?;
            session.end(&line);
        }
        Ok(())
    })
}

/// Renders one job on this thread; `None` when the user interrupted.
fn render(surroundings: &Surroundings<'_>, job: &Job) -> Result<Option<Snapshot>, ExperimentError> {
    let Surroundings { control, build_scene, build, core_seconds } = *surroundings;
    let pool = ThreadPoolBuilder::new().num_threads(1).build().map_err(ExperimentError::Threads)?;
    pool.install(|| {
        let failure = |source| ExperimentError::scene(job.bundle.description().name.as_ref(), source);
        let scene = build_scene(&job.bundle).map_err(failure)?;
        let plan = plan(&scene, u32::MAX);
        let mut film = LocalFilm::new(&scene, &plan);
        let (mut passes, mut wall, mut core) = (0_u64, 0.0, 0.0);
        while passes == 0 || core < core_seconds {
            let clocks = Clocks::of_this_thread();
            if !film.render_pass(control).map_err(ExperimentError::Render)? {
                return Ok(None);
            }
            let spent = clocks.spent(1);
            wall += spent.wall.as_secs_f64();
            core += spent.core.as_secs_f64();
            passes += 1;
        }
        let sums = film.sums().map_err(ExperimentError::Render)?;
        let counters = film.counters;
        let provenance = Provenance { build, counters, elapsed: None, assumptions: &[] };
        let image = local_render::image(&scene, &plan, &sums, &provenance).map_err(ExperimentError::BadImage)?;
        let samples = passes * u64::from(plan.sampling.samples_per_pass());
        Ok(Some(Snapshot { samples, wall_seconds: wall, core_seconds: core, counters, image }))
    })
}
