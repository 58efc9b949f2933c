//! `clerestory demo`: a farm on this machine renders sunlight through old panes, or a chapel, and shows its error
//! falling.

use std::fs;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, ValueEnum};
use clerestory_api::{ConvergencePoint, JobView};
use clerestory_render_core::document::{SamplingDescription, SceneDescription};
use clerestory_render_core::scene::description::FilmDescription;
use tempfile::TempDir;

use super::scene::write_chapel;
use crate::child::Environment;
use crate::connection::Connection;
use crate::download::download;
use crate::failure::Failure;
use crate::follow::follow;
use crate::image_file;
use crate::job_end::{check_done, check_image};
use crate::local_farm::{FarmPlan, LocalFarm, share_of_cores, share_of_memory};
use crate::outage::until_answered;
use crate::output::{print_json, print_line};
use crate::preflight::Preflight;
use crate::progress::Progress;
use crate::render_limits::RenderLimits;
use crate::scene_overrides::{LoadedScene, SamplingOverrides, SceneOverrides, Size};
use crate::shutdown::{self, Parent};
use crate::submission::{JobSettings, reference_asset, submit};
use crate::text::{counted, duration_text};

/// The room, from the root of the repository.
const SCENE: &str = "scenes/room.json";

/// The chapel, in the folder for the images.
const CHAPEL: &str = "chapel.json";

/// The reference: the same room with another seed, and some 280 samples a pixel.
const REFERENCE: &str = "scenes/room/demo-reference.exr";

/// What is rendered unless a scene is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum ShippedScene {
    /// Sunlight through four old panes in a room, with a reference.
    #[default]
    Room,
    /// A chapel with stained glass and leaded diamonds. It has no reference.
    Chapel,
}

impl ShippedScene {
    /// The scene file, which is made in the folder for the images where it does not ship.
    fn file(self, output: &Path) -> Result<PathBuf, Failure> {
        match self {
            Self::Room => shipped(SCENE),
            Self::Chapel => {
                fs::create_dir_all(output).map_err(|source| Failure::Write { file: output.to_owned(), source })?;
                let file = output.join(CHAPEL);
                write_chapel(&file)?;
                Ok(file)
            }
        }
    }

    /// Default size of the image. Paths in the chapel are longer.
    fn size(self) -> Size {
        let [width, height] = match self {
            Self::Room => [640, 480],
            Self::Chapel => [200, 150],
        };
        Size { width, height }
    }

    /// Smaller passes than the default, so that the first rounds come within seconds. Where there is no reference,
    /// blocks are small as well: four of them tell the error.
    fn sampling(self) -> SamplingDescription {
        let samples_per_block = match self {
            Self::Room => 64,
            Self::Chapel => 4,
        };
        SamplingDescription { samples_per_pass: 4, samples_per_block }
    }

    fn reference(self, film: FilmDescription, progress: &Progress) -> Result<Option<PathBuf>, Failure> {
        match self {
            Self::Room => shipped_reference(film, progress),
            Self::Chapel => Ok(None),
        }
    }
}

/// Worker processes.
const WORKERS: usize = 2;

/// Longest time to render, so that the demo ends soon on small machines too.
const TIME_LIMIT: Duration = Duration::from_secs(90);

/// Samples per pixel at which it ends on faster machines.
const SAMPLES_PER_PIXEL: u32 = 256;

/// Options of `clerestory demo`.
#[derive(Debug, Args)]
pub(crate) struct DemoArguments {
    /// What is rendered.
    #[arg(value_enum, default_value_t)]
    shipped: ShippedScene,
    /// Scene to render instead of one that ships with Clerestory.
    #[arg(long, value_name = "FILE", conflicts_with = "shipped")]
    scene: Option<PathBuf>,
    /// OpenEXR image that the error is measured against, for a scene of your own.
    #[arg(long, value_name = "FILE", requires = "scene")]
    reference: Option<PathBuf>,
    #[command(flatten)]
    limits: RenderLimits,
    #[command(flatten)]
    overrides: SceneOverrides,
    /// Folder for the images and logs.
    #[arg(long, value_name = "FOLDER", default_value = "demo-output")]
    output: PathBuf,
    /// End when the job has ended, instead of keeping the page open until Ctrl-C. Without a terminal on standard
    /// output, the demo always ends.
    #[arg(long)]
    exit: bool,
    /// Write the job as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) async fn run(mut arguments: DemoArguments) -> Result<(), Failure> {
    let mut progress = Progress::new();
    let scene = arguments.scene.clone().map_or_else(|| arguments.shipped.file(&arguments.output), Ok)?;
    if arguments.scene.is_none() {
        arguments.overrides.size.get_or_insert(arguments.shipped.size());
    }
    let mut limits = arguments.limits;
    if limits.spp.is_none() && limits.time.is_none() {
        limits.spp = Some(SAMPLES_PER_PIXEL);
        limits.time = Some(TIME_LIMIT);
    }
    let LoadedScene { bundle, assumptions } = arguments.overrides.load(&scene, SamplingOverrides::default())?;
    let description = SceneDescription { sampling: arguments.shipped.sampling(), ..bundle.description().clone() };
    let failure = |source| Failure::scene(&scene, source);
    let bundle = bundle.with_description(description).map_err(failure)?;
    let preflight = match Preflight::of(&bundle).map_err(failure)? {
        // The workers of the demo share the memory of this machine.
        Preflight::TooLarge(source) => return Err(failure(source)),
        preflight @ Preflight::Built(_) => preflight,
    };
    let reference = match arguments.scene {
        Some(_) => arguments.reference,
        None => arguments.shipped.reference(bundle.description().film, &progress)?,
    };
    limits.check_targets(reference.is_some(), None)?;
    let settings = JobSettings {
        name: None,
        samples_per_pixel: limits.samples_per_pixel(),
        time_limit_ms: limits.time_limit_ms(),
        targets: limits.targets(),
        adaptive: limits.adaptive,
        tile_size: 32,
        priority: 0,
        reference: reference_asset(reference.as_deref(), &bundle)?,
        assumptions,
    };

    let data = new_folder(&arguments.output)?;
    let stop = shutdown::token(Parent::None);
    let plan = FarmPlan {
        listen: "127.0.0.1:0".to_owned(),
        data: data.path().to_owned(),
        token_file: None,
        workers: WORKERS,
        threads: share_of_cores(WORKERS),
        memory_mib: share_of_memory(WORKERS),
        logs: Some(arguments.output.clone()),
        environment: Environment::WithoutSettings,
    };
    let mut farm = LocalFarm::start(&plan).await?;
    let connection = Connection::open(farm.address(), None)?;
    progress.note(&format!("The farm's page: {}", farm.address()));
    let threads = counted(plan.threads as u64, "thread", "threads");
    progress.note(&format!("Rendering {} on {WORKERS} workers of {threads}", scene.display()));

    let rendering = async {
        let job = submit(&connection, &bundle, settings).await?;
        progress.note(&format!("The job's page:  {}", connection.job_page(job.id)));
        preflight.announce(&job.missing_light, &progress);
        let job = follow(&connection, job.id, &mut progress).await?;
        check_image(&job)?;
        let series = until_answered(&connection, &progress, || connection.client.convergence(job.id)).await?;
        let files = [arguments.output.join("demo.exr"), arguments.output.join("demo.png")];
        download(&connection, &job, Some(&files[0]), Some(&files[1]), &progress).await?;
        if arguments.json { print_json(&job) } else { report(&job, &series.points, &files) }?;
        Ok(job)
    };
    let mut result = tokio::select! {
        result = rendering => result,
        failure = farm.broken() => Err(failure),
        () = stop.cancelled() => Err(Failure::Job("interrupted".to_owned())),
    };
    if let Ok(job) = &result
        && !arguments.exit
        && io::stdout().is_terminal()
    {
        progress.note(&format!("The page stays open until Ctrl-C: {}", connection.job_page(job.id)));
        tokio::select! {
            failure = farm.broken() => result = Err(failure),
            () = stop.cancelled() => {}
        }
    }
    farm.stop().await;
    let job = result?;
    progress.note(&format!(
        "For a farm that stays run `clerestory farm`, and beside it `clerestory submit {}{}`",
        scene.display(),
        reference.map(|file| format!(" --reference {}", file.display())).unwrap_or_default()
    ));
    check_done(&job)
}

/// Prints the result.
fn report(job: &JobView, points: &[ConvergencePoint], files: &[PathBuf]) -> Result<(), Failure> {
    let rate = job.samples as f64 / (job.core_ms.max(1) as f64 / 1000.0);
    let core_time = Duration::from_millis(u64::try_from(job.core_ms).unwrap_or(0));
    print_line(&format!(
        "{} samples in {} of core time, {rate:.0} a second on each core",
        job.samples,
        duration_text(core_time)
    ))?;
    let of = |error: fn(&ConvergencePoint) -> Option<f64>| -> Vec<_> {
        points.iter().filter_map(|point| Some((point.samples_per_pixel, error(point)?))).collect()
    };
    let measured = of(|point| point.mse);
    let is_measured = !measured.is_empty();
    let (errors, how) = if is_measured {
        (measured, "against the reference")
    } else {
        (of(|point| point.estimated_mse), "as the noise of the image tells")
    };
    if let [(first_samples, first), .., (last_samples, last)] = errors[..] {
        print_line(&format!(
            "Mean squared error {how}: {first:.3e} at {first_samples} samples per pixel, {last:.3e} at {last_samples}"
        ))?;
    }
    files.iter().try_for_each(|file| print_line(&format!("Wrote {}", file.display())))
}

/// The folder of a new farm, which is removed with the demo.
fn new_folder(output: &Path) -> Result<TempDir, Failure> {
    let made = fs::create_dir_all(output).and_then(|()| tempfile::Builder::new().prefix("farm-").tempdir_in(output));
    made.map_err(|source| Failure::Write { file: output.to_owned(), source })
}

/// The shipped reference, if the image has its size.
fn shipped_reference(film: FilmDescription, progress: &Progress) -> Result<Option<PathBuf>, Failure> {
    let file = shipped(REFERENCE)?;
    let image = image_file::read(&file)?;
    let (width, height) = (image.width(), image.height());
    if (width, height) == (film.width, film.height) {
        return Ok(Some(file));
    }
    progress.note(&format!("The reference has {width}x{height} pixels: at another size the error is not measured"));
    Ok(None)
}

/// A shipped file: below the working directory, or below a folder above the binary, as after `cargo build` in the
/// repository.
fn shipped(name: &str) -> Result<PathBuf, Failure> {
    let binary = std::env::current_exe().unwrap_or_default();
    let roots = std::iter::once(Path::new("")).chain(binary.ancestors().skip(1));
    roots.map(|root| root.join(name)).find(|file| file.is_file()).ok_or_else(|| {
        Failure::Usage(format!(
            "the demo's file {name} is not here: run the demo in a clone of the repository, or give a scene with \
             --scene"
        ))
    })
}
