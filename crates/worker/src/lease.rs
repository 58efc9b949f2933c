//! One lease, from its nodes to its end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clerestory_api::{BuildOutcome, Client, ClientError, LONGEST_FAILURE, Lease, LeaseReturn, SceneReport};
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tokio_util::task::AbortOnDropHandle;
use tracing::{debug, info, warn};

use crate::error::with_causes;
use crate::job_cache::{JobCache, JobPlan, PlanError};
use crate::renderer::{LeaseError, RenderedNode, Renderer};
use crate::retry::{repeat_while, until_answered};
use crate::uploader::{BatchOutcome, UploadBatch, UploadQueue, is_lease_over};

/// Nodes that may be rendered ahead of the batch that is being enqueued.
const RENDER_AHEAD: usize = 4;

/// Shortest time between renewals, whatever the term of the lease.
const SHORTEST_RENEWAL: Duration = Duration::from_millis(50);

/// Reports on a scene that something other than a coordinator may answer.
const MISDIRECTED_REPORTS: u32 = 5;

/// How the rendering of a lease ended.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// All nodes are rendered.
    Complete,
    /// The lease is no longer valid, or none of its nodes is outstanding.
    Over,
    /// The worker must end.
    Stopped,
    /// The nodes cannot be rendered here, for this reason.
    Failed(String),
    /// The scene cannot be built, for this reason, and the coordinator has the report.
    Unbuildable(String),
}

/// What became of a report on a scene.
enum Reported {
    /// The coordinator has it.
    Taken,
    /// The coordinator, or a proxy before it, refuses the report. The lease goes on.
    Refused,
    /// The lease is over, or the worker must end.
    Interrupted,
}

/// A lease that is being rendered. A background task renews it until it is settled.
pub(crate) struct LeaseWork {
    lease: Lease,
    client: Client,
    queue: UploadQueue,
    build: String,
    /// Cancelled when the worker must end, and with `over`.
    stop: CancellationToken,
    /// Cancelled when the lease is no longer valid, or none of its nodes is outstanding: all are accepted or taken
    /// over.
    over: CancellationToken,
    renewal: AbortOnDropHandle<()>,
    outcomes: Vec<oneshot::Receiver<BatchOutcome>>,
}

impl LeaseWork {
    pub(crate) fn new(
        lease: Lease,
        client: Client,
        queue: UploadQueue,
        build: String,
        worker_stop: &CancellationToken,
    ) -> Self {
        let stop = worker_stop.child_token();
        let over = CancellationToken::new();
        let renewal = {
            let (client, lease, stop, over) = (client.clone(), lease.clone(), stop.clone(), over.clone());
            AbortOnDropHandle::new(tokio::spawn(async move {
                over.run_until_cancelled(renew_until_over(&client, &lease)).await;
                over.cancel();
                stop.cancel();
            }))
        };
        Self { lease, client, queue, build, stop, over, renewal, outcomes: Vec::new() }
    }

    /// Renders the nodes and enqueues them for upload. Returns when no node is left to render. The returned future
    /// waits for the answers, and returns the lease if nodes are left over.
    pub(crate) async fn render(
        mut self,
        jobs: &mut JobCache,
        renderer: &Arc<Renderer>,
    ) -> (Ending, impl Future<Output = ()> + Send + 'static) {
        let fetched = self.stop.run_until_cancelled(jobs.plan(self.lease.job)).await;
        let ending = match fetched {
            None => self.interruption(),
            Some(Err(failure)) if failure.is_of_lost_asset() => {
                warn!(lease = %self.lease.id, reason = with_causes(&*failure), "a file of the job is lost");
                Ending::Over
            }
            Some(Err(failure)) => self.give_up(&failure).await,
            Some(Ok(plan)) => self.render_nodes(plan, renderer).await,
        };
        let failure = match &ending {
            Ending::Failed(reason) | Ending::Unbuildable(reason) => Some(reason.clone()),
            _ => None,
        };
        (ending, self.settle(failure))
    }

    /// The ending of a lease whose scene is not built. Reports a scene that cannot be built.
    async fn give_up(&self, failure: &PlanError) -> Ending {
        let reason = with_causes(failure);
        let Some(outcome) = failure.report().filter(|_| self.lease.wants_report) else {
            return Ending::Failed(reason);
        };
        match self.report(outcome).await {
            Reported::Taken => Ending::Unbuildable(reason),
            Reported::Refused => Ending::Failed(reason),
            Reported::Interrupted => self.interruption(),
        }
    }

    /// Reports how building the scene ended, until the coordinator answers.
    async fn report(&self, outcome: BuildOutcome) -> Reported {
        let report = SceneReport { token: self.lease.token, outcome };
        let mut misdirected = 0;
        // An answer of a proxy says nothing about the lease. A proxy that never lets reports through must not stop the
        // rendering.
        let may_pass = |error: &ClientError| {
            misdirected += u32::from(error.is_misdirected());
            error.is_transient() || (error.is_misdirected() && misdirected < MISDIRECTED_REPORTS)
        };
        let call = repeat_while("report a scene", may_pass, || self.client.report_scene(self.lease.id, &report));
        match self.stop.run_until_cancelled(call).await {
            None => Reported::Interrupted,
            Some(Ok(())) => Reported::Taken,
            Some(Err(error)) if is_lease_over(&error) => {
                info!(lease = %self.lease.id, reason = with_causes(&error), "the lease is over");
                self.over.cancel();
                self.stop.cancel();
                Reported::Interrupted
            }
            Some(Err(error)) => {
                let reason = with_causes(&error);
                warn!(lease = %self.lease.id, reason, "the coordinator refuses the report on a scene");
                Reported::Refused
            }
        }
    }

    /// Renders the nodes. Reports the scene first where that is wanted: the first nodes are rendered meanwhile, and
    /// uploads wait for the answer, so that the image of a job says what was reported.
    async fn render_nodes(&mut self, plan: Arc<JobPlan>, renderer: &Arc<Renderer>) -> Ending {
        let (sender, mut rendered) = mpsc::channel(RENDER_AHEAD);
        let cancelled = Arc::new(AtomicBool::new(false));
        let _watch = {
            let (stop, cancelled) = (self.stop.clone(), cancelled.clone());
            AbortOnDropHandle::new(tokio::spawn(async move {
                stop.cancelled().await;
                cancelled.store(true, Ordering::Relaxed);
            }))
        };
        let rendering = {
            let (plan, renderer, nodes) = (plan.clone(), renderer.clone(), self.lease.nodes.clone());
            tokio::task::spawn_blocking(move || renderer.render(&plan, &nodes, &cancelled, &sender))
        };
        if self.lease.wants_report {
            // A worker whose report is refused renders on. The next lease asks for a report again.
            self.report(plan.report()).await;
        }
        let mut batch: Vec<RenderedNode> = Vec::new();
        let mut due = Instant::now();
        loop {
            let next = tokio::select! {
                next = rendered.recv() => next,
                () = tokio::time::sleep_until(due), if !batch.is_empty() => {
                    self.enqueue(&plan, std::mem::take(&mut batch)).await;
                    continue;
                }
            };
            let Some(node) = next else { break };
            let bytes: usize = batch.iter().map(|node| node.rendered.node.bytes()).sum();
            let full = self.queue.full_batch_bytes();
            if !batch.is_empty() && bytes + node.rendered.node.bytes() > full {
                self.enqueue(&plan, std::mem::take(&mut batch)).await;
            }
            if batch.is_empty() {
                due = Instant::now() + Duration::from_millis(self.lease.upload_linger_ms.into());
            }
            batch.push(node);
            if batch.iter().map(|node| node.rendered.node.bytes()).sum::<usize>() >= full {
                self.enqueue(&plan, std::mem::take(&mut batch)).await;
            }
        }
        if !batch.is_empty() {
            self.enqueue(&plan, batch).await;
        }
        match rendering.await {
            Ok(Ok(())) => Ending::Complete,
            Ok(Err(LeaseError::Stopped)) => self.interruption(),
            Ok(Err(failure)) => Ending::Failed(with_causes(&failure)),
            Err(failure) => Ending::Failed(with_causes(&failure)),
        }
    }

    /// Queues nodes for upload; waits while the queue is full.
    async fn enqueue(&mut self, plan: &Arc<JobPlan>, nodes: Vec<RenderedNode>) {
        if self.over.is_cancelled() {
            return;
        }
        let (outcome, receiver) = oneshot::channel();
        let (plan, build) = (Arc::clone(plan), self.build.clone());
        let (lease, token, over) = (self.lease.id, self.lease.token, self.over.clone());
        let batch = UploadBatch { lease, token, plan, build, nodes, outcome, over };
        tokio::select! {
            sent = self.queue.send(batch) => {
                if sent {
                    self.outcomes.push(receiver);
                }
            }
            () = self.over.cancelled() => {}
        }
    }

    fn interruption(&self) -> Ending {
        if self.over.is_cancelled() { Ending::Over } else { Ending::Stopped }
    }

    /// Waits for the answers to all uploads, then returns the rest of the lease.
    async fn settle(self, mut failure: Option<String>) {
        let mut outstanding = None;
        for outcome in self.outcomes {
            match outcome.await {
                Ok(BatchOutcome::Answered { outstanding: left }) => outstanding = Some(left),
                Ok(BatchOutcome::LeaseOver) => {
                    info!(lease = %self.lease.id, "the lease is over; what was rendered for it is dropped");
                    self.over.cancel();
                }
                Ok(BatchOutcome::Rejected(reason)) => {
                    warn!(lease = %self.lease.id, reason, "the coordinator does not accept a partial");
                    failure.get_or_insert(reason);
                }
                Err(_) => {}
            }
        }
        if self.over.is_cancelled() || outstanding == Some(0) {
            return;
        }
        let failure = failure.map(|reason| reason.chars().take(LONGEST_FAILURE).collect());
        let body = LeaseReturn { token: self.lease.token, failure };
        match until_answered("return a lease", || self.client.return_lease(self.lease.id, &body)).await {
            Ok(()) => info!(lease = %self.lease.id, ?outstanding, "returned the rest of a lease"),
            Err(error) if is_lease_over(&error) => {}
            Err(error) => {
                let reason = with_causes(&error);
                warn!(lease = %self.lease.id, reason, "the coordinator does not take a lease back");
            }
        }
        drop(self.renewal);
    }
}

/// Renews a lease well before its deadline. Returns when it is no longer valid, or none of its nodes is outstanding.
async fn renew_until_over(client: &Client, lease: &Lease) {
    let mut expires_in_ms = lease.expires_in_ms;
    loop {
        let term = Duration::from_millis(u64::try_from(expires_in_ms).unwrap_or(0));
        tokio::time::sleep((term / 3).max(SHORTEST_RENEWAL)).await;
        // An answer of a proxy says nothing about the lease.
        let may_pass = |error: &ClientError| error.is_transient() || error.is_misdirected();
        match repeat_while("renew a lease", may_pass, || client.renew_lease(lease.id, lease.token)).await {
            Ok(renewal) if renewal.outstanding == 0 => {
                info!(lease = %lease.id, "others have what is left of the lease");
                return;
            }
            Ok(renewal) => {
                debug!(lease = %lease.id, "renewed a lease");
                expires_in_ms = renewal.expires_in_ms;
            }
            Err(error) => {
                info!(lease = %lease.id, reason = with_causes(&error), "the lease is over");
                return;
            }
        }
    }
}
