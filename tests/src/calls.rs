//! Calls of the API that must be refused: how they are sent, and what the answer has to say.

use std::future::Future;

use clerestory_api::{API_PREFIX, Client, ContentHash, PROBLEM_MEDIA_TYPE, Problem, ProblemCode};
use clerestory_render_core::scene;
use reqwest::Method;
use reqwest::header::CONTENT_TYPE;
use tokio::runtime::Runtime;

use crate::farm::Farm;

/// Most bytes of an asset or of a partial that a farm must take to refuse larger ones as the tables here say.
pub const MAX_BODY_BYTES: usize = 1_048_576;

/// A request, sent without changes.
#[derive(Clone, Debug)]
pub struct Call {
    method: Method,
    path: String,
    headers: Vec<(&'static str, String)>,
    body: Vec<u8>,
}

impl Call {
    /// A request for a path below the prefix of the API, without a body.
    pub fn new(method: Method, path: impl Into<String>) -> Self {
        Self { method, path: path.into(), headers: Vec::new(), body: Vec::new() }
    }

    /// A request with a body of JSON, or of what is declared as JSON.
    pub fn json(path: impl Into<String>, body: impl Into<Vec<u8>>) -> Self {
        Self::new(Method::POST, path).header("content-type", "application/json").body(body)
    }

    /// The request with a header more.
    #[must_use]
    pub fn header(mut self, name: &'static str, value: impl ToString) -> Self {
        self.headers.push((name, value.to_string()));
        self
    }

    /// The request with a body.
    #[must_use]
    pub fn body(mut self, body: impl Into<Vec<u8>>) -> Self {
        self.body = body.into();
        self
    }

    /// The request without a header.
    #[must_use]
    pub fn without(mut self, name: &str) -> Self {
        self.headers.retain(|(other, _)| *other != name);
        self
    }
}

/// How a call must be refused.
#[derive(Clone, Debug)]
pub struct Refusal {
    /// HTTP status.
    pub status: u16,
    /// The kind of problem.
    pub code: ProblemCode,
    /// The field that is named as wrong.
    pub field: Option<String>,
    /// What the message must contain: the value that was found, and what would be right.
    pub says: &'static [&'static str],
}

/// A refusal that names a field.
pub fn refused(status: u16, code: ProblemCode, field: impl Into<String>, says: &'static [&'static str]) -> Refusal {
    Refusal { status, code, field: Some(field.into()), says }
}

/// A call that must be refused.
#[derive(Clone, Debug)]
pub struct BadCall {
    /// What is wrong with it.
    pub what: &'static str,
    /// Contents that it names, which are uploaded before.
    pub uploads: Vec<Vec<u8>>,
    /// The call.
    pub call: Call,
    /// The answer.
    pub refusal: Refusal,
}

impl BadCall {
    /// A call that names no content of its own.
    pub fn new(what: &'static str, call: Call, refusal: Refusal) -> Self {
        Self { what, uploads: Vec::new(), call, refusal }
    }
}

/// The name of a content on the wire.
pub fn content_hash(content: &[u8]) -> ContentHash {
    ContentHash::from(*scene::ContentHash::of(content).as_bytes())
}

/// A caller of a farm.
pub struct Caller {
    runtime: Runtime,
    http: reqwest::Client,
    client: Client,
    address: String,
}

impl Caller {
    /// A caller of a farm without a token.
    ///
    /// # Panics
    ///
    /// When its connection cannot be set up.
    pub fn new(farm: &Farm) -> Self {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let client = Client::new(farm.address(), None).expect("an address");
        Self {
            runtime,
            http: reqwest::Client::builder().no_proxy().build().expect("a client"),
            client,
            address: farm.address().to_owned(),
        }
    }

    /// The typed client, for what is not malformed. [`Caller::wait`] waits for its answers.
    pub fn client(&self) -> &Client {
        &self.client
    }

    /// Waits for an answer.
    pub fn wait<T>(&self, answer: impl Future<Output = T>) -> T {
        self.runtime.block_on(answer)
    }

    /// Uploads a content and answers its name.
    ///
    /// # Panics
    ///
    /// When it is refused.
    pub fn upload(&self, content: &[u8]) -> ContentHash {
        let hash = content_hash(content);
        self.wait(self.client.upload_asset(&hash, content.to_vec().into(), |_| ())).expect("an upload that is taken");
        hash
    }

    /// Sends a call that must be refused. The farm must be ready for work after it.
    ///
    /// # Errors
    ///
    /// What is not as it should be in the answer.
    ///
    /// # Panics
    ///
    /// When a content that the call names cannot be uploaded.
    pub fn check(&self, bad: &BadCall) -> Result<(), String> {
        let BadCall { what, uploads, call, refusal } = bad;
        for content in uploads {
            self.upload(content);
        }
        let problem = self.wait(self.problem(call)).map_err(|reason| format!("{what}: {reason}"))?;
        let message = problem.to_string();
        let found = (problem.status, problem.code, &problem.field);
        let expected = (refusal.status, refusal.code, &refusal.field);
        if found != expected {
            return Err(format!("{what}: {found:?} instead of {expected:?} in: {message}"));
        }
        if let Some(fragment) = refusal.says.iter().find(|fragment| !message.contains(**fragment)) {
            return Err(format!("{what}: no {fragment:?} in: {message}"));
        }
        if problem.request_id.is_none() {
            return Err(format!("{what}: nobody can find it in the log: {message}"));
        }
        if self.wait(self.client.is_ready()) { Ok(()) } else { Err(format!("{what}: the farm is not ready after it")) }
    }

    async fn problem(&self, call: &Call) -> Result<Problem, String> {
        let Call { method, path, headers, body } = call.clone();
        let mut request = self.http.request(method, format!("{}{API_PREFIX}{path}", self.address)).body(body);
        for (name, value) in headers {
            request = request.header(name, value);
        }
        let response = request.send().await.map_err(|error| format!("no answer: {error}"))?;
        let status = response.status().as_u16();
        let media_type = response.headers().get(CONTENT_TYPE).and_then(|value| value.to_str().ok()).map(str::to_owned);
        let text = response.text().await.map_err(|error| format!("half an answer: {error}"))?;
        if media_type.as_deref() != Some(PROBLEM_MEDIA_TYPE) {
            return Err(format!("{status} with {media_type:?}, which is no problem document: {text}"));
        }
        let problem: Problem = serde_json::from_str(&text).map_err(|error| format!("{error} in: {text}"))?;
        if problem.status == status { Ok(problem) } else { Err(format!("status {status} with: {text}")) }
    }
}
