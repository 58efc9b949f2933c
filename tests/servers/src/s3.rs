//! A server that speaks S3 over a temporary folder: the program `s3-server` of this package.

use std::fs;
use std::io::{self, BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use tempfile::TempDir;

use crate::Faults;

/// Who may use the server.
const ACCESS_KEY: &str = "clerestory";

/// What they have to know.
const SECRET_KEY: &str = "stained-glass";

/// A server on a free port of the loopback interface. It checks signatures, as S3 does.
#[derive(Debug)]
pub struct S3Server {
    folder: TempDir,
    port: u16,
    buckets: AtomicU32,
    faults: Option<Faults>,
    process: Child,
}

/// The server that all tests of this process share, started when it is asked for first.
///
/// # Panics
///
/// When it does not start.
pub fn s3() -> &'static S3Server {
    static SERVER: OnceLock<S3Server> = OnceLock::new();
    SERVER.get_or_init(|| S3Server::start().expect("the S3 server starts"))
}

impl S3Server {
    /// Starts a server.
    ///
    /// # Errors
    ///
    /// When its program has not been built, or does not start.
    pub fn start() -> io::Result<Self> {
        Self::start_on(tempfile::tempdir()?, None)
    }

    /// Starts a server whose disk can have faults.
    ///
    /// # Errors
    ///
    /// When its program or the library with the faults has not been built, or it does not start.
    pub fn start_with_faults() -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let faults = Faults::below(folder.path(), None)?;
        Self::start_on(folder, Some(faults))
    }

    fn start_on(folder: TempDir, faults: Option<Faults>) -> io::Result<Self> {
        let (process, port) = launch(&folder, 0, faults.as_ref())?;
        Ok(Self { folder, port, buckets: AtomicU32::new(0), faults, process })
    }

    /// The faults of its disk, where it can have some.
    pub fn faults(&self) -> Option<&Faults> {
        self.faults.as_ref()
    }

    /// Port of the loopback interface on which it listens.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// Makes an empty bucket and returns its name.
    ///
    /// # Panics
    ///
    /// When the disk is full.
    pub fn new_bucket(&self) -> String {
        let name = format!("glass-{}", self.buckets.fetch_add(1, Ordering::Relaxed));
        fs::create_dir(self.folder.path().join(&name)).expect("a writable folder");
        name
    }

    /// What programs find in their environment to use the server.
    pub fn environment(&self) -> [(String, String); 3] {
        self.environment_through(self.port)
    }

    /// The same, to reach it through another port of the loopback interface.
    pub fn environment_through(&self, port: u16) -> [(String, String); 3] {
        let endpoint = format!("http://127.0.0.1:{port}");
        [("AWS_ENDPOINT_URL", &*endpoint), ("AWS_ACCESS_KEY_ID", ACCESS_KEY), ("AWS_SECRET_ACCESS_KEY", SECRET_KEY)]
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
    }

    /// Kills the server, as a power cut would.
    ///
    /// # Panics
    ///
    /// When the system does not let it be killed.
    pub fn kill(&mut self) {
        self.process.kill().expect("a process of ours");
        self.process.wait().expect("a process of ours");
    }

    /// Suspends the server, or wakes it up again.
    ///
    /// # Panics
    ///
    /// When it has ended by itself.
    pub fn suspend(&mut self, suspended: bool) {
        let signal = if suspended { Signal::SIGSTOP } else { Signal::SIGCONT };
        kill(Pid::from_raw(self.process.id().cast_signed()), signal).expect("the server runs");
    }

    /// Starts it again, on the same port and with what it had stored.
    ///
    /// # Errors
    ///
    /// When it does not start.
    pub fn restart(&mut self) -> io::Result<()> {
        (self.process, self.port) = launch(&self.folder, self.port, self.faults.as_ref())?;
        Ok(())
    }
}

impl Drop for S3Server {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The server over a folder, and the port on which it listens; 0 takes a free one.
fn launch(folder: &TempDir, port: u16, faults: Option<&Faults>) -> io::Result<(Child, u16)> {
    let mut command = Command::new(program()?);
    command.arg(folder.path()).args([&port.to_string(), ACCESS_KEY, SECRET_KEY]);
    command.envs(faults.into_iter().flat_map(Faults::environment));
    let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::inherit()).spawn()?;
    let mut line = String::new();
    if let Some(output) = process.stdout.take() {
        BufReader::new(output).read_line(&mut line)?;
    }
    let port = line.trim().parse().map_err(|_| io::Error::other("the S3 server did not name its port"))?;
    Ok((process, port))
}

/// The server's program, as cargo built it with this test.
fn program() -> io::Result<PathBuf> {
    let test = std::env::current_exe()?;
    // Tests lie in target/PROFILE/deps, programs in target/PROFILE.
    let found = test.ancestors().skip(1).map(|folder| folder.join("s3-server")).find(|program| program.is_file());
    found.ok_or_else(|| {
        io::Error::new(
            io::ErrorKind::NotFound,
            "no s3-server above the test: run `cargo build --release --workspace` first",
        )
    })
}
