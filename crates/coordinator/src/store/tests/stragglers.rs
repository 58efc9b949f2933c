//! Stragglers: an idle worker takes over what they hold, and the first result wins.

use std::collections::BTreeSet;

use clerestory_api::{JobId, NodeVerdict, WorkerId};
use clerestory_film::{NodeAddress, TileGrid};

use crate::model::{ClaimTerms, Delivery, Grant, JobRecord, LeaseState, NewJob};
use crate::store::tests::farm::terms;
use crate::store::tests::{Farm, delivered};

pub(super) async fn held_nodes_are_taken_over_and_the_first_result_wins(farm: Farm) {
    let job = farm.job(1).await;
    let [slow, quick, third] = [farm.worker().await, farm.worker().await, farm.worker().await];
    let first = farm.claim(slow, 100, 0).await.unwrap();
    assert_eq!(first.nodes.len(), 15);
    farm.store.renew(first.lease.id, first.lease.token, 0, 6000).await.unwrap();
    assert!(farm.claim(quick, 100, 1999).await.is_none(), "it may still be at it");
    let second = farm.claim(quick, 100, 2000).await.unwrap();
    assert_eq!(second.nodes, first.nodes[7..], "the later half, in order");
    let verdicts = farm.deliver(&second, &second.nodes[1..], 2000).await.unwrap().verdicts;
    assert_eq!(verdicts, [NodeVerdict::Accepted; 7]);
    let answer = farm.deliver(&first, &first.nodes[6..9], 2100).await.unwrap();
    assert_eq!(answer.verdicts, [NodeVerdict::Accepted, NodeVerdict::Accepted, NodeVerdict::Duplicate]);
    assert_eq!(answer.outstanding, 6);
    let late = farm.deliver(&second, &second.nodes[..1], 2200).await.unwrap();
    assert_eq!((late.verdicts, late.outstanding), (vec![NodeVerdict::Duplicate], 0));
    let rest = farm.claim(third, 2, 5000).await.unwrap();
    assert_eq!(rest.nodes, first.nodes[4..6], "no more than is asked for");
    farm.deliver(&rest, &rest.nodes, 5000).await.unwrap();
    farm.deliver(&first, &first.nodes[..4], 5100).await.unwrap();
    assert_eq!(farm.addresses(job).await, first.nodes, "each once");
}

pub(super) async fn what_a_worker_may_still_keep_is_not_taken_over(farm: Farm) {
    farm.job(1).await;
    let [slow, quick] = [farm.worker().await, farm.worker().await];
    let claim = async |worker, now_ms| {
        let terms = ClaimTerms {
            target_ms: 5000,
            upload_linger_ms: 5000,
            ttl_ms: 100_000,
            fixed_nodes: Some(15),
            ..terms(worker, now_ms)
        };
        farm.store.claim(move || terms).await.unwrap()
    };
    let held = claim(slow, 0).await.unwrap();
    assert_eq!((held.nodes.len(), held.upload_linger_ms), (15, 5000));
    assert!(claim(quick, 9999).await.is_none(), "of what it has had for as long as another needs, all may be complete");
    assert_eq!(claim(quick, 10_000).await.unwrap().nodes, held.nodes[7..]);
}

pub(super) async fn nodes_wait_for_others_no_longer_than_their_lease_should_take(farm: Farm) {
    let job = farm.job_like(|job| NewJob { passes: 1, grid: TileGrid::new(64, 64, 16), ..job }).await;
    let record = farm.store.job(job).await.unwrap().unwrap();
    let worker = farm.worker().await;
    let claim = async |count, now_ms| {
        let terms = ClaimTerms { upload_linger_ms: 30_000, fixed_nodes: Some(count), ..terms(worker, now_ms) };
        farm.store.claim(move || terms).await.unwrap().unwrap()
    };
    let [alone, unknown] = [claim(1, 0).await, claim(3, 0).await];
    assert_eq!([alone.upload_linger_ms, unknown.upload_linger_ms], [1000, 30_000]);
    // One a second.
    let rate = record.node_samples(&alone.nodes[0]) as f64;
    bring(&farm, &alone, &alone.nodes, &record, rate, 500).await;
    assert_eq!([claim(1, 500).await, claim(8, 500).await].map(|grant| grant.upload_linger_ms), [1000, 8000]);
}

pub(super) async fn late_nodes_are_taken_over_beside_an_older_lease_that_may_keep_its_own(farm: Farm) {
    farm.job(1).await;
    let claim = async |worker, upload_linger_ms, count, now_ms| {
        let terms = ClaimTerms { upload_linger_ms, ttl_ms: 100_000, fixed_nodes: Some(count), ..terms(worker, now_ms) };
        farm.store.claim(move || terms).await.unwrap()
    };
    let [older, younger, quick] = [farm.worker().await, farm.worker().await, farm.worker().await];
    claim(older, 30_000, 8, 0).await.unwrap();
    let late = claim(younger, 1000, 7, 100).await.unwrap();
    assert!(claim(quick, 1000, 15, 2000).await.is_none());
    assert_eq!(claim(quick, 1000, 15, 2100).await.unwrap().nodes, late.nodes[3..]);
}

pub(super) async fn a_node_is_not_leased_again_without_end(farm: Farm) {
    farm.job_like(|job| NewJob { passes: 1, grid: TileGrid::new(8, 8, 16), ..job }).await;
    let mut last = None;
    for time in 0..3 {
        let grant = farm.claim(farm.worker().await, 1, time * 2000).await.unwrap();
        farm.store.renew(grant.lease.id, grant.lease.token, time * 2000, 100_000).await.unwrap();
        if let Some(before) = last.replace(grant.lease.id) {
            let before = farm.store.lease(before).await.unwrap();
            assert_eq!(before.state, LeaseState::Complete, "another has all of it");
        }
    }
    assert!(farm.claim(farm.worker().await, 1, 50_000).await.is_none());
    assert!(farm.claim(farm.worker().await, 1, 52_000).await.is_some(), "the last to take it over has stopped");
}

pub(super) async fn overdue_nodes_of_an_urgent_job_come_before_free_work_of_others(farm: Farm) {
    let urgent = farm.job_with(1, 5, None).await;
    let other = farm.job(4).await;
    let [slow, quick] = [farm.worker().await, farm.worker().await];
    let held = farm.claim(slow, 100, 0).await.unwrap();
    assert_eq!((held.lease.job, held.nodes.len()), (urgent, 15));
    farm.store.renew(held.lease.id, held.lease.token, 0, 100_000).await.unwrap();
    farm.deliver(&held, &held.nodes[..1], 2500).await.unwrap();
    for time in [2000, 3000, 5499] {
        assert_eq!(farm.claim(quick, 1, time).await.unwrap().lease.job, other, "the slow one may still be at it");
    }
    let taken = farm.claim(quick, 100, 5500).await.unwrap();
    assert_eq!((taken.lease.job, taken.nodes.as_slice()), (urgent, &held.nodes[8..]));
}

pub(super) async fn overdue_nodes_of_the_next_round_are_taken_over_while_there_is_work_of_later_ones(farm: Farm) {
    farm.job(4).await;
    let [slow, quick] = [farm.worker().await, farm.worker().await];
    let held = farm.claim(slow, 15, 0).await.unwrap();
    assert!(held.nodes.iter().all(|node| node.passes().first == 0));
    farm.store.renew(held.lease.id, held.lease.token, 0, 100_000).await.unwrap();
    let later = farm.claim(quick, 1, 2999).await.unwrap();
    assert_eq!(later.nodes[0].passes().first, 1);
    assert_eq!(farm.claim(quick, 100, 3000).await.unwrap().nodes, held.nodes[7..]);
}

pub(super) async fn a_single_node_is_taken_over_by_its_passes(farm: Farm) {
    let [slow, quick] = [farm.worker().await, farm.worker().await];
    let grid = TileGrid::new(8, 8, 16);
    let whole = NodeAddress { frame: 0, tile: 0, level: 1, index: 3 };
    let [first_half, second_half] = whole.children().unwrap();
    for is_whole_first in [true, false] {
        farm.job_like(|job| NewJob { passes: 8, grid, ..job }).await;
        let early = farm.claim(slow, 5, 0).await.unwrap();
        farm.deliver(&early, &early.nodes, 0).await.unwrap();
        let held = farm.claim(slow, 1, 0).await.unwrap();
        assert_eq!(held.nodes, [whole]);
        farm.store.renew(held.lease.id, held.lease.token, 0, 100_000).await.unwrap();
        let claim = async || {
            let terms = ClaimTerms { ttl_ms: 100_000, ..terms(quick, 2000) };
            farm.store.claim(move || terms).await.unwrap().unwrap()
        };
        let taken = claim().await;
        assert_eq!(taken.nodes, [second_half]);
        if is_whole_first {
            let answer = farm.deliver(&held, &held.nodes, 2100).await.unwrap();
            assert_eq!((answer.verdicts, answer.outstanding), (vec![NodeVerdict::Accepted], 0));
            let outstanding = farm.store.renew(taken.lease.id, taken.lease.token, 2100, 100_000).await.unwrap();
            assert_eq!(outstanding, 0, "nothing of it is wanted any more");
            let answer = farm.deliver(&taken, &taken.nodes, 2200).await.unwrap();
            assert_eq!(answer.verdicts, [NodeVerdict::Duplicate]);
        } else {
            let answer = farm.deliver(&taken, &taken.nodes, 2100).await.unwrap();
            assert_eq!(answer.verdicts, [NodeVerdict::Accepted]);
            let answer = farm.deliver(&held, &held.nodes, 2200).await.unwrap();
            assert_eq!((answer.verdicts, answer.outstanding), (vec![NodeVerdict::Duplicate], 0));
            assert_eq!(claim().await.nodes, [first_half], "the rest is free again");
        }
    }
}

/// A worker of the simulation.
struct Worker {
    id: WorkerId,
    grant: Option<Grant>,
    /// Nodes of the grant that are rendered; the last `unsent` of them have not been brought, and will be when that is
    /// due, in tenths of a second.
    rendered: usize,
    unsent: usize,
    due: i64,
    /// Samples of the next node that are rendered.
    samples: f64,
}

/// A farm of which a tenth gets twenty times slower in the middle of the job ends it not much later than it could.
pub(super) async fn stragglers_do_not_delay_the_end(farm: Farm) {
    check_the_end(farm, 1000).await;
}

/// So does one whose workers keep what they have rendered for as long as those of a farm of thousands.
pub(super) async fn stragglers_do_not_hold_up_the_end_where_workers_keep_nodes_for_long(farm: Farm) {
    check_the_end(farm, 30_000).await;
}

/// Time is counted in tenths of a second; a worker brings what it has rendered as late as its lease lets it, as real
/// ones do.
async fn check_the_end(farm: Farm, upload_linger_ms: i64) {
    const WORKERS: usize = 20;
    const STRAGGLERS: usize = 2;
    const RATE: f64 = 100_000.0;
    let grid = TileGrid::new(1024, 1024, 64);
    let job =
        farm.job_like(|job| NewJob { passes: 8, samples_per_pass: 16, samples_per_block: 256, grid, ..job }).await;
    let record = farm.store.job(job).await.unwrap().unwrap();
    let mut workers = Vec::new();
    for _ in 0..WORKERS {
        workers.push(Worker { id: farm.worker().await, grant: None, rendered: 0, unsent: 0, due: 0, samples: 0.0 });
    }
    // When the stragglers get slow, the other workers would be half done.
    let slow_from = record.total_samples() as f64 / RATE / WORKERS as f64 / 2.0;
    let rate =
        |number: usize, seconds: f64| if number < STRAGGLERS && seconds >= slow_from { RATE / 20.0 } else { RATE };
    let done_by_then = slow_from * RATE * WORKERS as f64;
    let ideal_rate = RATE * (WORKERS - STRAGGLERS) as f64 + RATE / 20.0 * STRAGGLERS as f64;
    let ideal = slow_from + (record.total_samples() as f64 - done_by_then) / ideal_rate;

    let mut repeated = 0;
    let mut tenths = 0_i64;
    while !is_complete(&farm, job).await {
        let seconds = tenths as f64 / 10.0;
        for (number, worker) in workers.iter_mut().enumerate() {
            // Each has its own moment in a second.
            let turn = (tenths as usize + number).is_multiple_of(10);
            if worker.grant.is_none() && turn {
                worker.grant = claim(&farm, worker.id, upload_linger_ms, tenths * 100).await;
                (worker.rendered, worker.unsent, worker.samples) = (0, 0, 0.0);
            }
            let Some(grant) = &worker.grant else { continue };
            worker.samples += rate(number, seconds) / 10.0;
            while let Some(node) = grant.nodes.get(worker.rendered)
                && worker.samples >= record.node_samples(node) as f64
            {
                worker.samples -= record.node_samples(node) as f64;
                worker.rendered += 1;
                if worker.unsent == 0 {
                    worker.due = tenths + grant.upload_linger_ms / 100;
                }
                worker.unsent += 1;
            }
            let is_over = worker.rendered == grant.nodes.len();
            if worker.unsent > 0 && (tenths >= worker.due || is_over) {
                let nodes = &grant.nodes[worker.rendered - worker.unsent..worker.rendered];
                repeated += bring(&farm, grant, nodes, &record, rate(number, seconds), tenths * 100).await;
                worker.unsent = 0;
            }
            if is_over {
                let (lease, token) = (grant.lease.id, grant.lease.token);
                farm.store.return_lease(lease, token, tenths * 100).await.unwrap();
                worker.grant = claim(&farm, worker.id, upload_linger_ms, tenths * 100).await;
                (worker.rendered, worker.unsent) = (0, 0);
            }
        }
        tenths += 1;
        assert!(tenths < 100_000, "the job does not end");
    }
    let seconds = tenths as f64 / 10.0;
    let wasted = repeated as f64 / record.total_samples() as f64;
    println!(
        "{seconds} s, {:.3} of the ideal {ideal:.1} s; {wasted:.4} of all samples rendered twice",
        seconds / ideal
    );
    assert!(seconds <= 1.2 * ideal, "{seconds} s in place of {ideal} s");
    assert!(wasted < 0.05, "{wasted} of all samples were rendered for nothing");
}

async fn is_complete(farm: &Farm, job: JobId) -> bool {
    let record = farm.store.job(job).await.unwrap().unwrap();
    record.samples == record.total_samples()
}

async fn claim(farm: &Farm, worker: WorkerId, upload_linger_ms: i64, now_ms: i64) -> Option<Grant> {
    let terms = ClaimTerms { target_ms: 10_000, upload_linger_ms, ttl_ms: 1_000_000, ..terms(worker, now_ms) };
    farm.store.claim(move || terms).await.unwrap()
}

/// Brings nodes that were rendered at some samples a second with both cores, and answers the samples that were not
/// needed.
async fn bring(farm: &Farm, grant: &Grant, nodes: &[NodeAddress], job: &JobRecord, rate: f64, now_ms: i64) -> u64 {
    let samples: u64 = nodes.iter().map(|node| job.node_samples(node)).sum();
    let core_ms = (samples as f64 / rate * 2000.0) as i64;
    let nodes: BTreeSet<NodeAddress> = nodes.iter().copied().collect();
    let nodes = nodes.into_iter().map(delivered).collect();
    let (lease, token) = (grant.lease.id, grant.lease.token);
    let delivery = Delivery { lease, token, nodes, core_ms, now_ms, alive_ms: 0 };
    samples - farm.store.accept(delivery).await.unwrap().samples
}
