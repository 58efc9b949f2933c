//! Nodes that a second worker renders too, and the consequences when the results differ.

use clerestory_api::{
    BuildOutcome, BuiltScene, ConvergencePoint, JobId, JobState, NodeVerdict, WorkerActivity, WorkerId, WorkerState,
};
use clerestory_film::{NodeAddress, Targets};

use crate::model::{CheckOutcome, Removed, SceneReport};
use crate::store::tests::adaptive::some_shares;
use crate::store::tests::claims::fail;
use crate::store::tests::{
    DeliveredNode, Farm, Grant, LeaseError, Merge, TTL_MS, WorkerError, blob_range, delivered, merge,
};

/// Nodes with this digest, all of them selected for checks.
pub(super) fn with_digest(nodes: &[NodeAddress], bits: &str) -> Vec<DeliveredNode> {
    let node = |address: &NodeAddress| DeliveredNode {
        digest: format!("{address} {bits}"),
        is_selected: true,
        ..delivered(*address)
    };
    nodes.iter().map(node).collect()
}

pub(super) async fn bring(farm: &Farm, grant: &Grant, bits: &str, now_ms: i64) -> CheckOutcome {
    farm.bring(grant, with_digest(&grant.nodes, bits), now_ms).await.unwrap().checks
}

pub(super) async fn named<const N: usize>(farm: &Farm, names: [&str; N]) -> [WorkerId; N] {
    let mut workers = Vec::new();
    for name in names {
        workers.push(farm.worker_named(name).await.unwrap());
    }
    workers.try_into().unwrap()
}

/// Workers with these names and digests of the probe.
pub(super) async fn with_digests<const N: usize>(farm: &Farm, workers: [(&str, &str); N]) -> [WorkerId; N] {
    let mut registered = Vec::new();
    for (name, digest) in workers {
        registered.push(farm.worker_with(name, Some(digest)).await.unwrap());
    }
    registered.try_into().unwrap()
}

pub(super) async fn redone(farm: &Farm, job: JobId) -> u64 {
    farm.store.job(job).await.unwrap().unwrap().redone_nodes
}

pub(super) async fn two_equal_votes_end_a_check(farm: Farm) {
    let job = farm.job(1).await;
    let [first, second] = named(&farm, ["a", "b"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    assert!(bring(&farm, &all, "right", 0).await.has_work);
    assert_eq!(farm.next_complete_round(job).await, None, "its nodes are not checked");
    assert!(farm.claim(first, 100, 0).await.is_none(), "nobody checks what it has rendered itself");
    let check = farm.claim(second, 4, 0).await.unwrap();
    assert_eq!(check.nodes, all.nodes[..4]);
    let answer = farm.bring(&check, with_digest(&check.nodes, "right"), 0).await.unwrap();
    assert_eq!((answer.verdicts, answer.outstanding), (vec![NodeVerdict::Duplicate; 4], 0));
    assert!(answer.checks.has_ended && answer.checks.quarantined.is_empty());
    assert_eq!(farm.next_complete_round(job).await, None, "some of its nodes are not checked");
    let rest = farm.claim(second, 100, 0).await.unwrap();
    assert_eq!(rest.nodes, all.nodes[4..]);
    bring(&farm, &rest, "right", 0).await;
    assert!(farm.next_complete_round(job).await.is_some());
    let record = farm.store.job(job).await.unwrap().unwrap();
    assert_eq!((record.samples, record.accepted_nodes), (record.total_samples(), 15), "a check is no progress");
}

pub(super) async fn a_worker_whose_vote_differs_from_two_others_is_found_and_its_nodes_are_rendered_again(farm: Farm) {
    let job = farm.job(1).await;
    let ended = farm.job(1).await;
    let [good, wrong, third] = named(&farm, ["good", "wrong", "third"]).await;
    let some = farm.claim(good, 5, 0).await.unwrap();
    let others = farm.claim(wrong, 100, 0).await.unwrap();
    let elsewhere = farm.claim(wrong, 1, 0).await.unwrap();
    assert_eq!(elsewhere.lease.job, ended);
    farm.deliver(&elsewhere, &elsewhere.nodes, 0).await.unwrap();
    let held = farm.claim(wrong, 1, 0).await.unwrap();
    farm.store.end_job(ended, crate::model::Ending::Cancelled, 0).await.unwrap();
    farm.deliver(&some, &some.nodes, 0).await.unwrap();
    bring(&farm, &others, "wrong", 0).await;

    let check = farm.claim(good, 2, 0).await.unwrap();
    assert_eq!(check.nodes, others.nodes[..2]);
    let disputed = bring(&farm, &check, "right", 0).await;
    assert!(disputed.has_work && disputed.quarantined.is_empty(), "one of the two is wrong");
    let decision = farm.claim(third, 2, 0).await.unwrap();
    assert_eq!(decision.nodes, others.nodes[..2]);
    let outcome = bring(&farm, &decision, "right", 7).await;
    let [(found, quarantine)] = outcome.quarantined.as_slice() else { panic!("{outcome:?}") };
    assert_eq!((*found, quarantine.since_ms, quarantine.ended_jobs.as_slice()), (wrong, 7, &[ended][..]));
    assert!(quarantine.reason.contains(&job.to_string()), "{}", quarantine.reason);
    assert_eq!((outcome.redone.as_slice(), outcome.removed.blob_ranges.len()), (&[job][..], 10));
    assert_eq!(farm.addresses(job).await, some.nodes, "nothing of it is left");
    assert_eq!(redone(&farm, job).await, 10);
    let digest = farm.record(job).await.probe_digest;
    assert_eq!(digest.as_deref(), Some(""), "what is left of it has these bits");

    let refused = farm.store.touch_worker(wrong, 8, WorkerActivity::default()).await;
    assert!(matches!(refused, Err(WorkerError::Quarantined { worker, .. }) if worker == wrong), "{refused:?}");
    assert!(matches!(farm.worker_named("wrong").await, Err(WorkerError::Quarantined { .. })), "by another identity");
    assert!(farm.deliver(&held, &held.nodes, 8).await.is_err());
    let repeated = farm.deliver(&others, &others.nodes, 8).await;
    assert!(matches!(repeated, Err(LeaseError::Returned)), "what is wrong is not taken twice: {repeated:?}");
    let view = farm.store.worker(wrong, 0).await.unwrap();
    assert_eq!((view.state, view.quarantine.as_ref()), (WorkerState::Quarantined, Some(quarantine)));

    let again = farm.claim(good, 100, 9).await.unwrap();
    assert_eq!(again.nodes, others.nodes);
    bring(&farm, &again, "right", 9).await;
    let check = farm.claim(third, 100, 9).await.unwrap();
    assert_eq!(check.nodes, others.nodes, "what is rendered again is checked again");
    bring(&farm, &check, "right", 9).await;
    assert!(farm.next_complete_round(job).await.is_some());
    let record = farm.store.job(job).await.unwrap().unwrap();
    assert_eq!(record.samples, record.total_samples());

    farm.store.release_worker(wrong).await.unwrap();
    assert!(
        farm.store.touch_worker(wrong, 9, WorkerActivity::default()).await.is_ok()
            && farm.worker_named("wrong").await.is_ok()
    );
}

pub(super) async fn points_that_were_measured_with_wrong_nodes_are_taken_back(farm: Farm) {
    let job = farm.job(4).await;
    let [good, wrong, third] = named(&farm, ["good", "wrong", "third"]).await;
    for round in 0..2 {
        // A worker that turns out to be wrong renders the first tile.
        let first = farm.claim(wrong, 1, 0).await.unwrap();
        assert_eq!(first.nodes, [NodeAddress { frame: 0, tile: 0, level: 0, index: round }]);
        farm.deliver(&first, &first.nodes, 0).await.unwrap();
        let rest = farm.claim(good, 14, 0).await.unwrap();
        farm.deliver(&rest, &rest.nodes, 0).await.unwrap();
        record(&farm, job, round).await;
    }
    let children = |tile| NodeAddress { frame: 0, tile, level: 1, index: 0 };
    let merged: Vec<Merge> =
        (0..15).map(|tile| merge(children(tile), blob_range("merged", u64::from(tile) * 10))).collect();
    farm.store.replace(job, 0, merged).await.unwrap();

    let stale = farm.store.job(job).await.unwrap().unwrap();
    let last = farm.claim(wrong, 1, 0).await.unwrap();
    bring(&farm, &last, "wrong", 0).await;
    for worker in [good, third] {
        let check = farm.claim(worker, 1, 0).await.unwrap();
        assert_eq!(check.nodes, last.nodes);
        bring(&farm, &check, "right", 0).await;
    }
    let job_record = farm.store.job(job).await.unwrap().unwrap();
    assert!(farm.store.convergence(job).await.unwrap().is_empty(), "both were measured with it");
    assert_eq!((job_record.rounds, redone(&farm, job).await), (2, 2), "two passes in one node, and the last");
    let again = farm.claim(good, 2, 0).await.unwrap();
    let passes = [0, 1].map(|index| NodeAddress { frame: 0, tile: 0, level: 0, index });
    assert_eq!(again.nodes, passes, "cut where rounds end, and first");
    let rest = farm.claim(third, 100, 0).await.unwrap();
    farm.deliver(&rest, &rest.nodes, 0).await.unwrap();
    assert_eq!(farm.next_complete_round(job).await, None, "earlier passes are missing");
    farm.deliver(&again, &again.nodes, 0).await.unwrap();
    let complete = farm.next_complete_round(job).await.unwrap();
    assert_eq!((complete.round, complete.passes), (2, 4));
    let late = farm.store.record_round(&stale, vec![point(2)], 0).await.unwrap();
    assert_eq!(late, None, "it was measured before nodes were taken out");
    let merged = merge(NodeAddress { frame: 0, tile: 0, level: 1, index: 0 }, blob_range("late", 0));
    assert!(farm.store.replace(job, 0, vec![merged]).await.is_err(), "it was summed before nodes were taken out");
    let fresh = farm.store.job(job).await.unwrap().unwrap();
    assert!(farm.store.record_round(&fresh, vec![point(2)], 0).await.unwrap().is_some());
}

fn point(round: u32) -> ConvergencePoint {
    ConvergencePoint {
        frame: 0,
        round,
        passes: 1 << round,
        samples_per_pixel: 4 << round,
        core_ms: 0,
        wall_ms: 0,
        recorded_ms: 0,
        mse: None,
        corrected_mse: None,
        rel_mse: None,
        psnr: None,
        flip: None,
        estimated_mse: None,
    }
}

async fn record(farm: &Farm, job: JobId, round: u32) {
    assert!(farm.next_complete_round(job).await.is_some());
    let record = farm.store.job(job).await.unwrap().unwrap();
    farm.store.record_round(&record, vec![point(round)], 0).await.unwrap().unwrap();
}

pub(super) async fn a_check_that_no_worker_can_do_does_not_delay_the_round(farm: Farm) {
    let job = farm.job(1).await;
    let alone = farm.worker_named("alone").await.unwrap();
    let late = 10 * TTL_MS;
    let some = farm.claim(alone, 7, 0).await.unwrap();
    assert!(!bring(&farm, &some, "bits", 0).await.has_work, "nobody is there to check");
    // Another is there for a while, and gets nothing to do before it goes.
    let other = farm.worker_named("other").await.unwrap();
    farm.store.touch_worker(other, late, WorkerActivity::default()).await.unwrap();
    let rest = farm.claim(alone, 100, late).await.unwrap();
    assert!(bring(&farm, &rest, "bits", late).await.has_work);
    assert!(farm.store.give_up_checks(late).await.unwrap().is_empty(), "the other may still do them");
    assert!(farm.store.give_up_checks(i64::MIN).await.unwrap().is_empty(), "all are waited for");
    assert_eq!(farm.next_complete_round(job).await, None);
    let given_up = farm.store.give_up_checks(late + 1).await.unwrap();
    assert_eq!(given_up.len(), 8);
    assert!(given_up.iter().all(|given_up| given_up.workers == [alone]));
    assert!(farm.next_complete_round(job).await.is_some());

    let job = farm.job(1).await;
    let all = farm.claim(alone, 100, late).await.unwrap();
    bring(&farm, &all, "bits", late).await;
    let check = farm.claim(other, 100, late).await.unwrap();
    bring(&farm, &check, "others", late).await;
    assert_eq!(farm.next_complete_round(job).await, None, "a third has to decide");
    let given_up = farm.store.give_up_checks(late).await.unwrap();
    assert!(given_up.len() == 15 && given_up.iter().all(|given_up| given_up.workers == [alone, other]));
    assert!(farm.next_complete_round(job).await.is_some());
}

pub(super) async fn no_check_waits_for_a_machine_that_fails_again_and_again(farm: Farm) {
    let job = farm.job(1).await;
    let [first, failing] = named(&farm, ["first", "failing"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    assert!(bring(&farm, &all, "bits", 0).await.has_work);
    for attempt in 0..5 {
        assert!(farm.store.give_up_checks(0).await.unwrap().is_empty(), "{attempt} failures");
        fail(&farm, failing, attempt * 60_000, 0).await;
    }
    assert_eq!(farm.next_complete_round(job).await, None);
    let given_up = farm.store.give_up_checks(0).await.unwrap();
    assert!(given_up.len() == 15 && given_up.iter().all(|given_up| given_up.workers == [first]), "{given_up:?}");
    assert!(farm.next_complete_round(job).await.is_some());

    // Nor is any begun, until it has brought something.
    let job = farm.job(1).await;
    let late = 5 * 60_000;
    let some = farm.claim(first, 5, late).await.unwrap();
    assert_eq!(some.lease.job, job);
    assert!(!bring(&farm, &some, "bits", late).await.has_work);
    let one = farm.claim(failing, 1, late).await.unwrap();
    farm.deliver(&one, &one.nodes, late).await.unwrap();
    let rest = farm.claim(first, 100, late).await.unwrap();
    assert!(bring(&farm, &rest, "bits", late).await.has_work);
    let check = farm.claim(failing, 100, late).await.unwrap();
    assert_eq!(check.nodes, rest.nodes);
}

pub(super) async fn an_answered_check_ends_a_row_of_failures(farm: Farm) {
    farm.job(1).await;
    let [first, second] = named(&farm, ["first", "second"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    bring(&farm, &all, "bits", 0).await;
    for now_ms in [0, 5 * 60_000] {
        for attempt in 0..4 {
            fail(&farm, second, now_ms + attempt * 60_000, 0).await;
        }
        let late = now_ms + 4 * 60_000;
        let check = farm.claim(second, 1, late).await.unwrap();
        bring(&farm, &check, "bits", late).await;
        assert!(farm.store.give_up_checks(0).await.unwrap().is_empty(), "it can do the others, too");
    }
}

pub(super) async fn a_check_that_one_machine_fails_waits_for_another(farm: Farm) {
    let job = farm.job(1).await;
    let [first, failing, third] = named(&farm, ["first", "failing", "third"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    bring(&farm, &all, "bits", 0).await;
    for attempt in 0..20 {
        fail(&farm, failing, attempt * 60_000, 0).await;
        assert!(farm.store.give_up_checks(0).await.unwrap().is_empty(), "{attempt} failures");
    }
    let late = 20 * 60_000;
    let checks = farm.claim(third, 100, late).await.unwrap();
    assert_eq!(checks.nodes, all.nodes);
    bring(&farm, &checks, "bits", late).await;
    assert!(farm.next_complete_round(job).await.is_some());
}

pub(super) async fn a_check_ends_though_no_node_would_be_chosen_now(farm: Farm) {
    farm.job(1).await;
    let [first, second, third] = named(&farm, ["first", "second", "third"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    assert!(bring(&farm, &all, "bits", 0).await.has_work);
    let unchosen = |nodes: &[NodeAddress], bits: &str| -> Vec<DeliveredNode> {
        with_digest(nodes, bits).into_iter().map(|node| DeliveredNode { is_selected: false, ..node }).collect()
    };
    let check = farm.claim(second, 1, 0).await.unwrap();
    let agreed = farm.bring(&check, unchosen(&check.nodes, "bits"), 0).await.unwrap().checks;
    assert!(agreed.has_ended && !agreed.has_work, "{agreed:?}");
    let check = farm.claim(second, 100, 0).await.unwrap();
    assert_eq!(check.nodes.len(), all.nodes.len() - 1, "the one that has been compared is not claimed again");
    let disputed = farm.bring(&check, unchosen(&check.nodes, "others"), 0).await.unwrap().checks;
    assert!(disputed.has_work && !disputed.has_ended, "{disputed:?}");
    let decision = farm.claim(third, 100, 0).await.unwrap();
    let decided = farm.bring(&decision, unchosen(&decision.nodes, "bits"), 0).await.unwrap().checks;
    assert!(matches!(decided.quarantined.as_slice(), [(wrong, _)] if *wrong == second), "{decided:?}");
}

pub(super) async fn a_worker_with_another_fingerprint_cannot_check(farm: Farm) {
    let job = farm.job(1).await;
    let [first, _other] = with_digests(&farm, [("first", "x"), ("other", "y")]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    assert!(!bring(&farm, &all, "bits", 0).await.has_work, "nobody who can check is there");
    assert!(farm.next_complete_round(job).await.is_some());

    let job = farm.job(1).await;
    let [second] = with_digests(&farm, [("second", "x")]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    assert!(bring(&farm, &all, "bits", 0).await.has_work);
    assert!(farm.store.give_up_checks(0).await.unwrap().is_empty(), "the second may still do them");
    let check = farm.claim(second, 100, 0).await.unwrap();
    bring(&farm, &check, "others", 0).await;
    assert_eq!(farm.next_complete_round(job).await, None, "a third has to decide");
    let given_up = farm.store.give_up_checks(0).await.unwrap();
    assert!(given_up.len() == 15 && given_up.iter().all(|given_up| given_up.workers == [first, second]));
    assert!(farm.next_complete_round(job).await.is_some());
}

pub(super) async fn workers_of_one_name_are_one_machine(farm: Farm) {
    let job = farm.job(1).await;
    let [before, again] = named(&farm, ["wrong", "wrong"]).await;
    let some = farm.claim(before, 5, 0).await.unwrap();
    assert!(!bring(&farm, &some, "wrong", 0).await.has_work, "no other machine is there");
    let [good, third] = named(&farm, ["good", "third"]).await;
    let rest = farm.claim(again, 100, 0).await.unwrap();
    assert!(bring(&farm, &rest, "wrong", 0).await.has_work);
    assert!(farm.claim(before, 100, 0).await.is_none(), "no machine checks itself");
    let check = farm.claim(good, 100, 0).await.unwrap();
    assert!(bring(&farm, &check, "right", 0).await.quarantined.is_empty());
    assert!(farm.claim(before, 100, 0).await.is_none(), "no machine has two voices");
    let decision = farm.claim(third, 100, 0).await.unwrap();
    assert_eq!((&check.nodes, &decision.nodes), (&rest.nodes, &rest.nodes));
    let outcome = bring(&farm, &decision, "right", 0).await;
    assert!(matches!(outcome.quarantined.as_slice(), [(worker, _)] if *worker == again), "{outcome:?}");
    assert_eq!(outcome.removed.blob_ranges.len(), 15, "also what it rendered before it was started again");
    assert!(farm.addresses(job).await.is_empty());
    for worker in [before, again] {
        let refused = farm.store.touch_worker(worker, 0, WorkerActivity::default()).await;
        assert!(matches!(refused, Err(WorkerError::Quarantined { .. })), "{refused:?}");
    }
    assert!(matches!(farm.deliver(&some, &some.nodes, 0).await, Err(LeaseError::Returned)));
    farm.store.release_worker(before).await.unwrap();
    for worker in [before, again] {
        farm.store.touch_worker(worker, 0, WorkerActivity::default()).await.unwrap();
    }
}

pub(super) async fn a_worker_of_the_same_name_cannot_check(farm: Farm) {
    let job = farm.job(1).await;
    let [first, namesake, _other] = named(&farm, ["first", "first", "other"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    assert!(bring(&farm, &all, "bits", 0).await.has_work);
    let late = 10 * TTL_MS;
    farm.store.touch_worker(namesake, late, WorkerActivity::default()).await.unwrap();
    assert_eq!(farm.store.give_up_checks(late).await.unwrap().len(), 15);
    assert!(farm.next_complete_round(job).await.is_some());
}

pub(super) async fn a_job_that_is_pinned_to_a_wrong_machine_alone_restarts_with_another(farm: Farm) {
    let [begun, untouched] = [farm.job(1).await, farm.job(1).await];
    // Its memory was wrong while it rendered the probe.
    let [odd] = with_digests(&farm, [("wrong", "odd")]).await;
    let some = farm.claim(odd, 100, 0).await.unwrap();
    let held = farm.claim(odd, 100, 0).await.unwrap();
    assert_eq!((some.lease.job, held.lease.job), (begun, untouched));
    let (lease, token, now_ms, alive_ms) = (some.lease.id, some.lease.token, 0, i64::MIN);
    let outcome = BuildOutcome::Built(BuiltScene::default());
    farm.store.report_scene(SceneReport { lease, token, outcome, now_ms, alive_ms }).await.unwrap();
    farm.deliver(&some, &some.nodes[..3], 0).await.unwrap();

    let [wrong, good, third] = with_digests(&farm, [("wrong", "x"), ("good", "x"), ("third", "x")]).await;
    assert!(farm.claim(good, 1, 0).await.is_none(), "both have other bits");
    let checked = farm.job(1).await;
    let grant = farm.claim(wrong, 2, 0).await.unwrap();
    assert_eq!(grant.lease.job, checked);
    let outcome = find_wrong(&farm, &grant, [good, third]).await;
    assert_eq!(outcome.redone, [begun, untouched, checked]);
    assert_eq!((redone(&farm, begun).await, redone(&farm, untouched).await), (3, 0));
    for (job, late) in [(begun, some), (untouched, held)] {
        let record = farm.record(job).await;
        assert_eq!((record.probe_digest, record.built_scene), (None, None));
        let late = farm.deliver(&late, &late.nodes, 0).await;
        assert!(matches!(late, Err(LeaseError::Returned)), "{late:?}");
        let all = farm.claim(good, 100, 0).await.unwrap();
        assert_eq!((all.lease.job, all.nodes.len()), (job, 15));
        farm.deliver(&all, &all.nodes, 0).await.unwrap();
        assert_eq!(farm.record(job).await.probe_digest.as_deref(), Some("x"));
        assert!(farm.next_complete_round(job).await.is_some());
    }
}

/// Longer than any of these leases should last, milliseconds.
pub(super) const LONG_MS: i64 = 100_000;

pub(super) async fn the_second_upload_of_a_node_is_its_check(farm: Farm) {
    let job = farm.job(1).await;
    let [first, second] = named(&farm, ["first", "second"]).await;
    let one = farm.claim(first, 1, 0).await.unwrap();
    let rest = farm.claim(second, 100, 0).await.unwrap();
    farm.deliver(&rest, &rest.nodes, 0).await.unwrap();
    let late = 60_000;
    farm.store.renew(one.lease.id, one.lease.token, 0, late + TTL_MS).await.unwrap();
    let taken = farm.claim(second, 1, late).await.unwrap();
    assert_eq!(taken.nodes, one.nodes, "as work that the first does not bring");
    assert!(bring(&farm, &one, "bits", late).await.has_work);
    assert_eq!(farm.next_complete_round(job).await, None, "it is to be checked");
    assert!(!bring(&farm, &one, "others", late).await.has_work, "not by whoever has brought it");
    assert!(bring(&farm, &taken, "bits", late).await.has_ended);
    assert!(farm.next_complete_round(job).await.is_some());
}

pub(super) async fn the_worker_that_rendered_a_node_is_not_waited_for_to_check_it(farm: Farm) {
    farm.job(1).await;
    let [first, second, third] = named(&farm, ["first", "second", "third"]).await;
    let one = farm.claim(first, 1, 0).await.unwrap();
    let rest = farm.claim(second, 100, 0).await.unwrap();
    farm.deliver(&rest, &rest.nodes, 0).await.unwrap();
    let late = 60_000;
    farm.store.renew(one.lease.id, one.lease.token, 0, late + TTL_MS).await.unwrap();
    let taken = farm.claim(second, 1, late).await.unwrap();
    assert!(bring(&farm, &one, "right", late).await.has_work);
    let check = farm.claim(second, 1, late).await.unwrap();
    assert_eq!((&taken.nodes, &check.nodes), (&one.nodes, &one.nodes), "as work, and to check it");
    let disputed = bring(&farm, &taken, "wrong", late).await;
    assert!(disputed.has_work && !disputed.has_ended, "{disputed:?}");
    assert_eq!(outstanding(&farm, &check, late).await, 0, "it has answered it");
    let decision = farm.claim(third, 1, late).await.unwrap();
    assert_eq!(decision.nodes, one.nodes);
    let decided = bring(&farm, &decision, "right", late).await;
    assert!(matches!(decided.quarantined.as_slice(), [(wrong, _)] if *wrong == second), "{decided:?}");
}

/// How much is still wanted under a lease, which goes on.
pub(super) async fn outstanding(farm: &Farm, grant: &Grant, now_ms: i64) -> u32 {
    farm.store.renew(grant.lease.id, grant.lease.token, now_ms, now_ms + LONG_MS).await.unwrap()
}

pub(super) async fn a_job_stays_pinned_to_its_first_fingerprint(farm: Farm) {
    let older = farm.job(1).await;
    let newer = farm.job(1).await;
    let mut workers = Vec::new();
    for digest in [Some("x"), Some("y"), None, Some("x")] {
        workers.push(farm.worker_with("w", digest).await.unwrap());
    }
    let [x, y, none, other_x] = workers.try_into().unwrap();
    assert_eq!(farm.claim(x, 1, 0).await.unwrap().lease.job, older);
    assert_eq!(farm.claim(y, 1, 0).await.unwrap().lease.job, newer);
    assert_eq!(farm.claim(y, 1, 0).await.unwrap().lease.job, newer);
    assert!(farm.claim(none, 1, 0).await.is_none());
    assert_eq!(farm.claim(other_x, 100, 0).await.unwrap().lease.job, older);
    assert!(farm.claim(other_x, 1, 0).await.is_none());
    let store = &farm.store;
    let passed_over = |id| async move { store.worker(id, 0).await.unwrap().passed_over };
    assert_eq!((passed_over(x).await, passed_over(y).await), (vec![newer], vec![older]));
    assert_eq!(passed_over(none).await, [older, newer]);
}

/// Two other workers find that a worker has brought other digests for the nodes of a lease than they do.
async fn find_wrong(farm: &Farm, grant: &Grant, others: [WorkerId; 2]) -> CheckOutcome {
    assert!(bring(farm, grant, "wrong", 0).await.has_work);
    let mut outcome = CheckOutcome::default();
    for worker in others {
        let check = farm.claim(worker, grant.nodes.len() as u32, 0).await.unwrap();
        assert_eq!(check.nodes, grant.nodes);
        outcome = bring(farm, &check, "right", 0).await;
    }
    assert_eq!(outcome.quarantined.len(), 1, "{outcome:?}");
    outcome
}

pub(super) async fn a_pilot_that_a_wrong_worker_has_rendered_is_rendered_again(farm: Farm) {
    let job = farm.adaptive_job(Targets::default()).await;
    let [good, wrong, third] = named(&farm, ["good", "wrong", "third"]).await;
    let first = farm.claim(wrong, 1, 0).await.unwrap();
    let rest = farm.claim(wrong, 256, 0).await.unwrap();
    farm.deliver(&rest, &rest.nodes, 0).await.unwrap();
    let tiles = job.grid.len();
    assert_eq!(farm.pilot(&job).await.unwrap().len() as u32, 5 * tiles);
    let outcome = find_wrong(&farm, &first, [good, third]).await;
    assert_eq!(outcome.removed.blob_ranges.len(), 1 + rest.nodes.len());
    assert!(farm.pilot(&job).await.unwrap().is_empty());
    farm.deliver_all(good).await;
    assert_eq!(farm.pilot(&job).await.unwrap().len() as u32, 5 * tiles);
    assert_eq!(farm.accepted(job.id).await, vec![32; tiles as usize]);
    farm.record_rounds(job.id, 1, 1.0).await;
    assert!(farm.next_complete_round(job.id).await.is_some(), "the round of the pilot is complete with it");
}

pub(super) async fn a_job_whose_passes_a_wrong_pilot_has_shared_out_begins_again(farm: Farm) {
    let job = farm.adaptive_job(Targets::default()).await;
    let [good, wrong, third] = named(&farm, ["good", "wrong", "third"]).await;
    farm.deliver_all(wrong).await;
    farm.record_rounds(job.id, 1, 1.0).await;
    let stale = farm.record(job.id).await;
    farm.store.share_out(&stale, some_shares(&job)).await.unwrap();
    farm.record_rounds(job.id, 1, 1.0).await;
    let beyond = farm.claim(wrong, 1, 0).await.unwrap();
    let outcome = find_wrong(&farm, &beyond, [good, third]).await;
    assert_eq!(outcome.redone, [job.id]);
    let record = farm.record(job.id).await;
    assert_eq!((record.rounds, record.samples, record.shared_samples), (0, 0, None));
    assert_eq!(record.probe_digest, None, "nothing is left that has any bits");
    assert!(farm.addresses(job.id).await.is_empty() && farm.store.convergence(job.id).await.unwrap().is_empty());

    farm.deliver_all(good).await;
    farm.record_rounds(job.id, 1, 1.0).await;
    let late = farm.store.share_out(&stale, some_shares(&job)).await.unwrap();
    assert!(!late, "it was decided before nodes were taken out");
    assert_eq!(farm.discard_pilot(&stale).await, Removed::default(), "it is needed again");
    let record = farm.record(job.id).await;
    assert_eq!(record.shared_samples, None);
    farm.store.share_out(&record, some_shares(&record)).await.unwrap();
    farm.deliver_all(good).await;
    farm.record_rounds(job.id, 8, 1.0).await;
    let done = farm.record(job.id).await;
    assert_eq!((done.state, done.samples), (JobState::Done, done.total_samples()));
}
