//! What a user can do about a failure.

use std::io::{self, Write};

use clerestory_api::{ClientError, ProblemCode};

use crate::connection::TOKEN_VARIABLE;
use crate::error_text::report;
use crate::failure::Failure;
use crate::text::printable_lines;

/// Part of the client's message about an answer without TLS.
const NO_TLS: &str = "InvalidContentType";

/// Part of the client's message about an answer that is not HTTP, such as TLS.
const NO_HTTP: &str = "invalid HTTP version parsed";

/// Writes a failure, its causes and what can be done to standard error.
pub(crate) fn print_failure(failure: &Failure) {
    // Without standard error, no reader is left.
    let _ = writeln!(io::stderr().lock(), "error: {}", report(failure));
    if let Some(advice) = advice(failure) {
        let _ = writeln!(io::stderr().lock(), "{}", printable_lines(&advice));
    }
}

/// What the user can do about it, where the causes do not say.
pub(crate) fn advice(failure: &Failure) -> Option<String> {
    let call = failure.causes().find_map(|cause| cause.downcast_ref::<ClientError>());
    if let Some(advice) = call.and_then(advice_on_call) {
        return Some(advice);
    }
    if let Failure::Write { file, source } | Failure::WrittenElsewhere { file, source, .. } = failure
        && matches!(source.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded)
    {
        return Some(format!(
            "the disk is full: make room where {} is, or name a file on another disk",
            file.display()
        ));
    }
    let Failure::Coordinator { address, .. } = failure else { return None };
    if is_connection_refused(failure) {
        return Some(
            "no coordinator is there: start one with `clerestory farm` or `clerestory coordinator`, or name another \
             with --coordinator"
                .to_owned(),
        );
    }
    let says = |text: &str| failure.causes().any(|cause| cause.to_string().contains(text));
    if address.starts_with("https://") && says(NO_TLS) {
        let plain = address.replacen("https", "http", 1);
        return Some(format!("the server there does not speak TLS: is it {plain}?"));
    }
    if address.starts_with("http://") && says(NO_HTTP) {
        let secure = address.replacen("http", "https", 1);
        return Some(format!("the server there does not speak plain HTTP: is it {secure}?"));
    }
    None
}

/// Whether the machine of the coordinator refuses the connection.
fn is_connection_refused(failure: &Failure) -> bool {
    let mut system = failure.causes().filter_map(|cause| cause.downcast_ref::<io::Error>());
    system.any(|error| error.kind() == io::ErrorKind::ConnectionRefused)
}

/// What the user can do about a call that failed or was refused.
fn advice_on_call(error: &ClientError) -> Option<String> {
    let token = || {
        format!("put the farm's token in the environment variable {TOKEN_VARIABLE}, or in a file named by --token-file")
    };
    match error {
        ClientError::Problem { problem, .. } if problem.code == ProblemCode::Unauthorized => Some(token()),
        ClientError::UnexpectedAnswer { status: 401, answer, .. } => match &answer.challenge {
            Some(challenge) if challenge.to_ascii_lowercase().starts_with("basic") => Some(
                "a proxy in between asks for a name and a password: put them into the address, as in \
                 http://NAME:PASSWORD@farm.example"
                    .to_owned(),
            ),
            _ => Some(token()),
        },
        ClientError::UnexpectedAnswer { status: 407, .. } => Some(
            "the proxy asks for a name and a password: put them into the variable that names it, as in \
             http://NAME:PASSWORD@proxy.example:3128"
                .to_owned(),
        ),
        ClientError::UnexpectedAnswer { answer, .. } if answer.proxy.is_some() => Some(without_proxy()),
        error if error.silent_proxy().is_some() => Some(without_proxy()),
        _ => None,
    }
}

/// Advice to call without the proxy of the environment.
fn without_proxy() -> String {
    "the environment names that proxy (http_proxy, https_proxy or all_proxy): list the coordinator's host in \
     no_proxy to \
     call it directly"
        .to_owned()
}
