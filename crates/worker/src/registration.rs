//! Who this worker is to the coordinator, and the sign of life that keeps it so.

use std::time::Duration;

use clerestory_api::{Client, ClientError, ProblemCode, WorkerId, WorkerRegistration, WorkerView};
use tokio::sync::Mutex;
use tracing::{debug, error, info};

use crate::error::with_causes;
use crate::job_cache::Activity;
use crate::retry::{repeat_while, until_answered};

/// Time between heartbeats; well below the shortest sensible lease.
const HEARTBEAT_PERIOD: Duration = Duration::from_secs(5);

/// The identity under which the worker claims leases. A coordinator may forget it; then the worker registers again.
pub(crate) struct Registration {
    client: Client,
    introduction: WorkerRegistration,
    /// Held while registering, so that of all who notice that the identity is gone only one asks for a new one.
    identity: Mutex<WorkerId>,
}

impl Registration {
    /// Registers, waiting for the coordinator as long as it takes. A server that is no coordinator is not waited for:
    /// the address is probably wrong.
    pub(crate) async fn new(client: Client, introduction: WorkerRegistration) -> Result<Self, ClientError> {
        let may_pass = |error: &ClientError| error.is_transient() && !error.is_misdirected();
        let view = repeat_while("register", may_pass, || client.register_worker(&introduction)).await?;
        let identity = Mutex::new(noted(&view));
        Ok(Self { client, introduction, identity })
    }

    /// The identity.
    pub(crate) async fn identity(&self) -> WorkerId {
        *self.identity.lock().await
    }

    /// Registers again, unless somebody has already replaced the identity that turned out to be `unknown`.
    pub(crate) async fn replace(&self, unknown: WorkerId) -> Result<(), ClientError> {
        let mut identity = self.identity.lock().await;
        if *identity == unknown {
            *identity = register(&self.client, &self.introduction).await?;
        }
        Ok(())
    }

    /// Says that the worker ends, so that nobody waits for it. Nothing depends on an answer.
    pub(crate) async fn end(&self) {
        // Held, so that a heartbeat which comes too late does not register the worker again.
        let identity = self.identity.lock().await;
        if let Err(failure) = self.client.end_worker(*identity).await {
            debug!(reason = with_causes(&failure), "the coordinator was not told that the worker ends");
        }
    }

    /// Sends heartbeats for as long as it is polled, with what is being built.
    pub(crate) async fn keep_alive(&self, activity: &Activity) {
        loop {
            tokio::time::sleep(HEARTBEAT_PERIOD).await;
            let identity = self.identity().await;
            // A missed beat needs no repetition of its own: the next one is due soon.
            let Err(failure) = self.client.heartbeat(identity, &activity.report()).await else { continue };
            if is_unknown_worker(&failure)
                && let Err(failure) = self.replace(identity).await
            {
                error!(reason = with_causes(&failure), "cannot register again");
            }
        }
    }
}

/// Whether the coordinator does not know the worker any more.
pub(crate) fn is_unknown_worker(failure: &ClientError) -> bool {
    failure.problem().is_some_and(|problem| problem.code == ProblemCode::UnknownWorker)
}

async fn register(client: &Client, introduction: &WorkerRegistration) -> Result<WorkerId, ClientError> {
    let view = until_answered("register", || client.register_worker(introduction)).await?;
    Ok(noted(&view))
}

/// The identity of a worker that has registered, which is logged.
fn noted(view: &WorkerView) -> WorkerId {
    info!(worker = %view.id, name = view.name, cores = view.cores, "registered");
    view.id
}
