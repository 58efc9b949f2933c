//! A simulated worker: it speaks to the coordinator as a real one does, and brings noise.
//!
//! It registers, sends signs of life, waits for leases, renews them while it holds them, uploads nodes as the real one does, as often as its
//! lease says, those that would have been rendered by then, and repeats calls that fail in a way that may pass. Two things are left out: it does not fetch the scene,
//! which real ones do once for each job; and it claims only after its upload was answered, where real ones claim meanwhile.

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

/// How long the coordinator may let a claim wait for work, as real workers do, milliseconds.
const LONG_POLL_MS: u32 = 15_000;

/// Time between signs of life, as real workers send them.
const HEARTBEAT_PERIOD: Duration = Duration::from_secs(5);

/// What a pass of a tile is said to have taken, milliseconds of one core: as long as the work of a whole lease should take, so that
/// the coordinator cuts no larger nodes.
const PASS_CORE_MS: u64 = 10_000;

/// What the workers of a load have in common.
#[derive(Debug)]
pub(crate) struct Load {
    /// The connections; each call that is under way has one of its own.
    pub(crate) client: Client,
    /// What they bring.
    pub(crate) noise: Noise,
    /// What they count.
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
        let registration = WorkerRegistration { name, cores: 1, build: BUILD.to_owned(), probe_digest: None };
        Ok(self.until_answered(|| self.client.register_worker(&registration)).await?.id)
    }

    /// Works as a registered worker for as long as it is polled, from `start` on. Ends only for a failure, which is noted.
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
                    // Who is late does not catch up: a farm that cannot follow is offered less.
                    let now = Instant::now();
                    turn = now.max(turn + self.cycle.unwrap_or_default());
                    tokio::select! {
                        worked_off = self.work_off(&lease, now, turn) => {
                            if let Err(failure) = worked_off {
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
            None => self.tally.claimed_in_vain(asked, start.elapsed()),
        }
        Ok(lease)
    }

    /// Uploads the nodes of a lease as if one after the other had been rendered from `start` to `due`.
    async fn work_off(&self, lease: &Lease, start: Instant, due: Instant) -> Result<(), WorkerFailure> {
        let count = lease.nodes.len().max(1);
        let each = (due - start).div_f64(count as f64);
        let rendered = |time: Instant| match each.is_zero() {
            true => count,
            false => ((time - start).div_duration_f64(each).round() as usize).min(count),
        };
        let gathering_time = Duration::from_millis(lease.gather_ms.into());
        let (mut next, mut outstanding) = (0, 0);
        while next < lease.nodes.len() {
            let hand_in = due.min(start + each.mul_f64((next + 1) as f64) + gathering_time);
            tokio::time::sleep_until(hand_in).await;
            let end = rendered(hand_in).max(next + 1);
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
                // Others have taken the rest over, and the job may have ended.
                Err(failure) if !is_lease_over(&failure) => return Err(failure.into()),
                Ok(()) | Err(_) => {}
            }
        }
        Ok(())
    }

    /// Uploads nodes of a lease, and answers how many of it are still wanted; `None` when it is over.
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
                self.tally.came_late(nodes);
                Ok(None)
            }
            Err(failure) => Err(failure.into()),
        }
    }

    /// Renews a lease for as long as it is polled. When that is over, the upload hears of it.
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
            // The next one is due soon.
            if self.client.heartbeat(worker, &WorkerActivity::default()).await.is_err() {
                self.tally.repeats();
            }
        }
    }

    /// Repeats a call until it is answered for good, with the pauses of a real worker.
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

/// Whether the nodes of a lease are somebody else's by now.
fn is_lease_over(failure: &ClientError) -> bool {
    let is_over =
        |code| matches!(code, ProblemCode::LeaseExpired | ProblemCode::LeaseReturned | ProblemCode::JobNotRunning);
    failure.problem().is_some_and(|problem| is_over(problem.code))
}
