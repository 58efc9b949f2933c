//! Leases: claimed, kept, worked off and given back.

use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use clerestory_api::{
    CORE_MILLISECONDS_HEADER, EXR_MEDIA_TYPE, FENCING_TOKEN_HEADER, Lease, LeaseId, LeaseRenewal, LeaseRequest,
    LeaseReturn, LeaseToken, PartialAnswer, ProblemCode,
};
use tokio::time::Instant;
use uuid::Uuid;

use crate::farm::Farm;
use crate::films::acceptance;
use crate::http::extract::{ArrivingBody, PathParameter, StrictJson, number_header, require_media_type};
use crate::http::problem::ApiError;
use crate::http::receiving::receive;
use crate::model::{ClaimTerms, Grant, LeaseRecord, WorkFailure, wire_address};
use crate::store::LeaseError;
use crate::watch::notifications::News;

/// Longest wait for work to appear.
const LONGEST_WAIT_MS: u32 = 20_000;

/// Longest lease that a worker may wish for.
const LONGEST_WANTED_MS: u32 = 3_600_000;

/// Most scenes that a worker may say it has at hand.
const MOST_BUILT: usize = 64;

/// Longest reason for giving a lease back.
const LONGEST_REASON: usize = 500;

/// Longest time that a partial may have taken, in milliseconds of one core: thirty years. Who claims more has not
/// measured.
const MOST_CORE_MS: u64 = 1_000_000_000_000;

/// Asks for work, and waits for it if there is none and the worker wants to.
#[utoipa::path(
    post, path = "/leases", tag = "leases", request_body = LeaseRequest,
    responses((status = 201, body = Lease), (status = 204, description = "There is no work for now."))
)]
pub(super) async fn claim(
    State(farm): State<Arc<Farm>>,
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
    let worker = request.worker;
    let until = Instant::now() + Duration::from_millis(request.wait_ms.into());
    // Who has just looked in vain, and asks again, goes on waiting, if it waits at all.
    let mut looks = request.wait_ms == 0 || farm.idle.is_to_look(worker, Instant::now().into_std());
    let mut has_waited = false;
    loop {
        // Listening begins before looking, so that work which appears in between is not slept through.
        let mut work = std::pin::pin!(farm.work.notified());
        work.as_mut().enable();
        if looks {
            let (asked, request) = (Arc::clone(&farm), request.clone());
            if let Some(grant) = farm.store.claim(move || terms(&asked, &request)).await? {
                farm.idle.has_work(worker);
                if has_waited {
                    // There may be more.
                    farm.ring_for_work();
                }
                return Ok((StatusCode::CREATED, Json(lease(&farm, grant))).into_response());
            }
            farm.idle.looked_in_vain(worker, Instant::now().into_std());
        }
        tokio::select! {
            () = work => (has_waited, looks) = (true, true),
            () = tokio::time::sleep_until(until) => return Ok(StatusCode::NO_CONTENT.into_response()),
            () = farm.stopping.cancelled() => return Ok(StatusCode::NO_CONTENT.into_response()),
        }
    }
}

fn terms(farm: &Farm, request: &LeaseRequest) -> ClaimTerms {
    ClaimTerms {
        worker: request.worker,
        built: request.built.clone(),
        lease: LeaseId::from(Uuid::now_v7()),
        max_nodes: request.max_nodes,
        fixed_nodes: farm.config.lease_nodes,
        target_ms: request.wanted_ms.map_or_else(|| milliseconds(farm.config.lease_target), i64::from),
        upload_linger_ms: milliseconds(farm.gathering_time()),
        ttl_ms: milliseconds(farm.config.lease_ttl),
        alive_ms: farm.alive_ms(),
        now_ms: farm.config.clock.now_ms(),
    }
}

fn milliseconds(duration: Duration) -> i64 {
    i64::try_from(duration.as_millis()).unwrap_or(i64::MAX)
}

fn lease(farm: &Farm, grant: Grant) -> Lease {
    let Grant { lease, scene_hash, nodes, upload_linger_ms } = grant;
    tracing::debug!(lease = %lease.id, job = %lease.job, worker = %lease.worker, nodes = nodes.len(), "lease granted");
    farm.tell(News::Lease(lease.job));
    Lease {
        id: lease.id,
        token: lease.token,
        job: lease.job,
        scene_hash,
        nodes: nodes.iter().map(wire_address).collect(),
        deadline_ms: lease.deadline_ms,
        expires_in_ms: milliseconds(farm.config.lease_ttl),
        gather_ms: u32::try_from(upload_linger_ms).unwrap_or(u32::MAX),
    }
}

/// Keeps a lease for another term.
#[utoipa::path(
    post, path = "/leases/{lease}/renew", tag = "leases", params(("lease" = LeaseId, Path)),
    request_body = LeaseToken, responses((status = 200, body = LeaseRenewal))
)]
pub(super) async fn renew(
    State(farm): State<Arc<Farm>>,
    PathParameter(lease): PathParameter<LeaseId>,
    StrictJson(LeaseToken { token }): StrictJson<LeaseToken>,
) -> Result<Json<LeaseRenewal>, ApiError> {
    let now_ms = farm.config.clock.now_ms();
    let expires_in_ms = milliseconds(farm.config.lease_ttl);
    let deadline_ms = now_ms.saturating_add(expires_in_ms);
    let outstanding = farm.store.renew(lease, token, now_ms, deadline_ms).await?;
    Ok(Json(LeaseRenewal { deadline_ms, expires_in_ms, outstanding }))
}

/// Uploads complete nodes of a lease. The answer comes when they are safe on disk.
#[utoipa::path(
    put, path = "/leases/{lease}/partial", tag = "leases",
    params(
        ("lease" = LeaseId, Path),
        ("clerestory-fencing-token" = u64, Header, description = "The lease's fencing token."),
        ("clerestory-core-ms" = u64, Header, description = "Milliseconds spent rendering, summed over cores, at most 10^12."),
    ),
    request_body(content = Vec<u8>, content_type = "image/x-exr"), responses((status = 200, body = PartialAnswer))
)]
pub(super) async fn partial(
    State(farm): State<Arc<Farm>>,
    PathParameter(lease): PathParameter<LeaseId>,
    request: Request,
) -> Result<Json<PartialAnswer>, ApiError> {
    let headers = request.headers();
    require_media_type(headers, EXR_MEDIA_TYPE)?;
    let token = number_header(headers, FENCING_TOKEN_HEADER)?;
    let core_ms = number_header(headers, CORE_MILLISECONDS_HEADER)?;
    check_core_ms(CORE_MILLISECONDS_HEADER, core_ms)?;
    // A lease that is no good is refused before its body is received.
    let record = valid_lease(&farm, lease, token, FENCING_TOKEN_HEADER).await?;
    // Another coordinator may have given it the lease.
    farm.idle.has_work(record.worker);
    let (body, _room) = receive(&farm, ArrivingBody::new(request, farm.config.max_partial_bytes)?).await?;
    // Thousands may wait above: what comes below takes its memory when its turn has come.
    Ok(Json(Box::pin(acceptance::accept(&farm, record, core_ms, body)).await?))
}

/// A lease that is good for `token`, which came in `field`.
pub(super) async fn valid_lease(
    farm: &Farm,
    lease: LeaseId,
    token: u64,
    field: &'static str,
) -> Result<LeaseRecord, ApiError> {
    let record = farm.store.lease(lease).await?;
    record.check(token, farm.config.clock.now_ms()).map_err(|error| match error {
        LeaseError::StaleToken(_) => ApiError::from(error).field(field),
        error => error.into(),
    })?;
    Ok(record)
}

/// Refuses a time that nobody has measured.
pub(super) fn check_core_ms(field: &'static str, core_ms: u64) -> Result<(), ApiError> {
    if core_ms <= MOST_CORE_MS {
        return Ok(());
    }
    Err(ApiError::invalid_field(field, core_ms, format!("at most {MOST_CORE_MS} milliseconds")))
}

/// Gives the rest of a lease back.
#[utoipa::path(
    post, path = "/leases/{lease}/return", tag = "leases", params(("lease" = LeaseId, Path)),
    request_body = LeaseReturn, responses((status = 204, description = "Its nodes are in the queue again."))
)]
pub(super) async fn give_back(
    State(farm): State<Arc<Farm>>,
    PathParameter(lease): PathParameter<LeaseId>,
    StrictJson(request): StrictJson<LeaseReturn>,
) -> Result<StatusCode, ApiError> {
    let (token, now_ms) = (request.token, farm.config.clock.now_ms());
    match request.failure {
        None => acceptance::give_back(&farm, lease, token, now_ms).await?,
        Some(reason) if reason.chars().count() > LONGEST_REASON => {
            let detail = "the reason is too long";
            return Err(ApiError::new(ProblemCode::InvalidField, detail)
                .field("failure")
                .value(reason)
                .expected(format!("at most {LONGEST_REASON} characters")));
        }
        Some(reason) => {
            // PostgreSQL holds no NUL.
            let reason = reason.replace('\0', "\u{fffd}");
            tracing::warn!(%lease, reason, "a worker could not do its work");
            let alive_ms = farm.alive_ms();
            let failure = WorkFailure { lease, token, reason, refused_partials: 0, now_ms, alive_ms };
            acceptance::fail(&farm, failure).await?;
        }
    }
    Ok(StatusCode::NO_CONTENT)
}
