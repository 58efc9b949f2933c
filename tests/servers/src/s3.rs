//! A server that speaks S3 over a temporary folder: the program `s3-server` of this package, or Garage.

use std::fs;
use std::io;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::garage::Garage;
use crate::watched::{self, Watched};
use crate::{Faults, free_port};

/// Who may use the server, in the form that Garage asks for.
pub(crate) const ACCESS_KEY: &str = "GK31415926535897932384626433";

/// What they have to know.
pub(crate) const SECRET_KEY: &str = "2718281828459045235360287471352662497757247093699959574966967627";

/// Where it is.
pub(crate) const REGION: &str = "us-east-1";

/// Longest time until a server takes connections.
const TIMEOUT: Duration = Duration::from_secs(60);

/// A server on a free port of the loopback interface. It checks signatures, as S3 does.
///
/// It is a small program of this package, unless the environment variable `CLERESTORY_TEST_GARAGE` has the path of
/// Garage's.
#[derive(Debug)]
pub struct S3Server {
    port: u16,
    buckets: AtomicU32,
    faults: Option<Faults>,
    garage: Option<Garage>,
    process: Watched,
    folder: TempDir,
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
        let port = free_port()?;
        let garage = Garage::if_wanted(folder.path(), port)?;
        let process = launch(folder.path(), port, faults.as_ref(), garage.as_ref())?;
        Ok(Self { port, buckets: AtomicU32::new(0), faults, garage, process, folder })
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
    /// When the server does not make it.
    pub fn new_bucket(&self) -> String {
        let name = format!("glass-{}", self.buckets.fetch_add(1, Ordering::Relaxed));
        let made = match &self.garage {
            Some(garage) => garage.make_bucket(&name),
            None => fs::create_dir(self.folder.path().join(&name)),
        };
        made.expect("the server makes a bucket");
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
        self.process.kill();
    }

    /// Suspends the server, or wakes it up again. One that has ended by itself stays dead.
    ///
    /// # Panics
    ///
    /// When the system does not know it.
    pub fn suspend(&mut self, suspended: bool) {
        self.process.suspend(suspended);
    }

    /// Whether the server has ended, by itself or killed.
    ///
    /// # Panics
    ///
    /// When the system does not know it.
    pub fn has_ended(&mut self) -> bool {
        self.process.has_ended()
    }

    /// Starts it again, on the same port and with what it had stored.
    ///
    /// # Errors
    ///
    /// When it does not start.
    pub fn restart(&mut self) -> io::Result<()> {
        self.process = launch(self.folder.path(), self.port, self.faults.as_ref(), self.garage.as_ref())?;
        Ok(())
    }
}

/// The server over a folder, as soon as it takes connections.
fn launch(folder: &Path, port: u16, faults: Option<&Faults>, garage: Option<&Garage>) -> io::Result<Watched> {
    let mut server = match garage {
        Some(garage) => garage.server(),
        None => {
            let mut server = watched::command(&program()?);
            server.arg(folder).args([&port.to_string(), ACCESS_KEY, SECRET_KEY]);
            server
        }
    };
    let mut process = Watched::start(server.envs(faults.into_iter().flat_map(Faults::environment)))?;
    let start = Instant::now();
    while let Err(error) = TcpStream::connect(("127.0.0.1", port)) {
        if process.has_ended() || start.elapsed() > TIMEOUT {
            return Err(error);
        }
        thread::sleep(Duration::from_millis(10));
    }
    Ok(process)
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
