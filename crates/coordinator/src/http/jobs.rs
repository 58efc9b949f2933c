//! Jobs: submitted, listed, shown, cancelled, released.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use clerestory_api::{ConvergenceSeries, JobId, JobScene, JobSubmission, JobView, LiveMeasurement};
use clerestory_film::TileGrid;

use super::extract::{JsonBody, MAX_SMALL_BODY, PathParameter, announced_bytes};
use super::problem::ApiError;
use crate::films::live::LiveErrors;
use crate::jobs::lifecycle::{JobError, Jobs};
use crate::jobs::submission::Submissions;
use crate::store::Store;
use crate::watch::views::Views;

/// Submits a job. When content is missing the answer is a problem with status 409 whose `missing` lists the hashes.
#[utoipa::path(
    post, path = "/jobs", tag = "jobs", request_body = JobSubmission, responses((status = 201, body = JobView))
)]
pub(super) async fn submit(
    State(submissions): State<Arc<Submissions>>,
    State(jobs): State<Arc<Jobs>>,
    request: Request,
) -> Result<(StatusCode, Json<JobView>), ApiError> {
    let most = MAX_SMALL_BODY.into();
    let announced = announced_bytes(request.headers()).map_or(most, |bytes| bytes.min(most));
    let arriving = submissions.reserve_body(announced).await?;
    let body = JsonBody::receive(request).await?;
    let room = submissions.reserve_parsing(body.len() as u64).await?;
    let submission = tokio::task::spawn_blocking(move || body.parse()).await??;
    drop(arriving);
    let job = submissions.submit(submission, room).await?;
    Ok((StatusCode::CREATED, Json(jobs.view(job).await?)))
}

/// All jobs, newest first.
#[utoipa::path(get, path = "/jobs", tag = "jobs", responses((status = 200, body = Vec<JobView>)))]
pub(super) async fn list(State(views): State<Arc<Views>>) -> Result<Json<Vec<JobView>>, ApiError> {
    Ok(Json(views.jobs().await?))
}

/// One job.
#[utoipa::path(
    get, path = "/jobs/{job}", tag = "jobs", params(("job" = JobId, Path)), responses((status = 200, body = JobView))
)]
pub(super) async fn show(
    State(jobs): State<Arc<Jobs>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<JobView>, ApiError> {
    Ok(Json(jobs.view(job).await?))
}

/// Cancels a job; what is complete is kept. A job that has ended does not change.
#[utoipa::path(
    post, path = "/jobs/{job}/cancel", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = JobView))
)]
pub(super) async fn cancel(
    State(jobs): State<Arc<Jobs>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<JobView>, ApiError> {
    Ok(Json(jobs.cancel(job).await?))
}

/// Gives leases again of a job that is held. A job that is not held does not change.
#[utoipa::path(
    post, path = "/jobs/{job}/release", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = JobView))
)]
pub(super) async fn release(
    State(jobs): State<Arc<Jobs>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<JobView>, ApiError> {
    Ok(Json(jobs.release(job).await?))
}

/// What a worker needs to render nodes of a job.
#[utoipa::path(
    get, path = "/jobs/{job}/scene", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = JobScene))
)]
pub(super) async fn scene(
    State(jobs): State<Arc<Jobs>>,
    State(store): State<Store>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<JobScene>, ApiError> {
    let record = jobs.find(job).await?;
    let (scene, assets) = store.job_scene(job).await?.ok_or(JobError::Unknown(job))?;
    let scene = serde_json::from_str(&scene).map_err(ApiError::internal)?;
    let TileGrid { tile_size, has_light_plane: light_plane, has_caustic: caustic, .. } = record.grid;
    let (scene_hash, passes) = (record.scene_hash, record.passes);
    Ok(Json(JobScene { job, scene, scene_hash, assets, tile_size, light_plane, caustic, passes }))
}

/// The convergence of a job.
#[utoipa::path(
    get, path = "/jobs/{job}/convergence", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = ConvergenceSeries))
)]
pub(super) async fn convergence(
    State(jobs): State<Arc<Jobs>>,
    State(store): State<Store>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<ConvergenceSeries>, ApiError> {
    let record = jobs.find(job).await?;
    let points = store.convergence(job).await?;
    Ok(Json(ConvergenceSeries { job, has_reference: record.reference.is_some(), points }))
}

/// The present error of a job, between its rounds. It is brought up to date once a second at most; that of a large
/// frame, over several calls.
#[utoipa::path(
    get, path = "/jobs/{job}/live", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = LiveMeasurement))
)]
pub(super) async fn live_error(
    State(jobs): State<Arc<Jobs>>,
    State(live_errors): State<Arc<LiveErrors>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<LiveMeasurement>, ApiError> {
    Ok(Json(live_errors.current(jobs.find(job).await?).await?))
}
