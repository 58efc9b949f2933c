//! A PostgreSQL server in a temporary folder.

use std::fs;
use std::io;
use std::net::TcpListener;
use std::os::unix::fs::chown;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::{Pid, Uid, User};
use tempfile::TempDir;

/// Longest time until a server takes connections.
const PATIENCE: Duration = Duration::from_secs(60);

/// Where Debian and Ubuntu keep the programs of each version.
const VERSIONS: &str = "/usr/lib/postgresql";

/// Runs the server until standard input ends, which it does with the process that holds the other end, however that ends.
const WATCH: &str = r#""$0" "$@" & server=$!; read -r _; kill -INT $server; wait $server"#;

/// A server with a superuser `postgres` who needs no password, on a free port of the loopback interface.
#[derive(Debug)]
pub struct Postgres {
    programs: PathBuf,
    port: u16,
    databases: AtomicU32,
    owner: Option<User>,
    /// The shell that ends the server.
    watch: Child,
    folder: TempDir,
}

/// The server that all tests of this process share, started when it is asked for first.
///
/// # Panics
///
/// When there is no PostgreSQL on this machine (`tests/run` installs it), or it does not start.
pub fn postgres() -> &'static Postgres {
    static SERVER: OnceLock<Postgres> = OnceLock::new();
    SERVER.get_or_init(|| Postgres::start().expect("PostgreSQL starts"))
}

impl Postgres {
    /// Starts a server.
    ///
    /// # Errors
    ///
    /// When there is no PostgreSQL on this machine, or it does not start.
    pub fn start() -> io::Result<Self> {
        let programs = programs()?;
        let folder = tempfile::tempdir()?;
        let owner = owner()?;
        if let Some(user) = &owner {
            chown(folder.path(), Some(user.uid.as_raw()), Some(user.gid.as_raw()))?;
        }
        let data = folder.path().join("data");
        let mut initialise = Command::new(programs.join("initdb"));
        initialise.arg("-D").arg(&data);
        initialise.args(["-U", "postgres", "--auth=trust", "--no-sync", "--encoding=UTF8", "--locale=C"]);
        run(owned(&mut initialise, owner.as_ref(), folder.path()))?;
        let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
        let watch = launch(&programs, port, owner.as_ref(), folder.path())?;
        let server = Self { programs, port, databases: AtomicU32::new(0), owner, watch, folder };
        server.wait()?;
        Ok(server)
    }

    /// Kills the server and all its processes, as a power cut would.
    ///
    /// # Panics
    ///
    /// When it does not run, or the system does not describe processes as Linux does.
    pub fn kill(&mut self) {
        let file = self.folder.path().join("data/postmaster.pid");
        let text = fs::read_to_string(file).expect("a server that runs has a file with its number");
        let server: u32 = text.lines().next().and_then(|line| line.parse().ok()).expect("a process number");
        let children = fs::read_to_string(format!("/proc/{server}/task/{server}/children")).expect("the server runs");
        let children = children.split_whitespace().filter_map(|number| number.parse::<u32>().ok());
        for process in [server].into_iter().chain(children) {
            // A process that has just ended needs no blow.
            let _ = kill(Pid::from_raw(process.cast_signed()), Signal::SIGKILL);
        }
        self.watch.kill().expect("a process of ours");
        self.watch.wait().expect("a process of ours");
    }

    /// Starts it again, on the same port and with what it had stored.
    ///
    /// # Panics
    ///
    /// When it does not start.
    pub fn restart(&mut self) {
        let launched = launch(&self.programs, self.port, self.owner.as_ref(), self.folder.path());
        self.watch = launched.expect("PostgreSQL starts again");
        self.wait().expect("PostgreSQL starts again");
    }

    /// Makes an empty database and returns its address.
    ///
    /// # Panics
    ///
    /// When the server does not make it.
    pub fn new_database(&self) -> String {
        let name = format!("farm_{}", self.databases.fetch_add(1, Ordering::Relaxed));
        run(self.client("createdb").arg(&name)).expect("the server makes a database");
        format!("postgres://postgres@127.0.0.1:{}/{name}", self.port)
    }

    fn wait(&self) -> io::Result<()> {
        let start = Instant::now();
        loop {
            match run(&mut self.client("pg_isready")) {
                Err(error) if start.elapsed() > PATIENCE => return Err(error),
                Err(_) => thread::sleep(Duration::from_millis(50)),
                Ok(()) => return Ok(()),
            }
        }
    }

    fn client(&self, program: &str) -> Command {
        let mut command = Command::new(self.programs.join(program));
        command.args(["-h", "127.0.0.1", "-U", "postgres", "-p", &self.port.to_string()]);
        command
    }
}

/// The server over a folder with a database cluster, in a shell that ends it.
fn launch(programs: &Path, port: u16, owner: Option<&User>, folder: &Path) -> io::Result<Child> {
    let mut server = Command::new("sh");
    server.args(["-c", WATCH]).arg(programs.join("postgres")).arg("-D").arg(folder.join("data"));
    server.args(["-p", &port.to_string(), "-c", "listen_addresses=127.0.0.1", "-c", "unix_socket_directories="]);
    server.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
    owned(&mut server, owner, folder).spawn()
}

/// The folder with the programs of the newest version.
fn programs() -> io::Result<PathBuf> {
    let version = |folder: &PathBuf| folder.file_name()?.to_str()?.parse::<u32>().ok();
    let folders = fs::read_dir(VERSIONS).into_iter().flatten().flatten().map(|entry| entry.path());
    let programs = folders.filter(|folder| folder.join("bin/initdb").exists()).max_by_key(version);
    programs.map(|folder| folder.join("bin")).ok_or_else(|| {
        let message =
            format!("no PostgreSQL server in {VERSIONS}: install it with tests/run, or the package postgresql");
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

/// Runs a command; an error has what it wrote.
fn run(command: &mut Command) -> io::Result<()> {
    let output = command.output()?;
    let words = || String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    if output.status.success() { Ok(()) } else { Err(io::Error::other(words())) }
}
