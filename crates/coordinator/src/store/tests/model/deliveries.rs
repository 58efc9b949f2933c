//! What workers bring.

use std::collections::BTreeSet;

use clerestory_api::NodeVerdict;
use clerestory_film::NodeAddress;
use clerestory_film::counters::Counters;
use uuid::Uuid;

use crate::model::{DeliveredNode, Delivery, LeaseState, WorkFailure};
use crate::store::errors::LeaseError;
use crate::store::results::acceptance::Acceptance;
use crate::store::tests::model::seen::Event;
use crate::store::tests::model::steps::{Others, Whose, chosen_of};
use crate::store::tests::model::{Farm, LEASE_MS, Model, REASON, blob_range, passes, round_of};

/// A node as it is uploaded; it is checked if it has a digest. It has as many rays as passes, so that a pass that
/// counts twice is seen.
pub(super) fn rendered(address: &NodeAddress, digest: Option<&str>) -> DeliveredNode {
    DeliveredNode {
        address: *address,
        blob_range: blob_range(&Uuid::now_v7().to_string(), 0),
        counters: Counters { rays: u64::from(address.passes().count), ..Counters::default() },
        digest: digest.unwrap_or_default().to_owned(),
        is_selected: digest.is_some(),
    }
}

impl Model {
    /// The chosen nodes of a lease, together with those of other leases.
    pub(super) fn brought(&self, lease: usize, chosen: u64, others: Option<Others>) -> Vec<NodeAddress> {
        let leased = &self.leases[lease].grant.nodes;
        let own = chosen_of(leased, chosen);
        let Some(Others { whose, chosen, come_first }) = others else { return own };
        let strange: Vec<NodeAddress> = match whose {
            Whose::Parents => leased.iter().map(NodeAddress::parent).collect(),
            Whose::Halves => leased.iter().filter_map(NodeAddress::children).flatten().collect(),
            Whose::Lease(number) => {
                self.lease(number).map(|other| self.leases[other].grant.nodes.clone()).unwrap_or_default()
            }
        };
        let strange = chosen_of(&strange, chosen);
        if come_first { [strange, own].concat() } else { [own, strange].concat() }
    }

    /// Brings nodes under a lease, which are checked if they have a digest. `None` when that is refused.
    pub(super) async fn deliver(
        &mut self,
        farm: &Farm,
        lease: usize,
        nodes: &[NodeAddress],
        core_ms: i64,
        digest: Option<&str>,
    ) -> Option<Acceptance> {
        let (id, token) = self.key(lease);
        let brought = nodes.iter().map(|node| rendered(node, digest)).collect();
        let delivery = Delivery { lease: id, token, nodes: brought, core_ms, now_ms: self.now_ms, alive_ms: 0 };
        let answer = farm.store.accept(delivery).await;
        let answer = self.answered(lease, answer)?;

        let all_samples: u64 = nodes.iter().map(|node| self.shape.samples(node)).sum();
        let core_ms_up_to = |samples: u64| (core_ms as f64 * samples as f64 / all_samples as f64) as i64;
        let (mut samples, mut samples_before, mut rounds) = (0, 0, BTreeSet::new());
        assert_eq!(answer.verdicts.len(), nodes.len());
        for (node, verdict) in nodes.iter().zip(&answer.verdicts) {
            assert_eq!(*verdict, self.verdict(lease, node), "{node:?}");
            self.note_verdict(lease, node, *verdict);
            let own_samples = self.shape.samples(node);
            if *verdict == NodeVerdict::Accepted {
                self.accept(node, core_ms_up_to(samples_before + own_samples) - core_ms_up_to(samples_before));
                samples += own_samples;
                rounds.insert(round_of(node.passes().first));
            }
            if *verdict == NodeVerdict::Duplicate {
                self.free_rest(lease, node);
            }
            samples_before += own_samples;
        }
        let mut completes_round = false;
        for round in rounds.into_iter().filter(|round| self.is_round_complete(*round)).collect::<Vec<_>>() {
            completes_round = true;
            self.work.entry(round).or_default().completed_ms = self.now_ms;
        }
        let outstanding = self.held_under(lease).len();
        assert_eq!((answer.samples, answer.completes_round), (samples, completes_round));
        assert_eq!(answer.outstanding as usize, outstanding);
        let held = &mut self.leases[lease];
        if outstanding == 0 && held.state == LeaseState::Active {
            held.state = LeaseState::Complete;
        }
        if samples > 0 {
            held.due_ms = self.now_ms + held.overdue_after_ms;
            self.workers[held.worker].failures_in_a_row = 0;
        }
        Some(answer)
    }

    /// What becomes of a node that is brought under a lease.
    pub(super) fn verdict(&self, lease: usize, node: &NodeAddress) -> NodeVerdict {
        if passes(node).any(|pass| self.done.contains(&pass)) {
            return NodeVerdict::Duplicate;
        }
        let is_leased = self.leases[lease].grant.nodes.contains(node);
        let is_pending = || {
            let passes: u32 = self.parts_of(node).iter().map(|part| part.passes().count).sum();
            self.pending.contains_key(node) || passes == node.passes().count
        };
        if is_leased && is_pending() { NodeVerdict::Accepted } else { NodeVerdict::Refused }
    }

    fn note_verdict(&mut self, lease: usize, node: &NodeAddress, verdict: NodeVerdict) {
        let leased = &self.leases[lease].grant.nodes;
        let mut related = leased.iter().filter(|own| own.overlaps(node));
        let event = match (verdict, related.next()) {
            (NodeVerdict::Accepted, _) if self.pending.contains_key(node) => Event::Accepted,
            (NodeVerdict::Accepted, _) => Event::AcceptedInParts,
            (NodeVerdict::Duplicate, _) => Event::Duplicate,
            (NodeVerdict::Refused, Some(own)) if own.level > node.level => Event::RefusedHalf,
            (NodeVerdict::Refused, Some(own)) if own.level < node.level => Event::RefusedParent,
            (NodeVerdict::Refused, Some(_)) => Event::RefusedOwn,
            (NodeVerdict::Refused, None) => Event::RefusedOther,
        };
        self.seen.note(event);
    }

    /// The pending nodes of which a larger one is the sum, as far as its passes are pending.
    fn parts_of(&self, node: &NodeAddress) -> Vec<NodeAddress> {
        let is_part = |part: &&NodeAddress| part.level < node.level && part.overlaps(node);
        self.pending.keys().filter(is_part).copied().collect()
    }

    /// Frees the rest of a node that a lease holds when others have brought a part of it: its worker will not bring
    /// more.
    fn free_rest(&mut self, lease: usize, node: &NodeAddress) {
        let (id, _) = self.key(lease);
        if !self.leases[lease].grant.nodes.contains(node) {
            return;
        }
        for part in self.parts_of(node) {
            let pending = self.pending.get_mut(&part).unwrap();
            if pending.lease == Some(id) {
                pending.lease = None;
                self.seen.note(Event::FreedRest);
            }
        }
    }

    fn accept(&mut self, node: &NodeAddress, core_ms: i64) {
        for part in self.parts_of(node) {
            self.pending.remove(&part);
        }
        self.pending.remove(node);
        self.accepted.insert(*node);
        self.done.extend(passes(node));
        self.rendered += u64::from(node.passes().count);
        self.core_ms += core_ms;
        self.work.entry(round_of(node.passes().first)).or_default().core_ms += core_ms;
    }

    /// Makes all calls under a lease with another token than its own. None goes through, and the next check finds that
    /// nothing has changed.
    pub(super) async fn use_wrong_token(&mut self, farm: &Farm, lease: usize, by: u64) {
        let (id, token) = self.key(lease);
        let token = token.wrapping_add(by);
        let nodes = self.leases[lease].grant.nodes.iter().map(|node| rendered(node, None)).collect();
        let delivery = Delivery { lease: id, token, nodes, core_ms: 10, now_ms: self.now_ms, alive_ms: 0 };
        let reason = REASON.to_owned();
        let failure = WorkFailure { lease: id, token, reason, refused_partials: 1, now_ms: self.now_ms, alive_ms: 0 };
        let refusals = [
            farm.store.accept(delivery).await.unwrap_err(),
            farm.store.renew(id, token, self.now_ms, self.now_ms + LEASE_MS).await.unwrap_err(),
            farm.store.return_lease(id, token, self.now_ms).await.unwrap_err(),
            farm.store.fail_lease(failure).await.unwrap_err(),
        ];
        for refusal in refusals {
            assert!(matches!(refusal, LeaseError::StaleToken(stale) if stale == token), "{refusal}");
        }
        self.seen.note(Event::RefusedToken);
    }
}
