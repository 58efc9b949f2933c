//! A farm on this machine: a coordinator and workers, each a process. A process that ends by itself is started again.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clerestory_worker::machine_memory;
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::child::{Child, Environment};
use crate::failure::Failure;
use crate::threads::ThreadCount;

/// Pause before a process that ended by itself is started again.
const RESTART_PAUSE: Duration = Duration::from_secs(1);

/// A coordinator that serves for this long has recovered from an earlier end.
const RECOVERY_TIME: Duration = Duration::from_secs(30);

/// Restarts in a row without recovery after which the farm is given up.
const MOST_RESTARTS: u32 = 5;

/// The farm to start.
#[derive(Clone, Debug)]
pub(crate) struct FarmPlan {
    /// Address on which the coordinator listens; port 0 for a free one.
    pub(crate) listen: String,
    /// Where the coordinator keeps its data.
    pub(crate) data: PathBuf,
    /// File with the farm's token.
    pub(crate) token_file: Option<PathBuf>,
    /// Number of workers.
    pub(crate) workers: usize,
    /// Threads of each worker.
    pub(crate) threads: usize,
    /// MiB of memory for the scenes of each worker; `None` for all that the machine has.
    pub(crate) memory_mib: Option<u64>,
    /// Folder for the log of each process; without one, logs go to standard error.
    pub(crate) logs: Option<PathBuf>,
    /// The settings in the environment that the processes see.
    pub(crate) environment: Environment,
}

/// A running farm.
pub(crate) struct LocalFarm {
    address: String,
    coordinator: JoinHandle<Option<Failure>>,
    stop_coordinator: CancellationToken,
    workers: JoinSet<()>,
    stop_workers: CancellationToken,
}

impl LocalFarm {
    /// Starts the coordinator, and once it listens, the workers.
    pub(crate) async fn start(plan: &FarmPlan) -> Result<Self, Failure> {
        let (coordinator, address) = start_coordinator(plan, &plan.listen).await?;
        let stop_coordinator = CancellationToken::new();
        let coordinator = tokio::spawn(supervise_coordinator(
            coordinator,
            plan.clone(),
            with_port_of(&plan.listen, &address),
            stop_coordinator.clone(),
        ));

        let stop_workers = CancellationToken::new();
        let mut workers = JoinSet::new();
        for number in 1..=plan.workers {
            let name = format!("worker-{number}");
            let arguments = worker_arguments(plan, &address, &name);
            workers.spawn(supervise(name, arguments, plan.clone(), stop_workers.clone()));
        }
        Ok(Self { address, coordinator, stop_coordinator, workers, stop_workers })
    }

    /// Address of the coordinator and its page.
    pub(crate) fn address(&self) -> &str {
        &self.address
    }

    /// Waits until the farm cannot go on, because its coordinator ends again and again.
    pub(crate) async fn broken(&mut self) -> Failure {
        match (&mut self.coordinator).await {
            Ok(Some(failure)) => failure,
            // Only `stop` stops it, which consumes the farm.
            Ok(None) => std::future::pending().await,
            Err(error) => Failure::Job(format!("what watches the coordinator failed: {error}")),
        }
    }

    /// Ends the workers, which upload their finished nodes, and then the coordinator.
    pub(crate) async fn stop(mut self) {
        self.stop_workers.cancel();
        while self.workers.join_next().await.is_some() {}
        self.stop_coordinator.cancel();
        if !self.coordinator.is_finished()
            && let Err(error) = self.coordinator.await
        {
            warn!(%error, "what watches the coordinator failed");
        }
    }
}

/// Starts a coordinator and waits until it serves; returns the address that it prints.
async fn start_coordinator(plan: &FarmPlan, listen: &str) -> Result<(Child, String), Failure> {
    let mut arguments = words(&["coordinator", "--listen", listen, "--data"]);
    arguments.push(plan.data.clone().into());
    arguments.extend(token_option(plan));
    let mut coordinator = Child::spawn("the coordinator", &arguments, log_file(plan, "coordinator"), plan.environment)?;
    let address = coordinator.first_line().await?;
    Ok((coordinator, address))
}

/// Keeps the coordinator running until it is stopped. Returns the last failure when it ends again and again without
/// recovering.
async fn supervise_coordinator(
    first: Child,
    plan: FarmPlan,
    listen: String,
    stop: CancellationToken,
) -> Option<Failure> {
    let mut running = Some(first);
    let mut restarts = 0;
    loop {
        let since = Instant::now();
        let failure = match running.take() {
            Some(mut coordinator) => match stop.run_until_cancelled(coordinator.ended()).await {
                Some(failure) => {
                    if since.elapsed() >= RECOVERY_TIME {
                        restarts = 0;
                    }
                    failure
                }
                None => {
                    coordinator.stop().await;
                    return None;
                }
            },
            None => match stop.run_until_cancelled(start_coordinator(&plan, &listen)).await? {
                Ok((coordinator, _)) => {
                    info!("the coordinator serves again");
                    running = Some(coordinator);
                    continue;
                }
                Err(failure) => failure,
            },
        };
        if restarts == MOST_RESTARTS {
            return Some(failure);
        }
        restarts += 1;
        warn!(%failure, "starting it again");
        stop.run_until_cancelled(tokio::time::sleep(RESTART_PAUSE * restarts)).await?;
    }
}

/// The address to listen on again. A free port, requested by 0, is known to the workers by now and stays.
fn with_port_of(listen: &str, address: &str) -> String {
    match (listen.rsplit_once(':'), address.rsplit_once(':')) {
        (Some((host, "0")), Some((_, port))) => format!("{host}:{port}"),
        _ => listen.to_owned(),
    }
}

/// Keeps a worker running until it is stopped.
async fn supervise(name: String, arguments: Vec<OsString>, plan: FarmPlan, stop: CancellationToken) {
    while !stop.is_cancelled() {
        let failure = match Child::spawn(&name, &arguments, log_file(&plan, &name), plan.environment) {
            Err(failure) => failure,
            Ok(mut worker) => match stop.run_until_cancelled(worker.ended()).await {
                None => return worker.stop().await,
                Some(failure) => failure,
            },
        };
        warn!(%failure, "starting it again");
        stop.run_until_cancelled(tokio::time::sleep(RESTART_PAUSE)).await;
    }
    info!(name, "stopped");
}

/// The arguments of a worker.
fn worker_arguments(plan: &FarmPlan, address: &str, name: &str) -> Vec<OsString> {
    let threads = plan.threads.to_string();
    let mut arguments = words(&["worker", "--coordinator", address, "--name", name, "--threads", &threads]);
    if let Some(memory) = plan.memory_mib {
        arguments.extend(words(&["--memory-mib", &memory.to_string()]));
    }
    arguments.extend(token_option(plan));
    arguments
}

fn words(words: &[&str]) -> Vec<OsString> {
    words.iter().map(OsString::from).collect()
}

fn token_option(plan: &FarmPlan) -> Vec<OsString> {
    let file = plan.token_file.as_deref().map(Path::as_os_str);
    file.map(|file| vec!["--token-file".into(), file.to_owned()]).unwrap_or_default()
}

/// The log of a process.
fn log_file(plan: &FarmPlan, name: &str) -> Option<PathBuf> {
    plan.logs.as_ref().map(|folder| folder.join(format!("{name}.log")))
}

/// Threads for each of `workers` workers, so that together they use every core.
pub(crate) fn share_of_cores(workers: usize) -> usize {
    (ThreadCount::of_cores().get().get() / workers).max(1)
}

/// MiB of memory for each of `workers` workers, so that all of them can build a scene at once. `None` for one worker,
/// which may take all, and on a system that does not report its memory.
pub(crate) fn share_of_memory(workers: usize) -> Option<u64> {
    let memory = machine_memory().filter(|_| workers > 1)?;
    Some(((memory / workers as u64) >> 20).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workers_of_one_machine_share_its_memory() {
        let memory_of = |workers| {
            let plan = FarmPlan {
                listen: String::new(),
                data: PathBuf::new(),
                token_file: None,
                workers,
                threads: 1,
                memory_mib: share_of_memory(workers),
                logs: None,
                environment: Environment::Inherited,
            };
            let arguments = worker_arguments(&plan, "http://127.0.0.1:7171", "worker-1");
            let at = arguments.iter().position(|argument| argument == "--memory-mib")?;
            arguments[at + 1].to_str().unwrap().parse::<u64>().ok()
        };
        assert_eq!(memory_of(1), None, "it may take all");
        let Some(machine) = machine_memory() else { return };
        for workers in [2, 3, 8] {
            let each = memory_of(workers).unwrap() << 20;
            let all = each * workers as u64;
            assert!(all <= machine && machine - all < (workers as u64) << 20, "{workers} of {each} in {machine}");
        }
    }

    #[test]
    fn a_coordinator_listens_again_where_it_did() {
        let again = |listen| with_port_of(listen, "http://127.0.0.1:40123");
        assert_eq!(again("127.0.0.1:0"), "127.0.0.1:40123");
        assert_eq!(again("[::]:0"), "[::]:40123");
        assert_eq!(again("0.0.0.0:7171"), "0.0.0.0:7171");
    }
}
