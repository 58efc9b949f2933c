//! The Clerestory render farm in one binary.
//!
//! Arguments are parsed once ([`arguments`]), interpreted once by each command ([`commands`]), and then the command
//! runs. `main` only turns the result into an exit code: 0 for success, 1 for failure, 2 for arguments or settings that
//! cannot be used. Results go to standard output, everything else (progress, logs, errors) to standard error.

mod activity;
mod arguments;
mod child;
mod commands;
mod connection;
mod experiment_host;
mod failure;
mod follow;
mod image_file;
mod like;
mod load;
mod local_farm;
mod local_scene;
mod logging;
mod memory;
mod output_file;
mod preview;
mod render_limits;
mod scene_overrides;
mod settings;
mod shutdown;
mod standard_error;
mod terminal;
mod threads;
mod viewer;

use std::process::ExitCode;
use std::time::Duration;

use arguments::{Arguments, Command};
use failure::Failure;

/// How long after the end of a command its leftover threads (a node being rendered, a read of standard input) may take.
const LEFTOVER_TIME: Duration = Duration::from_millis(100);

fn main() -> ExitCode {
    let arguments = arguments::read();
    if matches!(arguments.command, Command::Coordinator(_)) {
        memory::keep_little();
    }
    logging::start(&arguments);
    match run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read our output has seen enough, as in `clerestory jobs | head`.
        Err(failure) if failure.is_broken_pipe() => ExitCode::SUCCESS,
        Err(failure) => {
            terminal::print_failure(&failure);
            failure.exit_code()
        }
    }
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    let runtime = tokio::runtime::Runtime::new().map_err(Failure::Runtime)?;
    let result = runtime.block_on(commands::run(arguments.command));
    runtime.shutdown_timeout(LEFTOVER_TIME);
    result
}
