//! Errors as text.

use std::error::Error;

use clerestory_api::ClientError;

use crate::text::{printable, printable_lines};

/// An error and its causes in one line. Many errors repeat their cause in their message, so each text is written once.
pub(crate) fn report(error: &(dyn Error + 'static)) -> String {
    let mut report: Vec<String> = Vec::new();
    for text in chain(error).map(cause_text).filter(|text| !text.is_empty()) {
        if report.iter().any(|above| above.contains(&text)) {
            continue;
        }
        match report.last_mut() {
            // The text of the cause contains that of the error above it.
            Some(above) if text.starts_with(above.as_str()) => *above = text,
            _ => report.push(text),
        }
    }
    report.join(": ")
}

/// An error and its causes, outermost first.
fn chain<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |&error| error.source())
}

/// The innermost cause of an error.
pub(crate) fn root_cause(error: &dyn Error) -> &dyn Error {
    let mut cause = error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    cause
}

/// The message of an error without its causes.
fn cause_text(cause: &(dyn Error + 'static)) -> String {
    match cause.downcast_ref::<ClientError>() {
        // The text comes from a server.
        Some(answer) => printable(&answer.to_string()).into_owned(),
        None => printable_lines(&cause.to_string()).into_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An error with a cause.
    #[derive(Debug, thiserror::Error)]
    #[error("{message}")]
    struct Link {
        message: &'static str,
        source: Option<Box<Link>>,
    }

    fn link(messages: &[&'static str]) -> Option<Box<Link>> {
        let (message, causes) = messages.split_first()?;
        Some(Box::new(Link { message, source: link(causes) }))
    }

    #[test]
    fn a_cause_that_the_message_above_repeats_is_written_once() {
        let report = |causes: &[&'static str]| report(&Link { message: "cannot measure", source: link(causes) });
        assert_eq!(report(&["no table jobs"]), "cannot measure: no table jobs");
        for causes in [
            ["the store: no table jobs", "no table jobs", "no table jobs"],
            ["the store: no table jobs", "no table", "jobs"],
            ["the store", "the store: no table jobs", "no table jobs"],
        ] {
            assert_eq!(report(&causes), "cannot measure: the store: no table jobs");
        }
        assert_eq!(report(&["first", "", "second"]), "cannot measure: first: second");
    }
}
