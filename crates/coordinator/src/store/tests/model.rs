//! Random histories of a job, compared with a model in memory.
//!
//! Jobs have few or many nodes, and workers of all speeds claim leases of all sizes. Results arrive whole, in part,
//! twice, late, under a wrong token or for another worker's nodes. Leases are renewed, returned, taken over or expire.
//! Workers fail or turn out to be wrong, and coordinators restart. Rounds are recorded and merged.
//!
//! The rates of workers decide how finely work is cut and how much of it a lease gets, and every choice is correct. So
//! the model reads the choice and checks the rules. It predicts everything else.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;

use clerestory_api::{ConvergencePoint, JobId, JobState, LeaseId, WorkerId};
use clerestory_film::{NodeAddress, Rounds};
use proptest::prelude::ProptestConfig;
use proptest::test_runner::{RngSeed, TestRunner};
use uuid::Uuid;

use crate::model::{CompleteRound, Grant, LeaseState, NewJob};
use crate::store::engine::lists::address;
use crate::store::engine::row::Row;
use crate::store::engine::sql::query;
use crate::store::errors::LeaseError;
use crate::store::tests::{Farm, blob_range, merge};

mod claims;
mod deliveries;
mod leases;
mod seen;
mod steps;

use seen::{Event, Seen};
use steps::{History, Shape, Step, Wanted, history};

/// Workers that claim, bring and fail at random.
const WORKERS: usize = 3;

/// Term of a lease: longer than others wait before they take it over.
const LEASE_MS: i64 = 5000;

/// Longest rest after failures in a row.
const LONGEST_BACKOFF_MS: i64 = 60_000;

/// Why work fails.
const REASON: &str = "not a number";

/// A worker as the model has it.
struct Worker {
    id: WorkerId,
    /// Failures since something of it was accepted, and when the last one was.
    failures_in_a_row: u32,
    failed_ms: i64,
}

impl Worker {
    /// Until when it is given no work.
    fn backoff_until_ms(&self) -> i64 {
        match self.failures_in_a_row.checked_sub(1) {
            None => self.failed_ms,
            Some(doublings) => self.failed_ms + (1000_i64 << doublings.min(10)).min(LONGEST_BACKOFF_MS),
        }
    }
}

fn name(worker: usize) -> String {
    format!("worker {worker}")
}

/// A lease as the model has it.
struct Held {
    grant: Grant,
    worker: usize,
    state: LeaseState,
    granted_ms: i64,
    deadline_ms: i64,
    /// Time until it is overdue, and when that is.
    overdue_after_ms: i64,
    due_ms: i64,
}

/// A node that is cut and not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pending {
    round: u32,
    /// The lease that it was given out with last, if that is not over.
    lease: Option<LeaseId>,
    failures: u32,
    /// Which workers have failed on it.
    failed_on: [bool; WORKERS],
    repeats: u32,
}

impl Pending {
    /// One that nobody has had.
    fn new(round: u32) -> Self {
        Self { round, lease: None, failures: 0, failed_on: [false; WORKERS], repeats: 0 }
    }
}

/// Accepted work of one round.
#[derive(Clone, Copy, Debug, Default)]
struct Work {
    core_ms: i64,
    /// When the last of it was.
    completed_ms: i64,
}

/// What should be in the store.
struct Model {
    job: JobId,
    shape: Shape,
    workers: Vec<Worker>,
    /// Two more workers, which find out which one is wrong.
    judges: [WorkerId; 2],
    now_ms: i64,
    state: JobState,
    leases: Vec<Held>,
    pending: BTreeMap<NodeAddress, Pending>,
    /// Passes that were cut, by tile.
    cut: BTreeSet<(u32, u32)>,
    /// Largest levels to which the tiles of a round were cut.
    cut_levels: BTreeMap<u32, BTreeSet<u32>>,
    accepted: BTreeSet<NodeAddress>,
    /// Their passes, by tile.
    done: BTreeSet<(u32, u32)>,
    /// Passes that were ever accepted, also those that are rendered again, and the time that they took.
    rendered: u64,
    core_ms: i64,
    /// Of each round, since the job began, or began again.
    work: BTreeMap<u32, Work>,
    /// Nodes that were taken out to be rendered again.
    redone: u64,
    rounds: u32,
    /// Rounds of which there are points.
    points: BTreeSet<u32>,
    seen: Seen,
}

fn passes(node: &NodeAddress) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (tile, passes) = (node.tile, node.passes());
    (passes.first..passes.first + passes.count).map(move |pass| (tile, pass))
}

/// The round that a pass is work of.
fn round_of(pass: u32) -> u32 {
    if pass < 16 { pass.checked_ilog2().map_or(0, |doublings| doublings + 1) } else { 4 + pass / 16 }
}

impl Model {
    async fn new(farm: &Farm, shape: Shape) -> Self {
        let job = farm.job_like(|job| NewJob { passes: shape.passes, grid: shape.grid, ..job }).await;
        // Workers of one name would be one machine.
        let mut workers = Vec::new();
        for number in 0..WORKERS {
            let id = farm.worker_named(&name(number)).await.unwrap();
            workers.push(Worker { id, failures_in_a_row: 0, failed_ms: 0 });
        }
        let judges =
            [farm.worker_named("first judge").await.unwrap(), farm.worker_named("second judge").await.unwrap()];
        Self {
            job,
            shape,
            workers,
            judges,
            now_ms: 0,
            state: JobState::Queued,
            leases: Vec::new(),
            pending: BTreeMap::new(),
            cut: BTreeSet::new(),
            cut_levels: BTreeMap::new(),
            accepted: BTreeSet::new(),
            done: BTreeSet::new(),
            rendered: 0,
            core_ms: 0,
            work: BTreeMap::new(),
            redone: 0,
            rounds: 0,
            points: BTreeSet::new(),
            seen: Seen::default(),
        }
    }

    fn is_open(&self) -> bool {
        matches!(self.state, JobState::Queued | JobState::Running)
    }

    /// A lease, counted from the newest.
    fn lease(&self, number: usize) -> Option<usize> {
        self.leases.len().checked_sub(number + 1)
    }

    /// The identity of a lease, and its token.
    fn key(&self, lease: usize) -> (LeaseId, u64) {
        let held = &self.leases[lease].grant.lease;
        (held.id, held.token)
    }

    /// What a call under a lease is answered, if it fails.
    fn refusal(&self, lease: usize) -> Option<LeaseError> {
        let held = &self.leases[lease];
        match held.state {
            LeaseState::Active if held.deadline_ms <= self.now_ms => Some(LeaseError::Expired),
            LeaseState::Active | LeaseState::Complete => None,
            LeaseState::Returned => Some(LeaseError::Returned),
            LeaseState::Expired => Some(LeaseError::Expired),
            LeaseState::Ended => Some(LeaseError::JobNotRunning),
        }
    }

    /// Compares the answer to a call under a lease with the predicted one, and passes it on unless it is a refusal.
    #[track_caller]
    fn answered<T: Debug>(&mut self, lease: usize, answer: Result<T, LeaseError>) -> Option<T> {
        let Some(refusal) = self.refusal(lease) else { return Some(answer.unwrap()) };
        assert_eq!(answer.unwrap_err().to_string(), refusal.to_string());
        self.seen.note(Event::RefusedLate);
        None
    }

    fn held_under(&self, lease: usize) -> Vec<NodeAddress> {
        let (id, _) = self.key(lease);
        self.pending.iter().filter(|(_, pending)| pending.lease == Some(id)).map(|(node, _)| *node).collect()
    }

    /// Ends a lease: what it has is free.
    fn end(&mut self, lease: usize, state: LeaseState) {
        let (id, _) = self.key(lease);
        for pending in self.pending.values_mut().filter(|pending| pending.lease == Some(id)) {
            pending.lease = None;
        }
        self.leases[lease].state = state;
    }

    /// The newest lease of a worker that still has something.
    fn usable(&self, worker: usize) -> Option<usize> {
        let is_usable = |lease: &usize| {
            let held = &self.leases[*lease];
            let is_active = held.worker == worker && held.state == LeaseState::Active;
            is_active && self.refusal(*lease).is_none() && !self.held_under(*lease).is_empty()
        };
        (0..self.leases.len()).rev().find(is_usable)
    }

    fn boundaries(&self) -> Rounds {
        Rounds::new(self.shape.passes)
    }

    /// Whether a round exists and all of its passes are accepted.
    fn is_round_complete(&self, round: u32) -> bool {
        let Some(passes) = self.boundaries().passes(round) else { return false };
        let mut tiles = 0..self.shape.grid.len();
        tiles.all(|tile| (passes.first..passes.first + passes.count).all(|pass| self.done.contains(&(tile, pass))))
    }

    /// What waits to be rendered, as the store has it.
    async fn stored(&self, farm: &Farm) -> BTreeMap<NodeAddress, Pending> {
        let rows = query(
            "select frame, tile, level, idx, round, failures, failed_on, repeats, lease from pending where job = $1",
        )
        .bind(self.job.to_string())
        .fetch_all(&farm.store.readers)
        .await
        .unwrap();
        let failed_on = |row: &Row| {
            let failed: Option<Vec<(WorkerId, String)>> = row.optional_json("failed_on").unwrap();
            let named = failed.unwrap_or_default().into_iter();
            let mut failed_on = [false; WORKERS];
            named
                .for_each(|(_, failed)| failed_on[(0..WORKERS).find(|worker| name(*worker) == failed).unwrap()] = true);
            failed_on
        };
        let pending = |row: &Row| Pending {
            round: row.number("round").unwrap(),
            lease: row.optional_parsed("lease").unwrap(),
            failures: row.number("failures").unwrap(),
            failed_on: failed_on(row),
            repeats: row.number("repeats").unwrap(),
        };
        rows.iter().map(|row| (address(row).unwrap(), pending(row))).collect()
    }

    async fn take(&mut self, farm: Farm, step: Step) -> Farm {
        match step {
            Step::Claim { worker, wanted } => {
                self.claim(&farm, worker, wanted).await;
            }
            Step::Deliver { lease, chosen, core_ms, others } => {
                if let Some(lease) = self.lease(lease) {
                    let nodes = self.brought(lease, chosen, others);
                    self.deliver(&farm, lease, &nodes, core_ms, None).await;
                }
            }
            Step::UseWrongToken { lease, by } => {
                if let Some(lease) = self.lease(lease) {
                    self.use_wrong_token(&farm, lease, by).await;
                }
            }
            Step::Renew { lease } => {
                if let Some(lease) = self.lease(lease) {
                    self.renew(&farm, lease).await;
                }
            }
            Step::Return { lease } => {
                if let Some(lease) = self.lease(lease) {
                    self.give_back(&farm, lease).await;
                }
            }
            Step::Fail { lease, alone } => {
                if let Some(lease) = self.lease(lease) {
                    self.fail(&farm, lease, alone).await;
                }
            }
            Step::FailAgain { worker, times, alone } => self.fail_again(&farm, worker, times, alone).await,
            Step::FindWrong { worker } => self.find_wrong(&farm, worker).await,
            Step::Wait { ms } => self.now_ms += ms,
            Step::Expire => self.expire(&farm).await,
            Step::Keep { merged } => self.keep(&farm, merged).await,
            Step::Reopen => {
                self.seen.note(Event::Reopened);
                return farm.reopened().await;
            }
        }
        farm
    }

    /// Records the rounds that are complete, and merges the chosen ones of siblings until none of them is left.
    async fn keep(&mut self, farm: &Farm, merged: u64) {
        self.record(farm).await;
        loop {
            let is_selected =
                |parent: &NodeAddress| merged >> ((parent.tile * 8 + parent.level + parent.index) % 64) & 1 == 1;
            let left = |node: &&NodeAddress| node.index.is_multiple_of(2) && self.accepted.contains(&node.sibling());
            let parents: Vec<NodeAddress> =
                self.accepted.iter().filter(left).map(NodeAddress::parent).filter(is_selected).collect();
            if parents.is_empty() {
                break;
            }
            let merges =
                parents.iter().map(|parent| merge(*parent, blob_range(&Uuid::now_v7().to_string(), 0))).collect();
            let removed = farm.store.replace(self.job, self.redone, merges).await.unwrap();
            assert_eq!(removed.blob_ranges.len(), 2 * parents.len());
            for parent in parents {
                for half in parent.children().unwrap() {
                    assert!(self.accepted.remove(&half), "{half:?}");
                }
                self.accepted.insert(parent);
            }
            self.seen.note(Event::Merged);
        }
    }

    /// Records the rounds that are complete.
    async fn record(&mut self, farm: &Farm) {
        loop {
            let record = farm.store.job(self.job).await.unwrap().unwrap();
            let is_complete = (0..=self.rounds).all(|round| self.is_round_complete(round));
            let expected = is_complete.then(|| {
                let work = self.work.range(..=self.rounds);
                CompleteRound {
                    round: self.rounds,
                    passes: self.boundaries().end(self.rounds).unwrap(),
                    core_ms: work.clone().map(|(_, work)| work.core_ms).sum(),
                    completed_ms: work.map(|(_, work)| work.completed_ms).max().unwrap(),
                }
            });
            assert_eq!(farm.next_complete_round(self.job).await, expected);
            let Some(complete) = expected else { break };
            let point = ConvergencePoint {
                round: complete.round,
                passes: complete.passes,
                samples_per_pixel: u64::from(complete.passes) * 4,
                core_ms: complete.core_ms,
                wall_ms: complete.completed_ms - record.started_ms.unwrap(),
                recorded_ms: self.now_ms,
                ..ConvergencePoint::default()
            };
            let recorded = farm.store.record_round(&record, vec![point], self.now_ms).await.unwrap();
            assert_eq!(recorded.is_some(), self.is_open(), "a job that has failed has no more rounds");
            if recorded.is_none() {
                break;
            }
            self.points.insert(self.rounds);
            self.rounds += 1;
            self.seen.note(Event::Recorded);
            if complete.passes == self.shape.passes {
                self.end_job(JobState::Done);
            }
        }
    }

    fn end_job(&mut self, state: JobState) {
        self.state = state;
        self.pending.clear();
        self.leases
            .iter_mut()
            .filter(|held| held.state == LeaseState::Active)
            .for_each(|held| held.state = LeaseState::Ended);
    }

    async fn check(&self, farm: &Farm) {
        let rows = farm.store.nodes(self.job, 0, 0..u32::MAX, u32::MAX).await.unwrap();
        assert_eq!(rows.iter().map(|row| row.address).collect::<BTreeSet<_>>(), self.accepted);
        assert_eq!(rows.len(), self.accepted.len());
        for row in &rows {
            assert_eq!(row.work.counters.rays, u64::from(row.address.passes().count), "the work of {:?}", row.address);
        }
        assert_eq!(self.stored(farm).await, self.pending);
        let record = farm.store.job(self.job).await.unwrap().unwrap();
        assert_eq!((record.state, record.rounds, record.redone_nodes), (self.state, self.rounds, self.redone));
        let samples: u64 = self.accepted.iter().map(|node| self.shape.samples(node)).sum();
        assert_eq!(record.samples, samples);
        assert_eq!((record.counters.rays, record.core_ms), (self.rendered, self.core_ms), "work is counted once");
        let has_reason = record.failure.is_some_and(|failure| failure.contains(REASON));
        assert_eq!(has_reason, self.state == JobState::Failed);
        let points = farm.store.convergence(self.job).await.unwrap();
        assert!(points.iter().map(|point| point.round).eq(self.points.iter().copied()), "{points:?}");
    }

    /// Ends the job with one good worker, unless it has failed.
    async fn finish(&mut self, farm: &Farm) {
        // No lease lasts until then, and no rest.
        self.now_ms += LONGEST_BACKOFF_MS + LEASE_MS;
        self.expire(farm).await;
        self.keep(farm, 0).await;
        while let Some(lease) = self.claim(farm, 0, Wanted::exactly(256)).await {
            let nodes = self.leases[lease].grant.nodes.clone();
            self.deliver(farm, lease, &nodes, 10, None).await;
            self.keep(farm, u64::MAX).await;
        }
        if self.state == JobState::Failed {
            return;
        }
        assert_eq!(self.state, JobState::Done);
        let passes: Vec<_> = self.accepted.iter().flat_map(passes).collect();
        assert_eq!((passes.len(), self.done.len()), (self.shape.all_passes(), self.shape.all_passes()));
    }
}

/// Runs random histories, each on a farm of its own, and shows the shortest that fails.
fn histories<F: Future<Output = Farm>>(count: u32, farm: impl Fn() -> F) {
    let config = ProptestConfig {
        cases: count,
        rng_seed: RngSeed::Fixed(5),
        failure_persistence: None,
        max_shrink_iters: 500,
        ..ProptestConfig::default()
    };
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let seen = RefCell::new(Seen::default());
    let live = |history: History| {
        runtime.block_on(async {
            let mut farm = farm().await;
            let mut model = Model::new(&farm, history.shape).await;
            for step in history.steps {
                farm = model.take(farm, step).await;
                model.check(&farm).await;
            }
            model.finish(&farm).await;
            model.check(&farm).await;
            seen.borrow_mut().add(&model.seen);
        });
        Ok(())
    };
    TestRunner::new(config).run(&history(), live).unwrap();
    seen.into_inner().assert_all();
}

#[test]
fn every_history_of_a_job_in_a_file_ends_with_each_pass_once() {
    histories(150, Farm::in_a_file);
}

#[test]
fn every_history_of_a_job_in_postgres_ends_with_each_pass_once() {
    histories(45, Farm::in_postgres);
}
