//! A farm of real processes: the built binary `clerestory` as coordinator, as workers, and as a user's command.

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};

use clerestory_api::{Client, ClientError, ConvergenceSeries, JobId, JobView};
use clerestory_test_servers::{Balancer, Faults};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use tempfile::TempDir;

use crate::peak_memory::{PeakMemory, peak_memory};
use crate::stored_farm::copy_folder;
use crate::system_calls;
use crate::waiting::until;

/// Longest wait for anything that a farm should do.
const TIMEOUT: Duration = Duration::from_secs(240);

/// Longest wait for an answer of a farm that may be under attack.
const ANSWER: Duration = Duration::from_secs(2);

/// Coordinators with their data, and the workers that were started for them. They end with the value.
pub struct Farm {
    /// The binary of coordinators, workers and commands; `None` for the one that cargo built.
    build: Option<PathBuf>,
    token: Option<String>,
    options: Vec<String>,
    environment: Vec<(String, String)>,
    /// What everybody calls: the coordinator, or what is in front of several.
    address: String,
    coordinators: Vec<Coordinator>,
    workers: Vec<Process>,
    balancer: Option<Balancer>,
    /// Where the system calls of the coordinators are written.
    trace: Option<PathBuf>,
}

/// A coordinator.
struct Coordinator {
    data: TempDir,
    faults: Option<Faults>,
    address: String,
    process: Process,
}

impl Farm {
    /// A coordinator on a free port of the loopback interface, with further options of `clerestory coordinator`, and
    /// no worker.
    ///
    /// # Panics
    ///
    /// When it does not start.
    pub fn start(token: Option<&str>, options: &[&str]) -> Self {
        Self::start_in(&[], token, options)
    }

    /// As [`Self::start`], with variables in the coordinator's environment.
    ///
    /// # Panics
    ///
    /// When it does not start.
    pub fn start_in(environment: &[(String, String)], token: Option<&str>, options: &[&str]) -> Self {
        let mut farm = Self::nowhere(environment, token, options);
        farm.coordinators.push(farm.coordinator(false));
        farm.address = farm.coordinators[0].address.clone();
        farm
    }

    /// As [`Self::start`], on a copy of a data folder.
    ///
    /// # Panics
    ///
    /// When it does not start.
    pub fn start_on(data: &Path, options: &[&str]) -> Self {
        let mut farm = Self::nowhere(&[], None, options);
        let copy = tempfile::tempdir().expect("a temporary folder");
        copy_folder(data, copy.path(), &|_| true);
        farm.coordinators.push(farm.coordinator_on(copy, false));
        farm.address = farm.coordinators[0].address.clone();
        farm
    }

    /// As [`Self::start_with_faults`] for one coordinator, all of it with another build of `clerestory`.
    ///
    /// # Panics
    ///
    /// When it does not start.
    pub fn start_of_build(build: &Path, options: &[&str]) -> Self {
        let mut farm = Self { build: Some(build.to_owned()), ..Self::nowhere(&[], None, options) };
        farm.coordinators.push(farm.coordinator(true));
        farm.address = farm.coordinators[0].address.clone();
        farm
    }

    /// As [`Self::start`], with the [system calls](crate::system_calls) of the coordinator written to a file by
    /// `strace`.
    ///
    /// # Panics
    ///
    /// When it does not start.
    pub fn start_traced(trace: &Path, options: &[&str]) -> Self {
        let mut farm = Self { trace: Some(trace.to_owned()), ..Self::nowhere(&[], None, options) };
        farm.coordinators.push(farm.coordinator(false));
        farm.address = farm.coordinators[0].address.clone();
        farm
    }

    /// Starts coordinators whose disks and clocks can have faults. Until [`Self::call_through`] says otherwise,
    /// everybody calls the first.
    ///
    /// # Panics
    ///
    /// When they do not start.
    pub fn start_with_faults(count: usize, environment: &[(String, String)], options: &[&str]) -> Self {
        let mut farm = Self::nowhere(environment, None, options);
        farm.coordinators = (0..count).map(|_| farm.coordinator(true)).collect();
        farm.address = farm.coordinators[0].address.clone();
        farm
    }

    /// Starts coordinators behind a load balancer, whose disks and clocks can have faults. Their options name the
    /// database and the object store that they share.
    ///
    /// # Panics
    ///
    /// When they do not start.
    pub fn start_several(count: usize, environment: &[(String, String)], options: &[&str]) -> Self {
        let mut farm = Self::nowhere(environment, None, options);
        farm.coordinators = (0..count).map(|_| farm.coordinator(true)).collect();
        let balancer = Balancer::start(farm.sockets()).expect("a free port");
        farm.address = format!("http://{}", balancer.address());
        Self { balancer: Some(balancer), ..farm }
    }

    fn nowhere(environment: &[(String, String)], token: Option<&str>, options: &[&str]) -> Self {
        Self {
            build: None,
            token: token.map(str::to_owned),
            options: options.iter().map(|&option| option.to_owned()).collect(),
            environment: environment.to_vec(),
            address: String::new(),
            coordinators: Vec::new(),
            workers: Vec::new(),
            balancer: None,
            trace: None,
        }
    }

    /// Another coordinator, on a free port and with a data directory of its own.
    fn coordinator(&self, has_faults: bool) -> Coordinator {
        self.coordinator_on(tempfile::tempdir().expect("a temporary folder"), has_faults)
    }

    /// Another coordinator, on a free port and with this data directory.
    fn coordinator_on(&self, data: TempDir, has_faults: bool) -> Coordinator {
        let faults =
            has_faults.then(|| Faults::below(data.path(), None).expect("the library with the faults is built"));
        let (process, address) = Process::serving(&mut self.serving("127.0.0.1:0", data.path(), faults.as_ref()));
        Coordinator { data, faults, address, process }
    }

    /// The command of a coordinator.
    fn serving(&self, listen: &str, data: &Path, faults: Option<&Faults>) -> Command {
        let mut command = self.program();
        if let Some(trace) = &self.trace {
            command = system_calls::traced(&command, trace);
        }
        command.args(["coordinator", "--listen", listen, "--stop-with-stdin", "--data"]).arg(data).args(&self.options);
        command.envs(self.token.iter().map(|token| ("CLERESTORY_TOKEN", token)));
        command.envs(faults.into_iter().flat_map(Faults::environment));
        command.envs(self.environment.iter().cloned());
        command
    }

    fn program(&self) -> Command {
        self.build.as_deref().map_or_else(clerestory, command_of)
    }

    /// The folder with the data of a coordinator.
    pub fn data(&self, index: usize) -> &Path {
        self.coordinators[index].data.path()
    }

    /// Where the coordinators listen.
    ///
    /// # Panics
    ///
    /// When one has named no address.
    pub fn sockets(&self) -> Vec<SocketAddr> {
        let socket = |coordinator: &Coordinator| coordinator.socket().parse().expect("an address");
        self.coordinators.iter().map(socket).collect()
    }

    /// Lets everybody who starts from now on call the coordinators through what listens there.
    pub fn call_through(&mut self, socket: SocketAddr) {
        self.address = format!("http://{socket}");
    }

    /// The faults of the coordinator that was started as number `index`, where it can have some.
    pub fn faults(&self, index: usize) -> Option<&Faults> {
        self.coordinators[index].faults.as_ref()
    }

    /// Address of the coordinator and its page, or of what is in front of several.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Starts a worker with one thread.
    pub fn start_worker(&mut self, name: &str) {
        let mut command = self.command(&["worker", "--name", name, "--threads", "1", "--stop-with-stdin"]);
        self.workers.push(Process::spawn(&mut command));
    }

    /// Whether the worker that was started as number `index` has not ended.
    ///
    /// # Panics
    ///
    /// When the system does not know the process.
    pub fn worker_runs(&mut self, index: usize) -> bool {
        self.workers[index].runs()
    }

    /// Kills the worker that was started as number `index`, as a power cut would.
    pub fn kill_worker(&mut self, index: usize) {
        self.workers[index].kill();
    }

    /// Asks the worker that was started as number `index` to stop, and waits until it does.
    ///
    /// # Panics
    ///
    /// When it cannot be asked.
    pub fn stop_worker(&mut self, index: usize) -> ExitStatus {
        self.signal_worker(index, Signal::SIGTERM);
        self.workers[index].0.wait().expect("the worker ends")
    }

    /// Asks the worker that was started as number `index` to stop.
    ///
    /// # Panics
    ///
    /// When it does not run.
    pub fn ask_worker_to_stop(&self, index: usize) {
        self.signal_worker(index, Signal::SIGTERM);
    }

    /// Suspends the worker that was started as number `index`, as a laptop that goes to sleep, or wakes it up again.
    ///
    /// # Panics
    ///
    /// When it does not run.
    pub fn suspend_worker(&mut self, index: usize, suspended: bool) {
        self.signal_worker(index, if suspended { Signal::SIGSTOP } else { Signal::SIGCONT });
    }

    fn signal_worker(&self, index: usize, signal: Signal) {
        self.workers[index].signal(signal);
    }

    /// Number of the first coordinator's process; `None` when it has ended.
    ///
    /// # Panics
    ///
    /// When the system does not know the process.
    pub fn coordinator_process(&mut self) -> Option<u32> {
        let child = &mut self.coordinators[0].process.0;
        child.try_wait().expect("a process of ours").is_none().then(|| child.id())
    }

    /// The most memory that the first coordinator has had so far.
    ///
    /// # Panics
    ///
    /// When it has ended, or the system does not describe processes as Linux does.
    pub fn coordinator_memory(&self) -> PeakMemory {
        peak_memory(self.coordinators[0].process.0.id()).expect("the system describes the coordinator")
    }

    /// The most memory so far of the worker that was started as number `index`.
    ///
    /// # Panics
    ///
    /// When it has ended, or the system does not describe processes as Linux does.
    pub fn worker_memory(&self, index: usize) -> PeakMemory {
        peak_memory(self.workers[index].0.id()).expect("the system describes the worker")
    }

    /// Kills the coordinator that was started as number `index`, as a power cut would.
    pub fn kill_coordinator(&mut self, index: usize) {
        self.coordinators[index].process.kill();
    }

    /// Asks the coordinator that was started as number `index` to stop, and waits until it does.
    ///
    /// # Panics
    ///
    /// When it does not run, or ends with a failure.
    pub fn stop_coordinator(&mut self, index: usize) {
        self.coordinators[index].process.ends();
    }

    /// Starts it again, on the same port and with the same data, and waits until it serves.
    ///
    /// # Panics
    ///
    /// When it cannot start.
    pub fn restart_coordinator(&mut self, index: usize) {
        let (process, _) = Process::serving(&mut self.serving_again(index));
        self.coordinators[index].process = process;
    }

    /// Starts it again, on the same port, with the same data and with further options. It may not be able to start.
    pub fn launch_coordinator(&mut self, index: usize, options: &[&str]) {
        let mut command = self.serving_again(index);
        self.coordinators[index].process = Process::spawn(command.args(options).stdout(Stdio::null()));
    }

    fn serving_again(&self, index: usize) -> Command {
        let Coordinator { data, faults, .. } = &self.coordinators[index];
        self.serving(&self.coordinators[index].socket(), data.path(), faults.as_ref())
    }

    /// Whether the coordinator that was started as number `index` has not ended.
    ///
    /// # Panics
    ///
    /// When the system does not know the process.
    pub fn coordinator_runs(&mut self, index: usize) -> bool {
        self.coordinators[index].process.runs()
    }

    /// Suspends the coordinator that was started as number `index`, or wakes it up again.
    ///
    /// # Panics
    ///
    /// When it does not run.
    pub fn suspend_coordinator(&mut self, index: usize, suspended: bool) {
        self.coordinators[index].process.signal(if suspended { Signal::SIGSTOP } else { Signal::SIGCONT });
    }

    /// Submits a scene as a user does, and returns the identity of the job.
    ///
    /// # Panics
    ///
    /// When it is refused.
    pub fn submit(&self, scene: &Path, options: &[&str]) -> String {
        let mut command = self.command(&["submit"]);
        let output = succeeded(command.arg(scene).args(options));
        String::from_utf8(output.stdout).expect("text").trim().to_owned()
    }

    /// The newest job.
    ///
    /// # Panics
    ///
    /// When the farm does not answer, or has no job.
    pub fn newest_job(&self) -> JobView {
        self.newest_job_at(&self.address)
    }

    /// The newest job; `None` when there is none, or the farm does not answer.
    pub fn newest_job_if_any(&self) -> Option<JobView> {
        self.newest_job_if_it_answers(&self.address)
    }

    fn newest_job_if_it_answers(&self, address: &str) -> Option<JobView> {
        let client = Client::new(address, self.token.as_deref()).ok()?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().ok()?;
        let answer = async { tokio::time::timeout(ANSWER, client.jobs()).await.ok()?.ok() };
        runtime.block_on(answer)?.into_iter().next()
    }

    fn newest_job_at(&self, address: &str) -> JobView {
        let mut command = self.command(&["jobs", "--json"]);
        let output = succeeded(command.env("CLERESTORY_COORDINATOR", address));
        let jobs: Vec<JobView> = serde_json::from_slice(&output.stdout).expect("a list of jobs");
        jobs.into_iter().next().expect("a job")
    }

    /// Asks about the newest job until `enough` says so.
    ///
    /// # Panics
    ///
    /// When that does not happen within minutes.
    pub fn wait_until(&self, what: &str, enough: impl Fn(&JobView) -> bool) -> JobView {
        self.wait_until_at(&self.address, what, enough)
    }

    /// The same, asking the coordinator that was started as number `index`.
    ///
    /// # Panics
    ///
    /// When that does not happen within minutes.
    pub fn wait_at(&self, index: usize, what: &str, enough: impl Fn(&JobView) -> bool) -> JobView {
        self.wait_until_at(&self.coordinators[index].address, what, enough)
    }

    /// Waits until no job is queued or running but those that only workers of another build can continue.
    ///
    /// # Panics
    ///
    /// When that does not happen within minutes.
    pub fn wait_until_all_have_ended(&self) {
        let jobs = || self.asked(async |client| client.jobs().await);
        until("all have ended", || jobs().iter().all(|job| job.state.is_final() || job.waits_for_build.is_some()));
    }

    fn wait_until_at(&self, address: &str, what: &str, enough: impl Fn(&JobView) -> bool) -> JobView {
        let start = Instant::now();
        loop {
            // A call that one of several coordinators had taken when it was killed is lost with it.
            let job = match self.balancer {
                Some(_) => self.newest_job_if_it_answers(address),
                None => Some(self.newest_job_at(address)),
            };
            if let Some(job) = job.as_ref().filter(|job| enough(job)) {
                return job.clone();
            }
            assert!(start.elapsed() < TIMEOUT, "still not {what}: {job:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// The present image of a job, as OpenEXR.
    ///
    /// # Panics
    ///
    /// When the farm does not answer.
    pub fn image(&self, job: JobId) -> Vec<u8> {
        self.asked(async |client| client.image(job).await).to_vec()
    }

    /// The rounds of a job.
    ///
    /// # Panics
    ///
    /// When the farm does not answer.
    pub fn convergence(&self, job: JobId) -> ConvergenceSeries {
        self.asked(async |client| client.convergence(job).await)
    }

    /// Asks the farm; `None` when it does not answer, or refuses.
    pub fn asked_if_it_answers<T>(&self, call: impl AsyncFnOnce(&Client) -> Result<T, ClientError>) -> Option<T> {
        let client = Client::new(&self.address, self.token.as_deref()).ok()?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().ok()?;
        runtime.block_on(call(&client)).ok()
    }

    fn asked<T>(&self, call: impl AsyncFnOnce(&Client) -> Result<T, ClientError>) -> T {
        let client = Client::new(&self.address, self.token.as_deref()).expect("an address");
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        runtime.block_on(call(&client)).expect("an answer")
    }

    /// The command `clerestory` with arguments, as a user of this farm calls it.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = self.program();
        command.args(arguments).env("CLERESTORY_COORDINATOR", &self.address);
        // What coordinators log, others log too.
        command.envs(self.environment.iter().filter(|(name, _)| name == "CLERESTORY_LOG").cloned());
        command.envs(self.token.iter().map(|token| ("CLERESTORY_TOKEN", token)));
        command
    }
}

impl Coordinator {
    fn socket(&self) -> String {
        self.address.trim_start_matches("http://").trim_end_matches('/').to_owned()
    }
}

/// The command `clerestory`, as cargo built it with this test or command.
///
/// # Panics
///
/// When it has not been built.
pub fn clerestory() -> Command {
    program("clerestory")
}

/// A program of the workspace, as cargo built it with this test or command.
///
/// # Panics
///
/// When it has not been built.
pub fn program(name: &str) -> Command {
    let test = std::env::current_exe().expect("a process has a file");
    // Tests lie in target/PROFILE/deps, commands and what they call in target/PROFILE.
    let folder = test.ancestors().skip(1).find(|folder| !folder.ends_with("deps")).expect("a folder above `deps`");
    let binary: PathBuf = folder.join(name);
    assert!(binary.exists(), "{} is not there: run `cargo build --release` first", binary.display());
    command_of(&binary)
}

/// The command of a binary, without the settings of the environment.
pub fn command_of(binary: &Path) -> Command {
    let mut command = Command::new(binary);
    // Whatever the shell of the developer says about farms is not for the test.
    for (name, _) in std::env::vars_os().filter(|(name, _)| name.to_string_lossy().starts_with("CLERESTORY_")) {
        command.env_remove(name);
    }
    command.env("CLERESTORY_LOG", "warn");
    command
}

/// Runs a command that must succeed.
///
/// # Panics
///
/// When it fails, with what it said.
pub fn succeeded(command: &mut Command) -> Output {
    let output = command.output().expect("the command starts");
    assert!(output.status.success(), "{command:?} fails: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// A process that is killed with the value; or, when this process is killed, ends because its standard input does.
pub struct Process(Child);

impl Process {
    /// Starts a command that serves pages, and returns the address that it says first.
    ///
    /// # Panics
    ///
    /// When it says something else.
    pub fn serving(command: &mut Command) -> (Self, String) {
        let mut process = Self::spawn(command.stdout(Stdio::piped()));
        let mut address = String::new();
        let output = process.0.stdout.take().expect("its output is piped");
        BufReader::new(output).read_line(&mut address).expect("text");
        assert!(address.starts_with("http://"), "{command:?} says its address first, not `{address}`");
        (process, address.trim().to_owned())
    }

    /// Asks the process to end, and waits until it does.
    ///
    /// # Panics
    ///
    /// When it does not run, does not end within minutes, or ends with a failure.
    pub fn ends(&mut self) {
        self.signal(Signal::SIGTERM);
        until("the process ends", || !self.runs());
        let status = self.0.wait().expect("the process ends");
        assert!(status.success(), "{status}");
    }

    fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.0.id().cast_signed()), signal).expect("the process runs");
    }

    fn runs(&mut self) -> bool {
        self.0.try_wait().expect("a process of ours").is_none()
    }

    fn spawn(command: &mut Command) -> Self {
        Self(command.stdin(Stdio::piped()).spawn().expect("the binary starts"))
    }

    fn kill(&mut self) {
        self.0.kill().expect("the process can be killed");
        self.0.wait().expect("the process ends");
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
