//! Jobs: submitted, listed, shown, cancelled, released.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use clerestory_api::{ConvergenceSeries, JobId, JobScene, JobSubmission, JobView, LiveMeasurement, ProblemCode};

use crate::farm::Farm;
use crate::films::live;
use crate::films::repair::repair;
use crate::http::extract::{JsonBody, PathParameter, announced_bytes};
use crate::http::problem::ApiError;
use crate::jobs::submission as submit;
use crate::model::{Ending, JobRecord};
use crate::store::StoreError;
use crate::tasks::to_completion;
use crate::watch::notifications::News;
use crate::watch::views;

/// Submits a job. When content is missing the answer is a problem with status 409 whose `missing` lists the hashes.
#[utoipa::path(
    post, path = "/jobs", tag = "jobs", request_body = JobSubmission, responses((status = 201, body = JobView))
)]
pub(super) async fn submit(
    State(farm): State<Arc<Farm>>,
    request: Request,
) -> Result<(StatusCode, Json<JobView>), ApiError> {
    let most = super::MAX_SMALL_BODY.into();
    let announced = announced_bytes(request.headers()).map_or(most, |bytes| bytes.min(most));
    let arriving = farm.submissions.for_body(announced).await?;
    let body = JsonBody::receive(request).await?;
    let room = farm.submissions.for_parsing(body.len() as u64).await?;
    let submission = tokio::task::spawn_blocking(move || body.parse()).await.map_err(ApiError::internal)??;
    drop(arriving);
    let job = submit::job(&farm, submission, room).await?;
    let id = job.id;
    tracing::info!(job = %id, name = job.name, scene = job.scene_hash, passes = job.passes, "job submitted");
    let told = Arc::clone(&farm);
    let inserted = to_completion(async move {
        told.store.insert_job(job).await?;
        told.tell(News::Job(id));
        Ok::<_, StoreError>(())
    });
    inserted.await.map_err(ApiError::internal)??;
    Ok((StatusCode::CREATED, Json(views::job(&farm, find(&farm, id).await?).await?)))
}

/// All jobs, newest first.
#[utoipa::path(get, path = "/jobs", tag = "jobs", responses((status = 200, body = Vec<JobView>)))]
pub(super) async fn list(State(farm): State<Arc<Farm>>) -> Result<Json<Vec<JobView>>, ApiError> {
    Ok(Json(views::jobs(&farm).await?))
}

/// One job.
#[utoipa::path(
    get, path = "/jobs/{job}", tag = "jobs", params(("job" = JobId, Path)), responses((status = 200, body = JobView))
)]
pub(super) async fn show(
    State(farm): State<Arc<Farm>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<JobView>, ApiError> {
    Ok(Json(views::job(&farm, find(&farm, job).await?).await?))
}

/// Cancels a job; what is complete is kept. A job that has ended stays as it is.
#[utoipa::path(
    post, path = "/jobs/{job}/cancel", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = JobView))
)]
pub(super) async fn cancel(
    State(farm): State<Arc<Farm>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<JobView>, ApiError> {
    find(&farm, job).await?;
    let told = Arc::clone(&farm);
    let cancelled = to_completion(async move {
        if told.store.end_job(job, Ending::Cancelled, told.config.clock.now_ms()).await? {
            tracing::info!(%job, "job cancelled");
            told.tell(News::Job(job));
        }
        Ok::<_, StoreError>(())
    });
    cancelled.await.map_err(ApiError::internal)??;
    Ok(Json(views::job(&farm, find(&farm, job).await?).await?))
}

/// Gives leases again of a job that is held. A job that is not held stays as it is.
#[utoipa::path(
    post, path = "/jobs/{job}/release", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = JobView))
)]
pub(super) async fn release(
    State(farm): State<Arc<Farm>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<JobView>, ApiError> {
    find(&farm, job).await?;
    let told = Arc::clone(&farm);
    let released = to_completion(async move {
        if told.store.release_job(job, told.config.clock.now_ms()).await? {
            tracing::info!(%job, "job released");
            told.tell(News::Job(job));
        }
        Ok::<_, StoreError>(())
    });
    released.await.map_err(ApiError::internal)??;
    Ok(Json(views::job(&farm, find(&farm, job).await?).await?))
}

/// What a worker needs to render nodes of a job.
#[utoipa::path(
    get, path = "/jobs/{job}/scene", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = JobScene))
)]
pub(super) async fn scene(
    State(farm): State<Arc<Farm>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<JobScene>, ApiError> {
    let record = find(&farm, job).await?;
    let (scene, assets) = farm.store.job_scene(job).await?.ok_or_else(|| unknown(job))?;
    let scene = serde_json::from_str(&scene).map_err(ApiError::internal)?;
    let (tile_size, passes) = (record.grid.tile_size, record.passes);
    Ok(Json(JobScene { job, scene, scene_hash: record.scene_hash, assets, tile_size, passes }))
}

/// The convergence of a job.
#[utoipa::path(
    get, path = "/jobs/{job}/convergence", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = ConvergenceSeries))
)]
pub(super) async fn convergence(
    State(farm): State<Arc<Farm>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<ConvergenceSeries>, ApiError> {
    let record = find(&farm, job).await?;
    let points = farm.store.convergence(job).await?;
    Ok(Json(ConvergenceSeries { job, has_reference: record.reference.is_some(), points }))
}

/// The error of a job between its rounds, as it is now. It is brought up to date once a second at most; that of a large frame, over several
/// calls.
#[utoipa::path(
    get, path = "/jobs/{job}/live", tag = "jobs", params(("job" = JobId, Path)),
    responses((status = 200, body = LiveMeasurement))
)]
pub(super) async fn live_error(
    State(farm): State<Arc<Farm>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Json<LiveMeasurement>, ApiError> {
    let measured = match live::current(&farm, find(&farm, job).await?).await {
        Err(error) if repair(&farm, job, &error).await? => live::current(&farm, find(&farm, job).await?).await,
        measured => measured,
    };
    Ok(Json(measured?))
}

/// The job, or the problem that there is none.
pub(super) async fn find(farm: &Farm, job: JobId) -> Result<JobRecord, ApiError> {
    farm.store.job(job).await?.ok_or_else(|| unknown(job))
}

fn unknown(job: JobId) -> ApiError {
    ApiError::new(ProblemCode::UnknownJob, format!("there is no job {job}")).field("job").value(job)
}
