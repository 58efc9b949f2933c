//! A simulated worker: it calls the coordinator as a real one does, but uploads noise.
//!
//! It registers, sends heartbeats, waits for leases, renews them, uploads nodes at the times of a real worker, and
//! repeats calls after transient failures. Two things differ: it does not fetch the scene, and it claims only after its
//! upload was answered.

use std::sync::Arc;
use std::time::Duration;

use backon::{ExponentialBuilder, Retryable};
use bytes::Bytes;
use clerestory_api::{
    Client, ClientError, Lease, LeaseRequest, LeaseReturn, NodeAddress, PartialUpload, ProblemCode, WorkerActivity,
    WorkerId, WorkerRegistration,
};
use tokio::time::Instant;

use crate::error::report;
use crate::partials::{Noise, NoiseError};
use crate::settings::BUILD;
use crate::tally::Tally;

/// Longest wait of a claim for work, as of real workers, milliseconds.
const LONG_POLL_MS: u32 = 15_000;

/// Time between heartbeats, as of real workers.
const HEARTBEAT_PERIOD: Duration = Duration::from_secs(5);

/// Reported core time of a pass of a tile, milliseconds. It is the target time of a whole lease, so that the
/// coordinator cuts no larger nodes.
const PASS_CORE_MS: u64 = 10_000;

/// The shared state of the workers of a load.
#[derive(Debug)]
pub(crate) struct Load {
    /// The client. Each call in progress has a connection of its own.
    pub(crate) client: Client,
    /// The noise that they upload.
    pub(crate) noise: Noise,
    /// Their counters.
    pub(crate) tally: Tally,
    /// Time from one lease of a worker to its next; without one, the next follows at once.
    pub(crate) cycle: Option<Duration>,
}

/// A simulated worker fails.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WorkerFailure {
    #[error("the coordinator refuses a simulated worker")]
    Call(#[from] ClientError),
    #[error("cannot make a partial")]
    Noise(#[from] NoiseError),
}

impl Load {
    /// Registers the worker with this number.
    pub(crate) async fn register(&self, number: u32) -> Result<WorkerId, ClientError> {
        let name = format!("simulated-{number}");
        let registration =
            WorkerRegistration { name, cores: 1, build: BUILD.to_owned(), ..WorkerRegistration::default() };
        Ok(self.until_answered(|| self.client.register_worker(&registration)).await?.id)
    }

    /// Works as a registered worker from `start` on, for as long as it is polled. Ends only on a failure, which is
    /// noted.
    pub(crate) async fn work(self: Arc<Self>, worker: WorkerId, start: Instant) {
        let failure = tokio::select! {
            failure = self.leases(worker, start) => failure,
            () = self.heartbeats(worker) => return,
        };
        self.tally.fails(report(&failure));
    }

    async fn leases(&self, worker: WorkerId, start: Instant) -> WorkerFailure {
        tokio::time::sleep_until(start).await;
        let mut turn = start;
        loop {
            match self.claim(worker).await {
                Err(failure) => return failure.into(),
                Ok(None) => turn = Instant::now(),
                Ok(Some(lease)) => {
                    // A late worker does not catch up, so a farm that cannot follow is offered less.
                    let now = Instant::now();
                    turn = now.max(turn + self.cycle.unwrap_or_default());
                    tokio::select! {
                        uploaded_all = self.upload_all(&lease, now, turn) => {
                            if let Err(failure) = uploaded_all {
                                return failure;
                            }
                        }
                        () = self.renew(&lease) => {}
                    }
                }
            }
        }
    }

    async fn claim(&self, worker: WorkerId) -> Result<Option<Lease>, ClientError> {
        let request =
            LeaseRequest { worker, max_nodes: None, wanted_ms: None, wait_ms: LONG_POLL_MS, built: Vec::new() };
        let asked = self.tally.asks();
        let start = Instant::now();
        let lease = self.until_answered(|| self.client.claim_lease(&request)).await?;
        match &lease {
            Some(lease) => self.tally.granted(asked, start.elapsed(), &lease.nodes),
            None => self.tally.claim_without_work(asked, start.elapsed()),
        }
        Ok(lease)
    }

    /// Uploads the nodes of a lease as if they were rendered one after the other from `start` to `due`.
    async fn upload_all(&self, lease: &Lease, start: Instant, due: Instant) -> Result<(), WorkerFailure> {
        let count = lease.nodes.len().max(1);
        let each = (due - start).div_f64(count as f64);
        let rendered = |time: Instant| match each.is_zero() {
            true => count,
            false => ((time - start).div_duration_f64(each).round() as usize).min(count),
        };
        let linger = Duration::from_millis(lease.upload_linger_ms.into());
        let (mut next, mut outstanding) = (0, 0);
        while next < lease.nodes.len() {
            let upload_at = due.min(start + each.mul_f64((next + 1) as f64) + linger);
            tokio::time::sleep_until(upload_at).await;
            let end = rendered(upload_at).max(next + 1);
            for nodes in lease.nodes[next..end].chunks(self.noise.nodes_per_parcel()) {
                match self.upload(lease, nodes).await? {
                    Some(left) => outstanding = left,
                    None => return Ok(()),
                }
            }
            next = end;
        }
        if outstanding > 0 {
            let body = LeaseReturn { token: lease.token, failure: None };
            match self.until_answered(|| self.client.return_lease(lease.id, &body)).await {
                // Another worker has taken over the rest, or the job has ended.
                Err(failure) if !is_lease_over(&failure) => return Err(failure.into()),
                Ok(()) | Err(_) => {}
            }
        }
        Ok(())
    }

    /// Uploads nodes of a lease. Returns how many nodes of it are still wanted, or `None` when the lease has ended.
    async fn upload(&self, lease: &Lease, nodes: &[NodeAddress]) -> Result<Option<u32>, WorkerFailure> {
        let start = Instant::now();
        let body = Bytes::from(self.noise.partial(lease.job.to_string(), lease.scene_hash.clone(), nodes)?);
        let sent = self.tally.sends(start.elapsed());
        let (bytes, core_ms) = (body.len() as u64, PASS_CORE_MS.saturating_mul(nodes.len() as u64));
        let upload = PartialUpload { lease: lease.id, token: lease.token, core_ms, body };
        let start = Instant::now();
        match self.until_answered(|| self.client.upload_partial(upload.clone())).await {
            Ok(answer) => {
                self.tally.answered(sent, lease.job, start.elapsed(), bytes, &answer);
                Ok(Some(answer.outstanding))
            }
            Err(failure) if is_lease_over(&failure) => {
                self.tally.note_late(nodes);
                Ok(None)
            }
            Err(failure) => Err(failure.into()),
        }
    }

    /// Renews a lease for as long as it is polled. The upload fails when the lease has ended.
    async fn renew(&self, lease: &Lease) {
        let mut expires_in_ms = lease.expires_in_ms;
        loop {
            let term = Duration::from_millis(u64::try_from(expires_in_ms).unwrap_or(0));
            tokio::time::sleep((term / 3).max(Duration::from_millis(50))).await;
            match self.until_answered(|| self.client.renew_lease(lease.id, lease.token)).await {
                Ok(renewal) => expires_in_ms = renewal.expires_in_ms,
                Err(_) => std::future::pending().await,
            }
        }
    }

    async fn heartbeats(&self, worker: WorkerId) {
        loop {
            tokio::time::sleep(HEARTBEAT_PERIOD).await;
            // The next heartbeat follows soon.
            if self.client.heartbeat(worker, &WorkerActivity::default()).await.is_err() {
                self.tally.repeats();
            }
        }
    }

    /// Repeats a call until it has a final answer, with the pauses of a real worker.
    async fn until_answered<T, Answer>(&self, call: impl FnMut() -> Answer) -> Result<T, ClientError>
    where
        Answer: Future<Output = Result<T, ClientError>>,
    {
        let pauses = ExponentialBuilder::default()
            .with_min_delay(Duration::from_millis(100))
            .with_max_delay(Duration::from_secs(3))
            .with_jitter()
            .without_max_times();
        call.retry(pauses)
            .when(ClientError::is_transient)
            .adjust(|error, pause| pause.map(|pause| error.pause(pause)))
            .notify(|_, _| self.tally.repeats())
            .await
    }
}

/// Whether a lease has ended.
fn is_lease_over(failure: &ClientError) -> bool {
    let is_over =
        |code| matches!(code, ProblemCode::LeaseExpired | ProblemCode::LeaseReturned | ProblemCode::JobNotRunning);
    failure.problem().is_some_and(|problem| is_over(problem.code))
}
