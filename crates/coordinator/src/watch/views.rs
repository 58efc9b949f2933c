//! Views: jobs and workers as the API shows them.

use std::collections::BTreeSet;
use std::sync::Arc;

use clerestory_api::{ConvergencePoint, JobId, JobState, JobView, NamedWorker, SceneRefusal, WorkerId, WorkerView};
use clerestory_film::counters::Counters;

use crate::clock::Clock;
use crate::model::{self, JobRecord, round_error};
use crate::store::{Store, StoreError, WorkerError};
use crate::watch::liveness::Liveness;
use crate::watch::rates::Rates;

/// How long event streams show workers that have ended.
const ENDING_SHOWN_MS: i64 = 60 * 1000;

/// Reads jobs and workers for the API.
#[derive(Debug)]
pub(crate) struct Views {
    store: Store,
    clock: Clock,
    rates: Arc<Rates>,
    liveness: Arc<Liveness>,
}

impl Views {
    /// Views of a store.
    pub(crate) fn new(store: Store, clock: Clock, rates: Arc<Rates>, liveness: Arc<Liveness>) -> Self {
        Self { store, clock, rates, liveness }
    }

    /// The present state of a job.
    pub(crate) async fn job(&self, job: JobRecord) -> Result<JobView, StoreError> {
        let now_ms = self.clock.now_ms();
        let latest = match job.rounds.checked_sub(1) {
            Some(round) => self.store.convergence_point(job.id, 0, round).await?,
            None => None,
        };
        let is_running = !job.state.is_final();
        let started_ms = job.started_ms.filter(|_| is_running);
        let samples_per_second = started_ms.and_then(|started_ms| self.rates.rate(job.id, started_ms, now_ms));
        let expected_samples = expected_samples(&job, latest.as_ref());
        let is_end_known = job.targets.is_end_known(job.samples_per_block, latest.as_ref().map(round_error).as_ref());
        let remaining_ms = samples_per_second.and_then(|rate| {
            let by_rate = |samples: u64| (samples.saturating_sub(job.samples) as f64 / rate * 1000.0) as i64;
            let by_limit = started_ms.zip(limit_ms(&job)).map(|(started_ms, limit_ms)| {
                // The first pass is rendered in any case.
                let first_pass_ms = if job.rounds == 0 { by_rate(first_pass_samples(&job)) } else { 0 };
                started_ms.saturating_add(limit_ms).saturating_sub(now_ms).max(first_pass_ms)
            });
            let by_samples = is_end_known.then(|| by_rate(expected_samples));
            by_limit.into_iter().chain(by_samples).min()
        });
        let building_workers =
            if is_running { self.store.building_workers(job.id, self.liveness.silent_before_ms()).await? } else { 0 };
        let waits_for_build = self.store.build_wait(&job, self.liveness.silent_before_ms()).await?;
        let (progress, total_samples) = (progress(&job, expected_samples, now_ms), job.total_samples());
        let built = job.built_scene;
        Ok(JobView {
            building_workers,
            waits_for_build,
            scene_refusal: job.scene_refusal.filter(|_| is_running).map(scene_refusal),
            progress,
            total_samples,
            tiles: job.grid.camera_tiles(),
            light_plane: job.grid.has_light_plane,
            caustic: job.grid.has_caustic,
            width: job.grid.width,
            height: job.grid.height,
            tile_size: job.grid.tile_size,
            id: job.id,
            name: job.name,
            state: job.state,
            stopped_by: job.stopped_by.filter(|_| job.state == JobState::Done),
            failure: job.failure,
            failed_node: job.failed_node,
            hold: job.hold,
            priority: job.priority,
            integrator: job.integrator,
            scene_hash: job.scene_hash,
            missing_light: job.missing_light,
            left_to_chance: built.as_ref().map(|scene| scene.left_to_chance.clone()),
            chosen_methods: built.as_ref().map(|scene| scene.chosen_methods.clone()),
            import_notes: built.map(|scene| scene.import_notes),
            assumptions: job.assumptions,
            frames: job.frames,
            samples_per_pass: job.samples_per_pass,
            passes: job.passes,
            complete_passes: job.complete_passes,
            rounds: job.rounds,
            samples: job.samples,
            samples_per_second,
            remaining_ms,
            core_ms: job.core_ms,
            redone_nodes: job.redone_nodes,
            counters: counters(job.counters),
            time_limit_ms: job.time_limit_ms,
            target_mse: job.targets.mse,
            target_estimated_mse: job.targets.estimated_mse,
            adaptive: job.adaptive,
            reference: job.reference,
            latest,
            created_ms: job.created_ms,
            started_ms: job.started_ms,
            finished_ms: job.finished_ms,
        })
    }

    /// All jobs, newest first.
    pub(crate) async fn jobs(&self) -> Result<Vec<JobView>, StoreError> {
        let mut views = Vec::new();
        for record in self.store.jobs().await? {
            views.push(self.job(record).await?);
        }
        Ok(views)
    }

    /// All workers that have not ended, in order of registration.
    pub(crate) async fn workers(&self) -> Result<Vec<WorkerView>, StoreError> {
        self.store.workers(i64::MAX, self.liveness.silent_before_ms()).await
    }

    /// The same, with those that ended within the last minute.
    pub(crate) async fn workers_and_ended(&self) -> Result<Vec<WorkerView>, StoreError> {
        let ended_since_ms = self.clock.now_ms() - ENDING_SHOWN_MS;
        self.store.workers(ended_since_ms, self.liveness.silent_before_ms()).await
    }

    /// The jobs that wait for a worker of another build.
    pub(crate) async fn jobs_that_wait_for_a_build(&self) -> Result<BTreeSet<JobId>, StoreError> {
        self.store.jobs_that_wait_for_a_build(self.liveness.silent_before_ms()).await
    }

    /// One worker.
    pub(crate) async fn worker(&self, worker: WorkerId) -> Result<WorkerView, WorkerError> {
        self.store.worker(worker, self.liveness.silent_before_ms()).await
    }
}

/// Samples in the first pass of a job.
fn first_pass_samples(job: &JobRecord) -> u64 {
    job.pass_samples()
}

fn scene_refusal(refusal: model::SceneRefusal) -> SceneRefusal {
    let worker = NamedWorker { id: refusal.worker, name: refusal.name };
    SceneRefusal { worker, build: refusal.build, reason: refusal.reason }
}

/// Samples after which a job is expected to end: all, or fewer if the error of its last round promises a target
/// before.
fn expected_samples(job: &JobRecord, latest: Option<&ConvergencePoint>) -> u64 {
    let by_targets = latest.and_then(|point| job.targets.expected_samples(job.samples_per_block, &round_error(point)));
    let in_a_pixel = u64::from(job.passes) * u64::from(job.samples_per_pass);
    let fraction = by_targets.map_or(1.0, |samples| (samples / in_a_pixel.max(1) as f64).min(1.0));
    (job.total_samples() as f64 * fraction) as u64
}

/// The time limit that may end a job. A reopened job has passed it.
fn limit_ms(job: &JobRecord) -> Option<i64> {
    job.time_limit_ms.filter(|_| job.reopened_ms.is_none())
}

/// The progress of a job, 0 to 1. A time limit may end it long before its last sample, but not before its first pass is
/// complete.
fn progress(job: &JobRecord, expected_samples: u64, now_ms: i64) -> f64 {
    if job.state == JobState::Done {
        return 1.0;
    }
    let by_samples = job.samples as f64 / expected_samples.max(1) as f64;
    let elapsed_ms = job.started_ms.map(|started_ms| job.finished_ms.unwrap_or(now_ms).saturating_sub(started_ms));
    let by_time = elapsed_ms.zip(limit_ms(job)).map(|(elapsed_ms, limit_ms)| elapsed_ms as f64 / limit_ms as f64);
    let first_pass = if job.rounds == 0 { job.samples as f64 / first_pass_samples(job).max(1) as f64 } else { 1.0 };
    by_time.map_or(by_samples, |by_time| by_time.min(first_pass).max(by_samples)).min(1.0)
}

/// Counters as the wire has them.
fn counters(counters: Counters) -> clerestory_api::Counters {
    let Counters { height_evaluations, solver_calls, converged, unique_solutions, trials, truncated, rays, samples } =
        counters;
    clerestory_api::Counters {
        height_evaluations,
        solver_calls,
        converged,
        unique_solutions,
        trials,
        truncated,
        rays,
        samples,
    }
}
