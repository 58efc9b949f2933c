//! What a worker is given.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{JobState, LeaseId};
use clerestory_film::NodeAddress;

use crate::model::{ClaimTerms, Grant, LeaseState};
use crate::store::engine::sql::query;
use crate::store::tests::farm::terms;
use crate::store::tests::model::seen::Event;
use crate::store::tests::model::steps::Wanted;
use crate::store::tests::model::{Farm, Held, LEASE_MS, Model, Pending, passes, round_of};

/// Free nodes that there are when a claim has cut some; also the largest lease.
const MOST_NODES: usize = 256;

/// Most nodes beyond a full queue: those of one round in a tile, pass by pass, and the rest of one that is split.
const MOST_BEYOND: usize = 20;

/// Time for which no lease is taken over.
const GATHERING_MS: i64 = 1000;

/// Shortest time until a lease is overdue: three times the target.
const LEAST_PATIENCE_MS: i64 = 3000;

/// Most leases of a node while another lease holds it, unless that is overdue.
const MOST_REPEATS: u32 = 2;

/// Where what a worker is given should come from.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// What a lease that is overdue has of rounds up to one.
    Overdue {
        lease: usize,
        up_to: u32,
    },
    /// What nobody has.
    Free,
    /// What another lease has, if that is slow.
    Slow {
        lease: usize,
    },
    Nothing,
}

impl Model {
    /// Lets a worker claim, and answers the lease that it is granted.
    pub(super) async fn claim(&mut self, farm: &Farm, worker: usize, wanted: Wanted) -> Option<usize> {
        let source = self.source_for(worker);
        let terms = ClaimTerms {
            max_nodes: wanted.most,
            fixed_nodes: wanted.exactly,
            ttl_ms: LEASE_MS,
            ..terms(self.workers[worker].id, self.now_ms)
        };
        let grant = farm.store.claim(move || terms).await.unwrap();
        if self.workers[worker].backoff_until_ms() > self.now_ms {
            assert!(grant.is_none(), "it has failed and rests");
            self.seen.note(Event::Rested);
            return None;
        }
        let Some(grant) = grant else {
            // Whether a worker is thought slow depends on the pace of both.
            assert!(matches!(source, Source::Slow { .. } | Source::Nothing), "nothing of {source:?}");
            return None;
        };
        let stored = self.stored(farm).await;
        let taken_from = match source {
            Source::Free => {
                self.hold_against_free(&stored, &grant, wanted);
                None
            }
            Source::Overdue { lease, up_to } => {
                self.hold_against_lease(lease, |pending| pending.round <= up_to, &grant, wanted);
                self.seen.note(Event::TakenOverdue);
                Some(lease)
            }
            Source::Slow { lease } => {
                self.hold_against_lease(lease, |pending| pending.repeats < MOST_REPEATS, &grant, wanted);
                self.seen.note(Event::TakenOver);
                Some(lease)
            }
            Source::Nothing => panic!("there was nothing for it: {:?}", grant.nodes),
        };
        self.see_what_is_split(&stored, &grant, wanted);
        for node in &grant.nodes {
            let pending = self.pending.get_mut(node).unwrap();
            pending.lease = Some(grant.lease.id);
            pending.repeats += u32::from(taken_from.is_some());
            self.seen.note_level(node.level);
        }
        if let Some(lease) = taken_from.filter(|lease| self.held_under(*lease).is_empty()) {
            self.leases[lease].state = LeaseState::Complete;
        }
        if wanted.exactly.is_none() && grant.nodes.len() > 1 {
            self.seen.note(Event::LeasedByPace);
        }
        let deadline_ms = self.now_ms + LEASE_MS;
        assert_eq!(grant.lease.deadline_ms, deadline_ms);
        assert!(self.leases.last().is_none_or(|last| last.grant.lease.token < grant.lease.token));
        let overdue_after_ms = overdue_after_ms(farm, grant.lease.id).await;
        assert!(overdue_after_ms >= LEAST_PATIENCE_MS, "{overdue_after_ms}");
        self.state = JobState::Running;
        let (state, granted_ms, due_ms) = (LeaseState::Active, self.now_ms, self.now_ms + overdue_after_ms);
        self.leases.push(Held { grant, worker, state, granted_ms, deadline_ms, overdue_after_ms, due_ms });
        self.lease(0)
    }

    /// What a worker should be given: what the next round waits for and another has had for too long; then what is
    /// free; then what another has had for too long, whatever it is, or for long.
    fn source_for(&self, worker: usize) -> Source {
        if !self.is_open() {
            return Source::Nothing;
        }
        let is_cut = self.cut.len() == self.shape.all_passes();
        let is_free = !is_cut || self.pending.values().any(|pending| pending.lease.is_none());
        let up_to = if is_free { self.rounds } else { u32::MAX };
        let overdue = self
            .others(worker)
            .filter(|(_, held)| held.due_ms <= self.now_ms && self.has(held, |pending| pending.round <= up_to))
            .min_by_key(|(_, held)| (held.due_ms, held.grant.lease.token));
        if let Some((lease, _)) = overdue {
            return Source::Overdue { lease, up_to };
        }
        if is_free {
            return Source::Free;
        }
        let late_ms = self.now_ms - GATHERING_MS;
        let mut slow = self
            .others(worker)
            .filter(|(_, held)| held.granted_ms <= late_ms && self.has(held, |pending| pending.repeats < MOST_REPEATS));
        slow.next().map_or(Source::Nothing, |(lease, _)| Source::Slow { lease })
    }

    /// The leases that other workers have, oldest first.
    fn others(&self, worker: usize) -> impl Iterator<Item = (usize, &Held)> {
        let numbered = self.leases.iter().enumerate();
        numbered.filter(move |(_, held)| held.state == LeaseState::Active && held.worker != worker)
    }

    /// Whether a lease has any of some nodes.
    fn has(&self, held: &Held, is_wanted: impl Fn(&Pending) -> bool) -> bool {
        let id = held.grant.lease.id;
        self.pending.values().any(|pending| pending.lease == Some(id) && is_wanted(pending))
    }

    /// Holds what a worker was given against what was free.
    fn hold_against_free(&mut self, stored: &BTreeMap<NodeAddress, Pending>, grant: &Grant, wanted: Wanted) {
        let known = self.in_order(|pending| pending.lease.is_none());
        // Of a single node, more may have been cut than is to be seen.
        let single = grant.nodes.first().filter(|_| wanted.exactly.is_none() && grant.nodes.len() == 1);
        self.see_what_is_cut(stored, known.len(), single);
        let free = self.in_order(|pending| pending.lease.is_none());
        let fitting = wanted.at_most().min(free.len());
        let count = grant.nodes.len();
        assert!((1..=fitting).contains(&count), "{count} of {fitting}");
        if let Some(exactly) = wanted.exactly {
            let is_all_cut = self.cut.len() == self.shape.all_passes();
            assert!(count == fitting && (is_all_cut || count == exactly as usize), "{count} of {fitting}");
        }
        // By pace, as many as there were may be too few: then more are cut.
        let (has_cut, is_all_cut) = (free.len() > known.len(), self.cut.len() == self.shape.all_passes());
        let is_as_wanted = count < known.len() || count == wanted.at_most() || count == 1;
        assert!(has_cut || is_all_cut || is_as_wanted, "{count} of {}", known.len());
        let Some(node) = single else {
            assert_eq!(grant.nodes, free[..count], "what was cut first comes first");
            return;
        };
        // It may be the first part of one that is too large for the worker.
        let first_pass = node.passes().first;
        if let Some(first) = known.first() {
            assert!(node.overlaps(first) && node.level <= first.level, "{node:?} before {first:?}");
            assert_eq!(first_pass, first.passes().first, "{node:?} of {first:?}");
        } else {
            let first = free[0];
            assert_eq!((node.tile, round_of(first_pass)), (first.tile, round_of(first.passes().first)));
            assert_eq!(Some(first_pass), self.boundaries().passes(round_of(first_pass)).map(|passes| passes.first));
        }
    }

    /// Holds what a worker was given against what a lease has of which it may be given some: the later half of that, or
    /// less if that is too much for it; of a single node, the second half.
    fn hold_against_lease(&self, lease: usize, may_go: impl Fn(&Pending) -> bool, grant: &Grant, wanted: Wanted) {
        let (id, _) = self.key(lease);
        let held = self.in_order(|pending| pending.lease == Some(id) && may_go(pending));
        let half = held.len().div_ceil(2).min(wanted.at_most());
        let count = grant.nodes.len();
        assert!((1..=half).contains(&count), "{count} of {half}");
        if wanted.exactly.is_some() || count > 1 {
            assert!(wanted.exactly.is_none() || count == half, "{count} of {half}");
            assert_eq!(grant.nodes, held[held.len() - count..], "the later half comes");
            return;
        }
        let (node, last) = (grant.nodes[0], held[held.len() - 1]);
        assert!(node.overlaps(&last) && node.level <= last.level, "{node:?} for {last:?}");
        let ends = [node, last].map(|node| node.passes().first + node.passes().count);
        assert_eq!(ends[0], ends[1], "{node:?} of {last:?}");
        assert!(held.len() > 1 || last.level == 0 || node.level < last.level, "all of {last:?}");
    }

    /// Records the nodes that a claim has cut, and checks the rules: only work of the job, all of a tile's passes in a
    /// round, nothing twice, and a full queue but not more.
    fn see_what_is_cut(
        &mut self,
        stored: &BTreeMap<NodeAddress, Pending>,
        was_free: usize,
        single: Option<&NodeAddress>,
    ) {
        let is_first = self.cut.is_empty();
        let is_new = |node: &NodeAddress| !self.cut.contains(&(node.tile, node.passes().first));
        let new: Vec<(NodeAddress, u32)> =
            stored.iter().filter(|(node, _)| is_new(node)).map(|(node, pending)| (*node, pending.round)).collect();
        let mut levels: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for (node, round) in &new {
            for (tile, pass) in passes(node) {
                assert!(tile < self.shape.grid.len() && pass < self.shape.passes, "{node:?} is not part of the job");
                assert_eq!(round_of(pass), *round, "{node:?}");
                assert!(self.cut.insert((tile, pass)), "pass {pass} of tile {tile} was cut twice");
            }
            let level = levels.entry((*round, node.tile)).or_default();
            *level = node.level.max(*level);
            self.pending.insert(*node, Pending::new(*round));
        }
        for ((round, tile), level) in levels {
            let passes = self.boundaries().passes(round).unwrap();
            let mut round_passes = passes.first..passes.first + passes.count;
            assert!(round_passes.all(|pass| self.cut.contains(&(tile, pass))), "wave {round} of tile {tile} has gaps");
            // Where a node may have been split, its size is not what it was cut to.
            if single.is_some_and(|node| node.tile == tile && round_of(node.passes().first) == round) {
                continue;
            }
            let cut_levels = self.cut_levels.entry(round).or_default();
            if cut_levels.insert(level) && cut_levels.len() > 1 {
                self.seen.note(Event::CutByPace);
            }
        }
        let is_free = was_free + new.len();
        let is_all_cut = self.cut.len() == self.shape.all_passes();
        if !new.is_empty() {
            assert!(is_free >= MOST_NODES || is_all_cut, "only {is_free} nodes to choose from");
            assert!(
                was_free < MOST_NODES && is_free < MOST_NODES + MOST_BEYOND,
                "{was_free}, then {is_free}: too many"
            );
            if !is_first {
                self.seen.note(Event::Refilled);
            }
        }
    }

    /// Notes which node a claim has split because it is too large for the worker: its parts are what it was.
    fn see_what_is_split(&mut self, stored: &BTreeMap<NodeAddress, Pending>, grant: &Grant, wanted: Wanted) {
        let gone: Vec<NodeAddress> = self.pending.keys().filter(|node| !stored.contains_key(*node)).copied().collect();
        assert!(gone.len() <= 1, "{gone:?}");
        for whole in gone {
            assert!(wanted.exactly.is_none(), "{whole:?}");
            assert!(grant.nodes.len() == 1 && grant.nodes[0].overlaps(&whole), "{whole:?} for {:?}", grant.nodes);
            let parts: Vec<NodeAddress> = stored.keys().filter(|part| part.overlaps(&whole)).copied().collect();
            let part_passes: Vec<(u32, u32)> = parts.iter().flat_map(passes).collect();
            assert_eq!(part_passes.len(), whole.passes().count as usize, "{whole:?}: {parts:?}");
            let part_passes: BTreeSet<(u32, u32)> = part_passes.into_iter().collect();
            assert!(part_passes.into_iter().eq(passes(&whole)), "{whole:?}: {parts:?}");
            let pending = self.pending.remove(&whole).unwrap();
            self.pending.extend(parts.into_iter().map(|part| (part, pending)));
            self.seen.note(Event::Split);
        }
    }

    /// Some of the pending nodes, in the order in which they are given out.
    fn in_order(&self, is_wanted: impl Fn(&Pending) -> bool) -> Vec<NodeAddress> {
        let wanted = self.pending.iter().filter(|(_, pending)| is_wanted(pending));
        let mut nodes: Vec<_> = wanted.map(|(node, pending)| (pending.round, node.tile, node.index, *node)).collect();
        nodes.sort();
        nodes.into_iter().map(|(.., node)| node).collect()
    }
}

/// How long a lease may go on without an accepted node. That follows from the worker's pace.
async fn overdue_after_ms(farm: &Farm, lease: LeaseId) -> i64 {
    let found = query("select overdue_after_ms from leases where id = $1").bind(lease.to_string());
    found.fetch_one(&farm.store.readers).await.unwrap().integer("overdue_after_ms").unwrap()
}
