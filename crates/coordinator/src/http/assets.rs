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

use crate::blobs::{BlobError, UploadError};
use crate::farm::Farm;
use crate::films::repair;
use crate::http::extract::{PathParameter, announced_bytes, too_slow};
use crate::http::problem::ApiError;

/// Longest pause in an upload.
const LONGEST_PAUSE: Duration = Duration::from_secs(30);

/// Uploads an asset. What is there already is not read again.
#[utoipa::path(
    put, path = "/assets/{hash}", tag = "assets", params(("hash" = ContentHash, Path)),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = 204, description = "The asset is safe on disk."))
)]
pub(super) async fn put(
    State(farm): State<Arc<Farm>>,
    PathParameter(hash): PathParameter<ContentHash>,
    headers: HeaderMap,
    body: Body,
) -> Result<StatusCode, ApiError> {
    if farm.has_asset(hash).await? {
        repair::release_for_asset(&farm, hash).await?;
        return Ok(StatusCode::NO_CONTENT);
    }
    let limit = farm.config.max_asset_bytes;
    if announced_bytes(&headers).is_some_and(|announced| announced > limit) {
        return Err(ApiError::body_too_large(limit));
    }
    let size =
        farm.blobs.put_asset(hash, limit, chunks(body.into_data_stream())).await.map_err(|error| match error {
            UploadError::Source(Pause::TooLong) => too_slow(),
            UploadError::Source(Pause::CutOff) => ApiError::new(ProblemCode::InvalidBody, "the body was cut off"),
            UploadError::TooLarge { limit } => ApiError::body_too_large(limit),
            UploadError::HashMismatch { found } => ApiError::hash_mismatch(hash, found),
            UploadError::Store(error) => error.into(),
        })?;
    farm.store.insert_asset(hash, size, farm.config.clock.now_ms()).await?;
    tracing::info!(asset = %hash, size, "asset stored");
    repair::release_for_asset(&farm, hash).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Says whether an asset is there.
#[utoipa::path(
    head, path = "/assets/{hash}", tag = "assets", params(("hash" = ContentHash, Path)),
    responses((status = 200, description = "It is there."), (status = 404, description = "It has to be uploaded."))
)]
pub(super) async fn head(
    State(farm): State<Arc<Farm>>,
    PathParameter(hash): PathParameter<ContentHash>,
) -> Result<StatusCode, ApiError> {
    if farm.has_asset(hash).await? { Ok(StatusCode::OK) } else { Err(unknown(hash)) }
}

/// Downloads an asset.
#[utoipa::path(
    get, path = "/assets/{hash}", tag = "assets", params(("hash" = ContentHash, Path)),
    responses((status = 200, body = Vec<u8>, content_type = "application/octet-stream"))
)]
pub(super) async fn get(
    State(farm): State<Arc<Farm>>,
    PathParameter(hash): PathParameter<ContentHash>,
) -> Result<Response, ApiError> {
    if !farm.store.has_asset(hash).await? {
        return Err(unknown(hash));
    }
    let (size, stream) = match farm.blobs.asset_stream(hash).await {
        Err(error) if error.is_missing() => {
            repair::lose_asset(&farm, hash).await?;
            return Err(unknown(hash));
        }
        asset => asset?,
    };
    // Of an empty file nothing would be read that could be seen to be wrong.
    if size != farm.store.asset_bytes(std::iter::once(hash)).await? {
        repair::check_asset(&farm, hash).await?;
        return Err(unknown(hash));
    }
    let headers = [
        (CONTENT_TYPE, "application/octet-stream".to_owned()),
        (CONTENT_LENGTH, size.to_string()),
        (CACHE_CONTROL, "private, immutable, max-age=31536000".to_owned()),
    ];
    Ok((headers, Body::from_stream(verified(farm, hash, stream))).into_response())
}

/// The bytes of an asset, of which the last come when all have its hash; otherwise they are cut off.
fn verified(
    farm: Arc<Farm>,
    hash: ContentHash,
    stream: BoxStream<'static, Result<Bytes, BlobError>>,
) -> impl Stream<Item = io::Result<Bytes>> + Send {
    let state = Some((farm, stream, blake3::Hasher::new(), Bytes::new()));
    stream::unfold(state, move |state| async move {
        let (farm, mut stream, mut hasher, withheld) = state?;
        match stream.next().await {
            Some(Ok(piece)) => {
                hasher.update(&piece);
                Some((Ok(withheld), Some((farm, stream, hasher, piece))))
            }
            Some(Err(error)) => Some((Err(io::Error::other(error)), None)),
            None if hasher.finalize().as_bytes() == hash.as_bytes() => Some((Ok(withheld), None)),
            None => {
                if let Err(error) = repair::check_asset(&farm, hash).await {
                    tracing::error!(%error, asset = %hash, "a damaged asset could not be looked at");
                }
                Some((Err(io::Error::other("the asset is damaged")), None))
            }
        }
    })
}

fn unknown(hash: ContentHash) -> ApiError {
    let detail = format!(
        "no asset with the hash {hash} is here: it has not been uploaded, or it is lost; upload it, or submit its scene again"
    );
    ApiError::new(ProblemCode::UnknownAsset, detail).field("hash").value(hash)
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
