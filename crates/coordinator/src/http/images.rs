//! The image of a job as it is now.

use std::sync::Arc;

use axum::extract::State;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use clerestory_api::{EXR_MEDIA_TYPE, JobId, PreviewExposure, PreviewQuery, ToneCurve};
use clerestory_render_core::film::{self, Exposure, PreviewSettings};

use super::extract::{PathParameter, StrictQuery};
use super::jobs::find;
use super::problem::ApiError;
use crate::farm::Farm;
use crate::film::FilmError;
use crate::images;

/// Largest exposure, up or down.
const MOST_STOPS: f64 = 32.0;

/// The image as OpenEXR: each tile as far as it is complete. Its metadata hold the pass count of every tile.
#[utoipa::path(
    get, path = "/jobs/{job}/image.exr", tag = "images", params(("job" = JobId, Path)),
    responses((status = 200, body = Vec<u8>, content_type = "image/x-exr"))
)]
pub(super) async fn exr(
    State(farm): State<Arc<Farm>>,
    PathParameter(job): PathParameter<JobId>,
) -> Result<Response, ApiError> {
    let image = images::current(&farm, &find(&farm, job).await?).await?;
    let bytes = tokio::task::spawn_blocking(move || image.encode().map_err(FilmError::from));
    Ok(answer(EXR_MEDIA_TYPE, bytes.await.map_err(ApiError::internal)??))
}

/// The image as PNG.
#[utoipa::path(
    get, path = "/jobs/{job}/preview.png", tag = "images", params(("job" = JobId, Path), PreviewQuery),
    responses((status = 200, body = Vec<u8>, content_type = "image/png"))
)]
pub(super) async fn preview(
    State(farm): State<Arc<Farm>>,
    PathParameter(job): PathParameter<JobId>,
    StrictQuery(query): StrictQuery<PreviewQuery>,
) -> Result<Response, ApiError> {
    let exposure = match query.exposure {
        PreviewExposure::Auto => Exposure::Automatic,
        PreviewExposure::Stops(stops) if (-MOST_STOPS..=MOST_STOPS).contains(&stops) => Exposure::Stops(stops),
        // Not a number is in no range.
        PreviewExposure::Stops(stops) => {
            let expected = format!("`auto` or a number of stops between -{MOST_STOPS} and {MOST_STOPS}");
            return Err(ApiError::invalid_field("exposure", stops, expected));
        }
    };
    let curve = match query.curve {
        ToneCurve::Srgb => film::ToneCurve::Srgb,
        ToneCurve::Filmic => film::ToneCurve::Filmic,
    };
    let settings = PreviewSettings { exposure, curve };
    let image = images::current(&farm, &find(&farm, job).await?).await?;
    let bytes = tokio::task::spawn_blocking(move || film::encode_png(&image, &settings).map_err(FilmError::from));
    Ok(answer("image/png", bytes.await.map_err(ApiError::internal)??))
}

fn answer(media_type: &'static str, bytes: Vec<u8>) -> Response {
    ([(CONTENT_TYPE, media_type), (CACHE_CONTROL, "no-store")], bytes).into_response()
}
