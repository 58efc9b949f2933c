//! Assets: content that scenes name, uploaded once and named by its hash.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use axum::body::{Body, BodyDataStream};
use axum::extract::State;
use axum::http::header::{CACHE_CONTROL, CONTENT_LENGTH, CONTENT_TYPE};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use clerestory_api::{ContentHash, ProblemCode};
use futures::stream::{self, BoxStream, Stream};
use tokio_stream::StreamExt;

use super::extract::{PathParameter, announced_bytes, too_slow};
use super::problem::ApiError;
use super::state::BodyLimits;
use crate::blobs::{BlobError, UploadError};
use crate::films::assets::{AssetError, AssetUploadError, Assets};

/// Longest pause in an upload.
const LONGEST_PAUSE: Duration = Duration::from_secs(30);

/// Uploads an asset. What is there already is not read again.
#[utoipa::path(
    put, path = "/assets/{hash}", tag = "assets", params(("hash" = ContentHash, Path)),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = 204, description = "The asset is safe on disk."))
)]
pub(super) async fn put(
    State(assets): State<Arc<Assets>>,
    State(limits): State<BodyLimits>,
    PathParameter(hash): PathParameter<ContentHash>,
    headers: HeaderMap,
    body: Body,
) -> Result<StatusCode, ApiError> {
    if assets.has(hash).await? {
        assets.release_jobs(hash).await?;
        return Ok(StatusCode::NO_CONTENT);
    }
    let limit = limits.asset;
    if announced_bytes(&headers).is_some_and(|announced| announced > limit) {
        return Err(ApiError::body_too_large(limit));
    }
    let stored = assets.put(hash, limit, chunks(body.into_data_stream())).await;
    stored.map_err(|error| match error {
        AssetUploadError::Upload(UploadError::Source(Pause::TooLong)) => too_slow(),
        AssetUploadError::Upload(UploadError::Source(Pause::CutOff)) => {
            ApiError::new(ProblemCode::InvalidBody, "the body was cut off")
        }
        AssetUploadError::Upload(UploadError::TooLarge { limit }) => ApiError::body_too_large(limit),
        AssetUploadError::Upload(UploadError::HashMismatch { found }) => ApiError::hash_mismatch(hash, found),
        AssetUploadError::Upload(UploadError::Store(error)) => error.into(),
        AssetUploadError::Store(error) => error.into(),
    })?;
    Ok(StatusCode::NO_CONTENT)
}

/// Says whether an asset is there.
#[utoipa::path(
    head, path = "/assets/{hash}", tag = "assets", params(("hash" = ContentHash, Path)),
    responses((status = 200, description = "It is there."), (status = 404, description = "It has to be uploaded."))
)]
pub(super) async fn head(
    State(assets): State<Arc<Assets>>,
    PathParameter(hash): PathParameter<ContentHash>,
) -> Result<StatusCode, ApiError> {
    if assets.has(hash).await? { Ok(StatusCode::OK) } else { Err(AssetError::Unknown(hash).into()) }
}

/// Downloads an asset.
#[utoipa::path(
    get, path = "/assets/{hash}", tag = "assets", params(("hash" = ContentHash, Path)),
    responses((status = 200, body = Vec<u8>, content_type = "application/octet-stream"))
)]
pub(super) async fn get(
    State(assets): State<Arc<Assets>>,
    PathParameter(hash): PathParameter<ContentHash>,
) -> Result<Response, ApiError> {
    let (size, stream) = assets.open(hash).await?;
    let headers = [
        (CONTENT_TYPE, "application/octet-stream".to_owned()),
        (CONTENT_LENGTH, size.to_string()),
        (CACHE_CONTROL, "private, immutable, max-age=31536000".to_owned()),
    ];
    Ok((headers, Body::from_stream(verified(assets, hash, stream))).into_response())
}

/// The bytes of an asset. The last ones are sent when all bytes have its hash; otherwise the stream is cut off.
fn verified(
    assets: Arc<Assets>,
    hash: ContentHash,
    stream: BoxStream<'static, Result<Bytes, BlobError>>,
) -> impl Stream<Item = io::Result<Bytes>> + Send {
    let state = Some((assets, stream, blake3::Hasher::new(), Bytes::new()));
    stream::unfold(state, move |state| async move {
        let (assets, mut stream, mut hasher, withheld) = state?;
        match stream.next().await {
            Some(Ok(piece)) => {
                hasher.update(&piece);
                Some((Ok(withheld), Some((assets, stream, hasher, piece))))
            }
            Some(Err(error)) => Some((Err(io::Error::other(error)), None)),
            None if hasher.finalize().as_bytes() == hash.as_bytes() => Some((Ok(withheld), None)),
            None => {
                if let Err(error) = assets.check(hash).await {
                    tracing::error!(%error, asset = %hash, "a damaged asset could not be looked at");
                }
                Some((Err(io::Error::other("the asset is damaged")), None))
            }
        }
    })
}

enum Pause {
    TooLong,
    CutOff,
}

fn chunks(body: BodyDataStream) -> impl Stream<Item = Result<Bytes, Pause>> + Unpin {
    let chunks = body.timeout(LONGEST_PAUSE).map(|chunk| match chunk {
        Ok(Ok(bytes)) => Ok(bytes),
        Ok(Err(_)) => Err(Pause::CutOff),
        Err(_) => Err(Pause::TooLong),
    });
    Box::pin(chunks)
}
