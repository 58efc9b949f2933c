//! The Clerestory render farm in one binary.
//!
//! [`command_line`] parses the arguments. The module of a command in [`commands`] interprets and runs them. `main`
//! turns the result into an exit code: 0 for success, 1 for failure, 2 for unusable arguments or settings. Results go
//! to standard output. Progress, logs and errors go to standard error.

mod activity;
mod advice;
mod child;
mod command_line;
mod commands;
mod connection;
mod download;
mod error_text;
mod experiment_host;
mod failure;
mod follow;
mod frames;
mod image_file;
mod job_argument;
mod job_end;
mod job_samples;
mod leading_options;
mod like;
mod local_farm;
mod local_image;
mod local_scene;
mod logging;
mod measures;
mod memory;
mod model_options;
mod moment_options;
mod numbers;
mod outage;
mod output;
mod output_file;
mod preflight;
mod preview;
mod progress;
mod render_limits;
mod render_summary;
mod scene_overrides;
mod scene_text;
mod settings;
mod shutdown;
mod standard_error;
mod submission;
mod text;
mod threads;
mod version;
mod viewer;

use std::process::ExitCode;
use std::time::Duration;

use command_line::Arguments;
use commands::Command;
use failure::Failure;

/// Time for leftover threads after the end of a command, such as a render or a read of standard input.
const LEFTOVER_TIME: Duration = Duration::from_millis(100);

fn main() -> ExitCode {
    let arguments = command_line::read();
    if matches!(arguments.command, Command::Coordinator(_)) {
        memory::keep_little();
    }
    logging::start(arguments.log_format, arguments.log.clone(), arguments.command.is_service());
    match run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        // The reader of standard output has seen enough, as in `clerestory jobs | head`.
        Err(failure) if failure.is_broken_pipe() => ExitCode::SUCCESS,
        Err(failure) => {
            advice::print_failure(&failure);
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
