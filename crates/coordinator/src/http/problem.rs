//! From an error to a problem document (RFC 9457): the one place where it is decided what a caller is told.
//!
//! Handlers return an [`ApiError`]. Its response carries the problem as an extension; the [`explain`] layer, outside of
//! everything else, writes the document with the request's id and logs what the caller is not told: the cause of a 5xx.

use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::Request;
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use clerestory_api::{ContentHash, PROBLEM_MEDIA_TYPE, Problem, ProblemCode, is_printable};
use tower_http::csrf::ProtectionError;
use tracing::Instrument;
use uuid::Uuid;

use crate::blobs::BlobError;
use crate::films::FilmError;
use crate::store::{LeaseError, StoreError, WorkerError};

/// Longest value that is repeated to the caller.
const LONGEST_VALUE: usize = 120;

/// Why a request fails.
#[derive(Clone, Debug)]
pub(crate) struct ApiError {
    problem: Box<Problem>,
    /// When the caller is to come back.
    retry_after: Option<Duration>,
    cause: Option<Arc<dyn Error + Send + Sync>>,
}

impl ApiError {
    /// A problem of this kind.
    pub(crate) fn new(code: ProblemCode, detail: impl Into<String>) -> Self {
        let (status, title) = status_and_title(code);
        let name = serde_json::to_value(code).ok();
        let name = name.as_ref().and_then(serde_json::Value::as_str).unwrap_or_default();
        let problem = Problem {
            kind: format!("tag:clerestory,2026:problem:{name}"),
            title: title.to_owned(),
            status: status.as_u16(),
            detail: detail.into(),
            code,
            field: None,
            value: None,
            expected: None,
            missing: Vec::new(),
            request_id: None,
        };
        Self { problem: Box::new(problem), retry_after: None, cause: None }
    }

    /// A field that has a value which it cannot have.
    pub(crate) fn invalid_field(field: impl Into<String>, value: impl ToString, expected: impl Into<String>) -> Self {
        let field = field.into();
        Self::new(ProblemCode::InvalidField, format!("the value of `{field}` cannot be used"))
            .field(field)
            .value(value)
            .expected(expected)
    }

    /// Refuses a name with a character that changes how a line is shown.
    pub(crate) fn check_name(field: &str, name: &str) -> Result<(), Self> {
        let Some(found) = name.chars().find(|character| !is_printable(*character)) else { return Ok(()) };
        let detail = format!("the name has the character U+{:04X}, which is not shown", u32::from(found));
        let expected = "a name without control characters, line breaks and overrides of the direction of text";
        Err(Self::new(ProblemCode::InvalidName, detail).field(field).value(name).expected(expected))
    }

    /// A body of more bytes than this endpoint reads.
    pub(crate) fn body_too_large(limit: u64) -> Self {
        let problem = Self::new(ProblemCode::BodyTooLarge, "the body is larger than allowed");
        problem.field("body").expected(format!("at most {limit} bytes"))
    }

    /// A fault of ours. The cause goes to the log only.
    pub(crate) fn internal(cause: impl Error + Send + Sync + 'static) -> Self {
        let mut error = Self::new(ProblemCode::Internal, "the coordinator failed; its log has the cause");
        error.cause = Some(Arc::new(cause));
        error
    }

    /// Says when to come back.
    pub(crate) fn retry_after(mut self, pause: Duration) -> Self {
        self.retry_after = Some(pause);
        self
    }

    /// Whether the fault is not the caller's, so that the same call may succeed later.
    pub(crate) fn is_ours(&self) -> bool {
        self.problem.status >= 500
    }

    /// Names the field that is wrong.
    pub(crate) fn field(mut self, field: impl Into<String>) -> Self {
        self.problem.field = Some(field.into());
        self
    }

    /// Repeats its value.
    pub(crate) fn value(mut self, value: impl ToString) -> Self {
        let value = value.to_string();
        let mut shortened: String = value.chars().take(LONGEST_VALUE).collect();
        if shortened.len() < value.len() {
            shortened.push_str("...");
        }
        self.problem.value = Some(shortened);
        self
    }

    /// Says what would be right.
    pub(crate) fn expected(mut self, expected: impl Into<String>) -> Self {
        self.problem.expected = Some(expected.into());
        self
    }

    /// Bytes that do not have the hash under which they come.
    pub(crate) fn hash_mismatch(announced: ContentHash, found: ContentHash) -> Self {
        Self::new(ProblemCode::HashMismatch, format!("the content has the hash {found}"))
            .field("hash")
            .value(announced)
            .expected(found.to_string())
    }

    /// Lists content that has to be uploaded first.
    pub(crate) fn missing(mut self, missing: Vec<ContentHash>) -> Self {
        self.problem.missing = missing;
        self
    }
}

fn status_and_title(code: ProblemCode) -> (StatusCode, &'static str) {
    match code {
        ProblemCode::Unauthorized => (StatusCode::UNAUTHORIZED, "The farm's token is required"),
        ProblemCode::ForeignOrigin => (StatusCode::FORBIDDEN, "Request from another site"),
        ProblemCode::UnknownPath => (StatusCode::NOT_FOUND, "No such path"),
        ProblemCode::MethodNotAllowed => (StatusCode::METHOD_NOT_ALLOWED, "Method not allowed"),
        ProblemCode::UnknownJob => (StatusCode::NOT_FOUND, "No such job"),
        ProblemCode::UnknownWorker => (StatusCode::NOT_FOUND, "No such worker"),
        ProblemCode::WorkerQuarantined => (StatusCode::FORBIDDEN, "Worker is quarantined"),
        ProblemCode::UnknownLease => (StatusCode::NOT_FOUND, "No such lease"),
        ProblemCode::UnknownAsset => (StatusCode::NOT_FOUND, "No such asset"),
        ProblemCode::NoImageYet => (StatusCode::NOT_FOUND, "No image yet"),
        ProblemCode::InvalidBody => (StatusCode::BAD_REQUEST, "Body cannot be read"),
        ProblemCode::UnsupportedMediaType => (StatusCode::UNSUPPORTED_MEDIA_TYPE, "Wrong content type"),
        ProblemCode::UnknownField => (StatusCode::BAD_REQUEST, "Unknown field"),
        ProblemCode::InvalidField => (StatusCode::BAD_REQUEST, "Invalid value"),
        ProblemCode::InvalidName => (StatusCode::UNPROCESSABLE_ENTITY, "Unusable name"),
        ProblemCode::InvalidScene => (StatusCode::UNPROCESSABLE_ENTITY, "Invalid scene"),
        ProblemCode::InvalidReference => (StatusCode::UNPROCESSABLE_ENTITY, "Unusable reference"),
        ProblemCode::MissingAssets => (StatusCode::CONFLICT, "Assets have to be uploaded first"),
        ProblemCode::MissingPieces => (StatusCode::CONFLICT, "Pieces have to be uploaded first"),
        ProblemCode::HashMismatch => (StatusCode::UNPROCESSABLE_ENTITY, "Content does not have this hash"),
        ProblemCode::BodyTooLarge => (StatusCode::PAYLOAD_TOO_LARGE, "Body too large"),
        ProblemCode::BodyTooSlow => (StatusCode::REQUEST_TIMEOUT, "Body too slow"),
        ProblemCode::InvalidPartial => (StatusCode::UNPROCESSABLE_ENTITY, "Partial cannot be merged"),
        ProblemCode::LeaseExpired => (StatusCode::CONFLICT, "Lease has run out"),
        ProblemCode::LeaseReturned => (StatusCode::CONFLICT, "Lease was given back"),
        ProblemCode::StaleToken => (StatusCode::CONFLICT, "Fencing token is not the lease's"),
        ProblemCode::JobNotRunning => (StatusCode::CONFLICT, "Job is not being rendered"),
        ProblemCode::Unavailable => (StatusCode::SERVICE_UNAVAILABLE, "Not available now"),
        ProblemCode::Internal | ProblemCode::Unknown => (StatusCode::INTERNAL_SERVER_ERROR, "Internal error"),
    }
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Closed => Self::new(ProblemCode::Unavailable, "the coordinator is stopping; try again"),
            error @ StoreError::ReadOnly(_) => Self {
                cause: Some(Arc::new(error)),
                ..Self::new(ProblemCode::Unavailable, "the database takes no writes now; try again")
            },
            error => Self::internal(error),
        }
    }
}

impl From<WorkerError> for ApiError {
    fn from(error: WorkerError) -> Self {
        match error {
            WorkerError::Unknown(worker) => {
                let detail = "no worker has registered under this identity; register again";
                Self::new(ProblemCode::UnknownWorker, detail).field("worker").value(worker)
            }
            error @ WorkerError::Quarantined { worker, .. } => {
                Self::new(ProblemCode::WorkerQuarantined, error.to_string()).field("worker").value(worker)
            }
            WorkerError::Store(error) => error.into(),
        }
    }
}

impl From<LeaseError> for ApiError {
    fn from(error: LeaseError) -> Self {
        let detail = error.to_string();
        match error {
            LeaseError::Unknown(lease) => Self::new(ProblemCode::UnknownLease, detail).field("lease").value(lease),
            LeaseError::StaleToken(token) => {
                let problem = Self::new(ProblemCode::StaleToken, detail).field("token").value(token);
                problem.expected("the token that came with the lease")
            }
            LeaseError::Expired => Self::new(ProblemCode::LeaseExpired, detail),
            LeaseError::Returned => Self::new(ProblemCode::LeaseReturned, detail),
            LeaseError::JobNotRunning => Self::new(ProblemCode::JobNotRunning, detail),
            LeaseError::Store(error) => error.into(),
        }
    }
}

impl From<BlobError> for ApiError {
    fn from(error: BlobError) -> Self {
        Self::internal(error)
    }
}

impl From<FilmError> for ApiError {
    fn from(error: FilmError) -> Self {
        match error {
            FilmError::Empty => Self::new(ProblemCode::NoImageYet, "no node of this job has been accepted yet"),
            error @ FilmError::RenderedAgain => Self::new(ProblemCode::Unavailable, error.to_string()),
            FilmError::Store(error) => error.into(),
            error => Self::internal(error),
        }
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.problem.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let mut response = status.into_response();
        response.extensions_mut().insert(self);
        response
    }
}

/// Gives the request an id and a span, and turns every failure into a problem document.
pub(super) async fn explain(request: Request, next: Next) -> Response {
    let request_id = Uuid::now_v7().to_string();
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let span = tracing::info_span!("request", %request_id, %method, path = path.as_str());
    async {
        let mut response = next.run(request).await;
        if response.status().is_client_error() || response.status().is_server_error() {
            response = document(response, &method, &path, &request_id);
        }
        if let Ok(value) = HeaderValue::from_str(&request_id) {
            response.headers_mut().insert("x-request-id", value);
        }
        tracing::debug!(status = response.status().as_u16(), "answered");
        response
    }
    .instrument(span)
    .await
}

fn document(mut response: Response, method: &Method, path: &str, request_id: &str) -> Response {
    let error = match response.extensions_mut().remove::<ApiError>() {
        Some(error) => error,
        None => of_status(&response, method, path),
    };
    let mut problem = error.problem;
    match &error.cause {
        Some(cause) => tracing::error!(cause = &**cause as &dyn Error, "request failed"),
        None => tracing::debug!(code = ?problem.code, detail = problem.detail, "request refused"),
    }
    problem.request_id = Some(request_id.to_owned());
    let status = StatusCode::from_u16(problem.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
    let body = serde_json::to_vec(&problem).unwrap_or_default();
    let mut explained = (status, [(header::CONTENT_TYPE, PROBLEM_MEDIA_TYPE)], body).into_response();
    for name in [header::ALLOW, header::WWW_AUTHENTICATE, header::ACCEPT_ENCODING] {
        if let Some(value) = response.headers_mut().remove(&name) {
            explained.headers_mut().insert(name, value);
        }
    }
    if let Some(pause) = error.retry_after {
        explained.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(pause.as_secs()));
    }
    if problem.code == ProblemCode::Unauthorized {
        explained.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
    }
    explained
}

/// What a failure means that comes from the router or a layer, which know no problem documents.
fn of_status(response: &Response, method: &Method, path: &str) -> ApiError {
    if response.extensions().get::<ProtectionError>().is_some() {
        return ApiError::new(ProblemCode::ForeignOrigin, "the request comes from a page of another site");
    }
    match response.status() {
        StatusCode::NOT_FOUND => {
            ApiError::new(ProblemCode::UnknownPath, "there is nothing under this path").field("path").value(path)
        }
        StatusCode::METHOD_NOT_ALLOWED => {
            let problem = ApiError::new(ProblemCode::MethodNotAllowed, "this path does not know the method");
            problem.field("method").value(method).expected("a method that the header `allow` lists")
        }
        StatusCode::PAYLOAD_TOO_LARGE => ApiError::new(ProblemCode::BodyTooLarge, "the body is larger than allowed"),
        status if status.is_client_error() => {
            ApiError::new(ProblemCode::InvalidBody, "the request cannot be understood")
        }
        _ => ApiError::new(ProblemCode::Internal, "the coordinator failed; its log has the cause"),
    }
}
