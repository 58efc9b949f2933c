//! The keeper of the film: records rounds as they become complete, and merges what they leave behind.
//!
//! It does this off the path of requests: whoever brings a node waits for its acceptance only. Each job is looked at by one task at a time, so
//! that none waits for another's large frame; what takes much memory, the tasks do in turn. What a round needed apart, and no later one does, is
//! [merged](merging) when it has been recorded. Of several coordinators, one at a time keeps the film of a job ([`Claim`]); when it dies, another does.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clerestory_api::{ConvergencePoint, JobId, JobState};
use clerestory_film::PILOT_ROUND;
use tokio::sync::{Semaphore, mpsc};
use tokio::task::JoinSet;

use crate::farm::Farm;
use crate::films::convergence::{self, Reference};
use crate::films::repair::repair;
use crate::films::rounds::film_lease::{Claim, TERM_MS};
use crate::films::rounds::merging::merge;
use crate::films::{FilmError, pass_sharing as adaptive};
use crate::model::{CompleteRound, Ending, FilmLease, JobRecord};
use crate::store::StoreError;
use crate::watch::notifications::News;

/// Jobs whose rounds are recorded at the same time.
const ADVANCING: usize = 16;

/// Pause before a job is looked at again after a failure that may pass, such as a full disk. It doubles with each.
const RETRY: Duration = Duration::from_millis(250);

/// Longest such pause.
const LONGEST_RETRY: Duration = Duration::from_secs(5);

/// Keeps the film until the coordinator stops.
pub(crate) async fn run(farm: Arc<Farm>, mut grown: mpsc::UnboundedReceiver<JobId>) {
    let turns = Arc::new(Semaphore::new(ADVANCING));
    let mut keeper = Keeper { farm, turns, films: BTreeMap::new(), looks: JoinSet::new() };
    let mut waiting = Vec::new();
    loop {
        tokio::select! {
            () = keeper.farm.stopping.cancelled() => break,
            count = grown.recv_many(&mut waiting, 1024) => {
                if count == 0 {
                    break;
                }
                let jobs: BTreeSet<JobId> = waiting.drain(..).collect();
                for job in jobs {
                    keeper.look(job);
                }
            }
            Some(looked) = keeper.looks.join_next() => match looked {
                Ok((job, kept)) => keeper.has_looked(job, kept),
                Err(error) => tracing::error!(%error, "a look at a film failed"),
            },
        }
    }
    while keeper.looks.join_next().await.is_some() {}
    if let Err(error) = keeper.farm.store.release_film_leases(keeper.farm.coordinator).await {
        tracing::warn!(%error, "films that were kept here are kept by nobody for some seconds");
    }
}

/// Which films are looked at.
struct Keeper {
    farm: Arc<Farm>,
    /// Permits for recording the rounds of a job.
    turns: Arc<Semaphore>,
    films: BTreeMap<JobId, Film>,
    looks: JoinSet<(JobId, Option<Kept>)>,
}

/// The film of a job.
enum Film {
    /// Nobody looks at it.
    Idle(Kept),
    /// It is being looked at.
    Looked {
        /// Whether there have been news of it since.
        again: bool,
    },
}

impl Keeper {
    /// Looks at a job, at once or when the look at it that is under way has ended.
    fn look(&mut self, job: JobId) {
        let kept = match self.films.get_mut(&job) {
            Some(Film::Looked { again }) => {
                *again = true;
                return;
            }
            Some(Film::Idle(kept)) if kept.rests() => return,
            Some(Film::Idle(kept)) => std::mem::take(kept),
            None => Kept::default(),
        };
        self.films.insert(job, Film::Looked { again: false });
        let (farm, turns) = (Arc::clone(&self.farm), Arc::clone(&self.turns));
        self.looks.spawn(async move {
            let looking = (Arc::clone(&farm), turns);
            // In a task of its own: a look that panics is one that failed.
            let looked = tokio::spawn(async move { look(&looking.0, &looking.1, job, kept).await });
            let kept = looked.await.unwrap_or_else(|error| {
                tracing::error!(%job, %error, "keeping the film failed");
                let mut kept = Kept { failures: u32::MAX, ..Kept::default() };
                kept.rest(&farm, job);
                Some(kept)
            });
            (job, kept)
        });
    }

    /// Notes what a look has left; nothing when the job has ended.
    fn has_looked(&mut self, job: JobId, kept: Option<Kept>) {
        let looked = self.films.remove(&job);
        if let Some(kept) = kept {
            self.films.insert(job, Film::Idle(kept));
        }
        if matches!(looked, Some(Film::Looked { again: true })) {
            self.look(job);
        }
    }
}

/// What is known of a job from one look to the next.
#[derive(Debug, Default)]
pub(super) struct Kept {
    /// Whose the film is, until when.
    claim: Option<(FilmLease, i64)>,
    reference: Option<Reference>,
    /// Failures since the last success.
    failures: u32,
    /// A job that has just failed is looked at again then.
    rests_until: Option<Instant>,
}

impl Kept {
    fn rests(&self) -> bool {
        self.rests_until.is_some_and(|until| Instant::now() < until)
    }

    /// Leaves a job alone for a while after a failure.
    fn rest(&mut self, farm: &Farm, job: JobId) {
        let pause = RETRY.saturating_mul(1 << self.failures.min(5)).min(LONGEST_RETRY);
        self.failures = self.failures.saturating_add(1);
        self.rests_until = Some(Instant::now() + pause);
        look_again(farm, job, pause);
    }

    /// Until when the film of a job is kept here. Where it is not, the job is looked at again when the other's claim ends.
    async fn hold(&mut self, farm: &Farm, job: JobId) -> Result<Option<i64>, StoreError> {
        let now_ms = farm.config.clock.now_ms();
        match self.claim {
            // Renewed when half of the term is over, so that few calls write.
            Some((FilmLease::Held, until_ms)) if now_ms < until_ms - TERM_MS / 2 => return Ok(Some(until_ms)),
            Some((FilmLease::HeldElsewhere { .. }, until_ms)) if now_ms < until_ms => return Ok(None),
            _ => {}
        }
        let until_ms = now_ms.saturating_add(TERM_MS);
        let keeping = farm.store.acquire_film_lease(job, farm.coordinator, now_ms, until_ms).await?;
        let until_ms = match keeping {
            FilmLease::Held => until_ms,
            FilmLease::HeldElsewhere { until_ms } => {
                // Clocks differ: not at once again, and not after a term.
                let until_ms = until_ms.clamp(now_ms + TERM_MS / 20, now_ms + TERM_MS);
                let left = Duration::from_millis(u64::try_from(until_ms - now_ms).unwrap_or(0));
                look_again(farm, job, left);
                until_ms
            }
        };
        self.claim = Some((keeping, until_ms));
        Ok((keeping == FilmLease::Held).then_some(until_ms))
    }
}

/// Looks at a job again after some time.
fn look_again(farm: &Farm, job: JobId, after: Duration) {
    let (grown, stopping) = (farm.keeper(), farm.stopping.clone());
    tokio::spawn(async move {
        if stopping.run_until_cancelled(tokio::time::sleep(after)).await.is_some() {
            // The keeper is gone only when the coordinator stops.
            let _ = grown.send(job);
        }
    });
}

/// How far a film is; whatever else about it changes, what was read of it belongs together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FilmVersion {
    pub(super) rounds: u32,
    pub(super) redone_nodes: u64,
    pub(super) shared_samples: Option<u64>,
}

impl FilmVersion {
    pub(super) fn of(job: &JobRecord) -> Self {
        Self { rounds: job.rounds, redone_nodes: job.redone_nodes, shared_samples: job.shared_samples }
    }
}

/// Looks at a job, and answers what is to be known the next time; nothing when the job has ended.
async fn look(farm: &Arc<Farm>, turns: &Semaphore, job: JobId, mut kept: Kept) -> Option<Kept> {
    let mut is_suspected = false;
    loop {
        let mut version = None;
        let error = match advance(farm, turns, job, &mut kept, &mut version).await {
            Ok(true) => return None,
            Ok(false) => {
                kept.failures = 0;
                return Some(kept);
            }
            Err(error) => error,
        };
        let mut is_damaged = false;
        if error.is_damage() {
            // Another coordinator that keeps the film as well may have gone on in between, or nodes may have been taken out.
            is_damaged = is_settled(farm, job, &mut kept, version).await.unwrap_or(false);
        } else {
            match repair(farm, job, &error).await {
                Ok(true) => continue,
                Ok(false) => {}
                Err(error) => tracing::error!(%job, %error, "a film that cannot be read could not be repaired"),
            }
        }
        if is_damaged && !is_suspected {
            is_suspected = true;
            continue;
        }
        tracing::error!(%job, error = &error as &dyn std::error::Error, is_damaged, "keeping the film failed");
        if !(is_damaged && has_failed(farm, job, &error).await) {
            kept.rest(farm, job);
        }
        return Some(kept);
    }
}

/// Whether a film is where it was when it was read, and is kept here.
pub(super) async fn is_settled(
    farm: &Farm,
    job: JobId,
    kept: &mut Kept,
    version: Option<FilmVersion>,
) -> Result<bool, StoreError> {
    // Asked anew: another may have it by now.
    kept.claim = None;
    Ok(kept.hold(farm, job).await?.is_some() && farm.store.job(job).await?.as_ref().map(FilmVersion::of) == version)
}

/// Ends a job whose rows make no film, which can never be finished. `false` when that could not be done now.
async fn has_failed(farm: &Farm, job: JobId, error: &FilmError) -> bool {
    let ending = Ending::Failed(format!("the stored film is damaged: {error}"));
    match farm.store.end_job(job, ending, farm.config.clock.now_ms()).await {
        Ok(has_ended) => {
            if has_ended {
                farm.tell(News::Job(job));
            }
            true
        }
        Err(error) => {
            tracing::error!(%job, %error, "the job could not be marked as failed");
            false
        }
    }
}

/// Records every complete round of a job. Answers whether the job has ended and there is nothing left to do; `stand` is how far the film was when it
/// was read last.
async fn advance(
    farm: &Arc<Farm>,
    turns: &Semaphore,
    job: JobId,
    kept: &mut Kept,
    version: &mut Option<FilmVersion>,
) -> Result<bool, FilmError> {
    let (mut waited, mut claim) = (None, None::<Claim>);
    while !farm.stopping.is_cancelled() {
        let Some(record) = farm.store.job(job).await? else { return Ok(true) };
        if record.reopened_ms.is_some() {
            if farm.store.close_reopened(job, farm.config.clock.now_ms()).await? {
                tracing::info!(%job, "job done again: the lost nodes are there");
                farm.tell(News::Job(job));
                merge(farm, &record, record.rounds).await?;
            }
            return Ok(false);
        }
        // A job that was cancelled or ran out of time may have completed a round just before; no round of a failed one is recorded.
        let complete = match record.state {
            JobState::Failed => None,
            _ => farm.store.complete_round(&record).await?,
        };
        let Some(complete) = complete else {
            if record.state.is_final() {
                if record.adaptive {
                    adaptive::discard_pilot(farm, &record).await?;
                }
                farm.rates.remove(job);
            }
            return Ok(record.state.is_final());
        };
        let _turn = match waited.take() {
            Some(turn) => turn,
            None => match turns.try_acquire() {
                Ok(turn) => turn,
                Err(_) => {
                    // Another coordinator may have time for it meanwhile. And what was read is old when the turn has come.
                    claim = None;
                    waited = farm.stopping.run_until_cancelled(turns.acquire()).await.and_then(Result::ok);
                    continue;
                }
            },
        };
        if claim.as_ref().is_some_and(Claim::is_lost) {
            (claim, kept.claim) = (None, None);
        }
        let claim = match &mut claim {
            Some(claim) => claim,
            None => {
                let Some(until_ms) = kept.hold(farm, job).await? else { return Ok(false) };
                claim.insert(Claim::renewed(farm, job, until_ms))
            }
        };
        *version = Some(FilmVersion::of(&record));
        if complete.round == PILOT_ROUND && record.adaptive && record.shared_samples.is_none() {
            let decided = claim.while_held(adaptive::decide(farm, &record)).await;
            let Some(shares) = decided.transpose()? else { continue };
            adaptive::share_out(farm, &record, shares).await?;
            continue;
        }
        let measured = claim.while_held(measure(farm, &record, &complete, &mut kept.reference)).await;
        let Some(points) = measured.transpose()? else { continue };
        // Where another has recorded it, that one merges too.
        if record_round(farm, &record, &complete, points).await? {
            *version = Some(FilmVersion { rounds: record.rounds + 1, ..FilmVersion::of(&record) });
            merge(farm, &record, complete.round + 1).await?;
        }
    }
    Ok(false)
}

/// Measures the frames of a job at a complete round.
async fn measure(
    farm: &Farm,
    job: &JobRecord,
    complete: &CompleteRound,
    reference: &mut Option<Reference>,
) -> Result<Vec<ConvergencePoint>, FilmError> {
    if let Some(hash) = job.reference
        && reference.is_none()
    {
        *reference = Some(Reference::measure(farm, job.grid, hash).await?);
    }
    let tile_passes = farm.store.tile_passes(job).await?;
    let mut points = Vec::new();
    for frame in 0..job.frames {
        points.push(convergence::point(farm, job, complete, frame, &tile_passes, reference.as_ref()).await?);
    }
    Ok(points)
}

/// Records a round; `false` when that has been done.
async fn record_round(
    farm: &Farm,
    job: &JobRecord,
    complete: &CompleteRound,
    points: Vec<ConvergencePoint>,
) -> Result<bool, FilmError> {
    let recorded = farm.store.record_round(job, points, farm.config.clock.now_ms()).await?;
    let is_new = recorded.is_some();
    if let Some(recorded) = recorded {
        tracing::info!(job = %job.id, round = complete.round, passes = complete.passes, "round complete");
        if let Some(reason) = recorded.stopped_by {
            tracing::info!(job = %job.id, reason = reason.name(), "job done");
        }
        farm.tell(News::Job(job.id));
        farm.let_go(recorded.discarded).await;
    }
    Ok(is_new)
}
