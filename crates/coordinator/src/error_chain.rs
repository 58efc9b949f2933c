//! Errors of libraries in one line. Some of them repeat their source in their own message, and others do not.

use std::error::Error;

/// An error with its causes, each once.
pub(crate) fn in_one_line(error: &dyn Error) -> String {
    let mut line = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let words = cause.to_string();
        if !line.contains(&words) {
            line.push_str(": ");
            line.push_str(&words);
        }
        next = cause.source();
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("no pane: {source}")]
    struct Repeating {
        source: Silent,
    }

    #[derive(Debug, thiserror::Error)]
    #[error("no glass")]
    struct Silent {
        #[source]
        source: std::fmt::Error,
    }

    #[test]
    fn each_cause_is_said_once() {
        let error = Repeating { source: Silent { source: std::fmt::Error } };
        assert_eq!(in_one_line(&error), format!("no pane: no glass: {}", std::fmt::Error));
    }
}
