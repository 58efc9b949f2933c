//! One lease, from its nodes to its end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clerestory_api::{Client, ClientError, Lease, LeaseReturn};
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tokio_util::task::AbortOnDropHandle;
use tracing::{debug, info, warn};

use crate::error::with_causes;
use crate::job_cache::{JobCache, JobPlan};
use crate::renderer::{LeaseError, RenderedNode, Renderer};
use crate::retry::{repeat_while, until_answered};
use crate::uploader::{Outbox, Parcel, Receipt, is_lease_over};

/// Longest reason that a coordinator takes with a lease that is given back, characters.
const LONGEST_REASON: usize = 500;

/// Nodes that may be rendered ahead of the parcel that is being handed in.
const RENDER_AHEAD: usize = 4;

/// Shortest time between renewals, whatever term the coordinator names.
const SHORTEST_RENEWAL: Duration = Duration::from_millis(50);

/// How the rendering of a lease ended.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// All its nodes are rendered.
    Complete,
    /// The lease does not count any more, or nothing of it is wanted.
    Over,
    /// The worker was told to end.
    Stopped,
    /// Its nodes cannot be rendered here, for this reason.
    Failed(String),
}

/// A lease in work. It is renewed in the background until it is settled.
pub(crate) struct LeaseWork {
    lease: Lease,
    client: Client,
    outbox: Outbox,
    build: String,
    /// Cancelled when the worker is told to end, or `over` is.
    stop: CancellationToken,
    /// Cancelled when the lease does not count any more, or nothing of it is wanted: all is accepted, or others have
    /// it.
    over: CancellationToken,
    renewal: AbortOnDropHandle<()>,
    receipts: Vec<oneshot::Receiver<Receipt>>,
}

impl LeaseWork {
    pub(crate) fn new(
        lease: Lease,
        client: Client,
        outbox: Outbox,
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
        Self { lease, client, outbox, build, stop, over, renewal, receipts: Vec::new() }
    }

    /// Renders the lease's nodes and hands them in. Returns as soon as nothing is left to render, with the rest:
    /// waiting for the answers and, where nodes are left over, giving them back.
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
            Some(Err(failure)) => Ending::Failed(with_causes(&*failure)),
            Some(Ok(plan)) => self.render_nodes(plan, renderer).await,
        };
        let failure = match &ending {
            Ending::Failed(reason) => Some(reason.clone()),
            _ => None,
        };
        (ending, self.settle(failure))
    }

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
        let mut gathered: Vec<RenderedNode> = Vec::new();
        let mut due = Instant::now();
        loop {
            let next = tokio::select! {
                next = rendered.recv() => next,
                () = tokio::time::sleep_until(due), if !gathered.is_empty() => {
                    self.hand_in(&plan, std::mem::take(&mut gathered)).await;
                    continue;
                }
            };
            let Some(node) = next else { break };
            let bytes: usize = gathered.iter().map(|node| node.rendered.node.bytes()).sum();
            let full = self.outbox.full_parcel_bytes();
            if !gathered.is_empty() && bytes + node.rendered.node.bytes() > full {
                self.hand_in(&plan, std::mem::take(&mut gathered)).await;
            }
            if gathered.is_empty() {
                due = Instant::now() + Duration::from_millis(self.lease.gather_ms.into());
            }
            gathered.push(node);
            if gathered.iter().map(|node| node.rendered.node.bytes()).sum::<usize>() >= full {
                self.hand_in(&plan, std::mem::take(&mut gathered)).await;
            }
        }
        if !gathered.is_empty() {
            self.hand_in(&plan, gathered).await;
        }
        match rendering.await {
            Ok(Ok(())) => Ending::Complete,
            Ok(Err(LeaseError::Stopped)) => self.interruption(),
            Ok(Err(failure)) => Ending::Failed(with_causes(&failure)),
            Err(failure) => Ending::Failed(with_causes(&failure)),
        }
    }

    /// Queues nodes for upload; waits while the queue is full.
    async fn hand_in(&mut self, plan: &Arc<JobPlan>, nodes: Vec<RenderedNode>) {
        if self.over.is_cancelled() {
            return;
        }
        let (receipt, receiver) = oneshot::channel();
        let (plan, build) = (Arc::clone(plan), self.build.clone());
        let (lease, token, over) = (self.lease.id, self.lease.token, self.over.clone());
        let parcel = Parcel { lease, token, plan, build, nodes, receipt, over };
        tokio::select! {
            sent = self.outbox.send(parcel) => {
                if sent {
                    self.receipts.push(receiver);
                }
            }
            () = self.over.cancelled() => {}
        }
    }

    fn interruption(&self) -> Ending {
        if self.over.is_cancelled() { Ending::Over } else { Ending::Stopped }
    }

    /// Waits for the answers to everything handed in, then gives back what is left of the lease.
    async fn settle(self, mut failure: Option<String>) {
        let mut outstanding = None;
        for receipt in self.receipts {
            match receipt.await {
                Ok(Receipt::Answered { outstanding: left }) => outstanding = Some(left),
                Ok(Receipt::LeaseOver) => {
                    info!(lease = %self.lease.id, "the lease is over; what was rendered for it is dropped");
                    self.over.cancel();
                }
                Ok(Receipt::Rejected(reason)) => {
                    warn!(lease = %self.lease.id, reason, "the coordinator does not accept a partial");
                    failure.get_or_insert(reason);
                }
                Err(_) => {}
            }
        }
        if self.over.is_cancelled() || outstanding == Some(0) {
            return;
        }
        let failure = failure.map(|reason| reason.chars().take(LONGEST_REASON).collect());
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

/// Renews a lease well before its deadline; returns when it does not count any more, or nothing of it is wanted.
async fn renew_until_over(client: &Client, lease: &Lease) {
    let mut expires_in_ms = lease.expires_in_ms;
    loop {
        let term = Duration::from_millis(u64::try_from(expires_in_ms).unwrap_or(0));
        tokio::time::sleep((term / 3).max(SHORTEST_RENEWAL)).await;
        // What a proxy answers says nothing of the lease.
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
