//! `clerestory render`: renders a scene in this process, without a farm.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use clerestory_film::{ImageMetadata, LARGEST_TILE, encode_png, mean_squared_standard_error, smallest_tile};
use clerestory_local_render::{PassPlan, Spent};
use clerestory_render_core::integrator::PreparedScene;

use crate::activity::Activity;
use crate::failure::Failure;
use crate::frames::{self, FrameArguments, file_of_frame};
use crate::image_file::read_reference;
use crate::like::{self, Recipe};
use crate::local_image::{RenderTask, render};
use crate::local_scene;
use crate::numbers::whole;
use crate::output::{print_json, print_line};
use crate::output_file::{
    check_image_name, check_outputs, is_standard_output, png_beside, write, write_or_keep, write_stats,
};
use crate::preview::PreviewArguments;
use crate::progress::Progress;
use crate::render_limits::RenderLimits;
use crate::render_summary::{PassCounts, Summary};
use crate::scene_overrides::{LoadedScene, SamplingOverrides, SceneOverrides};
use crate::standard_error;
use crate::threads::ThreadCount;

/// Options of `clerestory render`.
#[derive(Debug, Args)]
pub(crate) struct RenderArguments {
    /// The scene file.
    scene: PathBuf,
    /// The image to write [default: the scene's file name with .exr, in the working directory]. With several frames,
    /// #### in the name is the number of the frame.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Also write a PNG beside the image.
    #[arg(long)]
    png: bool,
    #[command(flatten)]
    frames: FrameArguments,
    #[command(flatten)]
    preview: PreviewArguments,
    #[command(flatten)]
    limits: RenderLimits,
    #[command(flatten)]
    overrides: SceneOverrides,
    #[command(flatten)]
    sampling: SamplingOverrides,
    /// Edge of a tile in pixels.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = whole(1..=LARGEST_TILE))]
    tile: u32,
    /// Make this image again, bit for bit: with its seed, integrator, size, sampling, tiles and passes.
    #[arg(long, value_name = "FILE", conflicts_with_all =
        ["spp", "time", "target_mse", "target_estimated_mse", "adaptive", "integrator", "set", "seed", "size",
        "samples_per_pass", "samples_per_block", "tile", "frame", "frames"])]
    like: Option<PathBuf>,
    /// OpenEXR image to measure the error against at each round.
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
    let (loaded, recipe) = load(&arguments)?;
    let frames = match &recipe {
        Some(recipe) => recipe.frame..=recipe.frame,
        None => arguments.frames.chosen(loaded.bundle.description())?,
    };
    let timeline = &loaded.bundle.description().timeline;
    let output = arguments.output.clone().unwrap_or_else(|| default_output(&arguments.scene, !timeline.is_empty()));
    let has_several = frames.clone().count() > 1;
    if has_several {
        frames::check_names(&[("--output", Some(&output)), ("--stats", arguments.stats.as_deref())])?;
    }
    let files = |frame| Files::of(&arguments, &output, Some(frame).filter(|_| !timeline.is_empty()));
    for frame in frames.clone() {
        files(frame).check(&arguments)?;
    }
    let mut before = None;
    for (number, frame) in frames.enumerate() {
        let files = files(frame);
        if has_several {
            let name = timeline.get(frame as usize).map(|frame| frame.name.as_str()).unwrap_or_default();
            Progress::new().note(format!("Frame {frame} {name}").trim_end());
        }
        let task = Arc::new(interpret(&arguments, &loaded, recipe.as_ref(), (frame, &files), before.take())?);
        if number == 0 {
            task.announce();
        }
        task.announce_sun();
        render_frame(&arguments, &task, &files).await?;
        before = Arc::into_inner(task).map(|task| task.scene);
    }
    Ok(())
}

/// The files of a frame.
struct Files {
    output: PathBuf,
    png: Option<PathBuf>,
    stats: Option<PathBuf>,
    reference: Option<PathBuf>,
}

impl Files {
    /// Without a timeline, no name has the number of a frame in it.
    fn of(arguments: &RenderArguments, output: &Path, frame: Option<u32>) -> Self {
        let of_frame = |pattern: &Path| frame.map_or_else(|| pattern.to_owned(), |frame| file_of_frame(pattern, frame));
        let output = of_frame(output);
        let png = arguments.png.then(|| png_beside(&output));
        let [stats, reference] = [&arguments.stats, &arguments.reference].map(|file| file.as_deref().map(of_frame));
        Self { output, png, stats, reference }
    }

    /// Whether they can be written.
    fn check(&self, arguments: &RenderArguments) -> Result<(), Failure> {
        let Self { output, png, stats, reference } = self;
        check_image_name(output)?;
        check_outputs(
            &[("--output", Some(output.as_path())), ("--png", png.as_deref()), ("--stats", stats.as_deref())],
            &[("the scene", Some(arguments.scene.as_path())), ("the reference", reference.as_deref())],
        )
    }
}

/// Renders a frame, and writes and prints what the options ask for.
async fn render_frame(arguments: &RenderArguments, task: &Arc<RenderTask>, files: &Files) -> Result<(), Failure> {
    let rendering = render(Arc::clone(task)).await?;
    let Files { output, png, stats, .. } = files;
    let Spent { wall, core } = rendering.spent;
    let image = task.image(&rendering.sums, rendering.counters, Some(wall)).map_err(Failure::BadImage)?;
    write_or_keep(output, &image.encode().map_err(|error| Failure::BadImage(error.into()))?)?;
    if let Some(file) = png {
        let bytes = encode_png(&image, &arguments.preview.settings()).map_err(Failure::Preview)?;
        write(file, &bytes)?;
    }
    let mut work = rendering.counters;
    work += rendering.pilot;
    let summary = Summary {
        frame: task.plan.frame,
        output: output.clone(),
        png: png.clone(),
        scene_hash: task.scene.hash().to_string(),
        width: image.width(),
        height: image.height(),
        samples: work.samples,
        passes: PassCounts::of(&image),
        tiles: task.plan.grid.len(),
        standard_error_tiles: image.metadata().map_or(0, ImageMetadata::tiles_with_standard_error),
        seconds: wall.as_secs_f64(),
        core_seconds: core.as_secs_f64(),
        samples_per_second: work.samples as f64 / wall.as_secs_f64(),
        threads: task.threads.get(),
        stopped_by: rendering.stopped_by,
        metrics: task.measures(&image)?,
        counters: work,
    };
    if let Some(file) = stats {
        write_stats(file, &work)?;
    }
    let metadata = image.metadata().filter(|_| task.absence.is_none());
    if arguments.json {
        print_json(&summary)?;
    } else if is_standard_output(output) {
        // The image is on standard output, and nothing else belongs there.
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

/// Reads the scene, and of `--like` how to make its image.
fn load(arguments: &RenderArguments) -> Result<(LoadedScene, Option<Recipe>), Failure> {
    let file = &arguments.scene;
    let activity = Activity::begin("Reading the scene and its files");
    let loaded = match &arguments.like {
        None => (arguments.overrides.load(file, arguments.sampling)?, None),
        Some(image) => {
            let loaded = arguments.overrides.load_at_moment(file)?;
            let recipe = like::recipe(loaded.bundle.clone(), file, image)?;
            (loaded, Some(recipe))
        }
    };
    activity.done("The scene is read");
    Ok(loaded)
}

/// What to render of a frame. What the scene of the frame `before` has in common with it is not built again.
fn interpret(
    arguments: &RenderArguments,
    loaded: &LoadedScene,
    recipe: Option<&Recipe>,
    (frame, files): (u32, &Files),
    before: Option<PreparedScene>,
) -> Result<RenderTask, Failure> {
    let failure = |source| Failure::scene(&arguments.scene, source);
    let (bundle, tiles) = match recipe {
        Some(Recipe { bundle, grid, tile_passes, .. }) => (bundle.clone(), Some((*grid, tile_passes.clone()))),
        None => (loaded.bundle.frame(frame).map_err(failure)?, None),
    };
    let assumptions = loaded.assumptions.clone();
    let activity = Activity::begin("Building the scene");
    let scene = match before {
        Some(before) => local_scene::change(before, &bundle),
        None => activity.build(&bundle),
    };
    let scene = scene.map_err(failure)?;
    activity.done("The scene is ready");
    let film = bundle.description().film;
    let sampling = scene.sampling();
    let plan = match tiles {
        Some((grid, tile_passes)) => PassPlan { frame, grid, sampling, tile_passes, adaptation: None },
        None => {
            let smallest = smallest_tile(film.width, film.height);
            if arguments.tile < smallest {
                return Err(Failure::Usage(format!(
                    "tiles of {0} x {0} pixels are too many: expected --tile of at least {smallest} pixels for an \
                     image of {1} x {2}",
                    arguments.tile, film.width, film.height
                )));
            }
            let grid = bundle.description().grid(arguments.tile);
            let passes = arguments.limits.samples_per_pixel().div_ceil(sampling.samples_per_pass());
            let adaptation = arguments.limits.adaptation(sampling, passes)?;
            PassPlan { frame, grid, sampling, tile_passes: vec![passes; grid.len() as usize], adaptation }
        }
    };
    let reference = files.reference.as_deref().map(|file| read_reference(file, film)).transpose()?;
    let reference = reference.map(|(_, image)| image);
    let noise = reference.as_ref().and_then(mean_squared_standard_error);
    arguments.limits.check_targets(reference.is_some(), noise)?;
    let threads = arguments.threads.unwrap_or_else(ThreadCount::of_cores).get();
    let (time, targets) = (arguments.limits.time, arguments.limits.targets());
    let samples = Some(arguments.limits.samples_per_pixel()).filter(|_| arguments.like.is_none());
    let absence = samples.and_then(|samples| standard_error::absence(sampling, samples));
    Ok(RenderTask { scene, plan, reference, threads, time, targets, absence, assumptions })
}

fn default_output(scene: &Path, has_timeline: bool) -> PathBuf {
    let mut name = scene.file_stem().unwrap_or(scene.as_os_str()).to_owned();
    name.push(if has_timeline { "-####.exr" } else { ".exr" });
    PathBuf::from(name)
}
