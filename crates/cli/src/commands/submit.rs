//! `clerestory submit`: sends a scene to a farm and downloads its image.

use std::path::PathBuf;
use std::sync::OnceLock;

use clap::Args;
use clerestory_api::{JobId, JobView};
use clerestory_film::{ImageMetadata, LARGEST_TILE, Sampling};

use crate::activity::Activity;
use crate::connection::{Connection, ConnectionArguments};
use crate::download::download;
use crate::failure::Failure;
use crate::follow::follow;
use crate::job_end::{check_done, check_image};
use crate::numbers::whole;
use crate::output::{print_json, print_line};
use crate::output_file::{check_image_name, check_outputs, png_beside, write_stats};
use crate::preflight::Preflight;
use crate::progress::Progress;
use crate::render_limits::RenderLimits;
use crate::scene_overrides::{LoadedScene, SamplingOverrides, SceneOverrides};
use crate::shutdown::{self, Parent};
use crate::standard_error;
use crate::submission::{JobSettings, reference_asset, submit};

/// Options of `clerestory submit`.
#[derive(Debug, Args)]
pub(crate) struct SubmitArguments {
    /// The scene file.
    scene: PathBuf,
    #[command(flatten)]
    connection: ConnectionArguments,
    #[command(flatten)]
    limits: RenderLimits,
    #[command(flatten)]
    overrides: SceneOverrides,
    #[command(flatten)]
    sampling: SamplingOverrides,
    /// A name for lists [default: the scene's].
    #[arg(long)]
    name: Option<String>,
    /// Edge of a tile in pixels.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = whole(1..=LARGEST_TILE))]
    tile: u32,
    /// Jobs of higher priority are served first.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole(i32::MIN..=i32::MAX))]
    priority: i32,
    /// OpenEXR image to measure the error against.
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Wait for the job to end, and show its progress.
    #[arg(long)]
    wait: bool,
    /// Write the image here when the job has ended; with `--wait`.
    #[arg(short, long, value_name = "FILE", requires = "wait")]
    output: Option<PathBuf>,
    /// Also write a PNG beside it.
    #[arg(long, requires = "output")]
    png: bool,
    /// Write the counters (height evaluations, solver calls, solutions, ...) as JSON to this file when the job has
    /// ended. They count all accepted work. Of a job that a time or a target ended, that may be more than the image
    /// has.
    #[arg(long, value_name = "FILE", requires = "wait")]
    stats: Option<PathBuf>,
    /// Write the job as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) async fn run(arguments: SubmitArguments) -> Result<(), Failure> {
    arguments.output.as_deref().map_or(Ok(()), check_image_name)?;
    let png = arguments.output.as_deref().filter(|_| arguments.png).map(png_beside);
    check_outputs(
        &[
            ("--output", arguments.output.as_deref()),
            ("--png", png.as_deref()),
            ("--stats", arguments.stats.as_deref()),
        ],
        &[("the scene", Some(arguments.scene.as_path())), ("the reference", arguments.reference.as_deref())],
    )?;
    let connection = arguments.connection.open()?;
    // The coordinator checks the reference, which is only sent from here.
    arguments.limits.check_targets(arguments.reference.is_some(), None)?;
    let activity = Activity::begin("Reading the scene and its files");
    let LoadedScene { bundle, assumptions } = arguments.overrides.load(&arguments.scene, arguments.sampling)?;
    activity.done("The scene is read");
    let settings = JobSettings {
        name: arguments.name,
        samples_per_pixel: arguments.limits.samples_per_pixel(),
        time_limit_ms: arguments.limits.time_limit_ms(),
        targets: arguments.limits.targets(),
        adaptive: arguments.limits.adaptive,
        tile_size: arguments.tile,
        priority: arguments.priority,
        reference: reference_asset(arguments.reference.as_deref(), &bundle)?,
        assumptions,
    };
    // Building may take minutes.
    connection.check().await?;
    let preflight = Preflight::of(&bundle).map_err(|source| Failure::scene(&arguments.scene, source))?;
    let sampling = bundle.description().sampling;
    // The coordinator refuses a scene with others.
    let sampling = Sampling::new(sampling.samples_per_pass, sampling.samples_per_block).ok();
    let absence = sampling.and_then(|sampling| standard_error::absence(sampling, settings.samples_per_pixel));
    let stop = shutdown::token(Parent::None);
    let files = Files { exr: arguments.output, png, stats: arguments.stats };
    let submitted = OnceLock::new();
    let work = async {
        let job = submit(&connection, &bundle, settings).await?;
        // It is set once.
        let _ = submitted.set(job.id);
        let mut progress = Progress::new();
        progress.note(&format!("Job {}: {}", job.id, connection.job_page(job.id)));
        preflight.announce(&job.missing_light, &progress);
        absence.iter().for_each(|absence| progress.note(absence));
        if !arguments.wait {
            return Ok(job);
        }
        let (job, metadata) = wait(&connection, job.id, &files, &mut progress).await?;
        preflight.announce_report(&job, &progress);
        let metadata = metadata.filter(|_| absence.is_none());
        metadata.as_ref().and_then(standard_error::note_of_gaps).iter().for_each(|note| progress.note(note));
        Ok::<_, Failure>(job)
    };
    let job = tokio::select! {
        job = work => job?,
        () = stop.cancelled() => return Err(interrupted(submitted.get())),
    };
    if arguments.json { print_json(&job) } else { print_line(&job.id.to_string()) }?;
    if arguments.wait { check_done(&job) } else { Ok(()) }
}

/// The files for the results of a job.
struct Files {
    exr: Option<PathBuf>,
    png: Option<PathBuf>,
    stats: Option<PathBuf>,
}

/// Waits for a job to end and fetches its results. Returns the job, and the metadata of its image if that was fetched.
async fn wait(
    connection: &Connection,
    job: JobId,
    files: &Files,
    progress: &mut Progress,
) -> Result<(JobView, Option<ImageMetadata>), Failure> {
    let Files { exr, png, stats } = files;
    let job = follow(connection, job, progress).await?;
    check_image(&job)?;
    let metadata = download(connection, &job, exr.as_deref(), png.as_deref(), progress).await?;
    if let Some(file) = stats {
        write_stats(file, &job.counters)?;
    }
    [exr, png, stats].into_iter().flatten().for_each(|file| progress.note(&format!("Wrote {}", file.display())));
    Ok((job, metadata))
}

/// The failure of an interrupted command, which says what becomes of the job.
fn interrupted(job: Option<&JobId>) -> Failure {
    Failure::Interrupted(match job {
        None => "interrupted before the coordinator had taken the job".to_owned(),
        Some(job) => format!(
            "interrupted; job {job} goes on: see `clerestory watch {job}`, end it with `clerestory cancel {job}`"
        ),
    })
}
