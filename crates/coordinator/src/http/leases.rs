//! Leases: claimed, renewed, worked off and given back.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use clerestory_api::{
    BuildOutcome, CORE_MILLISECONDS_HEADER, EXR_MEDIA_TYPE, FENCING_TOKEN_HEADER, LONGEST_FAILURE, LONGEST_REFUSAL,
    Lease, LeaseId, LeaseRenewal, LeaseRequest, LeaseReturn, LeaseToken, PartialAnswer, ProblemCode, SceneReport,
};
use clerestory_render_core::document::{MAX_NOTE_CHARACTERS, MAX_NOTES};

use crate::films::acceptance::Acceptance;
use crate::http::extract::{ArrivingBody, PathParameter, StrictJson, number_header, require_media_type};
use crate::http::problem::ApiError;
use crate::http::receiving::ReceivingMemory;
use crate::http::state::BodyLimits;
use crate::jobs::claims::Claims;
use crate::model::LeaseRecord;
use crate::store::LeaseError;

/// Longest wait for work.
const LONGEST_WAIT_MS: u32 = 20_000;

/// Longest lease that a worker may ask for.
const LONGEST_WANTED_MS: u32 = 3_600_000;

/// Most scenes that a worker may name as built.
const MOST_BUILT: usize = 64;

/// Most lines about a built scene, in each list.
const MOST_LINES: usize = 1000;

/// Longest time of a partial, in milliseconds of one core: thirty years. A longer one was not measured.
const MOST_CORE_MS: u64 = 1_000_000_000_000;

/// Asks for work, and waits for it if there is none and the worker wants to.
#[utoipa::path(
    post, path = "/leases", tag = "leases", request_body = LeaseRequest,
    responses((status = 201, body = Lease), (status = 204, description = "There is no work for now."))
)]
pub(super) async fn claim(
    State(claims): State<Arc<Claims>>,
    StrictJson(request): StrictJson<LeaseRequest>,
) -> Result<Response, ApiError> {
    if request.max_nodes == Some(0) {
        return Err(ApiError::invalid_field("max_nodes", 0, "at least 1"));
    }
    if request.wait_ms > LONGEST_WAIT_MS {
        return Err(ApiError::invalid_field("wait_ms", request.wait_ms, format!("at most {LONGEST_WAIT_MS}")));
    }
    if let Some(wanted_ms) = request.wanted_ms.filter(|wanted_ms| !(1..=LONGEST_WANTED_MS).contains(wanted_ms)) {
        return Err(ApiError::invalid_field("wanted_ms", wanted_ms, format!("1 to {LONGEST_WANTED_MS}")));
    }
    if request.built.len() > MOST_BUILT {
        return Err(ApiError::invalid_field("built", request.built.len(), format!("at most {MOST_BUILT} jobs")));
    }
    match claims.claim(request).await? {
        Some(lease) => Ok((StatusCode::CREATED, Json(lease)).into_response()),
        None => Ok(StatusCode::NO_CONTENT.into_response()),
    }
}

/// Keeps a lease for another term.
#[utoipa::path(
    post, path = "/leases/{lease}/renew", tag = "leases", params(("lease" = LeaseId, Path)),
    request_body = LeaseToken, responses((status = 200, body = LeaseRenewal))
)]
pub(super) async fn renew(
    State(claims): State<Arc<Claims>>,
    PathParameter(lease): PathParameter<LeaseId>,
    StrictJson(LeaseToken { token }): StrictJson<LeaseToken>,
) -> Result<Json<LeaseRenewal>, ApiError> {
    Ok(Json(claims.renew(lease, token).await?))
}

/// Uploads complete nodes of a lease. The answer comes when they are safe on disk.
#[utoipa::path(
    put, path = "/leases/{lease}/partial", tag = "leases",
    params(
        ("lease" = LeaseId, Path),
        ("clerestory-fencing-token" = u64, Header, description = "The lease's fencing token."),
        ("clerestory-core-ms" = u64, Header, description = "Milliseconds spent rendering, summed over cores, at most \
                                                            10^12."),
    ),
    request_body(content = Vec<u8>, content_type = "image/x-exr"), responses((status = 200, body = PartialAnswer))
)]
pub(super) async fn partial(
    State(acceptance): State<Arc<Acceptance>>,
    State(claims): State<Arc<Claims>>,
    State(memory): State<Arc<ReceivingMemory>>,
    State(limits): State<BodyLimits>,
    PathParameter(lease): PathParameter<LeaseId>,
    request: Request,
) -> Result<Json<PartialAnswer>, ApiError> {
    let headers = request.headers();
    require_media_type(headers, EXR_MEDIA_TYPE)?;
    let token = number_header(headers, FENCING_TOKEN_HEADER)?;
    let core_ms = number_header(headers, CORE_MILLISECONDS_HEADER)?;
    check_core_ms(CORE_MILLISECONDS_HEADER, core_ms)?;
    // An invalid lease is refused before the body is received.
    let record = valid_lease(&acceptance, lease, token, FENCING_TOKEN_HEADER).await?;
    claims.found_work(record.worker);
    let (body, _room) = memory.receive(ArrivingBody::new(request, limits.partial)?).await?;
    // Thousands of requests may wait above. The future below gets its memory when its turn comes.
    Ok(Json(Box::pin(acceptance.accept(record, core_ms, body)).await?))
}

/// A lease that is valid for `token`, which came in `field`.
pub(super) async fn valid_lease(
    acceptance: &Acceptance,
    lease: LeaseId,
    token: u64,
    field: &'static str,
) -> Result<LeaseRecord, ApiError> {
    acceptance.valid_lease(lease, token).await.map_err(|error| match error {
        LeaseError::StaleToken(_) => ApiError::from(error).field(field),
        error => error.into(),
    })
}

/// Refuses an impossible time.
pub(super) fn check_core_ms(field: &'static str, core_ms: u64) -> Result<(), ApiError> {
    if core_ms <= MOST_CORE_MS {
        return Ok(());
    }
    Err(ApiError::invalid_field(field, core_ms, format!("at most {MOST_CORE_MS} milliseconds")))
}

/// Reports how building the scene of the lease's job ended. The first built scene of a job counts. A scene that two
/// machines refuse ends the job, and so does one that a machine refuses when no other could try.
#[utoipa::path(
    post, path = "/leases/{lease}/scene", tag = "leases", params(("lease" = LeaseId, Path)),
    request_body = SceneReport, responses((status = 204, description = "The coordinator knows how building ended."))
)]
pub(super) async fn report_scene(
    State(acceptance): State<Arc<Acceptance>>,
    PathParameter(lease): PathParameter<LeaseId>,
    StrictJson(SceneReport { token, outcome }): StrictJson<SceneReport>,
) -> Result<StatusCode, ApiError> {
    acceptance.report_scene(lease, token, checked(outcome)?).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The outcome, if it is not too long.
fn checked(outcome: BuildOutcome) -> Result<BuildOutcome, ApiError> {
    match outcome {
        BuildOutcome::Refused { reason } => {
            if reason.chars().count() > LONGEST_REFUSAL {
                let expected = format!("at most {LONGEST_REFUSAL} characters");
                return Err(ApiError::invalid_field("outcome.refused.reason", reason, expected));
            }
            // PostgreSQL holds no NUL.
            Ok(BuildOutcome::Refused { reason: reason.replace('\0', "\u{fffd}") })
        }
        BuildOutcome::Built(scene) => {
            let lists = [("left_to_chance", &scene.left_to_chance), ("chosen_methods", &scene.chosen_methods)];
            for (name, lines) in lists {
                if lines.len() > MOST_LINES {
                    let expected = format!("at most {MOST_LINES} lines");
                    return Err(ApiError::invalid_field(format!("outcome.built.{name}"), lines.len(), expected));
                }
            }
            let notes = "outcome.built.import_notes";
            if scene.import_notes.len() > MAX_NOTES {
                let expected = format!("at most {MAX_NOTES} lines");
                return Err(ApiError::invalid_field(notes, scene.import_notes.len(), expected));
            }
            if let Some(long) = scene.import_notes.iter().find(|note| note.chars().count() > MAX_NOTE_CHARACTERS) {
                let expected = format!("at most {MAX_NOTE_CHARACTERS} characters in each line");
                return Err(ApiError::invalid_field(notes, long, expected));
            }
            Ok(BuildOutcome::Built(scene))
        }
    }
}

/// Gives the rest of a lease back.
#[utoipa::path(
    post, path = "/leases/{lease}/return", tag = "leases", params(("lease" = LeaseId, Path)),
    request_body = LeaseReturn, responses((status = 204, description = "Its nodes are in the queue again."))
)]
pub(super) async fn give_back(
    State(acceptance): State<Arc<Acceptance>>,
    PathParameter(lease): PathParameter<LeaseId>,
    StrictJson(request): StrictJson<LeaseReturn>,
) -> Result<StatusCode, ApiError> {
    match request.failure {
        None => acceptance.give_back(lease, request.token).await?,
        Some(reason) if reason.chars().count() > LONGEST_FAILURE => {
            let detail = "the reason is too long";
            return Err(ApiError::new(ProblemCode::InvalidField, detail)
                .field("failure")
                .value(reason)
                .expected(format!("at most {LONGEST_FAILURE} characters")));
        }
        Some(reason) => {
            // PostgreSQL holds no NUL.
            let reason = reason.replace('\0', "\u{fffd}");
            acceptance.fail(lease, request.token, reason.clone(), 0).await?;
            tracing::warn!(%lease, reason, "a worker could not do its work");
        }
    }
    Ok(StatusCode::NO_CONTENT)
}
