//! The command line: a command and the options that all commands have. The options of each command are in its module.

use std::ffi::{OsStr, OsString};

use clap::error::{ContextKind, ContextValue};
use clap::{CommandFactory, FromArgMatches, Parser};
use tracing_subscriber::EnvFilter;

use crate::commands::Command;
use crate::logging::LogFormat;
use crate::version::BUILD;

/// A render farm for the light that old glass throws.
#[derive(Debug, Parser)]
#[command(
    version = BUILD,
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

/// Reads the command line. Ends the process with a message where the command line cannot be used.
pub(crate) fn read() -> Arguments {
    let mut command = with_negative_values(Arguments::command());
    let matches = command.try_get_matches_from_mut(std::env::args_os());
    let matches = matches.unwrap_or_else(|error| with_variable(error, &command).exit());
    Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit())
}

/// Adds the environment variable to an error about its value, because clap names the option only.
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

/// Whether a word of the command line is this value, or gives it to an option.
fn gives(word: &str, value: &str) -> bool {
    word == value || word.strip_suffix(value).is_some_and(|option| option.ends_with('='))
}

/// The environment variable of an option, by its long name, in a command or its subcommands.
fn variable(command: &clap::Command, name: &str) -> Option<OsString> {
    let own = command.get_arguments().filter(|argument| argument.get_long() == Some(name)).find_map(clap::Arg::get_env);
    own.map(OsStr::to_owned).or_else(|| command.get_subcommands().find_map(|below| variable(below, name)))
}

/// Lets every option take a negative number. Otherwise clap reports `-1` as an unknown option instead of a wrong value.
fn with_negative_values(command: clap::Command) -> clap::Command {
    let allowed = |argument: clap::Arg| {
        let has_value = argument.get_long().is_some() && argument.get_action().takes_values();
        if has_value { argument.allow_negative_numbers(true) } else { argument }
    };
    command.mut_args(allowed).mut_subcommands(with_negative_values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        with_negative_values(Arguments::command()).debug_assert();
    }
}
