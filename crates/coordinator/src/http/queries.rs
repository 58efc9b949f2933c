//! Queries of endpoints without parameters: one is refused, like an unknown member of a body.

use axum::extract::Request;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::http::extract::{query_pairs, unknown_parameter};

/// The layer.
pub(super) async fn refuse(request: Request, next: Next) -> Response {
    match query_pairs(request.uri()).into_iter().next() {
        None => next.run(request).await,
        Some((name, value)) => unknown_parameter(&name, value, "no parameters here").into_response(),
    }
}
