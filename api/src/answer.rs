//! What comes back: told from what proxies and login pages answer.

use std::fmt;
use std::time::Duration;

use reqwest::header::{
    AsHeaderName, CONTENT_ENCODING, CONTENT_TYPE, HeaderMap, LOCATION, RETRY_AFTER, SERVER, WWW_AUTHENTICATE,
};
use reqwest::{Response, StatusCode};
use serde::de::DeserializeOwned;

use crate::client_error::ClientError;
use crate::{API_PREFIX, PROBLEM_MEDIA_TYPE};

/// Characters of an unexpected answer that are shown.
const SHOWN_BODY: usize = 100;

/// Bytes of an unexpected answer that are read.
const READ_BODY: usize = 64 << 10;

/// An answer that is not one of a coordinator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnexpectedAnswer {
    /// HTTP status.
    pub status: u16,
    /// What the server calls itself.
    pub server: Option<String>,
    /// Media type of the body.
    pub media_type: Option<String>,
    /// How the body is encoded.
    pub encoding: Option<String>,
    /// Where it redirects to.
    pub location: Option<String>,
    /// How it asks for a name and a password.
    pub challenge: Option<String>,
    /// The beginning of the body, in one line.
    pub body: String,
    /// The proxy of the environment through which the call went.
    pub proxy: Option<String>,
}

impl UnexpectedAnswer {
    /// Whether the body was larger than what gets through.
    pub(crate) fn is_too_large(&self) -> bool {
        self.status == StatusCode::PAYLOAD_TOO_LARGE.as_u16()
    }
}

impl fmt::Display for UnexpectedAnswer {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "the answer does not come from a Clerestory coordinator: status {}", self.status)?;
        let part = |formatter: &mut fmt::Formatter<'_>, words: &str, value: &Option<String>| match value {
            Some(value) => write!(formatter, "{words}{value}"),
            None => Ok(()),
        };
        part(formatter, " of ", &self.server)?;
        part(formatter, ", ", &self.media_type)?;
        part(formatter, ", encoded as ", &self.encoding)?;
        part(formatter, ", redirects to ", &self.location)?;
        if !self.body.is_empty() {
            write!(formatter, ", `{}`", self.body)?;
        }
        match (&self.proxy, &self.location) {
            _ if self.is_too_large() => formatter.write_str(
                "; a proxy in between refuses a body of this size: raise its limit, which nginx calls \
                 client_max_body_size",
            ),
            (Some(proxy), _) => write!(formatter, "; it came through the proxy {proxy}"),
            (None, Some(location)) => match coordinator_at(location) {
                Some(address) => write!(formatter, "; the coordinator may be at {address}"),
                None => write!(formatter, "; a login page may be in between"),
            },
            (None, None) => write!(formatter, "; a proxy or a login page may be in between"),
        }
    }
}

/// The coordinator whose API a redirect leads to.
fn coordinator_at(location: &str) -> Option<&str> {
    location.split_once(API_PREFIX).map(|(address, _)| address).filter(|address| address.contains("://"))
}

/// Reads an answer that is a JSON value.
pub(crate) async fn json<T: DeserializeOwned>(response: Response, proxy: Option<&str>) -> Result<T, ClientError> {
    let response = of_type(response, "application/json", proxy).await?;
    let path = response.url().path().to_owned();
    let body = response.bytes().await?;
    serde_json::from_slice(&body).map_err(|source| ClientError::UnreadableAnswer { path, source })
}

/// An answer with a body of this type.
pub(crate) async fn of_type(
    response: Response,
    media_type: &str,
    proxy: Option<&str>,
) -> Result<Response, ClientError> {
    let response = success(response, proxy).await?;
    if media_type_of(response.headers()).is_some_and(|found| found.eq_ignore_ascii_case(media_type)) {
        return Ok(response);
    }
    Err(unexpected(response, proxy).await)
}

/// An answer without a body.
pub(crate) async fn empty(response: Response, proxy: Option<&str>) -> Result<(), ClientError> {
    let response = success(response, proxy).await?;
    match response.status() {
        StatusCode::NO_CONTENT => Ok(()),
        _ => Err(unexpected(response, proxy).await),
    }
}

/// Turns an answer that is not a success into an error, and so one that a proxy has encoded.
async fn success(response: Response, proxy: Option<&str>) -> Result<Response, ClientError> {
    // Nothing is asked for in an encoding.
    if response.status().is_success() && encoding(response.headers()).is_none() {
        return Ok(response);
    }
    let is_failure = response.status().is_client_error() || response.status().is_server_error();
    let is_problem = media_type_of(response.headers()).as_deref() == Some(PROBLEM_MEDIA_TYPE);
    if !is_failure || !is_problem || encoding(response.headers()).is_some() {
        return Err(unexpected(response, proxy).await);
    }
    let (mut answer, retry_after) = (unexpected_head(&response, proxy), retry_after(response.headers()));
    let body = response.bytes().await?;
    match serde_json::from_slice(&body) {
        Ok(problem) => Err(ClientError::Problem { problem: Box::new(problem), retry_after }),
        Err(_) => {
            answer.body = one_line(&body);
            Err(ClientError::UnexpectedAnswer { status: answer.status, answer: Box::new(answer), retry_after })
        }
    }
}

/// The error for an answer that is not one of a coordinator.
async fn unexpected(mut response: Response, proxy: Option<&str>) -> ClientError {
    let (mut answer, retry_after) = (unexpected_head(&response, proxy), retry_after(response.headers()));
    let mut body = Vec::new();
    // A body that is cut off tells less, and its status is known.
    while body.len() < READ_BODY
        && let Ok(Some(piece)) = response.chunk().await
    {
        body.extend_from_slice(&piece);
    }
    if answer.encoding.is_none() {
        answer.body = one_line(&body);
    }
    ClientError::UnexpectedAnswer { status: answer.status, answer: Box::new(answer), retry_after }
}

fn unexpected_head(response: &Response, proxy: Option<&str>) -> UnexpectedAnswer {
    let headers = response.headers();
    let status = response.status();
    let location = text(headers, LOCATION).filter(|_| status.is_redirection());
    UnexpectedAnswer {
        status: status.as_u16(),
        server: text(headers, SERVER),
        media_type: media_type_of(headers),
        encoding: encoding(headers),
        location: location.map(|place| response.url().join(&place).map_or(place, String::from)),
        challenge: text(headers, WWW_AUTHENTICATE),
        body: String::new(),
        proxy: proxy.map(str::to_owned),
    }
}

/// The beginning of a body in one line, even if it is a page.
fn one_line(body: &[u8]) -> String {
    let text = String::from_utf8_lossy(body);
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ").chars().filter(|character| !character.is_control()).take(SHOWN_BODY).collect()
}

fn text(headers: &HeaderMap, name: impl AsHeaderName) -> Option<String> {
    let value = headers.get(name)?.to_str().ok()?.trim();
    Some(value.chars().take(SHOWN_BODY).collect::<String>()).filter(|value| !value.is_empty())
}

fn media_type_of(headers: &HeaderMap) -> Option<String> {
    let value = text(headers, CONTENT_TYPE)?;
    Some(value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase())
}

fn encoding(headers: &HeaderMap) -> Option<String> {
    text(headers, CONTENT_ENCODING).filter(|encoding| !encoding.eq_ignore_ascii_case("identity"))
}

/// What an answer says of the next attempt, if it says it in seconds; dates depend on two clocks and are not read.
fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    headers.get(RETRY_AFTER)?.to_str().ok()?.trim().parse().ok().map(Duration::from_secs)
}
