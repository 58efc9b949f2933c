//! What can be typed: the commands, and the options that all of them have. Each command's own options are in its module.

use std::num::NonZeroU32;

use clap::{Parser, Subcommand, ValueEnum};
use tracing_subscriber::EnvFilter;

use crate::commands::bench::BenchArguments;
use crate::commands::cancel::CancelArguments;
use crate::commands::compare::CompareArguments;
use crate::commands::coordinator::CoordinatorArguments;
use crate::commands::demo::DemoArguments;
use crate::commands::farm::FarmArguments;
use crate::commands::jobs::JobsArguments;
use crate::commands::render::RenderArguments;
use crate::commands::scene::SceneArguments;
use crate::commands::submit::SubmitArguments;
use crate::commands::view::ViewArguments;
use crate::commands::watch::WatchArguments;
use crate::commands::worker::WorkerArguments;

/// A render farm for the light that old glass throws.
#[derive(Debug, Parser)]
#[command(
    version = env!("CLERESTORY_BUILD"),
    after_help = "Exit codes: 0 success, 1 failure, 2 arguments or settings that cannot be used."
)]
pub(crate) struct Arguments {
    /// How log lines on standard error are written.
    #[arg(long, global = true, value_enum, default_value = "text", env = "CLERESTORY_LOG_FORMAT")]
    pub(crate) log_format: LogFormat,
    /// What is logged, for instance `debug` or `warn,clerestory_worker=debug`.
    #[arg(long, global = true, value_name = "FILTER", env = "CLERESTORY_LOG")]
    pub(crate) log: Option<EnvFilter>,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// How log lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogFormat {
    /// For people.
    Text,
    /// One JSON object a line, for log collectors.
    Json,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a scene in this process, without a farm.
    Render(RenderArguments),
    /// Run the coordinator: queue, merge, HTTP API and dashboard.
    Coordinator(CoordinatorArguments),
    /// Run a worker: lease, render, upload.
    Worker(WorkerArguments),
    /// Run a coordinator and workers on this machine.
    Farm(FarmArguments),
    /// Submit a scene to a farm.
    Submit(SubmitArguments),
    /// List the jobs of a farm.
    Jobs(JobsArguments),
    /// Watch a job until it ends.
    Watch(WatchArguments),
    /// Cancel a job; what is complete is kept.
    Cancel(CancelArguments),
    /// Measure how far an image is from a reference.
    Compare(CompareArguments),
    /// Measure again what papers show, or how much a coordinator takes.
    Bench(BenchArguments),
    /// Write a scene that is computed.
    Scene(SceneArguments),
    /// Look at a scene in the browser: move the camera and the sun, and watch the picture become clear.
    View(ViewArguments),
    /// Start a farm on this machine, render an old window on it, and show the error falling.
    Demo(DemoArguments),
}

/// Reads a number of things of which there is at least one.
pub(crate) fn positive<T: TryFrom<NonZeroU32>>(text: &str) -> Result<T, String> {
    let number = text.parse::<NonZeroU32>().ok().and_then(|number| T::try_from(number).ok());
    number.ok_or_else(|| format!("expected a whole number, 1 to {}", u32::MAX))
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroUsize;

    use clap::CommandFactory;

    use super::*;

    #[test]
    fn a_number_of_things_is_whole_and_not_zero() {
        assert_eq!(positive("7"), Ok(NonZeroUsize::new(7).unwrap()));
        for text in ["0", "-1", "1.5", "4294967296", "many", ""] {
            let message = positive::<NonZeroU32>(text).unwrap_err();
            assert_eq!(message, "expected a whole number, 1 to 4294967295", "{text}");
        }
    }

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }
}
