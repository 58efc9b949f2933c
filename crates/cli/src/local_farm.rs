//! A farm on this machine: a coordinator and workers, each a process of its own.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::child::{Child, Environment};
use crate::failure::Failure;

/// Pause before a worker that ended by itself is started again.
const RESTART_PAUSE: Duration = Duration::from_secs(1);

/// What to start.
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
    /// Folder for the logs of each process; without one they go to standard error.
    pub(crate) logs: Option<PathBuf>,
    /// What the processes see of the settings in the environment.
    pub(crate) environment: Environment,
}

/// A running farm.
pub(crate) struct LocalFarm {
    coordinator: Child,
    address: String,
    workers: JoinSet<()>,
    stop_workers: CancellationToken,
}

impl LocalFarm {
    /// Starts the coordinator, and once it listens, the workers.
    pub(crate) async fn start(plan: &FarmPlan) -> Result<Self, Failure> {
        let mut arguments = words(&["coordinator", "--listen", &plan.listen, "--data"]);
        arguments.push(plan.data.clone().into());
        arguments.extend(token_option(plan));
        let log = log_file(plan, "coordinator");
        let mut coordinator = Child::spawn("the coordinator", &arguments, log, plan.environment)?;
        let address = coordinator.first_line().await?;

        let stop_workers = CancellationToken::new();
        let mut workers = JoinSet::new();
        for number in 1..=plan.workers {
            let name = format!("worker-{number}");
            let threads = plan.threads.to_string();
            let mut arguments = words(&["worker", "--coordinator", &address, "--name", &name, "--threads", &threads]);
            arguments.extend(token_option(plan));
            workers.spawn(supervise(name, arguments, plan.clone(), stop_workers.clone()));
        }
        Ok(Self { coordinator, address, workers, stop_workers })
    }

    /// Address of the coordinator and its page.
    pub(crate) fn address(&self) -> &str {
        &self.address
    }

    /// Waits until the farm cannot go on because its coordinator ended by itself.
    pub(crate) async fn broken(&mut self) -> Failure {
        self.coordinator.ended().await
    }

    /// Ends the workers, which hand over what they have, and then the coordinator.
    pub(crate) async fn stop(mut self) {
        self.stop_workers.cancel();
        while self.workers.join_next().await.is_some() {}
        self.coordinator.stop().await;
    }
}

/// Keeps a worker running until told to stop.
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
