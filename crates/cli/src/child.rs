//! Child processes of a local farm: this same binary, as coordinator or worker.
//!
//! A child holds the reading end of a pipe as its standard input and ends in good order when the pipe closes. So it ends
//! with its parent however that dies, and needs no signals, which differ between systems.

use std::ffi::OsString;
use std::fs::File;
use std::process::Stdio;
use std::time::Duration;

use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::process;
use tracing::warn;

use crate::failure::Failure;

/// How long a child may take to end before it is killed. Longer than its own grace.
const ENDING_TIME: Duration = Duration::from_secs(10);

/// A running child.
pub(crate) struct Child {
    name: String,
    process: process::Child,
    /// The writing end of the child's standard input. Kept apart from the process, which would close it while waiting.
    lifeline: Option<process::ChildStdin>,
}

impl Child {
    /// Starts this binary with other arguments. Its logs go to `log`, or where the parent's go.
    pub(crate) fn spawn(name: &str, arguments: &[OsString], log: Option<File>) -> Result<Self, Failure> {
        let binary = std::env::current_exe().map_err(Failure::Spawn)?;
        let mut command = process::Command::new(binary);
        command
            .args(arguments)
            .arg("--stop-with-stdin")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(log.map_or_else(Stdio::inherit, Stdio::from))
            .kill_on_drop(true);
        // An interrupt from the keyboard is for the parent, which ends its children in the right order.
        #[cfg(unix)]
        command.process_group(0);
        let mut process = command.spawn().map_err(Failure::Spawn)?;
        let lifeline = process.stdin.take();
        Ok(Self { name: name.to_owned(), process, lifeline })
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

    /// Waits for the child to end by itself; says how it did.
    pub(crate) async fn ended(&mut self) -> Failure {
        let status = self.process.wait().await.map_or_else(|error| error.to_string(), |status| status.to_string());
        Failure::Process(format!("{} ended by itself: {status}", self.name))
    }

    /// Lets the child end in good order, and kills it if it does not.
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
