//! Reading requests strictly: an error names the field, its value and what would be right.

use std::str::FromStr;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{FromRequest, FromRequestParts, Query, RawPathParams, Request};
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HeaderMap};
use axum::http::request::Parts;
use axum::response::IntoResponse;
use clerestory_api::ProblemCode;
use serde::de::DeserializeOwned;

use super::problem::ApiError;

/// How long a body that fits into memory may take to arrive.
const BODY_TIMEOUT: Duration = Duration::from_secs(120);

/// A JSON body. Unknown fields are errors, because the types of the API deny them.
pub(crate) struct StrictJson<T>(pub(crate) T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequest<S> for StrictJson<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        require_media_type(request.headers(), "application/json")?;
        let bytes = read_body(request, state).await?;
        let mut reader = serde_json::Deserializer::from_slice(&bytes);
        let value = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
            let path = error.path().to_string();
            match error.inner().classify() {
                serde_json::error::Category::Data => of_message(&path, &error.inner().to_string()),
                _ => {
                    let detail = format!("the body is not valid JSON: {}", error.inner());
                    ApiError::new(ProblemCode::InvalidBody, detail).expected("a JSON object")
                }
            }
        })?;
        reader.end().map_err(|error| {
            ApiError::new(ProblemCode::InvalidBody, format!("the body goes on after its JSON value: {error}"))
        })?;
        Ok(Self(value))
    }
}

/// Parameters of the query.
pub(crate) struct StrictQuery<T>(pub(crate) T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for StrictQuery<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        match Query::<T>::from_request_parts(parts, state).await {
            Ok(Query(value)) => Ok(Self(value)),
            Err(rejection) => {
                let text = rejection.body_text();
                let message = text.split_once("query string: ").map_or(text.as_str(), |(_, message)| message);
                let (path, message) = match message.split_once(": ") {
                    Some((path, rest)) if !path.contains(' ') => (path, rest),
                    _ => ("", message),
                };
                Err(of_message(path, message))
            }
        }
    }
}

/// The parameter of the path, read as an identity or a hash.
pub(crate) struct PathParameter<T>(pub(crate) T);

impl<S: Send + Sync, T: FromStr> FromRequestParts<S> for PathParameter<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let parameters = RawPathParams::from_request_parts(parts, state).await;
        let parameters =
            parameters.map_err(|_| ApiError::new(ProblemCode::UnknownPath, "the path is not valid UTF-8"))?;
        let (name, value) = parameters.iter().next().unwrap_or_default();
        value.parse().map(Self).map_err(|_| {
            let expected = match name {
                "hash" => "a BLAKE3 digest as 64 lowercase hexadecimal digits",
                _ => "a UUID",
            };
            ApiError::invalid_field(name, value, expected)
        })
    }
}

/// A whole body, as large as the route allows.
pub(crate) async fn read_body<S: Send + Sync>(request: Request, state: &S) -> Result<Bytes, ApiError> {
    match tokio::time::timeout(BODY_TIMEOUT, Bytes::from_request(request, state)).await {
        Ok(Ok(bytes)) => Ok(bytes),
        Ok(Err(rejection)) => Err(of_body_rejection(rejection)),
        Err(_) => Err(too_slow()),
    }
}

/// The body stopped coming.
pub(crate) fn too_slow() -> ApiError {
    ApiError::new(ProblemCode::BodyTooSlow, "the body took too long to arrive")
}

/// Refuses a body that is declared as something else. Browsers send such a type to another site only after asking, which
/// is one more lock against requests that pages make behind their readers' backs.
pub(crate) fn require_media_type(headers: &HeaderMap, expected: &'static str) -> Result<(), ApiError> {
    let found = headers.get(CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or("");
    let media_type = found.split(';').next().unwrap_or("").trim();
    if media_type.eq_ignore_ascii_case(expected) {
        return Ok(());
    }
    let detail = format!("this endpoint reads {expected}");
    Err(ApiError::new(ProblemCode::UnsupportedMediaType, detail).field("content-type").value(found).expected(expected))
}

/// A header that holds a number.
pub(crate) fn number_header(headers: &HeaderMap, name: &'static str) -> Result<u64, ApiError> {
    let found = headers.get(name).map(|value| String::from_utf8_lossy(value.as_bytes()).into_owned());
    let number = found.as_deref().and_then(|text| text.parse().ok());
    number
        .ok_or_else(|| ApiError::invalid_field(name, found.as_deref().unwrap_or("absent"), "a whole number, 0 or more"))
}

fn of_body_rejection(rejection: BytesRejection) -> ApiError {
    match rejection.into_response().status() {
        StatusCode::PAYLOAD_TOO_LARGE => ApiError::new(ProblemCode::BodyTooLarge, "the body is larger than allowed"),
        _ => ApiError::new(ProblemCode::InvalidBody, "the body was cut off"),
    }
}

/// From what serde says to field, value and expectation. Its messages are of the forms ``unknown field `a`, expected b``,
/// ``missing field `a` `` and `invalid type: a, expected b`.
fn of_message(path: &str, message: &str) -> ApiError {
    let (message, _) = message.split_once(" at line ").unwrap_or((message, ""));
    let (problem, expected) = message.split_once(", expected ").unwrap_or((message, ""));
    let quoted = |prefix: &str| problem.strip_prefix(prefix).map(|name| name.trim_matches('`'));
    let path = path.trim_matches('.');
    let member = |name: &str| match path {
        "" => name.to_owned(),
        // The reader counts the unknown member as part of the path already.
        _ if path == name || path.ends_with(&format!(".{name}")) => path.to_owned(),
        _ => format!("{path}.{name}"),
    };
    if let Some(name) = quoted("unknown field ") {
        return ApiError::new(ProblemCode::UnknownField, format!("nobody knows a field `{name}`"))
            .field(member(name))
            .expected(if expected.is_empty() { "no such field" } else { expected });
    }
    if let Some(name) = quoted("missing field ") {
        let name = member(name);
        return ApiError::new(ProblemCode::InvalidField, format!("the field `{name}` is missing"))
            .field(name)
            .expected("a value");
    }
    let value = problem.split_once(": ").map_or(problem, |(_, value)| value);
    let mut error = ApiError::new(ProblemCode::InvalidField, message.to_owned()).value(value);
    if !path.is_empty() {
        error = error.field(path);
    }
    if !expected.is_empty() {
        error = error.expected(expected);
    }
    error
}
