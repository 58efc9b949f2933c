//! The typed client: one method for each call that the programs of this repository make.

use std::convert::Infallible;
use std::fmt;
use std::time::Duration;

use bytes::Bytes;
use futures::stream;
use hyper_util::client::proxy::matcher::Matcher;
use reqwest::header::{AUTHORIZATION, CONTENT_LENGTH, CONTENT_TYPE, HeaderMap, HeaderValue};
use reqwest::redirect::Policy;
use reqwest::{Body, Method, Proxy, RequestBuilder, Response, StatusCode, Url};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::client_error::ClientError;
use crate::{
    ACCEPTED_NODES_HEADER, API_PREFIX, CORE_MILLISECONDS_HEADER, ContentHash, ConvergenceSeries, EXR_MEDIA_TYPE,
    EventStream, FENCING_TOKEN_HEADER, IntegratorView, JobId, JobScene, JobSubmission, JobView, Lease, LeaseId,
    LeaseRenewal, LeaseRequest, LeaseReturn, LeaseToken, LiveMeasurement, PIECE_MEDIA_TYPE, PartialAnswer,
    PartialPieces, PartialUpload, Preview, PreviewQuery, SceneReport, WorkerActivity, WorkerId, WorkerRegistration,
    WorkerView, address, answer,
};

/// Longest wait for a connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest wait for an answer, and longest silence in the middle of it. Long polls stay below it, event streams send
/// comments more often.
const TIMEOUT: Duration = Duration::from_secs(60);

/// The slowest line on which an upload gets through, bytes a second: the longer the body, the longer the wait for the
/// answer.
const SLOWEST_LINE: usize = 64 << 10;

/// Media type of an asset.
const OCTETS: &str = "application/octet-stream";

/// Bytes of an upload that are handed to the connection at a time.
const UPLOAD_PIECE: usize = 64 << 10;

/// A connection to a coordinator. Cheap to clone; clones share their connections.
#[derive(Clone)]
pub struct Client {
    http: reqwest::Client,
    /// Without a limit of its own on the wait for an answer, which would run while the body is still on its way.
    uploads: reqwest::Client,
    timeout: Duration,
    base: Url,
    /// The base in messages.
    address: String,
    /// The proxy that the environment names for this address, in messages.
    proxy: Option<String>,
}

impl fmt::Debug for Client {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Client").field("address", &self.address).field("proxy", &self.proxy).finish()
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
    /// A client for the coordinator at `address`, for instance `http://127.0.0.1:7171`. The address may have a path,
    /// and a name and a password for a proxy that asks for them. Nothing is sent yet.
    ///
    /// # Errors
    ///
    /// When the address, the token or the proxy of the environment cannot be used, or the client's TLS cannot be set
    /// up.
    pub fn new(address: &str, token: Option<&str>) -> Result<Self, ClientError> {
        Self::with(address, token, TIMEOUT, &Matcher::from_env())
    }

    fn with(address: &str, token: Option<&str>, timeout: Duration, environment: &Matcher) -> Result<Self, ClientError> {
        let base = address::parse(address)?;
        let mut headers = HeaderMap::new();
        if let Some(token) = token {
            if !base.username().is_empty() || base.password().is_some() {
                return Err(ClientError::TwoCredentials);
            }
            let mut value = HeaderValue::from_str(&format!("Bearer {token}")).map_err(|_| ClientError::InvalidToken)?;
            value.set_sensitive(true);
            headers.insert(AUTHORIZATION, value);
        }
        let intercept = address::proxy(&base, environment)?;
        let proxy = intercept.as_ref().map(address::shown_proxy);
        let client = || {
            // A redirect loses the bodies and the methods of calls.
            let builder = reqwest::Client::builder().redirect(Policy::none()).no_proxy();
            let builder = builder.default_headers(headers.clone()).connect_timeout(CONNECT_TIMEOUT);
            let Some((intercept, proxy)) = intercept.as_ref().zip(proxy.as_deref()) else { return Ok(builder) };
            let proxy = Proxy::all(proxy)?;
            Ok::<_, ClientError>(builder.proxy(match intercept.basic_auth() {
                Some(credentials) => proxy.custom_http_auth(credentials.clone()),
                None => proxy,
            }))
        };
        let (http, uploads) = (client()?.read_timeout(timeout).build()?, client()?.build()?);
        let address = address::without_credentials(base.as_str()).trim_end_matches('/').to_owned();
        Ok(Self { http, uploads, timeout, base, address, proxy })
    }

    /// The address of the coordinator for messages, without a password.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Whether the coordinator is up and its store is usable.
    pub async fn is_ready(&self) -> bool {
        let answer = self.http.get(self.at("/readyz")).send().await;
        answer.is_ok_and(|response| response.status() == StatusCode::NO_CONTENT)
    }

    /// Uploads an asset under its content hash, and tells `sent`, as pieces are handed to the connection, how many
    /// bytes each has. Uploading it again changes nothing.
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
        self.send_for_nothing(request).await
    }

    /// Downloads an asset.
    pub async fn asset(&self, hash: &ContentHash) -> Result<Bytes, ClientError> {
        let response = self.send_for(self.request(Method::GET, &format!("/assets/{hash}")), OCTETS).await?;
        Ok(response.bytes().await?)
    }

    /// Submits a job. A problem with code `missing_assets` lists what has to be uploaded first.
    pub async fn submit_job(&self, submission: &JobSubmission) -> Result<JobView, ClientError> {
        self.send_json(Method::POST, "/jobs", submission).await
    }

    /// The integrators that a scene may name.
    pub async fn integrators(&self) -> Result<Vec<IntegratorView>, ClientError> {
        self.get("/integrators").await
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
        self.send_for_json(self.request(Method::POST, &format!("/jobs/{job}/cancel"))).await
    }

    /// Gives leases again of a job that is held. A job that is not held does not change.
    pub async fn release_job(&self, job: JobId) -> Result<JobView, ClientError> {
        self.send_for_json(self.request(Method::POST, &format!("/jobs/{job}/release"))).await
    }

    /// What a worker needs to render nodes of a job.
    pub async fn job_scene(&self, job: JobId) -> Result<JobScene, ClientError> {
        self.get(&format!("/jobs/{job}/scene")).await
    }

    /// The convergence of a job.
    pub async fn convergence(&self, job: JobId) -> Result<ConvergenceSeries, ClientError> {
        self.get(&format!("/jobs/{job}/convergence")).await
    }

    /// The present error of a job, between its rounds.
    pub async fn live(&self, job: JobId) -> Result<LiveMeasurement, ClientError> {
        self.get(&format!("/jobs/{job}/live")).await
    }

    /// The present image as OpenEXR, whole.
    pub async fn image(&self, job: JobId) -> Result<Bytes, ClientError> {
        Ok(self.image_answer(job).await?.bytes().await?)
    }

    /// The present image as OpenEXR, in pieces as they arrive: it may be larger than memory.
    pub async fn image_download(&self, job: JobId) -> Result<ImageDownload, ClientError> {
        self.image_answer(job).await.map(ImageDownload)
    }

    async fn image_answer(&self, job: JobId) -> Result<Response, ClientError> {
        self.send_for(self.request(Method::GET, &format!("/jobs/{job}/image.exr")), EXR_MEDIA_TYPE).await
    }

    /// The present image as PNG.
    pub async fn preview(&self, job: JobId, query: &PreviewQuery) -> Result<Preview, ClientError> {
        let request = self.request(Method::GET, &format!("/jobs/{job}/preview.png")).query(query);
        let response = self.send_for(request, "image/png").await?;
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
        Ok(EventStream::new(self.send_for(request, "text/event-stream").await?))
    }

    /// Registers a worker.
    pub async fn register_worker(&self, registration: &WorkerRegistration) -> Result<WorkerView, ClientError> {
        self.send_json(Method::POST, "/workers", registration).await
    }

    /// Says that a worker is alive, and what it does. A problem with code `unknown_worker` means that it has to
    /// register again.
    pub async fn heartbeat(&self, worker: WorkerId, activity: &WorkerActivity) -> Result<(), ClientError> {
        let request = self.request(Method::POST, &format!("/workers/{worker}/heartbeat"));
        self.send_for_nothing(request.json(activity)).await
    }

    /// Gives work again to a worker that was quarantined, and to all of the same name.
    pub async fn release_worker(&self, worker: WorkerId) -> Result<WorkerView, ClientError> {
        self.send_for_json(self.request(Method::POST, &format!("/workers/{worker}/release"))).await
    }

    /// Says that a worker ends: what it has under lease goes back to the queue, and lists leave it out.
    pub async fn end_worker(&self, worker: WorkerId) -> Result<(), ClientError> {
        self.send_for_nothing(self.request(Method::DELETE, &format!("/workers/{worker}"))).await
    }

    /// All workers, without those that have ended.
    pub async fn workers(&self) -> Result<Vec<WorkerView>, ClientError> {
        self.get("/workers").await
    }

    /// Asks for work; `None` when there is none for now.
    pub async fn claim_lease(&self, request: &LeaseRequest) -> Result<Option<Lease>, ClientError> {
        let response = self.send(self.request(Method::POST, "/leases").json(request)).await?;
        match response.status() {
            StatusCode::NO_CONTENT => Ok(None),
            _ => answer::json(response, self.proxy.as_deref()).await.map(Some),
        }
    }

    /// Keeps a lease for another term.
    pub async fn renew_lease(&self, lease: LeaseId, token: u64) -> Result<LeaseRenewal, ClientError> {
        self.send_json(Method::POST, &format!("/leases/{lease}/renew"), &LeaseToken { token }).await
    }

    /// Reports how building the scene of a lease's job ended.
    pub async fn report_scene(&self, lease: LeaseId, report: &SceneReport) -> Result<(), ClientError> {
        let request = self.request(Method::POST, &format!("/leases/{lease}/scene"));
        self.send_for_nothing(request.json(report)).await
    }

    /// Uploads complete nodes of a lease. The answer comes when they are safe on disk.
    pub async fn upload_partial(&self, upload: PartialUpload) -> Result<PartialAnswer, ClientError> {
        let request = self
            .upload(&format!("/leases/{}/partial", upload.lease), upload.body.len())
            .header(CONTENT_TYPE, EXR_MEDIA_TYPE)
            .header(FENCING_TOKEN_HEADER, upload.token)
            .header(CORE_MILLISECONDS_HEADER, upload.core_ms)
            .body(upload.body);
        self.send_for_json(request).await
    }

    /// Uploads a piece of a partial that is too large to travel whole.
    pub async fn upload_piece(
        &self,
        lease: LeaseId,
        token: u64,
        hash: &ContentHash,
        piece: Bytes,
    ) -> Result<(), ClientError> {
        let request = self
            .upload(&format!("/leases/{lease}/pieces/{hash}"), piece.len())
            .header(CONTENT_TYPE, PIECE_MEDIA_TYPE)
            .header(FENCING_TOKEN_HEADER, token)
            .body(piece);
        self.send_for_nothing(request).await
    }

    /// Uploads complete nodes of a lease whose partial has been uploaded in pieces. A problem with code
    /// `missing_pieces` lists those that have to be uploaded again.
    pub async fn assemble_partial(&self, lease: LeaseId, pieces: &PartialPieces) -> Result<PartialAnswer, ClientError> {
        self.send_json(Method::POST, &format!("/leases/{lease}/pieces"), pieces).await
    }

    /// Gives the rest of a lease back.
    pub async fn return_lease(&self, lease: LeaseId, body: &LeaseReturn) -> Result<(), ClientError> {
        self.send_for_nothing(self.request(Method::POST, &format!("/leases/{lease}/return")).json(body)).await
    }

    fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.http.request(method, self.url(path))
    }

    /// A request with a body of `bytes`, which has as long as the slowest line takes.
    fn upload(&self, path: &str, bytes: usize) -> RequestBuilder {
        let on_its_way = Duration::from_secs_f64(bytes as f64 / SLOWEST_LINE as f64);
        self.uploads.put(self.url(path)).timeout(self.timeout + on_its_way)
    }

    /// The address of an endpoint.
    fn url(&self, path: &str) -> Url {
        self.at(&format!("{API_PREFIX}{path}"))
    }

    /// The address of what lies under a path of the coordinator.
    fn at(&self, path: &str) -> Url {
        let mut url = self.base.clone();
        url.set_path(&format!("{}{path}", self.base.path().trim_end_matches('/')));
        url
    }

    async fn send(&self, request: RequestBuilder) -> Result<Response, ClientError> {
        let sent = request.send().await;
        sent.map_err(|source| ClientError::Transport { proxy: self.proxy.clone(), source })
    }

    /// Sends a request whose answer has a body of this type.
    async fn send_for(&self, request: RequestBuilder, media_type: &str) -> Result<Response, ClientError> {
        answer::of_type(self.send(request).await?, media_type, self.proxy.as_deref()).await
    }

    /// Sends a request whose answer is JSON.
    async fn send_for_json<T: DeserializeOwned>(&self, request: RequestBuilder) -> Result<T, ClientError> {
        answer::json(self.send(request).await?, self.proxy.as_deref()).await
    }

    /// Sends a request whose answer has no body.
    async fn send_for_nothing(&self, request: RequestBuilder) -> Result<(), ClientError> {
        answer::empty(self.send(request).await?, self.proxy.as_deref()).await
    }

    async fn get<T: DeserializeOwned>(&self, path: &str) -> Result<T, ClientError> {
        self.send_for_json(self.request(Method::GET, path)).await
    }

    async fn send_json<T: DeserializeOwned>(
        &self,
        method: Method,
        path: &str,
        body: &impl Serialize,
    ) -> Result<T, ClientError> {
        self.send_for_json(self.request(method, path).json(body)).await
    }
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
        let timeout = Duration::from_millis(200);
        let client = Client::with(&address, None, timeout, &Matcher::builder().build()).unwrap();
        let server = tokio::spawn(async move {
            for answer in ["HTTP/1.1 204 No Content\r\n\r\n", ""] {
                let (mut connection, _) = listener.accept().await.unwrap();
                connection.readable().await.unwrap();
                tokio::time::sleep(3 * timeout).await;
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

    /// What the server was asked and the client made of this answer.
    async fn exchange(answer: String, client: impl FnOnce(&str) -> Client) -> (String, ClientError) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let client = client(&listener.local_addr().unwrap().to_string());
        let server = tokio::spawn(async move {
            let (mut connection, _) = listener.accept().await.unwrap();
            let mut request = Vec::new();
            while !request.ends_with(b"\r\n\r\n") {
                assert!(connection.read_buf(&mut request).await.unwrap() > 0, "the whole of a request");
            }
            connection.write_all(answer.as_bytes()).await.unwrap();
            String::from_utf8(request).unwrap()
        });
        let failure = client.jobs().await.unwrap_err();
        (server.await.unwrap(), failure)
    }

    fn answer(status: &str, headers: &[&str], body: &str) -> String {
        let headers: String = headers.iter().map(|header| format!("{header}\r\n")).collect();
        format!("HTTP/1.1 {status}\r\n{headers}content-length: {}\r\n\r\n{body}", body.len())
    }

    /// What a call makes of this answer.
    async fn failure(answer: String) -> ClientError {
        exchange(answer, |address| Client::new(&format!("http://{address}"), None).unwrap()).await.1
    }

    #[tokio::test]
    async fn a_slow_line_and_a_busy_server_pass_and_a_wrong_request_does_not() {
        let problem = r#"{"type":"about:blank","title":"slow","status":408,"detail":"slow","code":"body_too_slow"}"#;
        for (answer, passes) in [
            (answer("408 Request Timeout", &[], ""), true),
            (answer("429 Too Many Requests", &[], ""), true),
            (answer("503 Service Unavailable", &[], ""), true),
            (answer("400 Bad Request", &[], ""), false),
            (answer("413 Content Too Large", &[], ""), false),
            (answer("408 Request Timeout", &["content-type: application/problem+json"], problem), true),
        ] {
            let failure = failure(answer.clone()).await;
            assert_eq!(failure.is_transient(), passes, "{answer}");
            assert_eq!(failure.problem().is_some(), answer.contains("problem+json"), "{failure}");
        }
    }

    #[tokio::test]
    async fn an_answer_that_cannot_be_read_does_not_pass_and_says_what_is_wrong_and_one_that_is_cut_off_does() {
        let json = ["content-type: application/json"];
        let unreadable = failure(answer("200 OK", &json, "[{\"id\": \"door\"}]")).await;
        assert!(!unreadable.is_transient());
        assert!(unreadable.to_string().contains("/api/v1/jobs"), "{unreadable}");
        let reason = std::error::Error::source(&unreadable).unwrap().to_string();
        assert!(reason.contains("UUID"), "{reason}");
        let mut cut_off = answer("200 OK", &json, "[{\"id\": \"door\"}]");
        cut_off.truncate(cut_off.len() - 3);
        let cut_off = failure(cut_off).await;
        assert!(cut_off.is_transient(), "{cut_off}");
    }

    #[tokio::test]
    async fn the_next_attempt_comes_no_sooner_than_the_answer_asks() {
        let planned = Duration::from_millis(100);
        for (header, seconds) in
            [("retry-after: 7", 7), ("retry-after: 99999999999", 30), ("retry-after: soon", 0), ("x-other: 7", 0)]
        {
            let failure = failure(answer("429 Too Many Requests", &[header], "")).await;
            assert_eq!(failure.pause(planned), planned + Duration::from_secs(seconds), "{header}");
        }
    }

    #[tokio::test]
    async fn what_is_no_coordinator_is_told_from_one_and_described() {
        let html = "content-type: text/html; charset=utf-8";
        let page = "<html>\r\n Please\n sign in</html>";
        let problem = ["content-type: application/problem+json"];
        for (answer, passes, said) in [
            (answer("200 OK", &[html], page), true, "status 200, text/html, `<html> Please sign in</html>`"),
            (answer("204 No Content", &[], ""), true, "status 204"),
            (answer("502 Bad Gateway", &[html, "server: nginx/1.2"], page), true, "status 502 of nginx/1.2, text/html"),
            (answer("401 Unauthorized", &["www-authenticate: Basic realm=farm"], page), false, "status 401"),
            (
                answer("413 Request Entity Too Large", &["server: nginx"], ""),
                false,
                "status 413 of nginx; a proxy in between refuses a body of this size: raise its limit",
            ),
            (answer("404 Not Found", &problem, "{\"title\": \"lost\"}"), false, "`{\"title\": \"lost\"}`"),
            (answer("302 Found", &["location: /login"], ""), true, "redirects to http://127.0.0.1"),
            (
                answer("301 Moved", &["location: https://farm.example/api/v1/jobs"], ""),
                true,
                "the coordinator may be at https://farm.example",
            ),
            (
                answer("200 OK", &["content-type: application/json", "content-encoding: gzip"], "[]"),
                true,
                "application/json, encoded as gzip",
            ),
        ] {
            let failure = failure(answer.clone()).await;
            let message = failure.to_string();
            assert!(message.contains("does not come from a Clerestory coordinator"), "{answer}: {message}");
            assert!(message.contains(said), "{answer}: {message}");
            assert_eq!(failure.is_transient(), passes, "{answer}");
            assert_eq!(failure.is_misdirected(), !answer.contains(" 502 "), "{answer}");
        }
    }

    #[tokio::test]
    async fn a_coordinator_under_a_path_is_asked_there_with_the_name_and_password_of_the_address() {
        let client = |address: &str| Client::new(&format!("http://glazier:lead@{address}/glass/farm/"), None).unwrap();
        let (request, failure) = exchange(answer("401 Unauthorized", &[], ""), client).await;
        assert!(request.starts_with("GET /glass/farm/api/v1/jobs HTTP/1.1\r\n"), "{request}");
        assert!(request.contains("authorization: Basic Z2xhemllcjpsZWFk\r\n"), "{request}");
        assert!(!failure.to_string().contains("lead"), "{failure}");
        let client = Client::new("http://glazier:lead@farm.example:80/glass/", None).unwrap();
        assert_eq!(client.address(), "http://farm.example/glass");
        assert!(!format!("{client:?}").contains("lead"));
        let both = Client::new("http://glazier:lead@farm.example", Some("token")).unwrap_err();
        assert!(both.is_usage() && !both.to_string().contains("lead"), "{both}");
    }

    #[tokio::test]
    async fn a_failure_names_the_proxy_of_the_environment_through_which_the_call_went() {
        let behind = |proxy: &str| {
            let environment = Matcher::builder().all(format!("http://glazier:lead@{proxy}")).build();
            Client::with("http://farm.example:7171", None, TIMEOUT, &environment).unwrap()
        };
        let (request, refused) = exchange(answer("407 Proxy Authentication Required", &[], ""), behind).await;
        assert!(request.starts_with("GET http://farm.example:7171/api/v1/jobs HTTP/1.1\r\n"), "{request}");
        assert!(request.contains("proxy-authorization: Basic Z2xhemllcjpsZWFk\r\n"), "{request}");
        let said = refused.to_string();
        assert!(said.contains("status 407") && said.contains("through the proxy http://127.0.0.1:"), "{said}");
        assert!(!said.contains("lead"), "{said}");

        // Nobody listens on a port that was free a moment ago.
        let free = TcpListener::bind("127.0.0.1:0").await.unwrap().local_addr().unwrap().to_string();
        let silent = behind(&free).jobs().await.unwrap_err();
        assert_eq!(silent.silent_proxy(), Some(format!("http://{free}").as_str()));
        assert!(silent.to_string().contains(&format!("through the proxy http://{free}")), "{silent}");
    }
}
