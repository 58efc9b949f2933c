//! Workers: registered, heard of, listed, ended.

use std::sync::Arc;

use axum::Json;
use axum::extract::{FromRequest, Request, State};
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use clerestory_api::{WorkerActivity, WorkerId, WorkerRegistration, WorkerView};

use super::extract::{PathParameter, StrictJson};
use super::problem::ApiError;
use crate::jobs::workers::Workers;
use crate::model::check_name;
use crate::watch::views::Views;

/// Longest name or build.
const LONGEST_TEXT: usize = 200;

/// Most digests of a worker, over all methods.
const MOST_DIGESTS: usize = 1000;

/// Most threads of a machine that exists.
const MOST_CORES: u32 = 65_536;

/// Registers a worker.
#[utoipa::path(
    post, path = "/workers", tag = "workers", request_body = WorkerRegistration,
    responses((status = 201, body = WorkerView))
)]
pub(super) async fn register(
    State(workers): State<Arc<Workers>>,
    State(views): State<Arc<Views>>,
    StrictJson(registration): StrictJson<WorkerRegistration>,
) -> Result<(StatusCode, Json<WorkerView>), ApiError> {
    check(&registration)?;
    let id = workers.register(registration).await?;
    Ok((StatusCode::CREATED, Json(views.worker(id).await?)))
}

fn check(registration: &WorkerRegistration) -> Result<(), ApiError> {
    let digest = registration.probe_digest.as_deref();
    let texts = [("name", Some(&*registration.name)), ("build", Some(&*registration.build)), ("probe_digest", digest)];
    for (field, text) in texts {
        if let Some(text) = text.filter(|text| !is_text(text)) {
            return Err(ApiError::invalid_field(field, text, format!("1 to {LONGEST_TEXT} characters")));
        }
        check_name(field, text.unwrap_or_default())?;
    }
    let digests = &registration.method_digests;
    let count = digests.values().map(Vec::len).sum::<usize>().max(digests.len());
    if count > MOST_DIGESTS {
        return Err(ApiError::invalid_field("method_digests", count, format!("at most {MOST_DIGESTS} digests")));
    }
    for text in digests.keys().chain(digests.values().flatten()) {
        if !is_text(text) {
            let expected = format!("names and digests of 1 to {LONGEST_TEXT} characters");
            return Err(ApiError::invalid_field("method_digests", text, expected));
        }
        check_name("method_digests", text)?;
    }
    if !(1..=MOST_CORES).contains(&registration.cores) {
        return Err(ApiError::invalid_field("cores", registration.cores, format!("1 to {MOST_CORES}")));
    }
    Ok(())
}

/// Whether a text is neither empty nor too long.
fn is_text(text: &str) -> bool {
    (1..=LONGEST_TEXT).contains(&text.chars().count())
}

/// Says that a worker is alive, and what it does. Without a body, it builds nothing.
#[utoipa::path(
    post, path = "/workers/{worker}/heartbeat", tag = "workers", params(("worker" = WorkerId, Path)),
    request_body = Option<WorkerActivity>,
    responses((status = 204, description = "Heard."))
)]
pub(super) async fn heartbeat(
    State(workers): State<Arc<Workers>>,
    PathParameter(worker): PathParameter<WorkerId>,
    request: Request,
) -> Result<StatusCode, ApiError> {
    let activity = if request.headers().contains_key(CONTENT_TYPE) {
        StrictJson::from_request(request, &()).await?.0
    } else {
        WorkerActivity::default()
    };
    workers.heartbeat(worker, activity).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Says that a worker ends: what it has under lease goes back to the queue, and lists leave it out. A worker that has
/// ended stays so.
#[utoipa::path(
    delete, path = "/workers/{worker}", tag = "workers", params(("worker" = WorkerId, Path)),
    responses((status = 204, description = "It has ended."))
)]
pub(super) async fn end(
    State(workers): State<Arc<Workers>>,
    PathParameter(worker): PathParameter<WorkerId>,
) -> Result<StatusCode, ApiError> {
    workers.end(worker).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Gives work again to a worker that was quarantined, and to all of the same name.
#[utoipa::path(
    post, path = "/workers/{worker}/release", tag = "workers", params(("worker" = WorkerId, Path)),
    responses((status = 200, body = WorkerView))
)]
pub(super) async fn release(
    State(workers): State<Arc<Workers>>,
    State(views): State<Arc<Views>>,
    PathParameter(worker): PathParameter<WorkerId>,
) -> Result<Json<WorkerView>, ApiError> {
    workers.release(worker).await?;
    Ok(Json(views.worker(worker).await?))
}

/// All workers that have not ended, in order of registration. A silent one ends after a day, or when
/// another of its name has registered since.
#[utoipa::path(get, path = "/workers", tag = "workers", responses((status = 200, body = Vec<WorkerView>)))]
pub(super) async fn list(State(views): State<Arc<Views>>) -> Result<Json<Vec<WorkerView>>, ApiError> {
    Ok(Json(views.workers().await?))
}
