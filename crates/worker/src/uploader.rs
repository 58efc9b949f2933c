//! Uploads partials. Each is kept and sent again until the coordinator answers.
//!
//! A proxy may refuse a body that the coordinator would accept. Then nodes travel in smaller partials. A node that is
//! too large by itself travels in pieces, which the coordinator assembles. The uploader remembers the accepted size.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use bytes::Bytes;
use clerestory_api::{
    Client, ClientError, ContentHash, LeaseId, NodeVerdict, PartialAnswer, PartialPieces, PartialUpload, ProblemCode,
};
use clerestory_render_core::scene;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;
use tracing::{debug, warn};

use crate::error::with_causes;
use crate::job_cache::JobPlan;
use crate::renderer::RenderedNode;
use crate::retry::until_answered;

/// Batches that may wait for the one that is being sent. Beyond that, rendering waits.
const QUEUE_LENGTH: usize = 2;

/// Bytes of sums at which a batch is full, well below the limit of coordinators. A larger node travels alone.
const FULL_BATCH_BYTES: usize = 8 << 20;

/// Bodies are not split below this size, which is about that of calls without a partial.
const SMALLEST_BODY_BYTES: usize = 4 << 10;

/// Attempts to send the pieces of a partial when the coordinator has lost some.
const ATTEMPTS_WITH_PIECES: u32 = 3;

/// Nodes of one lease that are uploaded together.
pub(crate) struct UploadBatch {
    /// The lease under which they were rendered.
    pub(crate) lease: LeaseId,
    /// The lease's fencing token.
    pub(crate) token: u64,
    /// The plan of their job.
    pub(crate) plan: Arc<JobPlan>,
    /// The build that rendered them.
    pub(crate) build: String,
    /// The nodes, at least one.
    pub(crate) nodes: Vec<RenderedNode>,
    /// Receives the outcome.
    pub(crate) outcome: oneshot::Sender<BatchOutcome>,
    /// Cancelled when no node of the lease is outstanding.
    pub(crate) over: CancellationToken,
}

/// The outcome of a batch.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum BatchOutcome {
    /// The coordinator has answered for every node.
    Answered {
        /// Outstanding nodes of the lease.
        outstanding: u32,
    },
    /// The lease is over: another worker renders its nodes, or none does.
    LeaseOver,
    /// The batch could not be encoded or accepted, for this reason.
    Rejected(String),
}

/// The queue of batches. Sending waits while it is full.
#[derive(Clone)]
pub(crate) struct UploadQueue {
    batches: mpsc::Sender<UploadBatch>,
    limit: Arc<BodyLimit>,
}

impl UploadQueue {
    /// Enqueues a batch. False when the uploader has ended.
    pub(crate) async fn send(&self, batch: UploadBatch) -> bool {
        self.batches.send(batch).await.is_ok()
    }

    /// Bytes of sums at which a batch is full.
    pub(crate) fn full_batch_bytes(&self) -> usize {
        FULL_BATCH_BYTES.min(self.limit.bytes())
    }
}

/// The queue, and the task that uploads from it. The task ends when all copies of the queue are gone.
pub(crate) fn uploader(client: Client) -> (UploadQueue, impl Future<Output = ()>) {
    let (sender, mut batches) = mpsc::channel::<UploadBatch>(QUEUE_LENGTH);
    let limit = Arc::new(BodyLimit::default());
    let queue = UploadQueue { batches: sender, limit: Arc::clone(&limit) };
    let work = async move {
        while let Some(batch) = batches.recv().await {
            let UploadBatch { lease, token, plan, build, nodes, outcome, over } = batch;
            let delivery = Delivery { client: &client, limit: &limit, lease, token };
            let result = delivery.deliver(plan, build, Arc::new(nodes)).await;
            if matches!(result, BatchOutcome::Answered { outstanding: 0 } | BatchOutcome::LeaseOver) {
                over.cancel();
            }
            // The receiver is gone when the lease was dropped because the worker ends.
            let _ = outcome.send(result);
        }
    };
    (queue, work)
}

/// The largest body that reaches the coordinator, as far as refusals tell.
struct BodyLimit(AtomicUsize);

impl Default for BodyLimit {
    fn default() -> Self {
        Self(AtomicUsize::new(usize::MAX))
    }
}

impl BodyLimit {
    fn bytes(&self) -> usize {
        self.0.load(Ordering::Relaxed)
    }

    /// Lowers the limit below a refused body.
    fn lower(&self, refused: usize) {
        self.0.fetch_min((refused / 2).max(SMALLEST_BODY_BYTES), Ordering::Relaxed);
    }
}

/// The outcome of sending a body.
enum Sent<T> {
    Answered(T),
    /// The body is too large, for the named receiver.
    TooLarge(String),
    /// No answer will come.
    Ended(BatchOutcome),
}

/// The delivery of one batch.
struct Delivery<'a> {
    client: &'a Client,
    limit: &'a BodyLimit,
    lease: LeaseId,
    token: u64,
}

impl Delivery<'_> {
    /// Sends all nodes, in several partials if a proxy refuses one.
    async fn deliver(&self, plan: Arc<JobPlan>, build: String, nodes: Arc<Vec<RenderedNode>>) -> BatchOutcome {
        let mut outstanding = 0;
        let mut waiting = VecDeque::new();
        waiting.push_back(0..nodes.len());
        while let Some(range) = waiting.pop_front() {
            let (encoder, encoded, name, part) = (Arc::clone(&plan), Arc::clone(&nodes), build.clone(), range.clone());
            let encode = move || {
                let nodes = encoded[part].iter().map(|node| &node.rendered);
                encoder.encode_partial(nodes, &name).map_err(|error| with_causes(&error))
            };
            let file = match tokio::task::spawn_blocking(encode).await {
                Ok(Ok(file)) => Bytes::from(file),
                Ok(Err(reason)) => return BatchOutcome::Rejected(reason),
                Err(panic) => return BatchOutcome::Rejected(panic.to_string()),
            };
            let core_ms = core_ms(nodes[range.clone()].iter().map(|node| node.core_time).sum());
            match self.send(&file, core_ms, range.len()).await {
                Sent::Answered(answer) => {
                    log_verdicts(&answer);
                    debug!(lease = %self.lease, nodes = answer.nodes.len(), bytes = file.len(), "uploaded a partial");
                    outstanding = answer.outstanding;
                    if outstanding == 0 {
                        break;
                    }
                }
                Sent::TooLarge(reason) => match halves(&range) {
                    Some([first, second]) => {
                        waiting.push_front(second);
                        waiting.push_front(first);
                    }
                    None => return BatchOutcome::Rejected(reason),
                },
                Sent::Ended(outcome) => return outcome,
            }
        }
        BatchOutcome::Answered { outstanding }
    }

    /// Sends a partial of `nodes` nodes whole. A partial of a single node that is refused goes in pieces.
    async fn send(&self, file: &Bytes, core_ms: u64, nodes: usize) -> Sent<PartialAnswer> {
        if file.len() <= self.limit.bytes() {
            let upload = PartialUpload { lease: self.lease, token: self.token, core_ms, body: file.clone() };
            match self.call("upload a partial", file.len(), || self.client.upload_partial(upload.clone())).await {
                Sent::TooLarge(reason) if self.limit.bytes() >= file.len() => return Sent::TooLarge(reason),
                Sent::TooLarge(_) => {}
                sent => return sent,
            }
        }
        if nodes > 1 {
            let bytes = file.len();
            return Sent::TooLarge(format!("a partial of {bytes} bytes does not get through to the coordinator"));
        }
        for _ in 0..ATTEMPTS_WITH_PIECES {
            match self.send_in_pieces(file, core_ms).await {
                Sent::Answered(Some(answer)) => return Sent::Answered(answer),
                Sent::Answered(None) => {
                    warn!(lease = %self.lease, "the coordinator lacks pieces of a partial, sending all again")
                }
                Sent::TooLarge(reason) => return Sent::TooLarge(reason),
                Sent::Ended(outcome) => return Sent::Ended(outcome),
            }
        }
        Sent::Ended(BatchOutcome::Rejected("the coordinator does not keep the pieces of a partial".to_owned()))
    }

    /// Sends a partial in pieces. No answer when the coordinator has lost some of them.
    async fn send_in_pieces(&self, file: &Bytes, core_ms: u64) -> Sent<Option<PartialAnswer>> {
        let mut pieces = Vec::new();
        let mut start = 0;
        while start < file.len() {
            let piece = file.slice(start..file.len().min(start.saturating_add(self.limit.bytes())));
            let hash = ContentHash::from(*scene::ContentHash::of(&piece).as_bytes());
            let upload = || self.client.upload_piece(self.lease, self.token, &hash, piece.clone());
            match self.call("upload a piece of a partial", piece.len(), upload).await {
                Sent::Answered(()) => {
                    pieces.push(hash);
                    start += piece.len();
                }
                Sent::TooLarge(_) if self.limit.bytes() < piece.len() => {}
                Sent::TooLarge(reason) => return Sent::TooLarge(reason),
                Sent::Ended(outcome) => return Sent::Ended(outcome),
            }
        }
        debug!(lease = %self.lease, bytes = file.len(), pieces = pieces.len(), "uploaded a partial in pieces");
        let body = PartialPieces { token: self.token, core_ms, pieces };
        let assemble = || async {
            match self.client.assemble_partial(self.lease, &body).await {
                Ok(answer) => Ok(Some(answer)),
                Err(failure) if has_code(&failure, ProblemCode::MissingPieces) => Ok(None),
                Err(failure) => Err(failure),
            }
        };
        self.call("upload a partial", file.len(), assemble).await
    }

    /// Repeats a call with a body of `bytes` until the coordinator answers.
    async fn call<T, Answer>(&self, what: &'static str, bytes: usize, call: impl FnMut() -> Answer) -> Sent<T>
    where
        Answer: Future<Output = Result<T, ClientError>>,
    {
        match until_answered(what, call).await {
            Ok(answer) => Sent::Answered(answer),
            Err(failure) if is_lease_over(&failure) => Sent::Ended(BatchOutcome::LeaseOver),
            Err(failure) if has_code(&failure, ProblemCode::BodyTooLarge) => {
                Sent::TooLarge(format!("the coordinator takes no partial of {bytes} bytes: {}", with_causes(&failure)))
            }
            Err(failure) if failure.is_too_large_on_the_way() => {
                self.limit.lower(bytes);
                warn!(lease = %self.lease, bytes, reason = with_causes(&failure), "cutting uploads smaller");
                Sent::TooLarge(format!("{bytes} bytes: {}", with_causes(&failure)))
            }
            Err(failure) => Sent::Ended(BatchOutcome::Rejected(with_causes(&failure))),
        }
    }
}

/// The halves of a range of more than one.
fn halves(range: &Range<usize>) -> Option<[Range<usize>; 2]> {
    let middle = range.start + range.len() / 2;
    (range.len() > 1).then_some([range.start..middle, middle..range.end])
}

/// Rounds up, because a time of zero would tell nothing about the worker's rate.
fn core_ms(time: Duration) -> u64 {
    u64::try_from(time.as_nanos().div_ceil(1_000_000)).unwrap_or(u64::MAX)
}

fn log_verdicts(answer: &PartialAnswer) {
    for node in answer.nodes.iter().filter(|node| node.verdict == NodeVerdict::Refused) {
        let reason = node.reason.as_deref().unwrap_or("no reason given");
        warn!(node = ?node.node, reason, "the coordinator refused a node");
    }
}

fn has_code(failure: &ClientError, code: ProblemCode) -> bool {
    failure.problem().is_some_and(|problem| problem.code == code)
}

/// Whether the lease is no longer valid, whatever the reason.
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
