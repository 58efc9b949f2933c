//! Structured logs on standard error.

use std::io::{self, IsTerminal};

use clap::ValueEnum;
use tracing_subscriber::EnvFilter;

/// The form of log lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogFormat {
    /// For people.
    Text,
    /// One JSON object a line, for log collectors.
    Json,
}

/// Starts logging. Without a filter, a service logs what it does, and any other command logs warnings only.
pub(crate) fn start(format: LogFormat, filter: Option<EnvFilter>, is_service: bool) {
    let filter = filter.unwrap_or_else(|| EnvFilter::new(if is_service { "info" } else { "warn" }));
    let builder =
        tracing_subscriber::fmt().with_env_filter(filter).with_writer(io::stderr).with_ansi(io::stderr().is_terminal());
    match format {
        LogFormat::Text => builder.with_target(false).init(),
        LogFormat::Json => builder.json().flatten_event(true).init(),
    }
}
