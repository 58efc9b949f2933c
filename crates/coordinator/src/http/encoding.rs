//! Encodings: bodies are read as they are, so an encoded one is refused before it looks damaged.

use axum::extract::Request;
use axum::http::HeaderValue;
use axum::http::header::{ACCEPT_ENCODING, CONTENT_ENCODING, HeaderMap};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use clerestory_api::ProblemCode;

use crate::http::problem::ApiError;

/// The only encoding that is read: it changes nothing.
const IDENTITY: &str = "identity";

/// The layer.
pub(super) async fn refuse(request: Request, next: Next) -> Response {
    let Some(found) = encoding(request.headers()) else { return next.run(request).await };
    let error = ApiError::new(ProblemCode::UnsupportedMediaType, "this endpoint reads bodies without an encoding")
        .field("content-encoding")
        .value(found)
        .expected(format!("no such header, or `{IDENTITY}`"));
    let mut response = error.into_response();
    // It tells a sender what to try instead (RFC 9110, section 15.5.16).
    response.headers_mut().insert(ACCEPT_ENCODING, HeaderValue::from_static(IDENTITY));
    response
}

/// The first encoding that changes a body.
fn encoding(headers: &HeaderMap) -> Option<String> {
    headers.get_all(CONTENT_ENCODING).iter().find_map(|value| {
        let value = String::from_utf8_lossy(value.as_bytes());
        let mut names = value.split(',').map(str::trim);
        names.find(|name| !name.is_empty() && !name.eq_ignore_ascii_case(IDENTITY)).map(str::to_owned)
    })
}
