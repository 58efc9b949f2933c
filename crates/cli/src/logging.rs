//! Structured logs on standard error.

use std::io::{self, IsTerminal};

use tracing_subscriber::EnvFilter;

use crate::arguments::{Arguments, Command, LogFormat};

/// Starts logging as the arguments say. Services tell what they do, other commands only what goes wrong.
pub(crate) fn start(arguments: &Arguments) {
    let default = match arguments.command {
        Command::Coordinator(_) | Command::Worker(_) | Command::Farm(_) => "info",
        _ => "warn",
    };
    let filter = arguments.log.clone().unwrap_or_else(|| EnvFilter::new(default));
    let builder =
        tracing_subscriber::fmt().with_env_filter(filter).with_writer(io::stderr).with_ansi(io::stderr().is_terminal());
    match arguments.log_format {
        LogFormat::Text => builder.with_target(false).init(),
        LogFormat::Json => builder.json().flatten_event(true).init(),
    }
}
