//! `clerestory render`: a scene rendered in this process, without a farm.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant, SystemTime};

use clap::Args;
use clerestory_api::{ConvergencePoint, StopReason};
use clerestory_film::counters::Counters;
use clerestory_film::{
    FrameImage, ImageError, ImageMetadata, RoundError, Target, Targets, TileGrid, TileSum, encode_png,
    mean_squared_standard_error, smallest_tile,
};
use clerestory_local_render::{
    self as local_render, Clocks, Control, LocalRenderError, Outcome, PassPlan, Provenance, Round, Spent,
};
use clerestory_render_core::scene::Scene;
use rayon::ThreadPoolBuilder;
use serde::Serialize;
use tokio::sync::mpsc;

use crate::activity::Activity;
use crate::arguments::whole;
use crate::commands::compare::Measures;
use crate::commands::worker::BUILD;
use crate::failure::Failure;
use crate::image_file::read_reference;
use crate::like::{self, Recipe};
use crate::output_file::{
    check_image_name, check_outputs, is_standard_output, png_beside, write, write_or_keep, write_stats,
};
use crate::preview::PreviewArguments;
use crate::render_limits::RenderLimits;
use crate::scene_overrides::{SamplingOverrides, SceneOverrides};
use crate::shutdown::{self, Parent};
use crate::standard_error;
use crate::terminal::{Advance, Progress, counted, duration_text, print_json, print_line};
use crate::threads::ThreadCount;

/// Time between updates of the progress bar.
const REFRESH_PERIOD: Duration = Duration::from_millis(200);

/// Options of `clerestory render`.
#[derive(Debug, Args)]
pub(crate) struct RenderArguments {
    /// The scene file.
    scene: PathBuf,
    /// The image to write [default: the scene's file name with .exr, in the working directory].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Also write a PNG beside the image.
    #[arg(long)]
    png: bool,
    #[command(flatten)]
    preview: PreviewArguments,
    #[command(flatten)]
    limits: RenderLimits,
    #[command(flatten)]
    overrides: SceneOverrides,
    #[command(flatten)]
    sampling: SamplingOverrides,
    /// Edge of a tile in pixels.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = whole(1..=1024_u32))]
    tile: u32,
    /// Make this image again, bit for bit: its seed, integrator, size, sampling, tiles and the passes of each.
    #[arg(long, value_name = "FILE", conflicts_with_all =
        ["spp", "time", "target_mse", "target_estimated_mse", "adaptive", "integrator", "solver", "selection", "max_trials", "walks", "constraint", "steps", "chains", "casters",
        "receivers", "search", "missed", "reflected", "seed", "size", "samples_per_pass", "samples_per_block", "tile"])]
    like: Option<PathBuf>,
    /// OpenEXR image that the error is measured against at each round.
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Threads that render [default: one for each core].
    #[arg(long, value_name = "N", env = "CLERESTORY_THREADS")]
    threads: Option<ThreadCount>,
    /// Write the counters (height evaluations, solver calls, solutions, ...) as JSON to this file.
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    /// Write a summary as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) async fn run(arguments: RenderArguments) -> Result<(), Failure> {
    let output = arguments.output.clone().unwrap_or_else(|| default_output(&arguments.scene));
    check_image_name(&output)?;
    let png = arguments.png.then(|| png_beside(&output));
    check_outputs(
        &[("--output", Some(output.as_path())), ("--png", png.as_deref()), ("--stats", arguments.stats.as_deref())],
        &[("the scene", Some(arguments.scene.as_path())), ("the reference", arguments.reference.as_deref())],
    )?;
    let order = Arc::new(interpret(&arguments)?);
    order.tell();
    let rendering = render(order.clone()).await?;

    let Spent { wall, core } = rendering.spent;
    let image = order.image(&rendering.sums, rendering.counters, Some(wall)).map_err(Failure::BadImage)?;
    write_or_keep(&output, &image.encode().map_err(|error| Failure::BadImage(error.into()))?)?;
    if let Some(file) = &png {
        let bytes = encode_png(&image, &arguments.preview.settings()).map_err(Failure::Preview)?;
        write(file, &bytes)?;
    }
    let mut work = rendering.counters;
    work += rendering.pilot;
    let summary = Summary {
        output: output.clone(),
        png,
        scene_hash: order.scene.hash().to_string(),
        width: image.width(),
        height: image.height(),
        samples: work.samples,
        passes: PassCounts::of(&image),
        tiles: order.plan.grid.len(),
        standard_error_tiles: image.metadata().map_or(0, ImageMetadata::tiles_with_standard_error),
        seconds: wall.as_secs_f64(),
        core_seconds: core.as_secs_f64(),
        samples_per_second: work.samples as f64 / wall.as_secs_f64(),
        threads: order.threads.get(),
        stopped_by: rendering.stopped_by,
        metrics: order.measures(&image)?,
        counters: work,
    };
    if let Some(file) = &arguments.stats {
        write_stats(file, &work)?;
    }
    let metadata = image.metadata().filter(|_| order.absence.is_none());
    if arguments.json {
        print_json(&summary)?;
    } else if is_standard_output(&output) {
        // The image is there, and nothing else belongs into it.
        Progress::new().note(&summary.text());
    } else {
        print_line(&summary.text())?;
    }
    if rendering.is_interrupted {
        let gaps = metadata.and_then(standard_error::gaps).map(|gaps| format!("; {gaps}")).unwrap_or_default();
        return Err(Failure::Job(format!("interrupted; {} holds what was complete{gaps}", output.display())));
    }
    if let Some(note) = metadata.and_then(standard_error::note_of_gaps) {
        Progress::new().note(&note);
    }
    Ok(())
}

/// A render, with everything that it needs.
struct Order {
    scene: Scene,
    plan: PassPlan,
    reference: Option<FrameImage>,
    threads: NonZeroUsize,
    time: Option<Duration>,
    targets: Targets,
    /// That the image will have no standard error, where that is known before it is rendered.
    absence: Option<String>,
}

/// What came out of a render.
struct Rendering {
    sums: Vec<TileSum>,
    counters: Counters,
    /// Work that is not in the image.
    pilot: Counters,
    spent: Spent,
    /// What ended it; `None` when it was interrupted.
    stopped_by: Option<StopReason>,
    is_interrupted: bool,
}

fn interpret(arguments: &RenderArguments) -> Result<Order, Failure> {
    let file = &arguments.scene;
    let failure = |source| Failure::scene(file, source);
    let activity = Activity::begin("Reading the scene and its files");
    let (bundle, tiles) = match &arguments.like {
        None => (arguments.overrides.load(file, arguments.sampling)?, None),
        Some(image) => {
            let Recipe { bundle, tile_size, tile_passes } = like::recipe(file, image)?;
            (bundle, Some((tile_size, tile_passes)))
        }
    };
    let scene = activity.build(&bundle).map_err(failure)?;
    activity.done("The scene is ready");
    let film = bundle.description().film;
    let sampling = scene.sampling();
    let grid = |tile_size| TileGrid { width: film.width, height: film.height, tile_size };
    let plan = match tiles {
        Some((tile_size, tile_passes)) => PassPlan { grid: grid(tile_size), sampling, tile_passes, adaptation: None },
        None => {
            let smallest = smallest_tile(film.width, film.height);
            if arguments.tile < smallest {
                return Err(Failure::Usage(format!(
                    "tiles of {0} x {0} pixels are too many: expected --tile of at least {smallest} pixels for an image of {1} x {2}",
                    arguments.tile, film.width, film.height
                )));
            }
            let grid = grid(arguments.tile);
            let passes = arguments.limits.samples_per_pixel().div_ceil(sampling.samples_per_pass());
            let adaptation = arguments.limits.adaptation(sampling, passes)?;
            PassPlan { grid, sampling, tile_passes: vec![passes; grid.len() as usize], adaptation }
        }
    };
    let reference = arguments.reference.as_deref().map(|file| read_reference(file, film)).transpose()?;
    let reference = reference.map(|(_, image)| image);
    let noise = reference.as_ref().and_then(mean_squared_standard_error);
    arguments.limits.check_targets(reference.is_some(), noise)?;
    let threads = arguments.threads.unwrap_or_else(ThreadCount::of_cores).get();
    let (time, targets) = (arguments.limits.time, arguments.limits.targets());
    let samples = Some(arguments.limits.samples_per_pixel()).filter(|_| arguments.like.is_none());
    let absence = samples.and_then(|samples| standard_error::absence(sampling, samples));
    Ok(Order { scene, plan, reference, threads, time, targets, absence })
}

/// Renders on a pool of threads, and shows progress meanwhile.
async fn render(order: Arc<Order>) -> Result<Rendering, Failure> {
    let clocks = Clocks::now();
    let start = Instant::now();
    // A deadline that no clock reaches is none.
    let deadline = order.time.and_then(|time| start.checked_add(time));
    let control = Arc::new(Control { deadline, ..Control::default() });
    let threads = order.threads.get();
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().map_err(Failure::Threads)?;
    let (rounds, mut complete) = mpsc::unbounded_channel();
    let mut work = {
        let (order, control) = (order.clone(), control.clone());
        tokio::task::spawn_blocking(move || {
            let mut reached = None;
            let on_round = |round: &Round<'_>| {
                let point = order.point(round, control.samples.load(Ordering::Relaxed), clocks.spent(threads));
                let errors = [round_error(&point)];
                reached = order.targets.reached(order.plan.sampling.samples_per_block(), &errors).map(reason);
                // Nobody listens any more only when the process ends.
                let _ = rounds.send(point);
                if reached.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let outcome = pool.install(|| local_render::render(&order.scene, &order.plan, &control, on_round))?;
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
            _ = refresh.tick() => progress.show(&order.advance(&control, start, latest.as_ref())),
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

impl Order {
    /// Says what is known of the image before it is rendered.
    fn tell(&self) {
        let progress = Progress::new();
        for mesh in self.scene.meshes().iter().filter(|mesh| mesh.omitted_triangles() > 0) {
            let (name, omitted) = (mesh.name(), mesh.omitted_triangles());
            progress.note(&format!("Triangles without an area that are left out of the mesh {name:?}: {omitted}"));
        }
        progress.missing_light(&self.scene.description().missing_light(), &self.scene.left_to_chance());
        self.absence.iter().for_each(|absence| progress.note(absence));
        let gaps = self.reference.as_ref().and_then(standard_error::reference_gaps);
        gaps.iter().for_each(|gaps| progress.note(gaps));
    }

    fn image(&self, sums: &[TileSum], counters: Counters, elapsed: Option<Duration>) -> Result<FrameImage, ImageError> {
        local_render::image(&self.scene, &self.plan, sums, &Provenance { build: BUILD, counters, elapsed })
    }

    fn measures(&self, image: &FrameImage) -> Result<Option<Measures>, Failure> {
        self.reference.as_ref().map(|reference| Measures::of(image, reference)).transpose()
    }

    /// The error at a round; what cannot be measured is absent.
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

/// Why a render stops that has reached a target.
fn reason(target: Target) -> StopReason {
    match target {
        Target::Mse => StopReason::Mse,
        Target::EstimatedMse => StopReason::EstimatedMse,
    }
}

/// What `--json` prints.
#[derive(Serialize)]
struct Summary {
    output: PathBuf,
    png: Option<PathBuf>,
    scene_hash: String,
    width: u32,
    height: u32,
    samples: u64,
    passes: PassCounts,
    tiles: u32,
    /// Tiles whose standard error is known.
    standard_error_tiles: u32,
    /// Wall-clock time of rendering.
    seconds: f64,
    /// Time that all cores together spent on it.
    core_seconds: f64,
    samples_per_second: f64,
    threads: usize,
    stopped_by: Option<StopReason>,
    metrics: Option<Measures>,
    counters: Counters,
}

/// Fewest and most passes of any tile.
#[derive(Serialize)]
struct PassCounts {
    fewest: u32,
    most: u32,
}

impl PassCounts {
    fn of(image: &FrameImage) -> Self {
        let passes = image.metadata().map(|metadata| metadata.tile_passes.as_slice()).unwrap_or_default();
        let [fewest, most] = [passes.iter().min(), passes.iter().max()].map(|count| count.copied().unwrap_or(0));
        Self { fewest, most }
    }
}

impl Summary {
    fn text(&self) -> String {
        let mut text = format!(
            "Wrote {}{}: {}, {} in {} ({} of core time), {:.0} a second",
            self.output.display(),
            self.png.as_ref().map(|file| format!(" and {}", file.display())).unwrap_or_default(),
            match self.passes {
                PassCounts { fewest, most } if fewest == most => counted(most.into(), "pass", "passes"),
                PassCounts { fewest, most } => format!("{fewest} to {most} passes"),
            },
            counted(self.samples, "sample", "samples"),
            duration_text(Duration::from_secs_f64(self.seconds)),
            duration_text(Duration::from_secs_f64(self.core_seconds)),
            self.samples_per_second,
        );
        if let Some(Measures { metrics, .. }) = &self.metrics {
            text.push_str(&format!("; MSE {:.4e}", metrics.mse));
        }
        text
    }
}

fn default_output(scene: &Path) -> PathBuf {
    let mut name = scene.file_stem().unwrap_or(scene.as_os_str()).to_owned();
    name.push(".exr");
    PathBuf::from(name)
}
