//! An image that is rendered in this process, with progress and stop rules.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant, SystemTime};

use clerestory_api::{ConvergencePoint, StopReason};
use clerestory_film::counters::Counters;
use clerestory_film::{FrameImage, ImageError, RoundError, Target, Targets, TileSum, mean_squared_standard_error};
use clerestory_local_render::{
    self as local_render, Clocks, Control, LocalRenderError, Outcome, PassPlan, Provenance, Round, Spent,
};
use clerestory_render_core::document::SunOfScene;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::site::{ShownTimes, SunPosition};
use rayon::ThreadPoolBuilder;
use tokio::sync::mpsc;

use crate::failure::Failure;
use crate::measures::Measures;
use crate::progress::{Advance, Progress};
use crate::shutdown::{self, Parent};
use crate::standard_error;
use crate::version::BUILD;

/// Time between updates of the progress bar.
const REFRESH_PERIOD: Duration = Duration::from_millis(200);

/// What to render, and when to stop.
pub(crate) struct RenderTask {
    pub(crate) scene: PreparedScene,
    pub(crate) plan: PassPlan,
    pub(crate) reference: Option<FrameImage>,
    pub(crate) threads: NonZeroUsize,
    pub(crate) time: Option<Duration>,
    pub(crate) targets: Targets,
    /// A note that the image will have no standard error, where that is known before the render.
    pub(crate) absence: Option<String>,
    /// What was assumed for a file of another program.
    pub(crate) assumptions: Vec<String>,
}

/// The result of a render.
pub(crate) struct Rendering {
    pub(crate) sums: Vec<TileSum>,
    pub(crate) counters: Counters,
    /// The work on the pilot, which is not in the image.
    pub(crate) pilot: Counters,
    pub(crate) spent: Spent,
    /// Why it stopped; `None` when the user interrupted.
    pub(crate) stopped_by: Option<StopReason>,
    pub(crate) is_interrupted: bool,
}

/// Renders on a pool of threads and shows progress.
pub(crate) async fn render(task: Arc<RenderTask>) -> Result<Rendering, Failure> {
    let clocks = Clocks::now();
    let start = Instant::now();
    // A deadline that the clock cannot represent never comes.
    let deadline = task.time.and_then(|time| start.checked_add(time));
    let control = Arc::new(Control { deadline, ..Control::default() });
    let threads = task.threads.get();
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().map_err(Failure::Threads)?;
    let (rounds, mut complete) = mpsc::unbounded_channel();
    let mut work = {
        let (task, control) = (task.clone(), control.clone());
        tokio::task::spawn_blocking(move || {
            let mut reached = None;
            let on_round = |round: &Round<'_>| {
                let point = task.point(round, control.samples.load(Ordering::Relaxed), clocks.spent(threads));
                let errors = [round_error(&point)];
                reached = task.targets.reached(task.plan.sampling.samples_per_block(), &errors).map(reason);
                // The receiver is gone only when the process ends.
                let _ = rounds.send(point);
                if reached.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let outcome = pool.install(|| local_render::render(&task.scene, &task.plan, &control, on_round))?;
            Ok::<_, LocalRenderError>((outcome, reached))
        })
    };
    let stop = shutdown::token(Parent::None);
    let mut progress = Progress::new();
    let mut refresh = tokio::time::interval(REFRESH_PERIOD);
    let mut latest = None;
    let result = loop {
        tokio::select! {
            result = &mut work => break result,
            Some(point) = complete.recv() => progress.round(latest.insert(point)),
            _ = refresh.tick() => progress.show(&task.advance(&control, start, latest.as_ref())),
            () = stop.cancelled(), if !control.cancelled.load(Ordering::Relaxed) => {
                control.cancelled.store(true, Ordering::Relaxed);
            }
        }
    };
    while let Ok(point) = complete.try_recv() {
        progress.round(&point);
    }
    progress.finish();
    let (Outcome { sums, counters, pilot, is_complete }, reached) = match result {
        Ok(outcome) => outcome.map_err(Failure::Render)?,
        Err(panic) => return Err(Failure::RenderPanic(panic)),
    };
    if sums.is_empty() {
        return Err(Failure::Job("interrupted before any pass was complete".to_owned()));
    }
    let is_interrupted = stop.is_cancelled();
    let without_target = if is_complete { StopReason::Samples } else { StopReason::Time };
    let stopped_by = Some(reached.unwrap_or(without_target)).filter(|_| !is_interrupted);
    Ok(Rendering { sums, counters, pilot, spent: clocks.spent(threads), stopped_by, is_interrupted })
}

impl RenderTask {
    /// Tells the user where the sun stands, if the scene has a place and an hour.
    pub(crate) fn announce_sun(&self) {
        // A scene that is built has been checked.
        let Ok(Some(SunOfScene { place, moment, time, position })) = self.scene.description().sun() else { return };
        let progress = Progress::new();
        for remark in moment.remarks() {
            progress.note(&remark.to_string());
        }
        let Ok(ShownTimes { universal, mean, apparent, .. }) = ShownTimes::at(&place, time) else { return };
        let SunPosition { altitude, azimuth, .. } = position;
        progress.note(&format!(
            "The sun is {altitude:.2} degrees high, {azimuth:.2} from north by east: {universal} universal time, {} \
             local mean time, {} by a sundial (Gregorian)",
            mean.time_of_day(),
            apparent.time_of_day(),
        ));
    }

    /// Tells the user what is known of the image before the render.
    pub(crate) fn announce(&self) {
        let progress = Progress::new();
        for mesh in self.scene.scene().meshes().iter().filter(|mesh| mesh.omitted_triangles() > 0) {
            let (name, omitted) = (mesh.name(), mesh.omitted_triangles());
            progress.note(&format!("Triangles without an area that are left out of the mesh {name:?}: {omitted}"));
        }
        progress.import_notes(self.scene.import_notes());
        progress.chosen_methods(&self.scene.chosen_methods());
        progress.missing_light(&self.scene.description().missing_light(), &self.scene.left_to_chance());
        self.absence.iter().for_each(|absence| progress.note(absence));
        let gaps = self.reference.as_ref().and_then(standard_error::reference_gaps);
        gaps.iter().for_each(|gaps| progress.note(gaps));
    }

    pub(crate) fn image(
        &self,
        sums: &[TileSum],
        counters: Counters,
        elapsed: Option<Duration>,
    ) -> Result<FrameImage, ImageError> {
        let provenance = Provenance { build: BUILD, counters, elapsed, assumptions: &self.assumptions };
        local_render::image(&self.scene, &self.plan, sums, &provenance)
    }

    pub(crate) fn measures(&self, image: &FrameImage) -> Result<Option<Measures>, Failure> {
        self.reference.as_ref().map(|reference| Measures::of(image, reference)).transpose()
    }

    /// The errors at a round; an error that cannot be measured is absent.
    fn point(&self, round: &Round<'_>, samples: u64, spent: Spent) -> ConvergencePoint {
        let counters = Counters { samples, ..Counters::default() };
        let image = self.image(round.sums, counters, Some(spent.wall)).ok();
        let measures = image.as_ref().and_then(|image| self.measures(image).ok().flatten());
        let metrics = measures.as_ref().map(|measures| &measures.metrics);
        let estimated_mse = image.as_ref().and_then(mean_squared_standard_error);
        let milliseconds = |duration: Duration| i64::try_from(duration.as_millis()).unwrap_or(i64::MAX);
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        ConvergencePoint {
            frame: 0,
            round: round.number,
            passes: round.passes,
            samples_per_pixel: u64::from(round.passes) * u64::from(self.plan.sampling.samples_per_pass()),
            core_ms: milliseconds(spent.core),
            wall_ms: milliseconds(spent.wall),
            recorded_ms: milliseconds(now),
            mse: metrics.map(|metrics| metrics.mse),
            corrected_mse: metrics.and_then(|metrics| metrics.corrected_mse),
            rel_mse: metrics.and_then(|metrics| metrics.rel_mse),
            psnr: metrics.and_then(|metrics| metrics.psnr),
            flip: measures.as_ref().map(|measures| measures.flip),
            estimated_mse,
        }
    }

    fn advance(&self, control: &Control, start: Instant, latest: Option<&ConvergencePoint>) -> Advance {
        let samples = control.samples.load(Ordering::Relaxed);
        let elapsed = start.elapsed();
        let most = self.plan.tile_passes.iter().copied().max().unwrap_or(0);
        let in_a_pixel = f64::from(most) * f64::from(self.plan.sampling.samples_per_pass());
        let samples_per_block = self.plan.sampling.samples_per_block();
        let latest = latest.map(round_error);
        let latest = latest.as_ref();
        let by_targets = latest.and_then(|error| self.targets.expected_samples(samples_per_block, error));
        let part = by_targets.map_or(1.0, |samples| (samples / in_a_pixel.max(1.0)).min(1.0));
        let expected = part * control.planned.load(Ordering::Relaxed) as f64;
        let by_samples = samples as f64 / expected.max(1.0);
        let by_time = self.time.map_or(0.0, |time| elapsed.as_secs_f64() / time.as_secs_f64());
        let fraction = by_samples.max(by_time).min(1.0);
        let remaining = elapsed.as_secs_f64() * (1.0 / fraction - 1.0);
        let is_end_known = self.time.is_some() || self.targets.is_end_known(samples_per_block, latest);
        let remaining = Some(remaining).filter(|_| samples > 0 && fraction > 0.0 && is_end_known);
        let remaining = remaining.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        let samples_per_second = (samples > 0).then(|| samples as f64 / elapsed.as_secs_f64());
        Advance { fraction, samples_per_second, remaining, ..Advance::default() }
    }
}

/// The errors of a round that targets are compared with.
fn round_error(point: &ConvergencePoint) -> RoundError {
    let ConvergencePoint { samples_per_pixel, mse, corrected_mse, estimated_mse, .. } = *point;
    RoundError { samples_per_pixel, mse, corrected_mse, estimated_mse }
}

/// The stop reason of a target.
fn reason(target: Target) -> StopReason {
    match target {
        Target::Mse => StopReason::Mse,
        Target::EstimatedMse => StopReason::EstimatedMse,
    }
}
