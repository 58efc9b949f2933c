//! Why a call to a coordinator failed.

use std::time::Duration;

use crate::{Problem, UnexpectedAnswer};

/// Longest pause that an answer can ask for: below the time that a lease lasts by default.
const LONGEST_RETRY_AFTER: Duration = Duration::from_secs(30);

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The address cannot be one of a coordinator.
    #[error("`{value}` is not the address of a coordinator: {reason}")]
    InvalidAddress {
        /// The address, without a password.
        value: String,
        /// What is wrong with it, and what would be right.
        reason: String,
    },
    /// The token has characters that no header can carry.
    #[error(
        "the token has characters other than visible ASCII: expected something like the output of \
         `openssl rand -hex 32`"
    )]
    InvalidToken,
    /// The address has a name and a password, and there is a token too.
    #[error(
        "the address has a name and a password, and there is a token: one header carries either, expected one of them"
    )]
    TwoCredentials,
    /// The environment names a proxy of a kind that this client does not speak to.
    #[error(
        "the environment names the proxy {proxy}: expected one with http:// or https://, or the coordinator's host in no_proxy"
    )]
    UnusableProxy {
        /// The proxy, without a password.
        proxy: String,
    },
    /// The coordinator refused, and said why.
    #[error("{problem}")]
    Problem {
        /// What it said.
        problem: Box<Problem>,
        /// How long to wait before the next attempt, if the answer says.
        retry_after: Option<Duration>,
    },
    /// Something answered that is no coordinator.
    #[error("{answer}")]
    UnexpectedAnswer {
        /// HTTP status.
        status: u16,
        /// What answered.
        answer: Box<UnexpectedAnswer>,
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
    /// The request did not get through, or its answer did not.
    #[error("no answer from the coordinator{}", through(proxy.as_deref()))]
    Transport {
        /// The proxy through which the call went, without a password.
        proxy: Option<String>,
        /// Why.
        source: reqwest::Error,
    },
}

impl From<reqwest::Error> for ClientError {
    fn from(source: reqwest::Error) -> Self {
        Self::Transport { proxy: None, source }
    }
}

impl ClientError {
    /// Whether the same call may well succeed later: the coordinator is restarting, overloaded or out of reach, the
    /// line was too slow, or something in between answers for a while.
    pub fn is_transient(&self) -> bool {
        match self {
            Self::Transport { source, .. } => !source.is_builder(),
            Self::Problem { problem, .. } => is_transient(problem.status),
            // A login page, or a redirect to one, goes away after a login.
            Self::UnexpectedAnswer { status, .. } => is_transient(*status) || *status < 400,
            Self::InvalidAddress { .. }
            | Self::InvalidToken
            | Self::TwoCredentials
            | Self::UnusableProxy { .. }
            | Self::UnreadableAnswer { .. } => false,
        }
    }

    /// Whether something that is no coordinator has answered for good: on the first call, the address is probably
    /// wrong.
    pub fn is_misdirected(&self) -> bool {
        matches!(self, Self::UnexpectedAnswer { status, .. } if !is_transient(*status))
    }

    /// Whether something in between refused the size of the body: a coordinator says so in a problem.
    pub fn is_too_large_on_the_way(&self) -> bool {
        matches!(self, Self::UnexpectedAnswer { answer, .. } if answer.is_too_large())
    }

    /// Whether what was given cannot be used, so that nothing was sent.
    pub fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::InvalidAddress { .. } | Self::InvalidToken | Self::TwoCredentials | Self::UnusableProxy { .. }
        )
    }

    /// How long to wait before the same call, for a caller who means to wait for `planned`: what the answer asks for
    /// comes on top, so that callers who all were asked the same do not come back all at once.
    pub fn pause(&self, planned: Duration) -> Duration {
        match self {
            Self::Problem { retry_after, .. } | Self::UnexpectedAnswer { retry_after, .. } => {
                planned + retry_after.unwrap_or_default().min(LONGEST_RETRY_AFTER)
            }
            _ => planned,
        }
    }

    /// The problem document, if the coordinator sent one.
    pub fn problem(&self) -> Option<&Problem> {
        match self {
            Self::Problem { problem, .. } => Some(problem),
            _ => None,
        }
    }

    /// The proxy of a call without an answer.
    pub fn silent_proxy(&self) -> Option<&str> {
        match self {
            Self::Transport { proxy, .. } => proxy.as_deref(),
            _ => None,
        }
    }
}

/// Whether a status speaks of the moment and not of the request.
fn is_transient(status: u16) -> bool {
    // 408 Request Timeout and 429 Too Many Requests, of the coordinator or of a proxy before it.
    status >= 500 || matches!(status, 408 | 429)
}

/// Names the proxy, in words that follow others.
fn through(proxy: Option<&str>) -> String {
    proxy.map_or_else(String::new, |proxy| format!(" through the proxy {proxy}"))
}
