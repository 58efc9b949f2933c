//! Child processes of a local farm: this same binary, as coordinator or worker.
//!
//! The standard input of a child is a pipe, and the child ends when the pipe closes. So it ends with its parent,
//! whatever ends the parent. It needs no signals, which differ between systems.

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::process;
use tracing::warn;

use crate::failure::{Failure, USAGE};

/// Time for a child to end before it is killed. It is longer than the time that the child gives its own work.
const ENDING_TIME: Duration = Duration::from_secs(10);

/// Lines of its log that are shown when a child has failed.
const SHOWN_LINES: usize = 5;

/// The settings in the environment that a child sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Environment {
    /// Those of the parent.
    Inherited,
    /// None: its arguments are complete.
    WithoutSettings,
}

/// A running child.
pub(crate) struct Child {
    name: String,
    log: Option<Log>,
    process: process::Child,
    /// The writing end of the child's standard input. Kept apart from the process, which would close it while waiting.
    lifeline: Option<process::ChildStdin>,
}

impl Child {
    /// Starts this binary with other arguments. Its log is appended to the file `log`, or goes to the standard error of
    /// the parent.
    pub(crate) fn spawn(
        name: &str,
        arguments: &[OsString],
        log: Option<PathBuf>,
        environment: Environment,
    ) -> Result<Self, Failure> {
        let binary = std::env::current_exe().map_err(Failure::Spawn)?;
        let (log, log_file) = log.map(Log::open).transpose()?.unzip();
        let mut command = process::Command::new(binary);
        if environment == Environment::WithoutSettings {
            let names = std::env::vars_os().map(|(name, _)| name);
            for name in names.filter(|name| name.to_string_lossy().starts_with("CLERESTORY_")) {
                command.env_remove(name);
            }
        }
        command
            .args(arguments)
            .arg("--stop-with-stdin")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(log_file.map_or_else(Stdio::inherit, Stdio::from))
            .kill_on_drop(true);
        // A keyboard interrupt is for the parent, which ends its children in the right order.
        #[cfg(unix)]
        command.process_group(0);
        let mut process = command.spawn().map_err(Failure::Spawn)?;
        let lifeline = process.stdin.take();
        Ok(Self { name: name.to_owned(), log, process, lifeline })
    }

    /// Waits for the first line that the child writes to its standard output.
    pub(crate) async fn first_line(&mut self) -> Result<String, Failure> {
        let mut line = String::new();
        if let Some(output) = &mut self.process.stdout {
            BufReader::new(output).read_line(&mut line).await.map_err(Failure::Spawn)?;
        }
        if line.is_empty() {
            return Err(self.ended().await);
        }
        Ok(line.trim().to_owned())
    }

    /// Waits for the child to end by itself. Returns how it ended, with the end of its log.
    pub(crate) async fn ended(&mut self) -> Failure {
        let status = self.process.wait().await;
        let is_usage = status.as_ref().is_ok_and(|status| status.code() == Some(USAGE.into()));
        let status = status.map_or_else(|error| error.to_string(), |status| status.to_string());
        let log = self.log.as_ref().map(Log::end).unwrap_or_default();
        Failure::Process { message: format!("{} ended by itself: {status}{log}", self.name), is_usage }
    }

    /// Lets the child end, and kills it when that takes too long.
    pub(crate) async fn stop(mut self) {
        drop(self.lifeline.take());
        if tokio::time::timeout(ENDING_TIME, self.process.wait()).await.is_err() {
            warn!(process = self.name, "does not end, killing it");
            if let Err(error) = self.process.kill().await {
                warn!(process = self.name, %error, "cannot kill it");
            }
        }
    }
}

/// The log of a child, in a file that may have older content.
struct Log {
    file: PathBuf,
    /// Bytes of older content.
    start: u64,
}

impl Log {
    /// Opens a log to append to it. Its folder may be missing.
    fn open(file: PathBuf) -> Result<(Self, File), Failure> {
        let folder = file.parent().unwrap_or(Path::new(""));
        let opened = fs::create_dir_all(folder)
            .and_then(|()| File::options().create(true).append(true).open(&file))
            .and_then(|opened| Ok((opened.metadata()?.len(), opened)));
        match opened {
            Ok((start, opened)) => Ok((Self { file, start }, opened)),
            Err(source) => Err(Failure::Write { file, source }),
        }
    }

    /// The file and the last lines of the child, as the end of a message.
    fn end(&self) -> String {
        let bytes = fs::read(&self.file).unwrap_or_default();
        // A log that is shorter than its older content was truncated, so all of it is the child's.
        let own = usize::try_from(self.start).ok().and_then(|start| bytes.get(start..)).unwrap_or(&bytes);
        let text = String::from_utf8_lossy(own);
        let lines: Vec<&str> = text.lines().collect();
        let last = &lines[lines.len().saturating_sub(SHOWN_LINES)..];
        let last: String = last.iter().map(|line| format!("\n    {line}")).collect();
        format!("; the end of its log {}:{last}", self.file.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_log_is_shown_with_its_place_and_without_what_others_logged_before() {
        use std::io::Write;

        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("worker-1.log");
        fs::write(&file, "error: of yesterday\n").unwrap();
        let (log, mut opened) = Log::open(file.clone()).unwrap();
        assert!(log.end().ends_with("worker-1.log:"), "{}", log.end());
        opened.write_all(b"1\n2\n").unwrap();
        assert!(log.end().ends_with("worker-1.log:\n    1\n    2"), "{}", log.end());
        opened.write_all(b"3\n4\n5\n6\nerror: why\n").unwrap();
        let text = log.end();
        assert!(text.contains("worker-1.log:\n    3\n") && text.ends_with("\n    error: why"), "{text}");
        fs::remove_file(&file).unwrap();
        assert!(log.end().ends_with("worker-1.log:"));
    }
}
