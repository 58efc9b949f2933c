//! What becomes of leases that are not brought to their end.

use std::collections::BTreeSet;

use clerestory_api::{JobState, NodeVerdict};
use clerestory_film::NodeAddress;

use crate::model::{ClaimTerms, Delivery, LeaseState, WorkFailure};
use crate::store::tests::farm::terms;
use crate::store::tests::model::deliveries::rendered;
use crate::store::tests::model::seen::Event;
use crate::store::tests::model::steps::Wanted;
use crate::store::tests::model::{Farm, Held, LEASE_MS, Model, Pending, REASON, passes, round_of};

/// Machines that fail on a node before its job fails, and attempts when there is no other machine.
const ENOUGH_WORKERS: usize = 3;
const ENOUGH_FAILURES: u32 = 5;

impl Model {
    pub(super) async fn renew(&mut self, farm: &Farm, lease: usize) {
        let (id, token) = self.key(lease);
        let deadline_ms = self.now_ms + LEASE_MS;
        let answer = farm.store.renew(id, token, self.now_ms, deadline_ms).await;
        let Some(outstanding) = self.answered(lease, answer) else { return };
        assert_eq!(outstanding as usize, self.held_under(lease).len());
        let held = &mut self.leases[lease];
        match outstanding {
            // Others have all of it, or it is accepted.
            0 => held.state = LeaseState::Complete,
            _ => held.deadline_ms = deadline_ms,
        }
    }

    pub(super) async fn give_back(&mut self, farm: &Farm, lease: usize) {
        let (id, token) = self.key(lease);
        let answer = farm.store.return_lease(id, token, self.now_ms).await;
        if self.leases[lease].state == LeaseState::Returned {
            // A worker that returns it twice has not received the first answer.
            return answer.unwrap();
        }
        if self.answered(lease, answer).is_some() && self.leases[lease].state == LeaseState::Active {
            self.end(lease, LeaseState::Returned);
            self.seen.note(Event::Returned);
        }
    }

    pub(super) async fn expire(&mut self, farm: &Farm) {
        let is_due = |held: &Held| held.state == LeaseState::Active && held.deadline_ms <= self.now_ms;
        let due: Vec<usize> = (0..self.leases.len()).filter(|lease| is_due(&self.leases[*lease])).collect();
        assert_eq!(farm.expire(self.now_ms).await, due.len() as u64);
        for lease in due {
            self.end(lease, LeaseState::Expired);
            self.seen.note(Event::Expired);
        }
    }

    /// A worker fails, alone or while others are alive.
    pub(super) async fn fail(&mut self, farm: &Farm, lease: usize, alone: bool) {
        let (id, token) = self.key(lease);
        let alive_ms = if alone { i64::MAX } else { i64::MIN };
        let reason = REASON.to_owned();
        let failure = WorkFailure { lease: id, token, reason, refused_partials: 1, now_ms: self.now_ms, alive_ms };
        let answer = farm.store.fail_lease(failure).await;
        let Some(failed_job) = self.answered(lease, answer) else { return };
        let failing = self.leases[lease].worker;
        let worker = &mut self.workers[failing];
        worker.failures_in_a_row += 1;
        worker.failed_ms = self.now_ms;
        let mut has_failed = false;
        for pending in self.pending.values_mut().filter(|pending| pending.lease == Some(id)) {
            pending.failures += 1;
            pending.failed_on[failing] = true;
            let workers = pending.failed_on.iter().filter(|failed| **failed).count();
            has_failed |= workers >= ENOUGH_WORKERS || alone && pending.failures >= ENOUGH_FAILURES;
        }
        if self.leases[lease].state == LeaseState::Active {
            self.end(lease, LeaseState::Returned);
            self.seen.note(Event::Failed);
        }
        assert_eq!(failed_job, has_failed.then_some(self.job));
        if has_failed {
            self.end_job(JobState::Failed);
            self.seen.note(Event::JobFailed);
        }
    }

    /// A worker fails several times, each time as soon as it gets work again.
    pub(super) async fn fail_again(&mut self, farm: &Farm, worker: usize, times: u32, alone: bool) {
        for _ in 0..times {
            let lease = match self.usable(worker) {
                Some(lease) => lease,
                None => {
                    self.now_ms = self.now_ms.max(self.workers[worker].backoff_until_ms());
                    let Some(lease) = self.claim(farm, worker, Wanted::exactly(3)).await else { return };
                    lease
                }
            };
            self.fail(farm, lease, alone).await;
        }
    }

    /// A worker brings a wrong node, as two others find. It is released at once.
    pub(super) async fn find_wrong(&mut self, farm: &Farm, worker: usize) {
        let Some(lease) = self.usable(worker) else { return };
        let mut leased = self.leases[lease].grant.nodes.iter();
        let Some(node) = leased.find(|node| self.verdict(lease, node) == NodeVerdict::Accepted).copied() else {
            return;
        };
        let answer = self.deliver(farm, lease, &[node], 100, Some("wrong")).await.unwrap();
        let mut outcome = answer.checks;
        assert!(outcome.has_work, "it is to be checked");
        for judge in self.judges {
            let terms = ClaimTerms { fixed_nodes: Some(1), ..terms(judge, self.now_ms) };
            let grant = farm.store.claim(move || terms).await.unwrap().unwrap();
            assert_eq!(grant.nodes, [node], "checks come first");
            let (lease, token) = (grant.lease.id, grant.lease.token);
            let nodes = vec![rendered(&node, Some("right"))];
            let delivery = Delivery { lease, token, nodes, core_ms: 100, now_ms: self.now_ms, alive_ms: 0 };
            let answer = farm.store.accept(delivery).await.unwrap();
            assert_eq!(answer.verdicts, [NodeVerdict::Duplicate]);
            outcome = answer.checks;
        }
        let wrong = self.workers[worker].id;
        assert!(outcome.quarantined.iter().map(|(found, _)| *found).eq([wrong]), "{outcome:?}");
        assert_eq!(outcome.redone, [self.job]);
        farm.store.release_worker(wrong).await.unwrap();
        let taken = self.redo(worker);
        assert_eq!(outcome.removed.blob_ranges.len(), taken.len());
        if self.accepted.is_empty() {
            self.restart();
        } else {
            self.see_what_is_redone(farm, &taken, worker).await;
        }
    }

    /// Takes all out of the film that a worker may have rendered, and its leases from it.
    fn redo(&mut self, worker: usize) -> Vec<NodeAddress> {
        let mut leased = BTreeSet::new();
        for lease in 0..self.leases.len() {
            let held = &self.leases[lease];
            if held.worker != worker {
                continue;
            }
            leased.extend(held.grant.nodes.iter().flat_map(passes));
            if matches!(held.state, LeaseState::Active | LeaseState::Complete) {
                self.end(lease, LeaseState::Returned);
            }
        }
        let is_its = |node: &&NodeAddress| passes(node).any(|pass| leased.contains(&pass));
        let taken: Vec<NodeAddress> = self.accepted.iter().filter(is_its).copied().collect();
        for node in &taken {
            self.accepted.remove(node);
            for pass in passes(node) {
                self.done.remove(&pass);
            }
        }
        self.redone += taken.len() as u64;
        self.seen.note(Event::Redone);
        taken
    }

    /// Takes the job back to where it was before its first claim: nothing is left of it.
    fn restart(&mut self) {
        for held in &mut self.leases {
            if matches!(held.state, LeaseState::Active | LeaseState::Complete) {
                held.state = LeaseState::Returned;
            }
        }
        self.pending.clear();
        self.cut.clear();
        self.cut_levels.clear();
        self.work.clear();
        self.points.clear();
        self.rounds = 0;
        self.seen.note(Event::BegunAgain);
    }

    /// Notes how what was taken out has come back to the queue, and holds that to the rules: each pass once, as work of
    /// its round, and no coarser than work was given to the worker.
    async fn see_what_is_redone(&mut self, farm: &Farm, taken: &[NodeAddress], worker: usize) {
        let own = self.leases.iter().filter(|held| held.worker == worker);
        let largest_level = own.flat_map(|held| held.grant.nodes.iter().map(|node| node.level)).max().unwrap();
        let mut missing: BTreeSet<(u32, u32)> = taken.iter().flat_map(passes).collect();
        for (node, pending) in self.stored(farm).await {
            if self.pending.contains_key(&node) {
                continue;
            }
            assert!(node.level <= largest_level, "{node:?}");
            let round = round_of(node.passes().first);
            assert_eq!(pending, Pending::new(round), "{node:?}");
            for pass in passes(&node) {
                assert!(missing.remove(&pass), "{node:?} was not taken out, or twice");
                assert_eq!(round_of(pass.1), round, "{node:?}");
            }
            self.pending.insert(node, pending);
        }
        assert!(missing.is_empty(), "{missing:?}");
        let first = taken.iter().map(|node| round_of(node.passes().first)).min().unwrap();
        self.points.retain(|round| *round < first);
    }
}
