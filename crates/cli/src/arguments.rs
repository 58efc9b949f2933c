//! What can be typed: the commands, and the options that all of them have. Each command's own options are in its module.

use std::ffi::{OsStr, OsString};
use std::fmt::Display;
use std::num::NonZeroU32;
use std::ops::RangeInclusive;
use std::str::FromStr;

use clap::error::{ContextKind, ContextValue};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use tracing_subscriber::EnvFilter;

use crate::commands::bench::BenchArguments;
use crate::commands::compare::CompareArguments;
use crate::commands::coordinator::CoordinatorArguments;
use crate::commands::demo::DemoArguments;
use crate::commands::farm::FarmArguments;
use crate::commands::jobs::{JobsArguments, OneJob};
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
    Cancel(OneJob),
    /// Get a job going again that is held because workers died with it.
    Release(OneJob),
    /// Measure how far an image is from a reference.
    Compare(CompareArguments),
    /// Measure again what papers show, or how much a coordinator takes.
    Bench(BenchArguments),
    /// Write a scene that is computed.
    Scene(SceneArguments),
    /// Look at a scene in the browser: move the camera and the sun, and watch the picture become clear.
    View(ViewArguments),
    /// Start a farm on this machine, render sunlight through four old panes on it, and show the error falling.
    Demo(DemoArguments),
}

/// Reads what was typed; ends the process, with a message, where it cannot be used.
pub(crate) fn read() -> Arguments {
    let mut command = with_negative_values(Arguments::command());
    let matches = command.try_get_matches_from_mut(std::env::args_os());
    let matches = matches.unwrap_or_else(|error| with_variable(error, &command).exit());
    Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit())
}

/// Names the environment variable that a value comes from which cannot be used: the message names the option only.
fn with_variable(mut error: clap::Error, command: &clap::Command) -> clap::Error {
    if let (Some(ContextValue::String(option)), Some(ContextValue::String(value))) =
        (error.get(ContextKind::InvalidArg), error.get(ContextKind::InvalidValue))
        && let Some(name) = option.split(' ').next().and_then(|option| option.strip_prefix("--"))
        && let Some(variable) = variable(command, name)
        && std::env::var_os(&variable).is_some_and(|found| found == **value)
        && !std::env::args_os().map(|word| word.to_string_lossy().into_owned()).any(|word| gives(&word, value))
    {
        let tip = format!("the value is that of the environment variable {}", variable.display());
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}

/// Whether a word of the command line is a value, or gives it to an option.
fn gives(word: &str, value: &str) -> bool {
    word == value || word.strip_suffix(value).is_some_and(|option| option.ends_with('='))
}

/// The environment variable of an option, by its long name, of a command or of those below it.
fn variable(command: &clap::Command, name: &str) -> Option<OsString> {
    let own = command.get_arguments().filter(|argument| argument.get_long() == Some(name)).find_map(clap::Arg::get_env);
    own.map(OsStr::to_owned).or_else(|| command.get_subcommands().find_map(|below| variable(below, name)))
}

/// Lets a number below zero be the value of an option, which says then what it expects, and no option that nobody knows.
fn with_negative_values(command: clap::Command) -> clap::Command {
    let allowed = |argument: clap::Arg| {
        let has_value = argument.get_long().is_some() && argument.get_action().takes_values();
        if has_value { argument.allow_negative_numbers(true) } else { argument }
    };
    command.mut_args(allowed).mut_subcommands(with_negative_values)
}

/// A parser of whole numbers within a range.
pub(crate) fn whole<T>(range: RangeInclusive<T>) -> impl Fn(&str) -> Result<T, String> + Clone
where
    T: FromStr + PartialOrd + Display + Clone,
{
    move |text| {
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| format!("expected a whole number, {} to {}", range.start(), range.end()))
    }
}

/// Reads a number of things of which there is at least one.
pub(crate) fn positive(text: &str) -> Result<NonZeroU32, String> {
    text.parse().map_err(|_| format!("expected a whole number, 1 to {}", u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_of_things_is_whole_and_not_zero() {
        assert_eq!(positive("7"), Ok(NonZeroU32::new(7).unwrap()));
        for text in ["0", "-1", "1.5", "4294967296", "many", ""] {
            let message = positive(text).unwrap_err();
            assert_eq!(message, "expected a whole number, 1 to 4294967295", "{text}");
        }
    }

    #[test]
    fn a_whole_number_is_within_its_range() {
        let priority = whole(-2..=2_i32);
        assert_eq!((priority("-2"), priority("2")), (Ok(-2), Ok(2)));
        for text in ["3", "-3", "1.5", "high", ""] {
            assert_eq!(priority(text).unwrap_err(), "expected a whole number, -2 to 2", "{text}");
        }
    }

    #[test]
    fn the_command_line_is_consistent() {
        with_negative_values(Arguments::command()).debug_assert();
    }
}
