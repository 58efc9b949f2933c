//! The life of a worker.

use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use backon::BackoffBuilder;
use clerestory_api::{Client, ClientError, JobId, Lease, LeaseRequest, ProblemCode, WorkerRegistration};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tokio_util::task::AbortOnDropHandle;
use tracing::{error, info, warn};

use crate::error::with_causes;
use crate::job_cache::JobCache;
use crate::lease::{Ending, LeaseWork};
use crate::registration::{Registration, is_unknown_worker};
use crate::renderer::Renderer;
use crate::retry::{pauses, until_answered};
use crate::scene_budget::SceneBudget;
use crate::uploader::uploader;
use crate::{Config, WorkerError};

/// How long the coordinator may let a claim wait for work.
const LONG_POLL: Duration = Duration::from_secs(15);

/// Pause after an empty claim. A coordinator that is shutting down answers at once.
const IDLE_PAUSE: Duration = Duration::from_millis(100);

/// Time after the shutdown signal in which the worker uploads its complete nodes.
const SHUTDOWN_GRACE: Duration = Duration::from_secs(5);

/// Works for a coordinator until `shutdown` completes. Then it uploads its complete nodes, returns the rest of its
/// lease, reports that it ends, and returns within a few seconds.
///
/// It waits without end for a coordinator that is away.
///
/// # Errors
///
/// When the address or the token cannot be used, the coordinator refuses the worker, or threads cannot be started.
pub async fn run(config: Config, shutdown: impl Future<Output = ()> + Send + 'static) -> Result<(), WorkerError> {
    run_until(config, Box::pin(shutdown)).await
}

/// A future that is compiled where it is boxed.
type Boxed<T> = Pin<Box<dyn Future<Output = T> + Send>>;

/// As [`run`], but boxed: the worker is compiled once in this crate, and not in each crate that starts one.
fn run_until(config: Config, shutdown: Boxed<()>) -> Boxed<Result<(), WorkerError>> {
    Box::pin(work_until(config, shutdown))
}

async fn work_until(config: Config, shutdown: Boxed<()>) -> Result<(), WorkerError> {
    let client = Client::new(&config.coordinator, config.token.as_deref()).map_err(WorkerError::Connection)?;
    let renderer = Arc::new(Renderer::new(config.threads)?);
    let stop = CancellationToken::new();
    let signal = stop.clone();
    let _watch = AbortOnDropHandle::new(tokio::spawn(async move {
        shutdown.await;
        signal.cancel();
    }));

    let probing = Arc::clone(&renderer);
    let probed = tokio::task::spawn_blocking(move || probing.probe()).await.map_err(WorkerError::ProbePanic)??;
    let introduction = WorkerRegistration {
        name: config.name,
        cores: u32::try_from(config.threads.get()).unwrap_or(u32::MAX),
        build: config.build.clone(),
        probe_digest: Some(probed.first),
        method_digests: probed.methods,
    };
    let Some(registration) = stop.run_until_cancelled(Registration::new(client.clone(), introduction)).await else {
        return Ok(());
    };
    let registration = registration.map_err(|error| match error.is_misdirected() {
        true => WorkerError::Connection(error),
        false => WorkerError::Refused(error),
    })?;
    let mut jobs = JobCache::new(client.clone(), SceneBudget::new(config.memory));
    let activity = jobs.activity();
    let worker = Worker { client, registration, renderer, build: config.build, stop: stop.clone() };
    tokio::select! {
        result = worker.work(&mut jobs) => result,
        () = worker.registration.keep_alive(&activity) => Ok(()),
        () = async { stop.cancelled().await; tokio::time::sleep(SHUTDOWN_GRACE).await } => {
            warn!("ending without an answer from the coordinator; what it has not acknowledged will be rendered again");
            Ok(())
        }
    }
}

struct Worker {
    client: Client,
    registration: Registration,
    renderer: Arc<Renderer>,
    build: String,
    stop: CancellationToken,
}

impl Worker {
    /// Works through leases until it must stop, and then waits for the last uploads.
    async fn work(&self, jobs: &mut JobCache) -> Result<(), WorkerError> {
        let (queue, uploads) = uploader(self.client.clone());
        let _uploads = AbortOnDropHandle::new(tokio::spawn(uploads));
        let mut settling = JoinSet::new();
        let mut penalty = pauses().build();
        while let Some(claimed) = self.stop.run_until_cancelled(self.claim(jobs.jobs())).await {
            let Some(lease) = claimed? else {
                self.stop.run_until_cancelled(tokio::time::sleep(IDLE_PAUSE)).await;
                continue;
            };
            info!(lease = %lease.id, job = %lease.job, nodes = lease.nodes.len(), "claimed a lease");
            let work = LeaseWork::new(lease, self.client.clone(), queue.clone(), self.build.clone(), &self.stop);
            let (ending, rest) = work.render(jobs, &self.renderer).await;
            settling.spawn(rest);
            while settling.try_join_next().is_some() {}
            match ending {
                Ending::Complete | Ending::Over | Ending::Stopped => penalty = pauses().build(),
                Ending::Unbuildable(reason) => {
                    warn!(reason, "the scene of a job cannot be built");
                    penalty = pauses().build();
                }
                Ending::Failed(reason) => {
                    error!(reason, "could not render a lease, giving it back");
                    // The next lease may fail as fast, so do not spin.
                    if let Some(pause) = penalty.next() {
                        self.stop.run_until_cancelled(tokio::time::sleep(pause)).await;
                    }
                }
            }
        }
        while settling.join_next().await.is_some() {}
        info!("handed over everything, ending");
        self.registration.end().await;
        Ok(())
    }

    /// Claims a lease, with these scenes built or being built. `None` when the queue has no work.
    async fn claim(&self, built: Vec<JobId>) -> Result<Option<Lease>, WorkerError> {
        let worker = self.registration.identity().await;
        let wait_ms = u32::try_from(LONG_POLL.as_millis()).unwrap_or(u32::MAX);
        let request = LeaseRequest { worker, max_nodes: None, wanted_ms: None, wait_ms, built };
        match until_answered("claim a lease", || self.client.claim_lease(&request)).await {
            Ok(lease) => Ok(lease),
            Err(failure) if is_unknown_worker(&failure) => {
                self.registration.replace(worker).await.map_err(WorkerError::Refused)?;
                Ok(None)
            }
            Err(failure) if is_shut_out(&failure) => Err(WorkerError::Refused(failure)),
            Err(failure) => {
                error!(reason = with_causes(&failure), "the coordinator refused a claim");
                tokio::time::sleep(LONG_POLL).await;
                Ok(None)
            }
        }
    }
}

/// Whether the coordinator refuses this worker for good.
fn is_shut_out(failure: &ClientError) -> bool {
    let codes = [ProblemCode::Unauthorized, ProblemCode::WorkerQuarantined];
    failure.problem().is_some_and(|problem| codes.contains(&problem.code))
}
