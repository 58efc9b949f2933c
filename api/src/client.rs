//! The typed client: one method for each call that the programs of this repository make.

use std::convert::Infallible;
use std::time::Duration;

use bytes::Bytes;
use futures::stream;
use reqwest::header::{AUTHORIZATION, CONTENT_LENGTH, CONTENT_TYPE, HeaderMap, HeaderValue, RETRY_AFTER};
use reqwest::{Body, Method, RequestBuilder, Response, StatusCode, Url};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::{
    ACCEPTED_NODES_HEADER, API_PREFIX, CORE_MILLISECONDS_HEADER, ContentHash, ConvergenceSeries, EXR_MEDIA_TYPE,
    EventStream, FENCING_TOKEN_HEADER, JobId, JobScene, JobSubmission, JobView, Lease, LeaseId, LeaseRenewal,
    LeaseRequest, LeaseReturn, LeaseToken, LiveMeasurement, PROBLEM_MEDIA_TYPE, PartialAnswer, PartialUpload, Preview,
    PreviewQuery, Problem, WorkerId, WorkerRegistration, WorkerView,
};

/// Longest wait for a connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest wait for an answer, and longest silence in the middle of it. Long polls stay below it, event streams send comments
/// more often.
const PATIENCE: Duration = Duration::from_secs(60);

/// The slowest line on which an upload gets through, bytes a second: the longer the body, the longer the wait for the answer.
const SLOWEST_LINE: usize = 64 << 10;

/// Longest pause that an answer can ask for: below the time that a lease lasts by default.
const LONGEST_RETRY_AFTER: Duration = Duration::from_secs(30);

/// Characters of an unexpected answer that are shown.
const SHOWN_BODY: usize = 100;

/// Bytes of an upload that are handed to the connection at a time.
const UPLOAD_PIECE: usize = 64 << 10;

/// A connection to a coordinator. Cheap to clone; clones share their connections.
#[derive(Clone, Debug)]
pub struct Client {
    http: reqwest::Client,
    /// Without a limit of its own on the wait for an answer, which would run while the body is still on its way.
    uploads: reqwest::Client,
    patience: Duration,
    base: Url,
}

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The address cannot be one of a coordinator.
    #[error(
        "`{value}` is not the address of a coordinator: expected something like http://127.0.0.1:7171, without a path"
    )]
    InvalidAddress {
        /// The address.
        value: String,
    },
    /// The token has characters that no header can carry.
    #[error(
        "the token has characters other than visible ASCII: expected something like the output of `openssl rand -hex 32`"
    )]
    InvalidToken,
    /// The coordinator refused, and said why.
    #[error("{problem}")]
    Problem {
        /// What it said.
        problem: Box<Problem>,
        /// How long to wait before the next attempt, if the answer says.
        retry_after: Option<Duration>,
    },
    /// Somebody answered, but not as a coordinator does.
    #[error("unexpected answer with status {status}: {body}")]
    UnexpectedAnswer {
        /// HTTP status.
        status: u16,
        /// The beginning of the body.
        body: String,
        /// How long to wait before the next attempt, if the answer says.
        retry_after: Option<Duration>,
    },
    /// The coordinator answered with success, and with a body of another form than this build knows.
    #[error("the answer from {path} cannot be read")]
    UnreadableAnswer {
        /// The path that was asked.
        path: String,
        /// What could not be read.
        source: serde_json::Error,
    },
    /// The request did not get through.
    #[error("no answer from the coordinator")]
    Transport(#[from] reqwest::Error),
}

impl ClientError {
    /// Whether the same call may well succeed later: the coordinator is restarting, overloaded or out of reach, or the
    /// line was too slow.
    pub fn is_transient(&self) -> bool {
        match self {
            Self::Transport(error) => !error.is_builder(),
            Self::Problem { problem, .. } => is_transient(problem.status),
            Self::UnexpectedAnswer { status, .. } => is_transient(*status),
            Self::InvalidAddress { .. } | Self::InvalidToken | Self::UnreadableAnswer { .. } => false,
        }
    }

    /// How long to wait before the same call, for a caller who means to wait for `planned`: what the answer asks for
    /// comes on top, so that callers who all were asked the same do not come back all at once.
    pub fn pause(&self, planned: Duration) -> Duration {
        match self {
            Self::Problem { retry_after, .. } | Self::UnexpectedAnswer { retry_after, .. } => {
                planned + retry_after.unwrap_or_default().min(LONGEST_RETRY_AFTER)
            }
            Self::InvalidAddress { .. } | Self::InvalidToken | Self::UnreadableAnswer { .. } | Self::Transport(_) => {
                planned
            }
        }
    }

    /// The problem document, if the coordinator sent one.
    pub fn problem(&self) -> Option<&Problem> {
        match self {
            Self::Problem { problem, .. } => Some(problem),
            _ => None,
        }
    }
}

/// An image that is on its way.
#[derive(Debug)]
pub struct ImageDownload(Response);

impl ImageDownload {
    /// The next piece of the file; `None` when that was all.
    pub async fn piece(&mut self) -> Result<Option<Bytes>, ClientError> {
        Ok(self.0.chunk().await?)
    }
}

impl Client {
    /// A client for the coordinator at `address`, for instance `http://127.0.0.1:7171`. Nothing is sent yet.
    ///
    /// # Errors
    ///
    /// When the address or the token cannot be used, or the client's TLS cannot be set up.
    pub fn new(address: &str, token: Option<&str>) -> Result<Self, ClientError> {
        Self::with_patience(address, token, PATIENCE)
    }

    fn with_patience(address: &str, token: Option<&str>, patience: Duration) -> Result<Self, ClientError> {
        let invalid = || ClientError::InvalidAddress { value: address.to_owned() };
        let mut base: Url = address.parse().map_err(|_| invalid())?;
        let is_host_alone = base.path() == "/" && base.query().is_none() && base.fragment().is_none();
        if !matches!(base.scheme(), "http" | "https") || !is_host_alone {
            return Err(invalid());
        }
        base.set_path("");
        let mut headers = HeaderMap::new();
        if let Some(token) = token {
            let mut value = HeaderValue::from_str(&format!("Bearer {token}")).map_err(|_| ClientError::InvalidToken)?;
            value.set_sensitive(true);
            headers.insert(AUTHORIZATION, value);
        }
        let client = || reqwest::Client::builder().default_headers(headers.clone()).connect_timeout(CONNECT_TIMEOUT);
        Ok(Self { http: client().read_timeout(patience).build()?, uploads: client().build()?, patience, base })
    }

    /// Whether the coordinator is up and its store is usable.
    pub async fn is_ready(&self) -> bool {
        let Ok(url) = self.base.join("/readyz") else { return false };
        matches!(self.http.get(url).send().await, Ok(response) if response.status().is_success())
    }

    /// Uploads an asset under its content hash, and tells `sent`, as pieces are handed to the connection, how many bytes each
    /// has. Uploading it again changes nothing.
    pub async fn upload_asset(
        &self,
        hash: &ContentHash,
        content: Bytes,
        mut sent: impl FnMut(u64) + Send + 'static,
    ) -> Result<(), ClientError> {
        let length = content.len();
        let pieces = (0..length).step_by(UPLOAD_PIECE).map(move |start| {
            let piece = content.slice(start..length.min(start + UPLOAD_PIECE));
            sent(piece.len() as u64);
            Ok::<_, Infallible>(piece)
        });
        let request = self
            .upload(&format!("/assets/{hash}"), length)
            .header(CONTENT_LENGTH, length)
            .body(Body::wrap_stream(stream::iter(pieces)));
        check(request.send().await?).await?;
        Ok(())
    }

    /// Downloads an asset.
    pub async fn asset(&self, hash: &ContentHash) -> Result<Bytes, ClientError> {
        self.download(self.request(Method::GET, &format!("/assets/{hash}"))).await
    }

    /// Submits a job. A problem with code `missing_assets` lists what has to be uploaded first.
    pub async fn submit_job(&self, submission: &JobSubmission) -> Result<JobView, ClientError> {
        self.send_json(Method::POST, "/jobs", submission).await
    }

    /// All jobs, newest first.
    pub async fn jobs(&self) -> Result<Vec<JobView>, ClientError> {
        self.get("/jobs").await
    }

    /// One job.
    pub async fn job(&self, job: JobId) -> Result<JobView, ClientError> {
        self.get(&format!("/jobs/{job}")).await
    }

    /// Cancels a job; what is complete is kept. Cancelling a finished job changes nothing.
    pub async fn cancel_job(&self, job: JobId) -> Result<JobView, ClientError> {
        json(self.request(Method::POST, &format!("/jobs/{job}/cancel")).send().await?).await
    }

    /// What a worker needs to render nodes of a job.
    pub async fn job_scene(&self, job: JobId) -> Result<JobScene, ClientError> {
        self.get(&format!("/jobs/{job}/scene")).await
    }

    /// The convergence of a job.
    pub async fn convergence(&self, job: JobId) -> Result<ConvergenceSeries, ClientError> {
        self.get(&format!("/jobs/{job}/convergence")).await
    }

    /// The error of a job as it is now, between its rounds.
    pub async fn live(&self, job: JobId) -> Result<LiveMeasurement, ClientError> {
        self.get(&format!("/jobs/{job}/live")).await
    }

    /// The image as it is now, as OpenEXR, whole.
    pub async fn image(&self, job: JobId) -> Result<Bytes, ClientError> {
        self.download(self.request(Method::GET, &image_path(job))).await
    }

    /// The image as it is now, as OpenEXR, in pieces as they come: it may be larger than memory.
    pub async fn image_download(&self, job: JobId) -> Result<ImageDownload, ClientError> {
        Ok(ImageDownload(check(self.request(Method::GET, &image_path(job)).send().await?).await?))
    }

    /// The image as it is now, as PNG.
    pub async fn preview(&self, job: JobId, query: &PreviewQuery) -> Result<Preview, ClientError> {
        let request = self.request(Method::GET, &format!("/jobs/{job}/preview.png")).query(query);
        let response = check(request.send().await?).await?;
        let accepted_nodes =
            response.headers().get(ACCEPTED_NODES_HEADER).and_then(|value| value.to_str().ok()?.parse().ok());
        Ok(Preview { accepted_nodes: accepted_nodes.unwrap_or(0), png: response.bytes().await? })
    }

    /// Events of the whole farm, or of one job, after the event `last_id`.
    pub async fn events(&self, job: Option<JobId>, last_id: Option<i64>) -> Result<EventStream, ClientError> {
        let path = job.map_or_else(|| "/events".to_owned(), |job| format!("/jobs/{job}/events"));
        let mut request = self.request(Method::GET, &path);
        if let Some(id) = last_id {
            request = request.header("last-event-id", id);
        }
        Ok(EventStream::new(check(request.send().await?).await?))
    }

    /// Registers a worker.
    pub async fn register_worker(&self, registration: &WorkerRegistration) -> Result<WorkerView, ClientError> {
        self.send_json(Method::POST, "/workers", registration).await
    }

    /// Says that a worker is alive. A problem with code `unknown_worker` means that it has to register again.
    pub async fn heartbeat(&self, worker: WorkerId) -> Result<(), ClientError> {
        check(self.request(Method::POST, &format!("/workers/{worker}/heartbeat")).send().await?).await?;
        Ok(())
    }

    /// Gives work again to a worker that was quarantined, and to all of the same name.
    pub async fn release_worker(&self, worker: WorkerId) -> Result<WorkerView, ClientError> {
        let response = self.request(Method::POST, &format!("/workers/{worker}/release")).send().await?;
        Ok(check(response).await?.json().await?)
    }

    /// All workers.
    pub async fn workers(&self) -> Result<Vec<WorkerView>, ClientError> {
        self.get("/workers").await
    }

    /// Asks for work; `None` when there is none for now.
    pub async fn claim_lease(&self, request: &LeaseRequest) -> Result<Option<Lease>, ClientError> {
        let response = check(self.request(Method::POST, "/leases").json(request).send().await?).await?;
        match response.status() {
            StatusCode::NO_CONTENT => Ok(None),
            _ => json(response).await.map(Some),
        }
    }

    /// Keeps a lease for another term.
    pub async fn renew_lease(&self, lease: LeaseId, token: u64) -> Result<LeaseRenewal, ClientError> {
        self.send_json(Method::POST, &format!("/leases/{lease}/renew"), &LeaseToken { token }).await
    }

    /// Uploads complete nodes of a lease. The answer comes when they are safe on disk.
    pub async fn upload_partial(&self, upload: PartialUpload) -> Result<PartialAnswer, ClientError> {
        let request = self
            .upload(&format!("/leases/{}/partial", upload.lease), upload.body.len())
            .header(CONTENT_TYPE, EXR_MEDIA_TYPE)
            .header(FENCING_TOKEN_HEADER, upload.token)
            .header(CORE_MILLISECONDS_HEADER, upload.core_ms)
            .body(upload.body);
        json(request.send().await?).await
    }

    /// Gives the rest of a lease back.
    pub async fn return_lease(&self, lease: LeaseId, body: &LeaseReturn) -> Result<(), ClientError> {
        check(self.request(Method::POST, &format!("/leases/{lease}/return")).json(body).send().await?).await?;
        Ok(())
    }

    fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.http.request(method, self.url(path))
    }

    /// A request with a body of `bytes`, which has as long as the slowest line takes.
    fn upload(&self, path: &str, bytes: usize) -> RequestBuilder {
        let on_its_way = Duration::from_secs_f64(bytes as f64 / SLOWEST_LINE as f64);
        self.uploads.put(self.url(path)).timeout(self.patience + on_its_way)
    }

    fn url(&self, path: &str) -> Url {
        let mut url = self.base.clone();
        url.set_path(&format!("{API_PREFIX}{path}"));
        url
    }

    async fn get<T: DeserializeOwned>(&self, path: &str) -> Result<T, ClientError> {
        json(self.request(Method::GET, path).send().await?).await
    }

    async fn send_json<T: DeserializeOwned>(
        &self,
        method: Method,
        path: &str,
        body: &impl Serialize,
    ) -> Result<T, ClientError> {
        json(self.request(method, path).json(body).send().await?).await
    }

    async fn download(&self, request: RequestBuilder) -> Result<Bytes, ClientError> {
        Ok(check(request.send().await?).await?.bytes().await?)
    }
}

fn image_path(job: JobId) -> String {
    format!("/jobs/{job}/image.exr")
}

async fn json<T: DeserializeOwned>(response: Response) -> Result<T, ClientError> {
    let response = check(response).await?;
    let path = response.url().path().to_owned();
    let body = response.bytes().await?;
    serde_json::from_slice(&body).map_err(|source| ClientError::UnreadableAnswer { path, source })
}

/// Whether a status speaks of the moment and not of the request.
fn is_transient(status: u16) -> bool {
    // 408 Request Timeout and 429 Too Many Requests, of the coordinator or of a proxy before it.
    status >= 500 || matches!(status, 408 | 429)
}

/// What an answer says of the next attempt, if it says it in seconds; dates depend on two clocks and are not read.
fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    headers.get(RETRY_AFTER)?.to_str().ok()?.trim().parse().ok().map(Duration::from_secs)
}

/// Turns an answer that is not a success into an error.
async fn check(response: Response) -> Result<Response, ClientError> {
    let status = response.status();
    if status.is_success() {
        return Ok(response);
    }
    let is_problem = response
        .headers()
        .get(CONTENT_TYPE)
        .and_then(|value| value.to_str().ok())
        .is_some_and(|value| value.starts_with(PROBLEM_MEDIA_TYPE));
    let retry_after = retry_after(response.headers());
    let body = response.bytes().await?;
    if is_problem && let Ok(problem) = serde_json::from_slice(&body) {
        return Err(ClientError::Problem { problem: Box::new(problem), retry_after });
    }
    // In one line, even if it is a page.
    let words: Vec<String> = String::from_utf8_lossy(&body).split_whitespace().map(str::to_owned).collect();
    let body = words.join(" ").chars().take(SHOWN_BODY).collect();
    Err(ClientError::UnexpectedAnswer { status: status.as_u16(), body, retry_after })
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::TcpListener;

    use super::*;

    #[tokio::test]
    async fn an_upload_announces_its_length_and_tells_of_every_piece() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let client = Client::new(&format!("http://{}", listener.local_addr().unwrap()), None).unwrap();
        let content = Bytes::from(vec![b'g'; 2 * UPLOAD_PIECE + 5]);
        let length = content.len();
        let server = tokio::spawn(async move {
            let (mut connection, _) = listener.accept().await.unwrap();
            let mut request = Vec::new();
            while !request.ends_with(&vec![b'g'; length]) {
                assert!(connection.read_buf(&mut request).await.unwrap() > 0, "the whole of a request");
            }
            connection.write_all(b"HTTP/1.1 204 No Content\r\n\r\n").await.unwrap();
            String::from_utf8(request).unwrap()
        });
        let (pieces, told) = std::sync::mpsc::channel();
        let hash = ContentHash::from([7; 32]);
        client.upload_asset(&hash, content, move |bytes| pieces.send(bytes).unwrap()).await.unwrap();
        let request = server.await.unwrap();
        assert!(request.contains(&format!("content-length: {length}\r\n")), "{}", &request[..400]);
        assert_eq!(told.iter().collect::<Vec<_>>(), [UPLOAD_PIECE as u64, UPLOAD_PIECE as u64, 5]);
    }

    #[tokio::test]
    async fn an_upload_has_longer_than_an_answer_when_the_line_is_slow() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let patience = Duration::from_millis(200);
        let client = Client::with_patience(&address, None, patience).unwrap();
        let server = tokio::spawn(async move {
            for answer in ["HTTP/1.1 204 No Content\r\n\r\n", ""] {
                let (mut connection, _) = listener.accept().await.unwrap();
                connection.readable().await.unwrap();
                tokio::time::sleep(3 * patience).await;
                connection.write_all(answer.as_bytes()).await.unwrap();
                let _ = connection.read_to_end(&mut Vec::new()).await;
            }
        });
        // At the slowest line this takes ten seconds.
        let content = Bytes::from(vec![0; 10 * SLOWEST_LINE]);
        client.upload_asset(&ContentHash::from([7; 32]), content, |_| ()).await.unwrap();
        assert!(client.jobs().await.unwrap_err().is_transient());
        server.abort();
    }

    /// What a call makes of this answer.
    async fn failure(answer: &'static str) -> ClientError {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let client = Client::new(&format!("http://{}", listener.local_addr().unwrap()), None).unwrap();
        let server = tokio::spawn(async move {
            let (mut connection, _) = listener.accept().await.unwrap();
            assert!(connection.read(&mut [0; 4096]).await.unwrap() > 0, "a request");
            connection.write_all(answer.as_bytes()).await.unwrap();
        });
        let failure = client.jobs().await.unwrap_err();
        server.await.unwrap();
        failure
    }

    #[tokio::test]
    async fn a_slow_line_and_a_busy_server_pass_and_a_wrong_request_does_not() {
        for (answer, passes) in [
            ("HTTP/1.1 408 Request Timeout\r\ncontent-length: 0\r\n\r\n", true),
            ("HTTP/1.1 429 Too Many Requests\r\ncontent-length: 0\r\n\r\n", true),
            ("HTTP/1.1 503 Service Unavailable\r\ncontent-length: 0\r\n\r\n", true),
            ("HTTP/1.1 400 Bad Request\r\ncontent-length: 0\r\n\r\n", false),
            ("HTTP/1.1 413 Content Too Large\r\ncontent-length: 0\r\n\r\n", false),
            (
                "HTTP/1.1 408 Request Timeout\r\ncontent-type: application/problem+json\r\ncontent-length: 89\r\n\r\n\
                 {\"type\":\"about:blank\",\"title\":\"slow\",\"status\":408,\"detail\":\"slow\",\"code\":\"body_too_slow\"}",
                true,
            ),
        ] {
            let failure = failure(answer).await;
            assert_eq!(failure.is_transient(), passes, "{answer}");
            assert_eq!(failure.problem().is_some(), answer.contains("problem+json"), "{failure}");
        }
    }

    #[tokio::test]
    async fn an_answer_that_cannot_be_read_does_not_pass_and_says_what_is_wrong_and_one_that_is_cut_off_does() {
        let unreadable = failure("HTTP/1.1 200 OK\r\ncontent-length: 16\r\n\r\n[{\"id\": \"door\"}]").await;
        assert!(!unreadable.is_transient());
        assert!(unreadable.to_string().contains("/api/v1/jobs"), "{unreadable}");
        let reason = std::error::Error::source(&unreadable).unwrap().to_string();
        assert!(reason.contains("UUID"), "{reason}");
        let cut_off = failure("HTTP/1.1 200 OK\r\ncontent-length: 16\r\n\r\n[{").await;
        assert!(cut_off.is_transient(), "{cut_off}");
    }

    #[tokio::test]
    async fn the_next_attempt_comes_no_sooner_than_the_answer_asks() {
        let planned = Duration::from_millis(100);
        for (answer, seconds) in [
            ("HTTP/1.1 429 Too Many Requests\r\nretry-after: 7\r\ncontent-length: 0\r\n\r\n", 7),
            ("HTTP/1.1 429 Too Many Requests\r\nretry-after: 99999999999\r\ncontent-length: 0\r\n\r\n", 30),
            ("HTTP/1.1 429 Too Many Requests\r\nretry-after: soon\r\ncontent-length: 0\r\n\r\n", 0),
            ("HTTP/1.1 429 Too Many Requests\r\ncontent-length: 0\r\n\r\n", 0),
        ] {
            assert_eq!(failure(answer).await.pause(planned), planned + Duration::from_secs(seconds), "{answer}");
        }
    }
}
