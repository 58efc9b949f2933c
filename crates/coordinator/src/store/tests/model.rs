//! Random histories of a job, held against a model of them in memory: claims of all sizes by workers of all speeds, results that come whole,
//! in part, twice, late or for somebody else's nodes, leases that are kept, given back or run out, rounds and merges.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{ConvergencePoint, JobId, JobState, NodeVerdict, WorkerId};
use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{NodeAddress, TileGrid};
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};
use uuid::Uuid;

use super::{Farm, TTL_MS, merge, place};
use crate::store::leases::LeaseState;
use crate::store::{DeliveredNode, Delivery, Grant, LeaseError, NewJob};

const PASSES: u32 = 6;
const GRID: TileGrid = TileGrid { width: 40, height: 20, tile_size: 16 };
const WORKERS: usize = 3;

/// Something that happens. Leases are counted from the newest.
#[derive(Clone, Debug)]
enum Step {
    Claim { worker: usize, nodes: u32 },
    Deliver { lease: usize, chosen: u64, core_ms: i64, with_parents: bool },
    Renew { lease: usize },
    Return { lease: usize },
    Wait { ms: i64 },
    Expire,
    Keep { merged: u64 },
}

fn step() -> impl Strategy<Value = Step> {
    let lease = 0..4_usize;
    prop_oneof![
        4 => (0..WORKERS, 1..20_u32).prop_map(|(worker, nodes)| Step::Claim { worker, nodes }),
        6 => (lease.clone(), any::<u64>(), 1..3000_i64, any::<bool>())
            .prop_map(|(lease, chosen, core_ms, with_parents)| Step::Deliver { lease, chosen, core_ms, with_parents }),
        1 => lease.clone().prop_map(|lease| Step::Renew { lease }),
        1 => lease.prop_map(|lease| Step::Return { lease }),
        2 => (1..TTL_MS).prop_map(|ms| Step::Wait { ms }),
        1 => Just(Step::Expire),
        2 => any::<u64>().prop_map(|merged| Step::Keep { merged }),
    ]
}

/// A lease as the model has it.
struct Held {
    grant: Grant,
    worker: usize,
    state: LeaseState,
    deadline_ms: i64,
}

/// What should be in the store.
struct Model {
    job: JobId,
    workers: Vec<WorkerId>,
    now_ms: i64,
    leases: Vec<Held>,
    /// Nodes that are leased and not accepted, with the lease that was granted last.
    holders: BTreeMap<NodeAddress, usize>,
    /// Nodes that went back to the queue.
    free: BTreeSet<NodeAddress>,
    /// Passes that were ever given out, by tile: those below are cut.
    cut: BTreeSet<(u32, u32)>,
    accepted: BTreeSet<NodeAddress>,
    rounds: u32,
}

fn passes(node: &NodeAddress) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (tile, passes) = (node.tile, node.passes());
    (passes.first..passes.first + passes.count).map(move |pass| (tile, pass))
}

impl Model {
    async fn new(farm: &Farm) -> Self {
        let job = farm.job_like(|job| NewJob { passes: PASSES, grid: GRID, ..job }).await;
        let mut workers = Vec::new();
        for _ in 0..WORKERS {
            workers.push(farm.worker().await);
        }
        Self {
            job,
            workers,
            now_ms: 0,
            leases: Vec::new(),
            holders: BTreeMap::new(),
            free: BTreeSet::new(),
            cut: BTreeSet::new(),
            accepted: BTreeSet::new(),
            rounds: 0,
        }
    }

    fn is_accepted(&self, node: &NodeAddress) -> bool {
        self.accepted.iter().any(|accepted| accepted.overlaps(node))
    }

    /// Whether work is left that nobody has.
    fn has_free_work(&self) -> bool {
        !self.free.is_empty() || self.cut.len() < (GRID.len() * PASSES) as usize
    }

    async fn claim(&mut self, farm: &Farm, worker: usize, nodes: u32) -> Option<Grant> {
        let was_free = self.has_free_work();
        let Some(grant) = farm.claim(self.workers[worker], nodes, self.now_ms).await else {
            assert!(!was_free, "there was work: {:?}", self.free);
            return None;
        };
        let lease = self.leases.len();
        assert!((1..=nodes as usize).contains(&grant.nodes.len()));
        for node in &grant.nodes {
            assert!(!self.is_accepted(node), "{node:?} is accepted and was leased");
            match self.holders.insert(*node, lease) {
                Some(holder) => {
                    assert!(!was_free, "{node:?} was taken over while there was other work");
                    assert_ne!(self.leases[holder].worker, worker, "{node:?} is its own");
                    assert_eq!(self.leases[holder].state, LeaseState::Active);
                }
                None if self.free.remove(node) => {}
                None => {
                    for pass in passes(node) {
                        assert!(self.cut.insert(pass), "{pass:?} was cut twice");
                    }
                }
            }
        }
        let deadline_ms = self.now_ms + TTL_MS;
        assert_eq!(grant.lease.deadline_ms, deadline_ms);
        self.leases.push(Held { grant: grant.clone(), worker, state: LeaseState::Active, deadline_ms });
        Some(grant)
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

    fn held_under(&self, lease: usize) -> Vec<NodeAddress> {
        self.holders.iter().filter(|(_, holder)| **holder == lease).map(|(node, _)| *node).collect()
    }

    fn end(&mut self, lease: usize, state: LeaseState) {
        for node in self.held_under(lease) {
            self.holders.remove(&node);
            self.free.insert(node);
        }
        self.leases[lease].state = state;
    }

    async fn deliver(&mut self, farm: &Farm, lease: usize, nodes: Vec<NodeAddress>, core_ms: i64) {
        let held = &self.leases[lease].grant;
        let bring = |address: &NodeAddress| DeliveredNode {
            address: *address,
            place: place(&Uuid::now_v7().to_string(), 0),
            counters: Counters { rays: u64::from(address.passes().count), ..Counters::default() },
            digest: None,
        };
        let delivery = Delivery {
            lease: held.lease.id,
            token: held.lease.token,
            nodes: nodes.iter().map(bring).collect(),
            core_ms,
            now_ms: self.now_ms,
            alive_ms: 0,
        };
        let leased: BTreeSet<NodeAddress> = held.nodes.iter().copied().collect();
        let answer = farm.store.accept(delivery).await;
        if let Some(refusal) = self.refusal(lease) {
            assert_eq!(answer.unwrap_err().to_string(), refusal.to_string());
            return;
        }
        let answer = answer.unwrap();
        for (node, verdict) in nodes.iter().zip(&answer.verdicts) {
            let expected = match node {
                node if self.is_accepted(node) => NodeVerdict::Duplicate,
                node if leased.contains(node) => NodeVerdict::Accepted,
                _ => NodeVerdict::Refused,
            };
            assert_eq!(*verdict, expected, "{node:?}");
            if expected == NodeVerdict::Accepted {
                self.accepted.insert(*node);
                self.holders.retain(|held, _| !held.overlaps(node));
                self.free.retain(|free| !free.overlaps(node));
            }
        }
        let outstanding = self.held_under(lease).len();
        assert_eq!(answer.outstanding as usize, outstanding);
        if outstanding == 0 && self.leases[lease].state == LeaseState::Active {
            self.leases[lease].state = LeaseState::Complete;
        }
    }

    /// Records the rounds that are complete, and merges some of the siblings that rounds do not need apart.
    async fn keep(&mut self, farm: &Farm, merged: u64) {
        loop {
            let record = farm.store.job(self.job).await.unwrap().unwrap();
            assert_eq!(record.rounds, self.rounds);
            let end = record.boundaries().end(self.rounds);
            let done: BTreeSet<(u32, u32)> = self.accepted.iter().flat_map(passes).collect();
            let is_complete =
                end.is_some_and(|end| (0..GRID.len()).all(|tile| (0..end).all(|pass| done.contains(&(tile, pass)))));
            let wave = farm.next_wave(self.job).await;
            assert_eq!(wave.map(|wave| Some(wave.passes)), is_complete.then_some(end));
            let Some(wave) = wave else { break };
            let point = ConvergencePoint {
                frame: 0,
                round: wave.round,
                passes: wave.passes,
                samples_per_pixel: u64::from(wave.passes) * 4,
                core_ms: wave.core_ms,
                wall_ms: 0,
                recorded_ms: self.now_ms,
                mse: None,
                corrected_mse: None,
                rel_mse: None,
                psnr: None,
                estimated_mse: None,
            };
            farm.store.record_round(&record, vec![point], self.now_ms).await.unwrap().unwrap();
            self.rounds += 1;
            if wave.passes == PASSES {
                self.leases
                    .iter_mut()
                    .filter(|held| held.state == LeaseState::Active)
                    .for_each(|held| held.state = LeaseState::Ended);
            }
        }
        let parents: BTreeSet<NodeAddress> = self
            .accepted
            .iter()
            .filter(|node| self.accepted.contains(&node.sibling()))
            .map(NodeAddress::parent)
            .filter(|parent| merged >> (parent.tile * 8 + parent.level + parent.index) & 1 == 1)
            .collect();
        let merges: Vec<_> =
            parents.iter().map(|parent| merge(*parent, place(&Uuid::now_v7().to_string(), 0))).collect();
        farm.store.replace(self.job, 0, merges).await.unwrap();
        for parent in parents {
            self.accepted.retain(|node| !node.overlaps(&parent));
            self.accepted.insert(parent);
        }
    }

    async fn take(&mut self, farm: &Farm, step: &Step) {
        let lease = |number: usize| self.leases.len().checked_sub(number + 1);
        match *step {
            Step::Claim { worker, nodes } => {
                self.claim(farm, worker, nodes).await;
            }
            Step::Deliver { lease: number, chosen, core_ms, with_parents } => {
                let Some(lease) = lease(number) else { return };
                let leased = self.leases[lease].grant.nodes.clone();
                let mut nodes: Vec<_> =
                    (0..).zip(&leased).filter(|(bit, _)| chosen >> bit & 1 == 1).map(|(_, node)| *node).collect();
                if with_parents {
                    let parents: Vec<_> = nodes.iter().map(NodeAddress::parent).collect();
                    nodes.extend(parents);
                }
                self.deliver(farm, lease, nodes, core_ms).await;
            }
            Step::Renew { lease: number } => {
                let Some(lease) = lease(number) else { return };
                let held = self.leases[lease].grant.lease.clone();
                let answer = farm.store.renew(held.id, held.token, self.now_ms, self.now_ms + TTL_MS).await;
                let refusal = self.refusal(lease).map(|error| error.to_string());
                assert_eq!(answer.err().map(|error| error.to_string()), refusal);
                if refusal.is_none() {
                    self.leases[lease].deadline_ms = self.now_ms + TTL_MS;
                }
            }
            Step::Return { lease: number } => {
                let Some(lease) = lease(number) else { return };
                let held = self.leases[lease].grant.lease.clone();
                let answer = farm.store.return_lease(held.id, held.token, self.now_ms).await;
                let refusal = self.refusal(lease).filter(|error| !matches!(error, LeaseError::Returned));
                assert_eq!(answer.err().map(|error| error.to_string()), refusal.map(|error| error.to_string()));
                if self.refusal(lease).is_none() && self.leases[lease].state == LeaseState::Active {
                    self.end(lease, LeaseState::Returned);
                }
            }
            Step::Wait { ms } => self.now_ms += ms,
            Step::Expire => self.expire(farm).await,
            Step::Keep { merged } => self.keep(farm, merged).await,
        }
    }

    async fn expire(&mut self, farm: &Farm) {
        let is_due = |held: &Held| held.state == LeaseState::Active && held.deadline_ms <= self.now_ms;
        let due: Vec<usize> = (0..self.leases.len()).filter(|lease| is_due(&self.leases[*lease])).collect();
        assert_eq!(farm.store.expire_leases(self.now_ms).await.unwrap(), due.len() as u64);
        for lease in due {
            self.end(lease, LeaseState::Expired);
        }
    }

    async fn check(&self, farm: &Farm) {
        let rows = farm.addresses(self.job).await;
        assert_eq!(rows.iter().copied().collect::<BTreeSet<_>>(), self.accepted);
        assert_eq!(rows.len(), self.accepted.len());
        let record = farm.store.job(self.job).await.unwrap().unwrap();
        let passes: u64 = self.accepted.iter().map(|node| u64::from(node.passes().count)).sum();
        assert_eq!(record.counters.rays, passes, "work is counted once");
    }

    /// Ends the job with one good worker.
    async fn finish(&mut self, farm: &Farm) {
        self.now_ms += TTL_MS;
        self.expire(farm).await;
        self.keep(farm, 0).await;
        while let Some(grant) = self.claim(farm, 0, 20).await {
            let lease = self.leases.len() - 1;
            self.deliver(farm, lease, grant.nodes, 10).await;
            self.keep(farm, u64::MAX).await;
        }
        assert_eq!(farm.state(self.job).await, JobState::Done);
        let passes: Vec<_> = self.accepted.iter().flat_map(passes).collect();
        assert_eq!(passes.len() as u32, GRID.len() * PASSES);
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
    let history = |steps: Vec<Step>| {
        runtime.block_on(async {
            let farm = farm().await;
            let mut model = Model::new(&farm).await;
            for step in &steps {
                model.take(&farm, step).await;
                model.check(&farm).await;
            }
            model.finish(&farm).await;
            model.check(&farm).await;
        });
        Ok(())
    };
    TestRunner::new(config).run(&prop::collection::vec(step(), 1..60), history).unwrap();
}

#[test]
fn every_history_of_a_job_in_a_file_ends_with_each_pass_once() {
    histories(150, Farm::in_a_file);
}

#[test]
fn every_history_of_a_job_in_postgres_ends_with_each_pass_once() {
    histories(30, Farm::in_postgres);
}
