//! Who may call: one layer over everything but the health probes, the page's own files, and the opening of a session.
//!
//! With a token, callers send it as `Authorization: Bearer`. A browser sends it once, to `POST /session`, and gets a
//! cookie that pages of other sites cannot use (`SameSite=Strict`) and scripts cannot read (`HttpOnly`).
//!
//! Only a coordinator on a loopback address may run without a token. Then everybody on this machine may call, but not
//! the web pages that they visit. The `Host` must name this machine, so a foreign name that resolves to 127.0.0.1 opens
//! nothing. `CsrfLayer` refuses changes that other sites' pages ask for.

use std::net::IpAddr;

use axum::extract::{Request, State};
use axum::http::header::{AUTHORIZATION, COOKIE, HOST, HeaderMap, SET_COOKIE};
use axum::http::{HeaderValue, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use clerestory_api::{API_PREFIX, ProblemCode, SessionRequest};

use crate::config::Token;
use crate::http::extract::StrictJson;
use crate::http::problem::ApiError;
use crate::http::state::Access;

const SESSION_COOKIE: &str = "clerestory_session";

/// Opens a browser session with the farm's token.
#[utoipa::path(
    post, path = "/session", tag = "session", request_body = SessionRequest,
    responses((status = 204, description = "The answer sets the session's cookie."))
)]
pub(super) async fn open_session(
    State(Access(token)): State<Access>,
    StrictJson(request): StrictJson<SessionRequest>,
) -> Result<Response, ApiError> {
    let Some(token) = token else { return Ok(StatusCode::NO_CONTENT.into_response()) };
    if !token.matches(request.token.trim()) {
        return Err(ApiError::new(ProblemCode::Unauthorized, "this is not the farm's token").field("token"));
    }
    let cookie = format!("{SESSION_COOKIE}={}; Path=/; HttpOnly; SameSite=Strict", token.session());
    let cookie = HeaderValue::from_str(&cookie).map_err(ApiError::internal)?;
    Ok((StatusCode::NO_CONTENT, [(SET_COOKIE, cookie)]).into_response())
}

/// The layer.
pub(super) async fn authorise(State(Access(token)): State<Access>, request: Request, next: Next) -> Response {
    match check(token.as_ref(), &request) {
        Ok(()) => next.run(request).await,
        Err(error) => error.into_response(),
    }
}

fn check(token: Option<&Token>, request: &Request) -> Result<(), ApiError> {
    let Some(token) = token else { return check_host(request.uri(), request.headers()) };
    let path = request.uri().path();
    let is_open = !path.starts_with("/api/") || path == format!("{API_PREFIX}/session");
    if is_open || presents(token, request.headers()) {
        return Ok(());
    }
    let is_sent = request.headers().contains_key(AUTHORIZATION);
    let detail = if is_sent { "the token that was sent is not the farm's" } else { "no token was sent" };
    Err(ApiError::new(ProblemCode::Unauthorized, detail)
        .field("authorization")
        .expected("`Bearer` and the token that the coordinator was started with"))
}

fn presents(token: &Token, headers: &HeaderMap) -> bool {
    let bearer = headers.get(AUTHORIZATION).and_then(|value| value.to_str().ok());
    if let Some((scheme, candidate)) = bearer.and_then(|value| value.split_once(' ')) {
        return scheme.eq_ignore_ascii_case("bearer") && token.matches(candidate.trim());
    }
    let cookies = headers.get_all(COOKIE).iter().filter_map(|value| value.to_str().ok());
    let mut pairs = cookies.flat_map(|value| value.split(';')).filter_map(|pair| pair.trim().split_once('='));
    pairs.any(|(name, value)| name == SESSION_COOKIE && token.matches_session(value))
}

/// Whether the request was addressed to this machine by a name that nobody else can give away.
fn check_host(uri: &Uri, headers: &HeaderMap) -> Result<(), ApiError> {
    let host = uri.authority().map(|authority| authority.as_str());
    let host = host.or_else(|| headers.get(HOST).and_then(|value| value.to_str().ok())).unwrap_or("");
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    if name.eq_ignore_ascii_case("localhost") || address.is_ok_and(|address| address.is_loopback()) {
        return Ok(());
    }
    let detail = "a coordinator without a token answers only on the names of its own machine";
    Err(ApiError::new(ProblemCode::ForeignOrigin, detail)
        .field("host")
        .value(host)
        .expected("localhost, 127.0.0.1 or [::1]"))
}
