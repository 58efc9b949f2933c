//! The HTTP API and the dashboard.
//!
//! A request passes these layers, from the outside in:
//!
//! - [`drain`]: bodies that no handler has read to their end;
//! - [`problem::explain`]: request id, span, problem documents;
//! - panics are caught;
//! - [`auth::authorise`]: the token, or the name of this machine;
//! - requests from other sites' pages are refused;
//! - [`encoding`]: encoded bodies; [`queries`]: parameters that no endpoint has; limits of bodies.
//!
//! Handlers read with [`extract`], which names the field that is wrong, and return an [`ApiError`].

mod assets;
mod auth;
mod connections;
mod drain;
mod encoding;
mod events;
mod extract;
mod images;
mod integrators;
mod jobs;
mod leases;
mod lingering;
mod openapi;
mod pieces;
pub(crate) mod problem;
mod queries;
pub(crate) mod receiving;
pub(crate) mod state;
mod strict_object;
mod workers;

use std::sync::Arc;

use axum::extract::{DefaultBodyLimit, State};
use axum::http::header::{CONTENT_SECURITY_POLICY, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::get;
use axum::{Json, Router};
use clerestory_api::API_PREFIX;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::csrf::CsrfLayer;
use tower_http::set_header::SetResponseHeaderLayer;

use self::state::ApiState;
use crate::dashboard;
use crate::watch::readiness::Readiness;

pub(crate) use connections::serve;
pub(crate) use problem::ApiError;

/// What the dashboard's page may load: its own files, and images that it has fetched.
const PAGE_POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; \
     frame-ancestors 'none'; base-uri 'none'; form-action 'self'";

/// Everything that the coordinator serves.
pub(crate) fn router(state: ApiState) -> Router {
    let max_partial = usize::try_from(state.limits.partial).unwrap_or(usize::MAX);
    let api = Router::from(openapi::small())
        .route("/openapi.json", get(async || Json(openapi::description())))
        .layer(DefaultBodyLimit::max(extract::MAX_SMALL_BODY as usize))
        .merge(Router::from(openapi::partials()).layer(DefaultBodyLimit::max(max_partial)))
        // Assets are counted as they are written.
        .merge(Router::from(openapi::streams()).layer(DefaultBodyLimit::disable()))
        .route_layer(from_fn(queries::refuse))
        .merge(Router::from(openapi::with_parameters()))
        .route_layer(from_fn(encoding::refuse));
    let fixed = |name, value| SetResponseHeaderLayer::if_not_present(name, HeaderValue::from_static(value));
    Router::new()
        .nest(API_PREFIX, api)
        .fallback(dashboard::file)
        .layer(CsrfLayer::new())
        .layer(from_fn_with_state(state.clone(), auth::authorise))
        // Probes call by address, and learn only the state of the coordinator.
        .route("/healthz", get(async || StatusCode::NO_CONTENT))
        .route("/readyz", get(ready))
        .layer(CatchPanicLayer::new())
        .layer(from_fn(problem::explain))
        .layer(from_fn(drain::drop_leftover))
        .layer(fixed(X_CONTENT_TYPE_OPTIONS, "nosniff"))
        .layer(fixed(REFERRER_POLICY, "no-referrer"))
        .layer(fixed(CONTENT_SECURITY_POLICY, PAGE_POLICY))
        .with_state(state)
}

/// Whether the coordinator could store what callers bring now, or why not.
async fn ready(State(readiness): State<Arc<Readiness>>) -> Result<StatusCode, ApiError> {
    readiness.check().await?;
    Ok(StatusCode::NO_CONTENT)
}
