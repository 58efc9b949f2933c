//! Submissions: a scene and its files on their way to a farm.

use std::collections::BTreeMap;
use std::path::Path;

use backon::{ExponentialBuilder, Retryable};
use bytes::Bytes;
use clerestory_api::{ClientError, ContentHash, JobSubmission, JobView, ProblemCode};
use clerestory_film::Targets;
use clerestory_render_core::document::{SceneBundle, canonical_json};
use clerestory_render_core::scene::Asset;
use tracing::{info, warn};

use crate::activity::Activity;
use crate::connection::Connection;
use crate::failure::Failure;
use crate::image_file::read_reference;
use crate::progress::upload_bar;

/// Repetitions of an upload, with pauses of one second and more.
const UPLOAD_REPETITIONS: usize = 5;

/// Repetitions of a submission to a busy coordinator, with pauses of five seconds and more: about half an hour.
const BUSY_REPETITIONS: usize = 30;

/// How a scene is rendered.
#[derive(Debug)]
pub(crate) struct JobSettings {
    pub(crate) name: Option<String>,
    pub(crate) samples_per_pixel: u32,
    pub(crate) time_limit_ms: Option<i64>,
    pub(crate) targets: Targets,
    /// Whether the job is adaptive.
    pub(crate) adaptive: bool,
    pub(crate) tile_size: u32,
    pub(crate) priority: i32,
    /// The file of the reference image.
    pub(crate) reference: Option<Asset>,
    /// What was assumed for a file of another program.
    pub(crate) assumptions: Vec<String>,
}

/// Reads the reference for images of a scene, as bytes to send.
pub(crate) fn reference_asset(file: Option<&Path>, bundle: &SceneBundle) -> Result<Option<Asset>, Failure> {
    let reference = file.map(|file| read_reference(file, bundle.description().film)).transpose()?;
    Ok(reference.map(|(bytes, _)| Asset::new(bytes)))
}

/// Submits a job, and uploads the files that the coordinator lacks.
pub(crate) async fn submit(
    connection: &Connection,
    bundle: &SceneBundle,
    settings: JobSettings,
) -> Result<JobView, Failure> {
    let scene = serde_json::from_str(&canonical_json(bundle.description())).expect("canonical JSON is JSON");
    let assets = bundle.assets().iter().map(|(name, asset)| (name.clone(), wire_hash(asset))).collect();
    let contents: BTreeMap<ContentHash, &Asset> =
        bundle.assets().values().chain(&settings.reference).map(|asset| (wire_hash(asset), asset)).collect();
    let submission = JobSubmission {
        name: settings.name,
        scene,
        assets,
        samples_per_pixel: settings.samples_per_pixel,
        tile_size: settings.tile_size,
        priority: settings.priority,
        reference: settings.reference.as_ref().map(wire_hash),
        time_limit_ms: settings.time_limit_ms,
        target_mse: settings.targets.mse,
        target_estimated_mse: settings.targets.estimated_mse,
        adaptive: settings.adaptive,
        assumptions: settings.assumptions,
    };
    let missing = match asked(connection, &submission).await {
        Err(ClientError::Problem { problem, .. }) if problem.code == ProblemCode::MissingAssets => problem.missing,
        answer => return answer.map_err(|error| connection.failure(error)),
    };
    // A hash of another file cannot be uploaded; the second submission says what is wrong.
    let missing: Vec<(ContentHash, &Asset)> =
        missing.into_iter().filter_map(|hash| Some((hash, *contents.get(&hash)?))).collect();
    let size = |asset: &Asset| asset.bytes().len() as u64;
    let bar = upload_bar(missing.iter().map(|(_, asset)| size(asset)).sum());
    let mut uploaded = 0;
    for (hash, asset) in missing {
        bar.suspend(|| info!(%hash, bytes = size(asset), "uploading"));
        let content = Bytes::copy_from_slice(asset.bytes());
        // The coordinator has answered once, so a failure may be transient.
        let upload = || {
            // Bytes of an earlier attempt do not count.
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

/// Submits a job. The coordinator reads all files of the scene before it answers.
async fn asked(connection: &Connection, submission: &JobSubmission) -> Result<JobView, ClientError> {
    let activity = Activity::begin("Waiting for the coordinator, which validates the scene");
    let answer = send(connection, submission).await;
    if answer.is_ok() {
        activity.done("The coordinator has taken the job");
    }
    answer
}

/// Sends a submission. It is repeated while the coordinator is too busy to look at it, since no job exists then.
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

fn wire_hash(asset: &Asset) -> ContentHash {
    ContentHash::from(*asset.hash().as_bytes())
}
