//! Partials on their way to the coordinator. Each is kept and sent again until it is answered.

use std::time::Duration;

use bytes::Bytes;
use clerestory_api::{Client, ClientError, LeaseId, NodeVerdict, PartialAnswer, PartialUpload, ProblemCode};
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;
use tracing::{debug, warn};

use crate::error::with_causes;
use crate::retry::until_answered;

/// Partials that may wait for the one that is being sent. Beyond that, rendering waits.
const QUEUE_LENGTH: usize = 2;

/// Nodes of one lease that travel together.
pub(crate) struct Parcel {
    /// The lease under which they were rendered.
    pub(crate) lease: LeaseId,
    /// The lease's fencing token.
    pub(crate) token: u64,
    /// Makes the OpenEXR file; called once, off the asynchronous threads.
    pub(crate) encode: Box<dyn FnOnce() -> Result<Vec<u8>, String> + Send>,
    /// Time spent rendering them, summed over cores.
    pub(crate) core_time: Duration,
    /// Told what became of them.
    pub(crate) receipt: oneshot::Sender<Receipt>,
    /// Cancelled when nothing more of the lease is wanted.
    pub(crate) over: CancellationToken,
}

/// What became of a parcel.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Receipt {
    /// The coordinator has answered for every node.
    Answered {
        /// Nodes of the lease that it still wants.
        outstanding: u32,
    },
    /// The lease is over: somebody else renders its nodes, or nobody does.
    LeaseOver,
    /// The parcel could not be made or is not acceptable, for this reason.
    Rejected(String),
}

/// Where parcels are handed in. Waits while the queue is full.
pub(crate) type Outbox = mpsc::Sender<Parcel>;

/// The outbox, and the work of emptying it, which ends when all copies of the outbox are gone.
pub(crate) fn uploader(client: Client) -> (Outbox, impl Future<Output = ()>) {
    let (outbox, mut parcels) = mpsc::channel::<Parcel>(QUEUE_LENGTH);
    let work = async move {
        while let Some(parcel) = parcels.recv().await {
            let Parcel { lease, token, encode, core_time, receipt, over } = parcel;
            // Part of a millisecond counts as one: a node that took no time would tell nothing of the worker's speed.
            let core_ms = u64::try_from(core_time.as_nanos().div_ceil(1_000_000)).unwrap_or(u64::MAX);
            let outcome = match tokio::task::spawn_blocking(encode).await {
                Ok(Ok(file)) => send(&client, PartialUpload { lease, token, core_ms, body: Bytes::from(file) }).await,
                Ok(Err(reason)) => Receipt::Rejected(reason),
                Err(panic) => Receipt::Rejected(panic.to_string()),
            };
            if matches!(outcome, Receipt::Answered { outstanding: 0 } | Receipt::LeaseOver) {
                over.cancel();
            }
            // Nobody waits for the receipt of a lease that was dropped because the worker ends.
            let _ = receipt.send(outcome);
        }
    };
    (outbox, work)
}

async fn send(client: &Client, upload: PartialUpload) -> Receipt {
    let bytes = upload.body.len();
    match until_answered("upload a partial", || client.upload_partial(upload.clone())).await {
        Ok(answer) => {
            log_verdicts(&answer);
            debug!(lease = %upload.lease, nodes = answer.nodes.len(), bytes, "uploaded a partial");
            Receipt::Answered { outstanding: answer.outstanding }
        }
        Err(failure) if is_lease_over(&failure) => Receipt::LeaseOver,
        Err(failure) => Receipt::Rejected(with_causes(&failure)),
    }
}

fn log_verdicts(answer: &PartialAnswer) {
    for node in answer.nodes.iter().filter(|node| node.verdict == NodeVerdict::Refused) {
        let reason = node.reason.as_deref().unwrap_or("no reason given");
        warn!(node = ?node.node, reason, "the coordinator refused a node");
    }
}

/// Whether the lease does not count any more, whatever the reason.
pub(crate) fn is_lease_over(failure: &ClientError) -> bool {
    failure.problem().is_some_and(|problem| {
        matches!(
            problem.code,
            ProblemCode::LeaseExpired
                | ProblemCode::LeaseReturned
                | ProblemCode::StaleToken
                | ProblemCode::UnknownLease
                | ProblemCode::UnknownJob
                | ProblemCode::JobNotRunning
        )
    })
}
