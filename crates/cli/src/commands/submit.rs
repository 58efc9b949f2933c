//! `clerestory submit`: a scene on its way to a farm, and its image back.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use backon::{ExponentialBuilder, Retryable};
use bytes::Bytes;
use clap::Args;
use clerestory_api::{ClientError, ContentHash, JobId, JobSubmission, JobView, PreviewQuery, ProblemCode};
use clerestory_film::{ImageMetadata, Sampling, Targets};
use clerestory_render_core::scene::{Asset, SceneBundle, canonical_json};
use tracing::{info, warn};

use crate::activity::Activity;
use crate::arguments::whole;
use crate::commands::watch::{check_done, check_image};
use crate::connection::{Connection, ConnectionArguments};
use crate::failure::Failure;
use crate::follow::{follow, until_answered};
use crate::image_file::{metadata, read_reference};
use crate::output_file::{OutputFile, check_image_name, check_outputs, png_beside, write, write_stats};
use crate::render_limits::RenderLimits;
use crate::scene_overrides::{SamplingOverrides, SceneOverrides};
use crate::shutdown::{self, Parent};
use crate::standard_error;
use crate::terminal::{Progress, print_json, print_line, upload_bar};

/// How often an upload is repeated, with pauses of one second and more.
const UPLOAD_REPETITIONS: usize = 5;

/// How often a submission is repeated to a coordinator that is busy, with pauses of five seconds and more: for about half an hour.
const BUSY_REPETITIONS: usize = 30;

/// Bytes that the header of an image may take: a few for each of its tiles, of which a job has 65536 at most.
const MOST_HEADER_BYTES: usize = 4 << 20;

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
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = whole(1..=1024_u32))]
    tile: u32,
    /// Jobs of higher priority are served first.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole(i32::MIN..=i32::MAX))]
    priority: i32,
    /// OpenEXR image that the error is measured against.
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
    /// Write the counters (height evaluations, solver calls, solutions, ...) as JSON to this file when the job has ended.
    /// They count all work that was accepted; of a job that ended before its last sample, that may be more than is in the
    /// image.
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
    // The coordinator looks at the reference; here it is only sent.
    arguments.limits.check_targets(arguments.reference.is_some(), None)?;
    let activity = Activity::begin("Reading the scene and its files");
    let bundle = arguments.overrides.load(&arguments.scene, arguments.sampling)?;
    activity.done("The scene is read");
    let order = Order {
        name: arguments.name,
        samples_per_pixel: arguments.limits.samples_per_pixel(),
        time_limit_ms: arguments.limits.time_limit_ms(),
        targets: arguments.limits.targets(),
        adaptive: arguments.limits.adaptive,
        tile_size: arguments.tile,
        priority: arguments.priority,
        reference: reference_asset(arguments.reference.as_deref(), &bundle)?,
    };
    let sampling = bundle.description().sampling;
    // A scene with others is refused by the coordinator.
    let sampling = Sampling::new(sampling.samples_per_pass, sampling.samples_per_block).ok();
    let absence = sampling.and_then(|sampling| standard_error::absence(sampling, order.samples_per_pixel));
    let stop = shutdown::token(Parent::None);
    let files = Files { exr: arguments.output, png, stats: arguments.stats };
    let submitted = OnceLock::new();
    let work = async {
        let job = submit(&connection, &bundle, order).await?;
        // Nobody has set it before.
        let _ = submitted.set(job.id);
        let mut progress = Progress::new();
        progress.note(&format!("Job {}: {}", job.id, connection.job_page(job.id)));
        progress.missing_light(&job.missing_light, &job.left_to_chance);
        absence.iter().for_each(|absence| progress.note(absence));
        if !arguments.wait {
            return Ok(job);
        }
        let (job, metadata) = wait(&connection, job.id, &files, &mut progress).await?;
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

/// Where the results of a job go.
struct Files {
    exr: Option<PathBuf>,
    png: Option<PathBuf>,
    stats: Option<PathBuf>,
}

/// Waits for a job to end, and fetches its results. Returns the job as it ended, and how its image was made if it was fetched.
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

/// What an interruption leaves.
fn interrupted(job: Option<&JobId>) -> Failure {
    Failure::Interrupted(match job {
        None => "interrupted before the coordinator had taken the job".to_owned(),
        Some(job) => format!(
            "interrupted; job {job} goes on: see `clerestory watch {job}`, end it with `clerestory cancel {job}`"
        ),
    })
}

/// How a scene is to be rendered.
#[derive(Debug)]
pub(crate) struct Order {
    pub(crate) name: Option<String>,
    pub(crate) samples_per_pixel: u32,
    pub(crate) time_limit_ms: Option<i64>,
    pub(crate) targets: Targets,
    /// Whether passes are shared out among the tiles by their noise.
    pub(crate) adaptive: bool,
    pub(crate) tile_size: u32,
    pub(crate) priority: i32,
    /// The reference image, whole.
    pub(crate) reference: Option<Asset>,
}

/// Reads the reference for images of a scene, to be sent as it is.
pub(crate) fn reference_asset(file: Option<&Path>, bundle: &SceneBundle) -> Result<Option<Asset>, Failure> {
    let reference = file.map(|file| read_reference(file, bundle.description().film)).transpose()?;
    Ok(reference.map(|(bytes, _)| Asset::new(bytes)))
}

/// Submits a job, and uploads what the coordinator does not have yet.
pub(crate) async fn submit(connection: &Connection, bundle: &SceneBundle, order: Order) -> Result<JobView, Failure> {
    let scene = serde_json::from_str(&canonical_json(bundle.description())).expect("canonical JSON is JSON");
    let assets = bundle.assets().iter().map(|(name, asset)| (name.clone(), wire_hash(asset))).collect();
    let contents: BTreeMap<ContentHash, &Asset> =
        bundle.assets().values().chain(&order.reference).map(|asset| (wire_hash(asset), asset)).collect();
    let submission = JobSubmission {
        name: order.name,
        scene,
        assets,
        samples_per_pixel: order.samples_per_pixel,
        tile_size: order.tile_size,
        priority: order.priority,
        reference: order.reference.as_ref().map(wire_hash),
        time_limit_ms: order.time_limit_ms,
        target_mse: order.targets.mse,
        target_estimated_mse: order.targets.estimated_mse,
        adaptive: order.adaptive,
    };
    let missing = match asked(connection, &submission).await {
        Err(ClientError::Problem { problem, .. }) if problem.code == ProblemCode::MissingAssets => problem.missing,
        answer => return answer.map_err(|error| connection.failure(error)),
    };
    // A hash that is not ours cannot be helped; the second attempt says what is wrong with it.
    let missing: Vec<(ContentHash, &Asset)> =
        missing.into_iter().filter_map(|hash| Some((hash, *contents.get(&hash)?))).collect();
    let size = |asset: &Asset| asset.bytes().len() as u64;
    let bar = upload_bar(missing.iter().map(|(_, asset)| size(asset)).sum());
    let mut uploaded = 0;
    for (hash, asset) in missing {
        bar.suspend(|| info!(%hash, bytes = size(asset), "uploading"));
        let content = Bytes::copy_from_slice(asset.bytes());
        // The coordinator has answered once, so what fails now may well pass.
        let upload = || {
            // What an earlier attempt sent does not count.
            bar.set_position(uploaded);
            let bar = bar.clone();
            connection.client.upload_asset(&hash, content.clone(), move |bytes| bar.inc(bytes))
        };
        upload
            .retry(ExponentialBuilder::default().with_max_times(UPLOAD_REPETITIONS).with_jitter())
            .when(ClientError::is_transient)
            .adjust(|error, pause| pause.map(|pause| error.pause(pause)))
            .notify(|error, pause| {
                bar.suspend(|| warn!(%hash, ?pause, reason = %error, "the upload failed, trying again"));
            })
            .await
            .map_err(|error| connection.failure(error))?;
        uploaded += size(asset);
    }
    bar.finish_and_clear();
    asked(connection, &submission).await.map_err(|error| connection.failure(error))
}

/// Asks a coordinator to take a job. It looks at the whole scene before it answers.
async fn asked(connection: &Connection, submission: &JobSubmission) -> Result<JobView, ClientError> {
    let activity = Activity::begin("Waiting for the coordinator, which checks the scene");
    let answer = send(connection, submission).await;
    if answer.is_ok() {
        activity.done("The coordinator has taken the job");
    }
    answer
}

/// Sends a submission, again and again where the coordinator says that it is too busy to look at it: then it has not become a job.
async fn send(connection: &Connection, submission: &JobSubmission) -> Result<JobView, ClientError> {
    let is_busy = |error: &ClientError| match error {
        ClientError::Problem { problem, retry_after } => {
            problem.code == ProblemCode::Unavailable && retry_after.is_some()
        }
        _ => false,
    };
    let call = || connection.client.submit_job(submission);
    call.retry(ExponentialBuilder::default().with_max_times(BUSY_REPETITIONS).with_jitter())
        .when(is_busy)
        .adjust(|error, pause| pause.map(|pause| error.pause(pause)))
        .notify(|error, pause| warn!(?pause, reason = %error, "the coordinator is busy, trying again"))
        .await
}

/// Fetches the image of a job into files, and returns how it was made. A coordinator that goes away is waited for.
pub(crate) async fn download(
    connection: &Connection,
    job: &JobView,
    exr: Option<&Path>,
    png: Option<&Path>,
    progress: &Progress,
) -> Result<Option<ImageMetadata>, Failure> {
    let mut metadata = None;
    if let Some(file) = exr {
        // What fails here is a disk, and no call is repeated for it.
        metadata = until_answered(connection, progress, || fetch_image(connection, job.id, file)).await??;
    }
    if let Some(file) = png {
        let query = PreviewQuery::default();
        let preview = until_answered(connection, progress, || connection.client.preview(job.id, &query)).await?;
        write(file, &preview.png)?;
    }
    Ok(metadata)
}

/// Fetches an image into a file, piece by piece, and returns how it was made. The file may be a pipe, so its header is looked at on
/// the way.
async fn fetch_image(
    connection: &Connection,
    job: JobId,
    file: &Path,
) -> Result<Result<Option<ImageMetadata>, Failure>, ClientError> {
    let mut download = connection.client.image_download(job).await?;
    let mut output = match OutputFile::create(file) {
        Ok(output) => output,
        Err(failure) => return Ok(Err(failure)),
    };
    let mut head = Vec::new();
    while let Some(piece) = download.piece().await? {
        let rest = MOST_HEADER_BYTES - head.len();
        head.extend_from_slice(&piece[..piece.len().min(rest)]);
        if let Err(failure) = output.write(&piece) {
            return Ok(Err(failure));
        }
    }
    Ok(output.finish().map(|()| metadata(&head)))
}

fn wire_hash(asset: &Asset) -> ContentHash {
    ContentHash::from(*asset.hash().as_bytes())
}
