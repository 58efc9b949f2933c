//! The coordinator under load: the built program `clerestory`, as a process of its own.

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::process;

use crate::error::LoadError;

/// Time for a coordinator to end before it is killed.
const ENDING_TIME: Duration = Duration::from_secs(10);

/// Lines of the log that are shown when a coordinator fails.
const SHOWN_LINES: usize = 5;

/// A running coordinator. Its standard input is a pipe; it ends when the pipe closes, and so with this process.
pub(crate) struct Coordinator {
    process: process::Child,
    lifeline: Option<process::ChildStdin>,
    log: PathBuf,
}

impl Coordinator {
    /// Starts a coordinator without the settings of the environment. Its log goes to a file.
    pub(crate) fn start(program: &Path, arguments: &[OsString], log: PathBuf) -> Result<Self, LoadError> {
        let log_file = File::options().create(true).append(true).open(&log);
        let log_file = log_file.map_err(|source| LoadError::Write { file: log.clone(), source })?;
        let mut command = process::Command::new(program);
        let names = std::env::vars_os().map(|(name, _)| name);
        for name in names.filter(|name| name.to_string_lossy().starts_with("CLERESTORY_")) {
            command.env_remove(name);
        }
        command
            .args(arguments)
            .arg("--stop-with-stdin")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(log_file)
            .kill_on_drop(true);
        let spawned = command.spawn().map_err(|source| LoadError::Spawn { program: program.to_owned(), source });
        let mut process = spawned?;
        let lifeline = process.stdin.take();
        Ok(Self { process, lifeline, log })
    }

    /// The number of its process; `None` once it has ended.
    pub(crate) fn id(&self) -> Option<u32> {
        self.process.id()
    }

    /// Waits for the address that it prints when it serves.
    pub(crate) async fn address(&mut self) -> Result<String, LoadError> {
        let mut line = String::new();
        if let Some(output) = &mut self.process.stdout {
            let read = BufReader::new(output).read_line(&mut line).await;
            read.map_err(|error| LoadError::Ended(format!("the coordinator cannot be read: {error}")))?;
        }
        if line.is_empty() { Err(self.ended().await) } else { Ok(line.trim().to_owned()) }
    }

    /// Waits until it ends by itself, which is a failure.
    pub(crate) async fn ended(&mut self) -> LoadError {
        let status = self.process.wait().await;
        let status = status.map_or_else(|error| error.to_string(), |status| status.to_string());
        let log = fs::read_to_string(&self.log).unwrap_or_default();
        let lines: Vec<&str> = log.lines().collect();
        let last = lines[lines.len().saturating_sub(SHOWN_LINES)..].join("\n    ");
        LoadError::Ended(format!("the coordinator ended by itself: {status}; the end of its log:\n    {last}"))
    }

    /// Lets it end, and kills it when that takes too long.
    pub(crate) async fn stop(mut self) {
        drop(self.lifeline.take());
        if tokio::time::timeout(ENDING_TIME, self.process.wait()).await.is_err() {
            // A process that cannot be killed has ended.
            let _ = self.process.kill().await;
        }
    }
}

/// The build of a program, as it tells it.
pub(crate) fn build(program: &Path) -> Result<String, LoadError> {
    let output = Command::new(program).arg("--version").output();
    let output = output.map_err(|source| LoadError::Spawn { program: program.to_owned(), source })?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    Ok(text.split_whitespace().last().unwrap_or_default().to_owned())
}
