//! The registration of this worker, and the heartbeats that keep it alive.

use std::time::Duration;

use clerestory_api::{Client, ClientError, ProblemCode, WorkerId, WorkerRegistration, WorkerView};
use tokio::sync::Mutex;
use tracing::{debug, error, info};

use crate::error::with_causes;
use crate::job_cache::Activity;
use crate::retry::{repeat_while, until_answered};

/// Time between heartbeats, well below the shortest sensible lease.
const HEARTBEAT_PERIOD: Duration = Duration::from_secs(5);

/// The identity under which the worker claims leases. When a coordinator no longer knows it, the worker registers
/// again.
pub(crate) struct Registration {
    client: Client,
    introduction: WorkerRegistration,
    /// Locked while registering, so that only one task replaces an identity that the coordinator no longer knows.
    identity: Mutex<WorkerId>,
}

impl Registration {
    /// Registers, and waits for a coordinator that is away. A server that is no coordinator is an error: the address is
    /// probably wrong.
    pub(crate) async fn new(client: Client, introduction: WorkerRegistration) -> Result<Self, ClientError> {
        let may_pass = |error: &ClientError| error.is_transient() && !error.is_misdirected();
        let view = repeat_while("register", may_pass, || client.register_worker(&introduction)).await?;
        let identity = Mutex::new(log_registration(&view));
        Ok(Self { client, introduction, identity })
    }

    /// The identity.
    pub(crate) async fn identity(&self) -> WorkerId {
        *self.identity.lock().await
    }

    /// Registers again, unless another task has already replaced the `unknown` identity.
    pub(crate) async fn replace(&self, unknown: WorkerId) -> Result<(), ClientError> {
        let mut identity = self.identity.lock().await;
        if *identity == unknown {
            *identity = register(&self.client, &self.introduction).await?;
        }
        Ok(())
    }

    /// Reports that the worker ends, so that its leases are free at once. Nothing depends on the answer.
    pub(crate) async fn end(&self) {
        // Locked, so that a late heartbeat does not register the worker again.
        let identity = self.identity.lock().await;
        if let Err(failure) = self.client.end_worker(*identity).await {
            debug!(reason = with_causes(&failure), "the coordinator was not told that the worker ends");
        }
    }

    /// Sends heartbeats with the current activity, until it is dropped.
    pub(crate) async fn keep_alive(&self, activity: &Activity) {
        loop {
            tokio::time::sleep(HEARTBEAT_PERIOD).await;
            let identity = self.identity().await;
            // A heartbeat that fails is not repeated, because the next one is due soon.
            let Err(failure) = self.client.heartbeat(identity, &activity.report()).await else { continue };
            if is_unknown_worker(&failure)
                && let Err(failure) = self.replace(identity).await
            {
                error!(reason = with_causes(&failure), "cannot register again");
            }
        }
    }
}

/// Whether the coordinator no longer knows the worker.
pub(crate) fn is_unknown_worker(failure: &ClientError) -> bool {
    failure.problem().is_some_and(|problem| problem.code == ProblemCode::UnknownWorker)
}

async fn register(client: &Client, introduction: &WorkerRegistration) -> Result<WorkerId, ClientError> {
    let view = until_answered("register", || client.register_worker(introduction)).await?;
    Ok(log_registration(&view))
}

/// Logs a registration and returns its identity.
fn log_registration(view: &WorkerView) -> WorkerId {
    info!(worker = %view.id, name = view.name, cores = view.cores, "registered");
    view.id
}
