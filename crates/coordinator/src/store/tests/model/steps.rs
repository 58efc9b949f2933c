//! Which histories are drawn: a job, and what happens to it.

use std::ops::Range;

use clerestory_film::{NodeAddress, TileGrid};
use proptest::prelude::*;

use crate::store::tests::model::WORKERS;

/// Samples of each pixel in a pass, as in all jobs of these tests.
const SAMPLES_PER_PASS: u64 = 4;

/// What is rendered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) passes: u32,
    pub(super) grid: TileGrid,
}

impl Shape {
    /// Passes of all tiles together.
    pub(super) fn all_passes(&self) -> usize {
        (self.passes * self.grid.len()) as usize
    }

    /// Camera samples in a node.
    pub(super) fn samples(&self, node: &NodeAddress) -> u64 {
        let pixels = self.grid.tile(node.tile).unwrap().pixels() as u64;
        (pixels * SAMPLES_PER_PASS) << node.level
    }
}

/// How many nodes a worker asks for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    pub(super) exactly: Option<u32>,
    pub(super) most: Option<u32>,
}

impl Wanted {
    pub(super) fn exactly(nodes: u32) -> Self {
        Self { exactly: Some(nodes), most: None }
    }

    /// As many as it renders in the wanted time.
    fn by_pace(most: Option<u32>) -> Self {
        Self { exactly: None, most }
    }

    /// Most nodes that it is given.
    pub(super) fn at_most(&self) -> usize {
        self.exactly.or(self.most).unwrap_or(256) as usize
    }
}

/// Whose nodes come with those that a lease has.
#[derive(Clone, Copy, Debug)]
pub(super) enum Whose {
    /// The nodes of which its own are halves.
    Parents,
    /// The halves of its own.
    Halves,
    /// Those of a lease, which may be the same.
    Lease(usize),
}

/// Nodes that come with those that a lease has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Others {
    pub(super) whose: Whose,
    pub(super) chosen: u64,
    pub(super) come_first: bool,
}

/// A step of a history. Leases are counted from the newest, and the bits of a number choose nodes.
///
/// A wrong token differs from the lease's by some number. A worker that fails again fails on everything it gets. A
/// worker that turns out to be wrong renders other bits than two others, and then continues with a repaired machine.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Claim { worker: usize, wanted: Wanted },
    Deliver { lease: usize, chosen: u64, core_ms: i64, others: Option<Others> },
    UseWrongToken { lease: usize, by: u64 },
    Renew { lease: usize },
    Return { lease: usize },
    Fail { lease: usize, alone: bool },
    FailAgain { worker: usize, times: u32, alone: bool },
    FindWrong { worker: usize },
    Wait { ms: i64 },
    Expire,
    Keep { merged: u64 },
    Reopen,
}

/// A job, and what happens to it.
#[derive(Clone, Debug)]
pub(super) struct History {
    pub(super) shape: Shape,
    pub(super) steps: Vec<Step>,
}

/// Those of some nodes that are chosen.
pub(super) fn chosen_of(nodes: &[NodeAddress], chosen: u64) -> Vec<NodeAddress> {
    let is_selected = |number: u32| chosen >> (number % 64) & 1 == 1;
    (0..).zip(nodes).filter(|(number, _)| is_selected(*number)).map(|(_, node)| *node).collect()
}

fn chosen() -> impl Strategy<Value = u64> {
    prop_oneof![2 => any::<u64>(), 1 => Just(u64::MAX)]
}

fn wanted() -> impl Strategy<Value = Wanted> {
    prop_oneof![(1..20_u32).prop_map(Wanted::exactly), prop::option::of(1..40_u32).prop_map(Wanted::by_pace)]
}

fn others() -> impl Strategy<Value = Others> {
    let whose = prop_oneof![Just(Whose::Parents), Just(Whose::Halves), (0..4_usize).prop_map(Whose::Lease)];
    (whose, chosen(), any::<bool>()).prop_map(|(whose, chosen, come_first)| Others { whose, chosen, come_first })
}

/// From workers for which the largest nodes are small to those that a single pass keeps busy for longer than a lease
/// should take: how finely the next work is cut follows from it.
fn core_ms() -> impl Strategy<Value = i64> {
    prop_oneof![1..100_i64, 100..3000_i64, 3000..100_000_i64]
}

fn step() -> impl Strategy<Value = Step> {
    let lease = || 0..5_usize;
    let worker = || 0..WORKERS;
    prop_oneof![
        20 => (worker(), wanted()).prop_map(|(worker, wanted)| Step::Claim { worker, wanted }),
        24 => (lease(), chosen(), core_ms(), prop::option::weighted(0.4, others()))
            .prop_map(|(lease, chosen, core_ms, others)| Step::Deliver { lease, chosen, core_ms, others }),
        4 => (lease(), prop_oneof![Just(1_u64), Just(u64::MAX), 1..u64::MAX])
            .prop_map(|(lease, by)| Step::UseWrongToken { lease, by }),
        4 => lease().prop_map(|lease| Step::Renew { lease }),
        4 => lease().prop_map(|lease| Step::Return { lease }),
        4 => (lease(), any::<bool>()).prop_map(|(lease, alone)| Step::Fail { lease, alone }),
        1 => (worker(), 2..10_u32, any::<bool>())
            .prop_map(|(worker, times, alone)| Step::FailAgain { worker, times, alone }),
        4 => worker().prop_map(|worker| Step::FindWrong { worker }),
        8 => (1..3000_i64).prop_map(|ms| Step::Wait { ms }),
        4 => Just(Step::Expire),
        8 => chosen().prop_map(|merged| Step::Keep { merged }),
        2 => Just(Step::Reopen),
    ]
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    prop::collection::vec(step(), 1..60)
}

fn shape(passes: Range<u32>, width: Range<u32>, height: Range<u32>) -> impl Strategy<Value = Shape> {
    let shape = |(passes, width, height)| Shape { passes, grid: TileGrid::new(width, height, 16) };
    (passes, width, height).prop_map(shape)
}

/// Jobs whose work is cut at the first claim, and of which nothing may be free long before they end.
fn small() -> impl Strategy<Value = Shape> {
    shape(1..41, 1..65, 1..49)
}

/// Jobs that have more nodes than are cut ahead, however large those are: of some passes in many tiles, and of more in
/// fewer.
fn large() -> impl Strategy<Value = Shape> {
    prop_oneof![2 => shape(5..10, 145..177, 113..145), 1 => shape(17..29, 129..161, 65..81)]
}

/// So many tiles, of which the last is narrower.
fn row_of(tiles: u32) -> TileGrid {
    TileGrid::new(16 * tiles - 5, 9, 16)
}

/// A worker that has rendered the first two passes of all tiles turns out to be wrong, after another has brought the
/// next two, each two as one node. Each tile is one merged node, so its passes are pending one by one when the other
/// brings its nodes again, and some of them are leased.
fn redone_in_parts() -> impl Strategy<Value = History> {
    (4..25_u32, 2..7_u32, 1..17_u32, steps()).prop_map(|(passes, tiles, taken, later)| {
        let deliver = |lease, chosen| Step::Deliver { lease, chosen, core_ms: 100, others: None };
        let mut steps = vec![
            Step::Claim { worker: 0, wanted: Wanted::exactly(2 * tiles) },
            Step::Claim { worker: 1, wanted: Wanted::exactly(tiles) },
            // The first is what it is found to be wrong by.
            deliver(1, u64::MAX - 1),
            deliver(0, u64::MAX),
            Step::Keep { merged: u64::MAX },
            Step::FindWrong { worker: 0 },
            Step::Claim { worker: 2, wanted: Wanted::exactly(taken) },
            deliver(1, u64::MAX),
        ];
        steps.extend(later);
        History { shape: Shape { passes, grid: row_of(tiles) }, steps }
    })
}

/// A worker turns out to be wrong when no other has brought anything.
fn begun_again() -> impl Strategy<Value = History> {
    (small(), 1..20_u32, 1..20_u32, steps()).prop_map(|(shape, own, others, later)| {
        let mut steps = vec![
            Step::Claim { worker: 0, wanted: Wanted::exactly(own) },
            Step::Claim { worker: 1, wanted: Wanted::exactly(others) },
            Step::FindWrong { worker: 0 },
            Step::Deliver { lease: 0, chosen: u64::MAX, core_ms: 100, others: None },
        ];
        steps.extend(later);
        History { shape, steps }
    })
}

/// A worker holds all of a job for longer than others would need, but not for too long. Another takes over a pass of
/// the last node, and brings it before the first brings all of its nodes.
fn taken_over() -> impl Strategy<Value = History> {
    let passes = prop_oneof![Just(4_u32), Just(8_u32), Just(16_u32), Just(32_u32)];
    (passes, 2..7_u32, 2000..3000_i64, steps()).prop_map(|(passes, tiles, ms, later)| {
        let deliver = |lease| Step::Deliver { lease, chosen: u64::MAX, core_ms: 100, others: None };
        let mut steps = vec![
            Step::Claim { worker: 0, wanted: Wanted::exactly(256) },
            Step::Wait { ms },
            Step::Claim { worker: 1, wanted: Wanted::by_pace(None) },
            deliver(0),
            deliver(1),
        ];
        steps.extend(later);
        History { shape: Shape { passes, grid: row_of(tiles) }, steps }
    })
}

/// Any history; some begin with what would not come about often by chance.
pub(super) fn history() -> impl Strategy<Value = History> {
    let drawn = |(shape, steps)| History { shape, steps };
    prop_oneof![
        4 => (small(), steps()).prop_map(drawn),
        3 => (large(), steps()).prop_map(drawn),
        2 => redone_in_parts(),
        1 => begun_again(),
        2 => taken_over(),
    ]
}
