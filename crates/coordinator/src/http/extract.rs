//! Strict reading of requests: an error names the field, its value and what would be right.

use std::str::FromStr;
use std::time::Duration;

use axum::body::{BodyDataStream, Bytes};
use axum::extract::{FromRequest, FromRequestParts, Query, RawPathParams, Request};
use axum::http::Uri;
use axum::http::header::{CONTENT_LENGTH, CONTENT_TYPE, HeaderMap};
use axum::http::request::Parts;
use bytes::BytesMut;
use clerestory_api::ProblemCode;
use futures::stream::StreamExt;
use serde::de::DeserializeOwned;
use serde_json::Value;
use serde_path_to_error::Segment;
use tokio::time::Instant;

use crate::http::problem::ApiError;
use crate::http::strict_object::StrictObject;

/// Largest body that is not an asset or a partial: a scene with inline meshes.
pub(super) const MAX_SMALL_BODY: u32 = 16 << 20;

/// Longest time of a body that fits into memory.
const BODY_TIMEOUT: Duration = Duration::from_secs(120);

/// Longest silence before or within such a body. A sender that has stopped must not keep memory from others.
const LONGEST_SILENCE: Duration = Duration::from_secs(5);

/// How the reader begins when it speaks of a number that no double can hold.
const OUT_OF_RANGE: &str = "number out of range";

/// A JSON body. Unknown fields are errors, because the types of the API deny them.
pub(crate) struct StrictJson<T>(pub(crate) T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequest<S> for StrictJson<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, _state: &S) -> Result<Self, ApiError> {
        JsonBody::receive(request).await?.parse().map(Self)
    }
}

/// A body that is to be JSON.
pub(crate) struct JsonBody(Bytes);

impl JsonBody {
    /// Receives the body of a request.
    ///
    /// # Errors
    ///
    /// When it is of another type, is too large or does not come.
    pub(crate) async fn receive(request: Request) -> Result<Self, ApiError> {
        require_media_type(request.headers(), "application/json")?;
        read_body(request, MAX_SMALL_BODY.into()).await.map(Self)
    }

    /// Its bytes.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// What it says. Unknown fields are errors, because the types of the API deny them.
    ///
    /// # Errors
    ///
    /// When it is not JSON, or not of this type.
    pub(crate) fn parse<T: DeserializeOwned>(self) -> Result<T, ApiError> {
        // The reader of a type would accept an array for an object, and the last of two members with one name.
        read_json::<StrictObject>(&self.0)?;
        read_json(&self.0)
    }
}

fn read_json<T: DeserializeOwned>(body: &[u8]) -> Result<T, ApiError> {
    let mut reader = serde_json::Deserializer::from_slice(body);
    let value = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let path = error.path().to_string();
        let message = error.inner().to_string();
        if error.inner().is_data() || message.starts_with(OUT_OF_RANGE) {
            return of_message(&path, &message, value_at(body, error.path()));
        }
        let detail = format!("the body is not valid JSON: {message}");
        ApiError::new(ProblemCode::InvalidBody, detail).field("body").expected("a JSON object")
    })?;
    reader.end().map_err(|error| {
        let detail = format!("the body goes on after its JSON value: {error}");
        ApiError::new(ProblemCode::InvalidBody, detail).field("body").expected("one JSON object")
    })?;
    Ok(value)
}

/// The value at a position of a body: a text without quotation marks, anything else as JSON.
fn value_at(body: &[u8], path: &serde_path_to_error::Path) -> Option<String> {
    let body: Value = serde_json::from_slice(body).ok()?;
    let value = path.iter().try_fold(&body, |value, segment| match segment {
        Segment::Seq { index } => value.get(index),
        Segment::Map { key } => value.get(key),
        Segment::Enum { .. } | Segment::Unknown => None,
    })?;
    Some(value.as_str().map_or_else(|| value.to_string(), str::to_owned))
}

/// Parameters of the query.
pub(crate) struct StrictQuery<T>(pub(crate) T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for StrictQuery<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let rejection = match Query::<T>::from_request_parts(parts, state).await {
            Ok(Query(value)) => return Ok(Self(value)),
            Err(rejection) => rejection,
        };
        let text = rejection.body_text();
        let message = text.split_once("query string: ").map_or(text.as_str(), |(_, message)| message);
        let (path, message) = match message.split_once(": ") {
            Some((path, rest)) if !path.contains(' ') => (path, rest),
            _ => ("", message),
        };
        let value = |name: &str| query_pairs(&parts.uri).into_iter().find(|(known, _)| known == name);
        if let Some((name, known)) = message.strip_prefix("unknown field `").and_then(|rest| rest.split_once('`')) {
            let known = known.split_once("expected ").map_or("no parameters here", |(_, known)| known);
            return Err(unknown_parameter(name, value(name).map(|(_, value)| value).unwrap_or_default(), known));
        }
        Err(of_message(path, message, value(path).map(|(_, value)| value)))
    }
}

/// The parameters of a query, in its order.
pub(super) fn query_pairs(uri: &Uri) -> Vec<(String, String)> {
    Query::<Vec<(String, String)>>::try_from_uri(uri).map(|Query(pairs)| pairs).unwrap_or_default()
}

/// A parameter that an endpoint does not have, and those that it has.
pub(super) fn unknown_parameter(name: &str, value: String, known: &str) -> ApiError {
    let error = ApiError::new(ProblemCode::UnknownField, format!("this endpoint has no parameter `{name}`"));
    error.field(name).value(value).expected(known)
}

/// The parameter of the path, read as an identity or a hash.
pub(crate) struct PathParameter<T>(pub(crate) T);

impl<S: Send + Sync, T: FromStr> FromRequestParts<S> for PathParameter<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        parameter(path_parameters(parts, state).await?.iter().next()).map(Self)
    }
}

async fn path_parameters<S: Send + Sync>(parts: &mut Parts, state: &S) -> Result<RawPathParams, ApiError> {
    let parameters = RawPathParams::from_request_parts(parts, state).await;
    parameters.map_err(|_| ApiError::new(ProblemCode::UnknownPath, "the path is not valid UTF-8"))
}

fn parameter<T: FromStr>(found: Option<(&str, &str)>) -> Result<T, ApiError> {
    let (name, value) = found.unwrap_or_default();
    value.parse().map_err(|_| {
        let expected = match name {
            "hash" => "a BLAKE3 digest as 64 lowercase hexadecimal digits",
            _ => "a UUID",
        };
        ApiError::invalid_field(name, value, expected)
    })
}

/// Both parameters of a path that has two.
pub(crate) struct PathParameters<A, B>(pub(crate) A, pub(crate) B);

impl<S: Send + Sync, A: FromStr, B: FromStr> FromRequestParts<S> for PathParameters<A, B> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        let parameters = path_parameters(parts, state).await?;
        let mut parameters = parameters.iter();
        Ok(Self(parameter(parameters.next())?, parameter(parameters.next())?))
    }
}

/// A whole body of a route that reads `limit` bytes.
async fn read_body(request: Request, limit: u64) -> Result<Bytes, ApiError> {
    let mut arriving = ArrivingBody::new(request, limit)?;
    let mut body = BytesMut::new();
    while let Some(piece) = arriving.piece().await? {
        body.extend_from_slice(&piece);
    }
    Ok(body.freeze())
}

/// Bytes of a body, if its head says so.
pub(super) fn announced_bytes(headers: &HeaderMap) -> Option<u64> {
    headers.get(CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

/// A body that arrives and fits into memory.
pub(crate) struct ArrivingBody {
    stream: BodyDataStream,
    announced_bytes: Option<u64>,
    received_bytes: u64,
    limit: u64,
    /// Time left for the rest of it.
    time_left: Duration,
}

impl ArrivingBody {
    /// The body of a request to a route that reads `limit` bytes.
    ///
    /// # Errors
    ///
    /// When it is announced to be larger.
    pub(crate) fn new(request: Request, limit: u64) -> Result<Self, ApiError> {
        let announced_bytes = announced_bytes(request.headers());
        if announced_bytes.is_some_and(|bytes| bytes > limit) {
            return Err(ApiError::body_too_large(limit));
        }
        let stream = request.into_body().into_data_stream();
        Ok(Self { stream, announced_bytes, received_bytes: 0, limit, time_left: BODY_TIMEOUT })
    }

    /// Its bytes, if its head says so.
    pub(crate) fn announced_bytes(&self) -> Option<u64> {
        self.announced_bytes
    }

    /// Its next bytes, or `None` at its end.
    pub(crate) async fn piece(&mut self) -> Result<Option<Bytes>, ApiError> {
        let begin = Instant::now();
        let next = tokio::time::timeout(LONGEST_SILENCE.min(self.time_left), self.stream.next()).await;
        // The time between two calls is not the sender's.
        self.time_left = self.time_left.saturating_sub(begin.elapsed());
        let piece = match next {
            Ok(Some(Ok(piece))) => piece,
            Ok(Some(Err(_))) => {
                return Err(ApiError::new(ProblemCode::InvalidBody, "the body was cut off").field("body"));
            }
            Ok(None) => return Ok(None),
            Err(_) => return Err(too_slow()),
        };
        self.received_bytes = self.received_bytes.saturating_add(piece.len() as u64);
        if self.received_bytes > self.limit {
            return Err(ApiError::body_too_large(self.limit));
        }
        Ok(Some(piece))
    }
}

/// The body stopped coming.
pub(crate) fn too_slow() -> ApiError {
    ApiError::new(ProblemCode::BodyTooSlow, "the body took too long to arrive")
}

/// Refuses a body with another media type. Browsers send such a type to another site only after asking, which is one
/// more lock against forged requests.
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

/// Translates a message of serde to field, value and expectation. Messages are of the forms ``unknown field `a`,
/// expected b``, ``missing field `a` ``, ``duplicate field `a` `` and `invalid type: a, expected b`.
fn of_message(path: &str, message: &str, value: Option<String>) -> ApiError {
    let (message, _) = message.split_once(" at line ").unwrap_or((message, ""));
    let (problem, expected) = expectation(message);
    let quoted = |prefix: &str| problem.strip_prefix(prefix).map(|name| name.trim_matches('`'));
    let path = path.trim_matches('.');
    let member = |name: &str| match path {
        "" => name.to_owned(),
        // The path contains the unknown member already.
        _ if path == name || path.ends_with(&format!(".{name}")) => path.to_owned(),
        _ => format!("{path}.{name}"),
    };
    if let Some(name) = quoted("unknown field ") {
        return ApiError::new(ProblemCode::UnknownField, format!("there is no field `{name}`"))
            .field(member(name))
            .expected(if expected.is_empty() { "no such field" } else { expected });
    }
    for (prefix, what, expected) in
        [("missing field ", "missing", "a value"), ("duplicate field ", "there twice", "one value")]
    {
        if let Some(name) = quoted(prefix) {
            let name = member(name);
            return ApiError::new(ProblemCode::InvalidField, format!("the field `{name}` is {what}"))
                .field(name)
                .expected(expected);
        }
    }
    let mut error = match path {
        "" => ApiError::new(ProblemCode::InvalidBody, format!("the body cannot be used: {problem}")).field("body"),
        _ => {
            let detail = format!("the value of `{path}` cannot be used: {problem}");
            ApiError::new(ProblemCode::InvalidField, detail).field(path)
        }
    };
    if let Some(value) = value {
        error = error.value(value);
    }
    if !expected.is_empty() {
        error = error.expected(expected);
    }
    error
}

/// The problem and the expectation, the latter in the words of people who do not write Rust.
fn expectation(message: &str) -> (&str, &str) {
    let (problem, expected) = match message {
        _ if message.starts_with("UUID parsing failed") => ("it is no UUID", "a UUID"),
        _ if message.starts_with(OUT_OF_RANGE) => (message, "a number that a double can hold"),
        _ => message.split_once(", expected ").or(message.split_once(": expected ")).unwrap_or((message, "")),
    };
    let expected = match expected {
        "u32" => "a whole number, 0 to 4294967295",
        "i32" => "a whole number, -2147483648 to 2147483647",
        "u64" => "a whole number, 0 or more",
        "i64" => "a whole number",
        "f64" => "a number",
        "a string" => "a text",
        "a map" => "an object",
        other => other,
    };
    (problem, expected)
}
