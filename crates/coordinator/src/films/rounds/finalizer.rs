//! The round finalizer: records rounds as they become complete, and merges the nodes that they leave behind.
//!
//! It works off the path of requests: a worker that uploads a node waits for its acceptance only. One task at a time
//! [visits](super::visits) a job, so that no job waits for another's large frame. Work that needs much memory runs in
//! turn. When a round has been recorded, the nodes that only it needed apart are [merged](super::merging). Of several
//! coordinators, one at a time works on the film of a job, under a [lease](super::film_lease). When that coordinator
//! dies, another takes over.

use std::sync::Arc;
use std::time::Duration;

use clerestory_api::{ConvergencePoint, JobId, JobState};
use clerestory_film::PILOT_ROUND;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

use super::film_lease::{FilmLeases, RenewedLease, TERM_MS};
use super::film_state::{FilmState, FilmVersion};
use super::merging::Merger;
use crate::clock::Clock;
use crate::films::FilmError;
use crate::films::convergence::{FrameMetrics, Reference};
use crate::films::pass_sharing::PassSharing;
use crate::films::repair::Repair;
use crate::model::{CompleteRound, Ending, FilmLease, JobRecord};
use crate::store::{Store, StoreError};
use crate::watch::notifications::{Notification, Notifications};
use crate::watch::rates::Rates;

/// Jobs whose rounds are recorded at the same time.
const CONCURRENT_JOBS: usize = 16;

/// Records rounds.
#[derive(Debug)]
pub(crate) struct RoundFinalizer {
    store: Store,
    clock: Clock,
    leases: FilmLeases,
    metrics: Arc<FrameMetrics>,
    merger: Merger,
    sharing: PassSharing,
    repair: Arc<Repair>,
    rates: Arc<Rates>,
    notifications: Arc<Notifications>,
    stopping: CancellationToken,
    /// Permits for recording the rounds of a job.
    turns: Semaphore,
}

/// The parts that a [`RoundFinalizer`] works with.
#[derive(Debug)]
pub(crate) struct FinalizerParts {
    /// Leases films.
    pub(crate) leases: FilmLeases,
    /// Measures rounds.
    pub(crate) metrics: Arc<FrameMetrics>,
    /// Merges nodes.
    pub(crate) merger: Merger,
    /// Shares out passes.
    pub(crate) sharing: PassSharing,
    /// Repairs films that cannot be read.
    pub(crate) repair: Arc<Repair>,
    /// Rates of jobs that have not ended.
    pub(crate) rates: Arc<Rates>,
}

impl RoundFinalizer {
    /// A finalizer of the rounds in a store.
    pub(crate) fn new(
        store: Store,
        clock: Clock,
        notifications: Arc<Notifications>,
        stopping: CancellationToken,
        parts: FinalizerParts,
    ) -> Self {
        let FinalizerParts { leases, metrics, merger, sharing, repair, rates } = parts;
        let turns = Semaphore::new(CONCURRENT_JOBS);
        Self { store, clock, leases, metrics, merger, sharing, repair, rates, notifications, stopping, turns }
    }

    /// Cancelled when the coordinator stops.
    pub(super) fn stopping(&self) -> &CancellationToken {
        &self.stopping
    }

    /// Gives all film leases of this coordinator back.
    pub(super) async fn release_leases(&self) -> Result<(), StoreError> {
        self.leases.release_all().await
    }

    /// Visits a job again after a pause.
    pub(super) fn wake_after(&self, job: JobId, pause: Duration) {
        let (notifications, stopping) = (Arc::clone(&self.notifications), self.stopping.clone());
        tokio::spawn(async move {
            if stopping.run_until_cancelled(tokio::time::sleep(pause)).await.is_some() {
                notifications.wake_finalizer(job);
            }
        });
    }

    /// Visits a job, and answers the state for the next visit, or `None` when the job has ended.
    pub(super) async fn visit(&self, job: JobId, mut state: FilmState) -> Option<FilmState> {
        let mut is_suspected = false;
        loop {
            let mut version = None;
            let error = match self.advance(job, &mut state, &mut version).await {
                Ok(true) => return None,
                Ok(false) => {
                    state.failures = 0;
                    return Some(state);
                }
                Err(error) => error,
            };
            let mut is_damaged = false;
            if error.is_damage() {
                // Another coordinator may have worked on the film in between, or nodes may have been removed.
                is_damaged = self.is_unchanged(job, &mut state, version).await.unwrap_or(false);
            } else {
                match self.repair.repair(job, &error).await {
                    Ok(true) => continue,
                    Ok(false) => {}
                    Err(error) => tracing::error!(%job, %error, "a film that cannot be read could not be repaired"),
                }
            }
            if is_damaged && !is_suspected {
                is_suspected = true;
                continue;
            }
            tracing::error!(
                %job,
                error = &error as &dyn std::error::Error,
                is_damaged,
                "finalizing the rounds of a film failed"
            );
            if !(is_damaged && self.fail_job(job, &error).await) {
                self.wake_after(job, state.back_off());
            }
            return Some(state);
        }
    }

    /// Until when the film of a job is leased to this coordinator. A film that another coordinator holds is visited
    /// again when that lease ends.
    async fn acquire_lease(&self, job: JobId, state: &mut FilmState) -> Result<Option<i64>, StoreError> {
        let now_ms = self.clock.now_ms();
        match state.lease {
            // It is renewed after half a term, so that few calls write.
            Some((FilmLease::Held, until_ms)) if now_ms < until_ms - TERM_MS / 2 => return Ok(Some(until_ms)),
            Some((FilmLease::HeldElsewhere { .. }, until_ms)) if now_ms < until_ms => return Ok(None),
            _ => {}
        }
        let until_ms = now_ms.saturating_add(TERM_MS);
        let lease = self.leases.acquire(job, now_ms, until_ms).await?;
        let until_ms = match lease {
            FilmLease::Held => until_ms,
            FilmLease::HeldElsewhere { until_ms } => {
                // Clocks differ: neither at once again, nor after more than a term.
                let until_ms = until_ms.clamp(now_ms + TERM_MS / 20, now_ms + TERM_MS);
                let left = Duration::from_millis(u64::try_from(until_ms - now_ms).unwrap_or(0));
                self.wake_after(job, left);
                until_ms
            }
        };
        state.lease = Some((lease, until_ms));
        Ok((lease == FilmLease::Held).then_some(until_ms))
    }

    /// Whether a film still has the version that was read, and is leased to this coordinator.
    pub(super) async fn is_unchanged(
        &self,
        job: JobId,
        state: &mut FilmState,
        version: Option<FilmVersion>,
    ) -> Result<bool, StoreError> {
        // The lease is asked for anew: another coordinator may hold it by now.
        state.lease = None;
        let is_held = self.acquire_lease(job, state).await?.is_some();
        Ok(is_held && self.store.job(job).await?.as_ref().map(FilmVersion::of) == version)
    }

    /// Ends a job whose rows make no film, so that it can never be finished. `false` when that could not be done now.
    async fn fail_job(&self, job: JobId, error: &FilmError) -> bool {
        let ending = Ending::Failed(format!("the stored film is damaged: {error}"));
        match self.store.end_job(job, ending, self.clock.now_ms()).await {
            Ok(has_ended) => {
                if has_ended {
                    self.notifications.publish(Notification::Job(job));
                }
                true
            }
            Err(error) => {
                tracing::error!(%job, %error, "the job could not be marked as failed");
                false
            }
        }
    }

    /// Records every complete round of a job. Answers whether the job has ended and nothing is left to do. `version` is
    /// the version of the film that was read last.
    async fn advance(
        &self,
        job: JobId,
        state: &mut FilmState,
        version: &mut Option<FilmVersion>,
    ) -> Result<bool, FilmError> {
        let (mut waited, mut lease) = (None, None::<RenewedLease>);
        while !self.stopping.is_cancelled() {
            let Some(record) = self.store.job(job).await? else { return Ok(true) };
            if record.reopened_ms.is_some() {
                self.close_reopened(&record).await?;
                return Ok(false);
            }
            // A job that was cancelled or ran out of time may have completed a round before. No round of a failed job
            // is recorded.
            let complete = match record.state {
                JobState::Failed => None,
                _ => self.store.complete_round(&record).await?,
            };
            let Some(complete) = complete else {
                if record.state.is_final() {
                    self.settle(&record).await?;
                }
                return Ok(record.state.is_final());
            };
            let _turn = match waited.take() {
                Some(turn) => turn,
                None => match self.turns.try_acquire() {
                    Ok(turn) => turn,
                    Err(_) => {
                        // Another coordinator may have time for it meanwhile, and the record is old when the turn
                        // comes.
                        lease = None;
                        waited = self.stopping.run_until_cancelled(self.turns.acquire()).await.and_then(Result::ok);
                        continue;
                    }
                },
            };
            if lease.as_ref().is_some_and(RenewedLease::is_lost) {
                (lease, state.lease) = (None, None);
            }
            let lease = match &mut lease {
                Some(lease) => lease,
                None => {
                    let Some(until_ms) = self.acquire_lease(job, state).await? else { return Ok(false) };
                    lease.insert(self.leases.renewing(job, until_ms))
                }
            };
            *version = Some(FilmVersion::of(&record));
            if complete.round == PILOT_ROUND && record.adaptive && record.shared_samples.is_none() {
                let decided = lease.while_held(self.sharing.decide(&record)).await;
                let Some(shares) = decided.transpose()? else { continue };
                self.sharing.apply(&record, shares).await?;
                continue;
            }
            let measured = lease.while_held(self.measure(&record, &complete, &mut state.reference)).await;
            let Some(points) = measured.transpose()? else { continue };
            // A coordinator that has recorded the round merges as well.
            if self.record_round(&record, &complete, points).await? {
                *version = Some(FilmVersion { rounds: record.rounds + 1, ..FilmVersion::of(&record) });
                self.merger.merge(&record, complete.round + 1).await?;
            }
        }
        Ok(false)
    }

    /// Ends a reopened job that has its lost nodes again.
    async fn close_reopened(&self, job: &JobRecord) -> Result<(), FilmError> {
        if self.store.close_reopened(job.id, self.clock.now_ms()).await? {
            tracing::info!(job = %job.id, "job done again: the lost nodes are there");
            self.notifications.publish(Notification::Job(job.id));
            self.merger.merge(job, job.rounds).await?;
        }
        Ok(())
    }

    /// Frees what only a job that has not ended needs.
    async fn settle(&self, job: &JobRecord) -> Result<(), FilmError> {
        if job.adaptive {
            self.sharing.discard_pilot(job).await?;
        }
        self.rates.remove(job.id);
        Ok(())
    }

    /// Measures the frames of a job at a complete round.
    async fn measure(
        &self,
        job: &JobRecord,
        complete: &CompleteRound,
        reference: &mut Option<Reference>,
    ) -> Result<Vec<ConvergencePoint>, FilmError> {
        if let Some(hash) = job.reference
            && reference.is_none()
        {
            *reference = Some(self.metrics.reference(job.grid, hash).await?);
        }
        let tile_passes = self.store.tile_passes(job).await?;
        let mut points = Vec::new();
        for frame in 0..job.frames {
            points.push(self.metrics.point(job, complete, frame, &tile_passes, reference.as_ref()).await?);
        }
        Ok(points)
    }

    /// Records a round. `false` when that was done before.
    async fn record_round(
        &self,
        job: &JobRecord,
        complete: &CompleteRound,
        points: Vec<ConvergencePoint>,
    ) -> Result<bool, FilmError> {
        let Some(recorded) = self.store.record_round(job, points, self.clock.now_ms()).await? else {
            return Ok(false);
        };
        tracing::info!(job = %job.id, round = complete.round, passes = complete.passes, "round complete");
        if let Some(reason) = recorded.stopped_by {
            tracing::info!(job = %job.id, reason = reason.name(), "job done");
        }
        self.notifications.publish(Notification::Job(job.id));
        self.merger.release(recorded.discarded).await;
        Ok(true)
    }
}
