//! A server's process, which ends with the process that started it, whatever ends that.

use std::fs;
use std::io::{self, BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

/// Runs the server until it ends, or until standard input does, as happens when the process that holds the other end is
/// gone. Says the number of the server's process first.
const WATCH: &str = r#"
exec 3<&0
"$0" "$@" 3<&- >/dev/null & server=$!
echo $server
{
    read -r _ <&3
    kill -CONT $server $(cat /proc/$server/task/$server/children)
    kill -INT $server
} >/dev/null 2>&1 & reader=$!
wait $server
kill $reader 2>/dev/null"#;

/// Removes a folder when standard input and the server with this number have ended.
const REMOVE: &str = r#"read -r _; while kill -0 "$1" 2>/dev/null; do sleep 0.1; done; rm -rf "$0""#;

/// A server in a shell that ends it.
#[derive(Debug)]
pub(crate) struct Watched {
    shell: Child,
    server: Pid,
}

/// The command for [`Watched::start`], to which arguments and environment can be added.
pub(crate) fn command(program: &Path) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", WATCH]).arg(program);
    command
}

impl Watched {
    /// Starts a server.
    pub(crate) fn start(command: &mut Command) -> io::Result<Self> {
        let mut shell = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let mut line = String::new();
        if let Some(output) = shell.stdout.take() {
            BufReader::new(output).read_line(&mut line)?;
        }
        let number = line.trim().parse().map_err(|_| io::Error::other("a shell did not start a server"))?;
        Ok(Self { shell, server: Pid::from_raw(number) })
    }

    /// Starts the command that removes a folder after this process and the server have ended, for values that are never
    /// dropped.
    ///
    /// The folder goes when standard input of the command does: keep it.
    pub(crate) fn removed_afterwards(&self, folder: &Path) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", REMOVE]).arg(folder).arg(self.server.to_string());
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
        command
    }

    /// Kills the server and all its processes, as a power cut would. One that has ended by itself stays dead.
    ///
    /// # Panics
    ///
    /// When the system does not know its shell.
    pub(crate) fn kill(&mut self) {
        self.signal(Signal::SIGKILL);
        // Whatever the server has become, its shell does not wait for it without standard input.
        drop(self.shell.stdin.take());
        self.shell.wait().expect("a process of ours");
    }

    /// Suspends the server and all its processes, or wakes them up again. One that has ended by itself stays dead.
    ///
    /// # Panics
    ///
    /// When the system does not know its shell.
    pub(crate) fn suspend(&mut self, suspended: bool) {
        self.signal(if suspended { Signal::SIGSTOP } else { Signal::SIGCONT });
    }

    /// Sends a signal to the server and all its processes, as Linux describes them.
    fn signal(&mut self, signal: Signal) {
        if self.has_ended() {
            return;
        }
        let children = fs::read_to_string(format!("/proc/{0}/task/{0}/children", self.server)).unwrap_or_default();
        let children = children.split_whitespace().filter_map(|number| number.parse().ok()).map(Pid::from_raw);
        // The server first: it starts others.
        for process in [self.server].into_iter().chain(children) {
            // A process that has just ended hears nothing.
            let _ = kill(process, signal);
        }
    }

    /// Whether the server has ended, by itself or killed.
    ///
    /// # Panics
    ///
    /// When the system does not know its shell.
    pub(crate) fn has_ended(&mut self) -> bool {
        self.shell.try_wait().expect("a process of ours").is_some()
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        self.kill();
    }
}
