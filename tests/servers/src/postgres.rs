//! A PostgreSQL server in a temporary folder.

use std::fs;
use std::io;
use std::os::unix::fs::chown;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use nix::unistd::{Uid, User};
use tempfile::TempDir;

use crate::watched::{self, Watched};
use crate::{Faults, free_port};

/// Longest time until a server takes connections.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Where Debian and Ubuntu keep the programs of each version.
const VERSIONS: &str = "/usr/lib/postgresql";

/// A server with a superuser `postgres` who needs no password, on a free port of the loopback interface.
#[derive(Debug)]
pub struct Postgres {
    programs: PathBuf,
    port: u16,
    databases: AtomicU32,
    owner: Option<User>,
    faults: Option<Faults>,
    process: Watched,
    folder: TempDir,
}

/// The server that all tests of this process share, started when it is asked for first.
///
/// # Panics
///
/// When there is no PostgreSQL on this machine (`tests/run` installs it), or it does not start.
pub fn postgres() -> &'static Postgres {
    // With the process that removes its folder, because what is static is never dropped.
    static SERVER: OnceLock<(Postgres, Child)> = OnceLock::new();
    let start = || Postgres::start().and_then(Postgres::removed_afterwards);
    &SERVER.get_or_init(|| start().expect("PostgreSQL starts")).0
}

impl Postgres {
    /// Starts a server.
    ///
    /// # Errors
    ///
    /// When there is no PostgreSQL on this machine, or it does not start.
    pub fn start() -> io::Result<Self> {
        Self::start_on(tempfile::tempdir()?, owner()?, None)
    }

    /// Starts a server whose disk can have faults.
    ///
    /// # Errors
    ///
    /// When there is no PostgreSQL on this machine, it does not start, or the library with the faults has not been
    /// built.
    pub fn start_with_faults() -> io::Result<Self> {
        let (folder, owner) = (tempfile::tempdir()?, owner()?);
        let faults = Faults::below(folder.path(), owner.as_ref())?;
        Self::start_on(folder, owner, Some(faults))
    }

    fn start_on(folder: TempDir, owner: Option<User>, faults: Option<Faults>) -> io::Result<Self> {
        let programs = programs()?;
        if let Some(user) = &owner {
            chown(folder.path(), Some(user.uid.as_raw()), Some(user.gid.as_raw()))?;
        }
        let data = folder.path().join("data");
        let mut initialise = Command::new(programs.join("initdb"));
        initialise.arg("-D").arg(&data);
        initialise.args(["-U", "postgres", "--auth=trust", "--no-sync", "--encoding=UTF8", "--locale=C"]);
        run(owned(&mut initialise, owner.as_ref(), folder.path()))?;
        let port = free_port()?;
        let process = launch(&programs, port, owner.as_ref(), faults.as_ref(), folder.path())?;
        let mut server = Self { programs, port, databases: AtomicU32::new(0), owner, faults, process, folder };
        server.wait()?;
        Ok(server)
    }

    fn removed_afterwards(self) -> io::Result<(Self, Child)> {
        let mut remover = self.process.removed_afterwards(self.folder.path());
        let remover = owned(&mut remover, self.owner.as_ref(), self.folder.path()).spawn()?;
        Ok((self, remover))
    }

    /// The faults of its disk, where it can have some.
    pub fn faults(&self) -> Option<&Faults> {
        self.faults.as_ref()
    }

    /// Port of the loopback interface on which it listens.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// Kills the server and all its processes, as a power cut would. One that has ended by itself stays dead.
    ///
    /// # Panics
    ///
    /// When the system does not let it be killed.
    pub fn kill(&mut self) {
        self.process.kill();
    }

    /// Suspends the server and all its processes, or wakes them up again. One that has ended by itself stays dead.
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
        self.launch_again()?;
        self.wait()
    }

    fn launch_again(&mut self) -> io::Result<()> {
        let Self { programs, port, owner, faults, folder, .. } = self;
        self.process = launch(programs, *port, owner.as_ref(), faults.as_ref(), folder.path())?;
        Ok(())
    }

    /// Makes an empty database and returns its address.
    ///
    /// # Panics
    ///
    /// When the server does not make it.
    pub fn new_database(&self) -> String {
        self.new_database_in("UTF8")
    }

    /// The same, of texts in some encoding.
    ///
    /// # Panics
    ///
    /// When the server does not make it.
    pub fn new_database_in(&self, encoding: &str) -> String {
        let name = format!("farm_{}", self.databases.fetch_add(1, Ordering::Relaxed));
        let options = ["--template=template0", "--encoding", encoding, &name];
        run(self.client("createdb").args(options)).expect("the server makes a database");
        format!("postgres://postgres@127.0.0.1:{}/{name}", self.port)
    }

    /// The contents of a database as SQL, without what servers older than this one do not know.
    ///
    /// # Errors
    ///
    /// When the server refuses it, or the contents are not text.
    pub fn dump(&self, database: &str) -> io::Result<String> {
        let output = output(self.client("pg_dump").args(["--no-owner", "--no-privileges"]).arg(name_of(database)))?;
        let text = String::from_utf8(output.stdout).map_err(io::Error::other)?;
        let is_new = |line: &&str| {
            ["SET transaction_timeout", "\\restrict ", "\\unrestrict "].iter().any(|new| line.starts_with(new))
        };
        Ok(text.lines().filter(|line| !is_new(line)).flat_map(|line| [line, "\n"]).collect())
    }

    /// Makes a database of what [`Self::dump`] answered, from a file, and returns its address.
    ///
    /// # Panics
    ///
    /// When the server does not make it.
    pub fn restored(&self, dump: &Path) -> String {
        let database = self.new_database();
        let mut psql = self.client("psql");
        psql.args(["--no-psqlrc", "--quiet", "--set", "ON_ERROR_STOP=1", "--dbname", name_of(&database), "--file"]);
        run(psql.arg(dump)).expect("the server takes the dump");
        database
    }

    /// Makes the server reuse segments of its log for the next gigabyte, as one that has run for some minutes does. A
    /// new segment is filled with zeros and synced while all commits wait.
    ///
    /// # Errors
    ///
    /// When the server refuses it.
    pub fn settle(&self) -> io::Result<()> {
        const SEGMENTS: &str = "do $$ begin for segment in 1..64 loop \
                                perform pg_logical_emit_message(false, 'settle', 'segment'); \
                                perform pg_switch_wal(); end loop; end $$";
        let statements =
            ["alter system set min_wal_size = '1GB'", "select pg_reload_conf()", SEGMENTS, "checkpoint", "checkpoint"];
        run(self
            .client("psql")
            .args(["--no-psqlrc", "--set", "ON_ERROR_STOP=1"])
            .args(statements.iter().flat_map(|statement| ["-c", statement])))
    }

    /// Waits until it takes connections. One that ends meanwhile is started again: what was left of one that was killed
    /// may have been in its way.
    fn wait(&mut self) -> io::Result<()> {
        let start = Instant::now();
        while let Err(error) = run(&mut self.client("pg_isready")) {
            if start.elapsed() > TIMEOUT {
                return Err(error);
            }
            thread::sleep(Duration::from_millis(50));
            if self.has_ended() {
                self.launch_again()?;
            }
        }
        Ok(())
    }

    fn client(&self, program: &str) -> Command {
        let mut command = Command::new(self.programs.join(program));
        command.args(["-h", "127.0.0.1", "-U", "postgres", "-p", &self.port.to_string()]);
        command
    }
}

/// The server over a folder with a database cluster.
fn launch(
    programs: &Path,
    port: u16,
    owner: Option<&User>,
    faults: Option<&Faults>,
    folder: &Path,
) -> io::Result<Watched> {
    let mut server = watched::command(&programs.join("postgres"));
    server.arg("-D").arg(folder.join("data"));
    server.args(["-p", &port.to_string(), "-c", "listen_addresses=127.0.0.1", "-c", "unix_socket_directories="]);
    // Killed servers leave nothing behind in the system's shared memory.
    server.args(["-c", "dynamic_shared_memory_type=mmap"]);
    server.envs(faults.into_iter().flat_map(Faults::environment));
    Watched::start(owned(server.stderr(Stdio::null()), owner, folder))
}

/// The oldest version that the tests are for.
const OLDEST_VERSION: u32 = 15;

/// The folder with the programs of the newest version.
fn programs() -> io::Result<PathBuf> {
    let version = |folder: &PathBuf| folder.file_name()?.to_str()?.parse::<u32>().ok();
    let folders = fs::read_dir(VERSIONS).into_iter().flatten().flatten().map(|entry| entry.path());
    let usable = |folder: &PathBuf| version(folder) >= Some(OLDEST_VERSION) && folder.join("bin/initdb").exists();
    let programs = folders.filter(usable).max_by_key(version);
    programs.map(|folder| folder.join("bin")).ok_or_else(|| {
        let message = format!(
            "no PostgreSQL server of version {OLDEST_VERSION} or newer in {VERSIONS}: install it with tests/run, or \
             the package postgresql"
        );
        io::Error::new(io::ErrorKind::NotFound, message)
    })
}

/// The user as whom a server runs that refuses to run as root; `None` when this is not root.
fn owner() -> io::Result<Option<User>> {
    if !Uid::effective().is_root() {
        return Ok(None);
    }
    let user = User::from_name("postgres")?;
    user.map(Some).ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "there is no user postgres"))
}

fn owned<'a>(command: &'a mut Command, owner: Option<&User>, folder: &Path) -> &'a mut Command {
    if let Some(user) = owner {
        command.uid(user.uid.as_raw()).gid(user.gid.as_raw());
    }
    command.current_dir(folder).env("LC_ALL", "C")
}

/// The name of a database, of which this is the address.
fn name_of(address: &str) -> &str {
    address.rsplit('/').next().unwrap_or(address)
}

/// Runs a command; an error has what it wrote.
fn run(command: &mut Command) -> io::Result<()> {
    output(command).map(drop)
}

/// Runs a command and answers what it wrote, as does an error.
fn output(command: &mut Command) -> io::Result<Output> {
    let output = command.output()?;
    let words = || String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    if output.status.success() { Ok(output) } else { Err(io::Error::other(words())) }
}
