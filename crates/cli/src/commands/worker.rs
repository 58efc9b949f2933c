//! `clerestory worker`: runs a worker in this process.

use std::fs;
use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::Args;
use clerestory_worker::WorkerError;
use serde::Deserialize;

use crate::connection::{DEFAULT_LISTEN, token};
use crate::failure::Failure;
use crate::numbers::positive;
use crate::settings;
use crate::shutdown::{self, Parent};
use crate::threads::ThreadCount;
use crate::version::BUILD;

/// Options of `clerestory worker`.
#[derive(Debug, Args)]
pub(crate) struct WorkerArguments {
    /// TOML file with the same settings; options and environment win over it.
    #[arg(long, value_name = "FILE", env = "CLERESTORY_WORKER_CONFIG")]
    config: Option<PathBuf>,
    /// Address of the coordinator [default: http://127.0.0.1:7171].
    #[arg(long, value_name = "URL", env = "CLERESTORY_COORDINATOR")]
    coordinator: Option<String>,
    /// File with the farm's token [env: CLERESTORY_TOKEN_FILE]; the token itself can be in CLERESTORY_TOKEN.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// A name for people [default: the machine's].
    #[arg(long, env = "CLERESTORY_WORKER_NAME")]
    name: Option<String>,
    /// Threads that render [default: one for each core].
    #[arg(long, value_name = "N", env = "CLERESTORY_THREADS")]
    threads: Option<ThreadCount>,
    /// Most memory of all scenes together, MiB [default: all that the machine has].
    #[arg(long, value_name = "N", env = "CLERESTORY_MEMORY_MIB", value_parser = positive)]
    memory_mib: Option<NonZeroU32>,
    /// Stop when standard input ends; for workers that belong to another process.
    #[arg(long, hide = true)]
    stop_with_stdin: bool,
}

/// The configuration file.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct WorkerFile {
    coordinator: Option<String>,
    token_file: Option<PathBuf>,
    name: Option<String>,
    threads: Option<ThreadCount>,
    memory_mib: Option<NonZeroU32>,
}

pub(crate) async fn run(arguments: WorkerArguments) -> Result<(), Failure> {
    let parent = if arguments.stop_with_stdin { Parent::HoldsStdin } else { Parent::None };
    let config = interpret(arguments)?;
    let stop = shutdown::token(parent);
    clerestory_worker::run(config, async move { stop.cancelled().await }).await.map_err(failure)
}

/// The failure of this process when its worker fails.
fn failure(error: WorkerError) -> Failure {
    let is_usage = matches!(&error, WorkerError::Connection(error) if error.is_usage());
    Failure::Service { service: "worker", is_usage, source: Box::new(error) }
}

fn interpret(arguments: WorkerArguments) -> Result<clerestory_worker::Config, Failure> {
    let file: WorkerFile = settings::read(arguments.config.as_deref())?;
    let coordinator = arguments.coordinator.or(file.coordinator);
    Ok(clerestory_worker::Config {
        coordinator: coordinator.unwrap_or_else(|| format!("http://{DEFAULT_LISTEN}")),
        token: token(arguments.token_file.as_deref(), file.token_file.as_deref())?,
        name: arguments.name.or(file.name).unwrap_or_else(machine_name),
        threads: arguments.threads.or(file.threads).unwrap_or_else(ThreadCount::of_cores).get(),
        memory: arguments.memory_mib.or(file.memory_mib).map(|mib| u64::from(mib.get()) << 20),
        build: BUILD.to_owned(),
    })
}

fn machine_name() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").or_else(|_| fs::read_to_string("/etc/hostname"));
    name.map(|name| name.trim().to_owned()).ok().filter(|name| !name.is_empty()).unwrap_or_else(|| "worker".to_owned())
}

#[cfg(test)]
mod tests {
    use std::process::ExitCode;

    use clap::Parser;

    use super::*;

    /// A command line of this command alone.
    #[derive(Parser)]
    struct CommandLine {
        #[command(flatten)]
        arguments: WorkerArguments,
    }

    fn parse(options: &[&str]) -> WorkerArguments {
        CommandLine::try_parse_from(["worker"].iter().chain(options)).unwrap().arguments
    }

    #[test]
    fn options_win_over_the_file_and_the_file_over_defaults() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("worker.toml");
        fs::write(&file, "name = \"from the file\"\nthreads = 3\nmemory_mib = 512\n").unwrap();
        let config = interpret(parse(&["--config", file.to_str().unwrap(), "--threads", "5"])).unwrap();
        assert_eq!((config.name.as_str(), config.threads.get()), ("from the file", 5));
        assert_eq!(config.memory, Some(512 << 20));
        let config = interpret(parse(&["--config", file.to_str().unwrap(), "--memory-mib", "64"])).unwrap();
        assert_eq!(config.memory, Some(64 << 20));
        assert_eq!(config.coordinator, "http://127.0.0.1:7171");
    }

    #[test]
    fn a_file_has_the_same_range_of_threads_as_the_option() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("worker.toml");
        for threads in ["0", "-1", "10000", "1.5", "\"all\""] {
            fs::write(&file, format!("threads = {threads}\n")).unwrap();
            let failure = interpret(parse(&["--config", file.to_str().unwrap()])).unwrap_err();
            let text = failure.causes().map(ToString::to_string).collect::<Vec<_>>().join(": ");
            let expected = if threads.parse::<i64>().is_ok() { "threads, 1 to 1024" } else { "expected i64" };
            assert!(text.contains("worker.toml") && text.contains(&format!("threads = {threads}")), "{text}");
            assert!(text.contains(expected), "{text}");
            assert_eq!(failure.exit_code(), ExitCode::from(2));
        }
    }
}
