//! Partials that arrive in pieces, because a proxy refuses them whole.
//!
//! Pieces are blobs, so that each may reach another coordinator. They are named by their content: a repeated or late
//! piece changes nothing. When all are there, the worker names them in their order, and the partial is accepted like
//! one that arrived whole. Garbage collection removes pieces that are left over.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use bytes::{Bytes, BytesMut};
use clerestory_api::{
    ContentHash, FENCING_TOKEN_HEADER, LeaseId, PIECE_MEDIA_TYPE, PartialAnswer, PartialPieces, ProblemCode,
};
use futures::stream::{self, StreamExt, TryStreamExt};

use super::extract::{ArrivingBody, PathParameter, PathParameters, StrictJson, number_header, require_media_type};
use super::leases::{check_core_ms, valid_lease};
use super::problem::ApiError;
use super::receiving::{ReceivingMemory, Room};
use super::state::BodyLimits;
use crate::films::acceptance::Acceptance;
use crate::jobs::claims::Claims;

/// Pieces that are read at the same time.
const READS: usize = 8;

/// Most pieces of a partial.
const MOST_PIECES: usize = 65_536;

/// Uploads a piece of a partial that is too large to travel whole.
#[utoipa::path(
    put, path = "/leases/{lease}/pieces/{hash}", tag = "leases",
    params(
        ("lease" = LeaseId, Path),
        ("hash" = ContentHash, Path, description = "Of the piece."),
        ("clerestory-fencing-token" = u64, Header, description = "The lease's fencing token."),
    ),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = 204, description = "The piece is there."))
)]
pub(super) async fn put(
    State(acceptance): State<Arc<Acceptance>>,
    State(memory): State<Arc<ReceivingMemory>>,
    State(limits): State<BodyLimits>,
    PathParameters(lease, hash): PathParameters<LeaseId, ContentHash>,
    request: Request,
) -> Result<StatusCode, ApiError> {
    require_media_type(request.headers(), PIECE_MEDIA_TYPE)?;
    let token = number_header(request.headers(), FENCING_TOKEN_HEADER)?;
    valid_lease(&acceptance, lease, token, FENCING_TOKEN_HEADER).await?;
    let (piece, _room) = memory.receive(ArrivingBody::new(request, limits.partial)?).await?;
    let found = ContentHash::from(*blake3::hash(&piece).as_bytes());
    if found != hash {
        return Err(ApiError::hash_mismatch(hash, found));
    }
    memory.put_piece(lease, hash, piece).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Uploads complete nodes of a lease whose partial has been uploaded in pieces. The answer comes when they are safe on
/// disk. When pieces are missing the answer is a problem with status 409 whose `missing` lists their hashes.
#[utoipa::path(
    post, path = "/leases/{lease}/pieces", tag = "leases", params(("lease" = LeaseId, Path)),
    request_body = PartialPieces, responses((status = 200, body = PartialAnswer))
)]
pub(super) async fn assemble(
    State(acceptance): State<Arc<Acceptance>>,
    State(claims): State<Arc<Claims>>,
    State(memory): State<Arc<ReceivingMemory>>,
    State(limits): State<BodyLimits>,
    PathParameter(lease): PathParameter<LeaseId>,
    StrictJson(PartialPieces { token, core_ms, pieces }): StrictJson<PartialPieces>,
) -> Result<Json<PartialAnswer>, ApiError> {
    check_core_ms("core_ms", core_ms)?;
    if pieces.is_empty() || pieces.len() > MOST_PIECES {
        return Err(ApiError::invalid_field("pieces", pieces.len(), format!("1 to {MOST_PIECES} pieces")));
    }
    let record = valid_lease(&acceptance, lease, token, "token").await?;
    claims.found_work(record.worker);
    let (body, _room) = joined(&memory, limits.partial, lease, &pieces).await?;
    let answer = Box::pin(acceptance.accept(record, core_ms, body)).await.map_err(ApiError::from);
    // The pieces of a partial that may be sent again stay.
    if answer.as_ref().err().is_none_or(|error| !error.is_ours()) {
        memory.remove_pieces(lease, &pieces).await;
    }
    Ok(Json(answer?))
}

/// The pieces in their order, and the memory that they take. All sizes are known before the first piece is read.
async fn joined<'a>(
    memory: &'a ReceivingMemory,
    limit: u64,
    lease: LeaseId,
    pieces: &[ContentHash],
) -> Result<(Bytes, Room<'a>), ApiError> {
    let look = |hash: ContentHash| async move { Ok::<_, ApiError>((hash, memory.piece_size(lease, hash).await?)) };
    let mut sizes = stream::iter(pieces.iter().copied()).map(look).buffered(READS);
    let (mut bytes, mut missing) = (0_u64, Vec::new());
    while let Some((hash, size)) = sizes.try_next().await? {
        match size {
            Some(size) => bytes = bytes.saturating_add(size),
            None => missing.push(hash),
        }
        if bytes > limit {
            return Err(ApiError::body_too_large(limit));
        }
    }
    if !missing.is_empty() {
        let detail = format!("{} of the pieces must be uploaded first; `missing` lists them", missing.len());
        return Err(ApiError::new(ProblemCode::MissingPieces, detail).missing(missing));
    }
    let mut room = memory.room(Some(bytes));
    room.widen_to(bytes).await;
    let mut body = BytesMut::with_capacity(usize::try_from(bytes).unwrap_or(0));
    let read = |hash: ContentHash| memory.piece(lease, hash);
    let mut read = stream::iter(pieces.iter().copied()).map(read).buffered(READS);
    while let Some(piece) = read.try_next().await? {
        body.extend_from_slice(&piece);
    }
    Ok((body.freeze(), room))
}
