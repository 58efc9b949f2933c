//! Problem documents (RFC 9457): the one place that decides what a caller is told.
//!
//! Handlers return an [`ApiError`], and domain errors become one in the one `From` below. Its response carries the
//! problem as an extension. The [`explain`] layer is outside of everything else. It writes the document with the
//! request's id. It logs the cause of a 5xx, which the caller does not see.

use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::Request;
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use clerestory_api::{ContentHash, PROBLEM_MEDIA_TYPE, Problem, ProblemCode};
use tokio::task::JoinError;
use tower_http::csrf::ProtectionError;
use tracing::Instrument;
use uuid::Uuid;

use crate::blobs::BlobError;
use crate::error_chain::in_one_line;
use crate::films::FilmError;
use crate::films::acceptance::AcceptanceError;
use crate::films::assets::AssetError;
use crate::jobs::lifecycle::JobError;
use crate::jobs::submission_error::SubmissionError;
use crate::jobs::submission_memory::Busy;
use crate::jobs::workers::WorkerCallError;
use crate::model::UnprintableName;
use crate::store::{LeaseError, StoreError, WorkerError};
use crate::watch::readiness::NotReady;

/// Longest value that is repeated to the caller.
const LONGEST_VALUE: usize = 120;

/// Why a request fails.
#[derive(Clone, Debug)]
pub(crate) struct ApiError {
    problem: Box<Problem>,
    /// Pause before the caller should try again.
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

    /// A field with a value that it cannot have.
    pub(crate) fn invalid_field(field: impl Into<String>, value: impl ToString, expected: impl Into<String>) -> Self {
        let field = field.into();
        Self::new(ProblemCode::InvalidField, format!("the value of `{field}` cannot be used"))
            .field(field)
            .value(value)
            .expected(expected)
    }

    /// A body of more bytes than this endpoint reads.
    pub(crate) fn body_too_large(limit: u64) -> Self {
        let problem = Self::new(ProblemCode::BodyTooLarge, "the body is larger than allowed");
        problem.field("body").expected(format!("at most {limit} bytes"))
    }

    /// A failure of the coordinator. The cause goes to the log only.
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

    /// Whether the caller is not to blame, so that the same call may succeed later.
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

    /// Bytes with another hash than the one they arrive under.
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

/// The errors of the domain that callers can meet.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub(crate) enum DomainError {
    /// Of the database.
    Store(#[from] StoreError),
    /// Of a worker's call.
    Worker(#[from] WorkerError),
    /// Of a worker's call that has to be carried out to its end.
    WorkerCall(#[from] WorkerCallError),
    /// Of a call under a lease.
    Lease(#[from] LeaseError),
    /// Of a partial.
    Acceptance(#[from] AcceptanceError),
    /// Of the blob store.
    Blob(#[from] BlobError),
    /// Of a film.
    Film(#[from] FilmError),
    /// Of an asset.
    Asset(#[from] AssetError),
    /// Of a job.
    Job(#[from] JobError),
    /// Of a submission.
    Submission(#[from] SubmissionError),
    /// Of the memory for submissions.
    Busy(#[from] Busy),
    /// Of a name.
    Name(#[from] UnprintableName),
    /// Of readiness.
    NotReady(#[from] NotReady),
    /// Of a computation that was stopped.
    Stopped(#[from] JoinError),
}

/// The one way from an error of the domain to a problem.
impl<E: Into<DomainError>> From<E> for ApiError {
    fn from(error: E) -> Self {
        match error.into() {
            DomainError::Store(error) => of_store(error),
            DomainError::Worker(error) | DomainError::WorkerCall(WorkerCallError::Worker(error)) => of_worker(error),
            DomainError::Lease(error) | DomainError::Acceptance(AcceptanceError::Lease(error)) => of_lease(error),
            DomainError::Acceptance(AcceptanceError::InvalidPartial(reason)) => {
                Self::new(ProblemCode::InvalidPartial, reason).field("body")
            }
            DomainError::Film(error)
            | DomainError::Asset(AssetError::Film(error))
            | DomainError::Submission(SubmissionError::Film(error)) => of_film(error),
            DomainError::Asset(error @ AssetError::Unknown(hash)) => {
                Self::new(ProblemCode::UnknownAsset, error.to_string()).field("hash").value(hash)
            }
            DomainError::Job(error @ JobError::Unknown(job)) => {
                Self::new(ProblemCode::UnknownJob, error.to_string()).field("job").value(job)
            }
            DomainError::Job(JobError::Store(error)) => of_store(error),
            DomainError::Busy(busy) | DomainError::Submission(SubmissionError::Busy(busy)) => {
                Self::new(ProblemCode::Unavailable, busy.to_string()).retry_after(Busy::RETRY_AFTER)
            }
            DomainError::Name(error) | DomainError::Submission(SubmissionError::Name(error)) => of_name(error),
            DomainError::NotReady(problem) => Self::new(ProblemCode::Unavailable, problem.to_string()),
            DomainError::Submission(error) => of_submission(error),
            error @ (DomainError::WorkerCall(WorkerCallError::Stopped(_))
            | DomainError::Acceptance(_)
            | DomainError::Blob(_)
            | DomainError::Job(JobError::Stopped(_))
            | DomainError::Stopped(_)) => Self::internal(error),
        }
    }
}

fn of_store(error: StoreError) -> ApiError {
    match error {
        StoreError::Closed => ApiError::new(ProblemCode::Unavailable, "the coordinator is stopping; try again"),
        error @ StoreError::ReadOnly(_) => ApiError {
            cause: Some(Arc::new(error)),
            ..ApiError::new(ProblemCode::Unavailable, "the database takes no writes now; try again")
        },
        error => ApiError::internal(error),
    }
}

fn of_worker(error: WorkerError) -> ApiError {
    match error {
        WorkerError::Unknown(worker) => {
            let detail = "no worker has registered under this identity; register again";
            ApiError::new(ProblemCode::UnknownWorker, detail).field("worker").value(worker)
        }
        error @ WorkerError::Quarantined { worker, .. } => {
            ApiError::new(ProblemCode::WorkerQuarantined, error.to_string()).field("worker").value(worker)
        }
        WorkerError::Store(error) => of_store(error),
    }
}

fn of_lease(error: LeaseError) -> ApiError {
    let detail = error.to_string();
    match error {
        LeaseError::Unknown(lease) => ApiError::new(ProblemCode::UnknownLease, detail).field("lease").value(lease),
        LeaseError::StaleToken(token) => {
            let problem = ApiError::new(ProblemCode::StaleToken, detail).field("token").value(token);
            problem.expected("the token that came with the lease")
        }
        LeaseError::Expired => ApiError::new(ProblemCode::LeaseExpired, detail),
        LeaseError::Returned => ApiError::new(ProblemCode::LeaseReturned, detail),
        LeaseError::JobNotRunning => ApiError::new(ProblemCode::JobNotRunning, detail),
        LeaseError::Store(error) => of_store(error),
    }
}

fn of_film(error: FilmError) -> ApiError {
    match error {
        FilmError::Empty => ApiError::new(ProblemCode::NoImageYet, "no node of this job has been accepted yet"),
        error @ FilmError::RenderedAgain => ApiError::new(ProblemCode::Unavailable, error.to_string()),
        FilmError::Store(error) => of_store(error),
        error => ApiError::internal(error),
    }
}

fn of_name(error: UnprintableName) -> ApiError {
    let expected = "a name without control characters, line breaks and overrides of the direction of text";
    let problem = ApiError::new(ProblemCode::InvalidName, error.to_string());
    problem.field(error.field).value(error.name).expected(expected)
}

fn of_submission(error: SubmissionError) -> ApiError {
    let detail = error.to_string();
    match error {
        SubmissionError::InvalidField { field, value, expected } => {
            ApiError::new(ProblemCode::InvalidField, detail).field(field).value(value).expected(expected)
        }
        SubmissionError::InvalidScene { field, value, expected, .. } => {
            let problem = ApiError::new(ProblemCode::InvalidScene, detail).field(field);
            let problem = value.into_iter().fold(problem, ApiError::value);
            expected.into_iter().fold(problem, ApiError::expected)
        }
        SubmissionError::InvalidReference { hash, expected, .. } => {
            let problem = ApiError::new(ProblemCode::InvalidReference, detail).field("reference");
            problem.value(hash).expected(expected)
        }
        SubmissionError::MissingAssets(hashes) => ApiError::new(ProblemCode::MissingAssets, detail).missing(hashes),
        error => ApiError::internal(error),
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
        // As text: the JSON form of the log shows no sources of an error.
        Some(cause) => tracing::error!(cause = in_one_line(&**cause), "request failed"),
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

/// The problem of a failure that comes from the router or a layer.
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
