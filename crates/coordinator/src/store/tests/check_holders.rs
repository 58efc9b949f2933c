//! Workers that hold checks: another takes them over, and the first answer counts.

use clerestory_api::WorkerId;

use crate::model::CheckOutcome;
use crate::store::tests::checks::{bring, named, outstanding, with_digest};
use crate::store::tests::{Farm, Grant, TTL_MS};

pub(super) async fn checks_of_a_worker_that_is_gone_go_to_another(farm: Farm) {
    farm.job(1).await;
    let [first, second, third] = named(&farm, ["a", "b", "c"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    bring(&farm, &all, "right", 0).await;
    let lost = farm.claim(second, 5, 0).await.unwrap();
    farm.store.renew(lost.lease.id, lost.lease.token, 0, 5 * TTL_MS).await.unwrap();
    let rest = farm.claim(third, 100, 0).await.unwrap();
    bring(&farm, &rest, "right", 0).await;
    assert!(farm.claim(third, 100, 1999).await.is_none(), "it may still be at it, or wait to bring it");
    let taken = farm.claim(third, 5, 2000).await.unwrap();
    assert_eq!(taken.lease.nodes, lost.lease.nodes, "it has been at it for longer than a lease should take");
    assert!(bring(&farm, &taken, "right", 2001).await.has_ended);
    assert!(!bring(&farm, &lost, "other", 2002).await.has_work, "it is too late");
    assert_eq!(all.nodes.len(), lost.nodes.len() + rest.nodes.len());

    farm.job(1).await;
    let all = farm.claim(first, 100, 3000).await.unwrap();
    bring(&farm, &all, "right", 3000).await;
    let lost = farm.claim(second, 100, 3000).await.unwrap();
    farm.expire(3000 + TTL_MS).await;
    assert_eq!(farm.claim(third, 100, 3000 + TTL_MS).await.unwrap().nodes, lost.nodes);
}

/// A claim of whatever there is, under a lease that lasts.
async fn long(farm: &Farm, worker: WorkerId, now_ms: i64) -> Grant {
    let grant = farm.claim(worker, 100, now_ms).await.unwrap();
    outstanding(farm, &grant, now_ms).await;
    grant
}

pub(super) async fn the_holder_of_a_check_keeps_it_when_another_worker_takes_it_over(farm: Farm) {
    let job = farm.job(1).await;
    let [first, slow, slower, late] = named(&farm, ["first", "slow", "slower", "late"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    bring(&farm, &all, "bits", 0).await;
    let check = long(&farm, slow, 0).await;
    assert!(farm.claim(slow, 100, 2000).await.is_none(), "it has it already");
    let taken = long(&farm, slower, 2000).await;
    assert_eq!(check.nodes, all.nodes);
    assert!(taken.nodes.iter().eq(all.nodes.iter().rev()), "from the other end");
    for now_ms in [2000, 4000, 20_000] {
        assert_eq!([outstanding(&farm, &check, now_ms).await, outstanding(&farm, &taken, now_ms).await], [15; 2]);
        for worker in [slow, slower, late] {
            assert!(farm.claim(worker, 100, now_ms).await.is_none(), "two are at it");
        }
    }
    assert!(bring(&farm, &check, "bits", 20_000).await.has_ended, "whoever comes first");
    assert_eq!(outstanding(&farm, &taken, 20_000).await, 0);
    let answer = farm.bring(&taken, with_digest(&taken.nodes, "others"), 20_000).await.unwrap();
    assert_eq!(answer.checks, CheckOutcome::default(), "it comes second");
    assert!(farm.next_complete_round(job).await.is_some());
}

pub(super) async fn a_check_that_two_have_goes_on_without_either(farm: Farm) {
    farm.job(1).await;
    let [first, one, two, three] = named(&farm, ["first", "one", "two", "three"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    bring(&farm, &all, "bits", 0).await;
    for gives_up in [0, 1] {
        let now_ms = gives_up * 10_000;
        let check = long(&farm, one, now_ms).await;
        let taken = long(&farm, two, now_ms + 2000).await;
        let given_up = if gives_up == 0 { &check } else { &taken };
        farm.store.return_lease(given_up.lease.id, given_up.lease.token, now_ms + 2000).await.unwrap();
        let other = if gives_up == 0 { &taken } else { &check };
        assert_eq!(outstanding(&farm, other, now_ms + 2000).await, 15);
        assert!(farm.store.give_up_checks(i64::MAX).await.unwrap().is_empty(), "it is at it");
        let again = long(&farm, three, now_ms + 4000).await;
        assert_eq!(again.lease.nodes, all.lease.nodes, "there is one who has had it for long enough");
        farm.store.return_lease(again.lease.id, again.lease.token, now_ms + 4000).await.unwrap();
        farm.store.return_lease(other.lease.id, other.lease.token, now_ms + 4000).await.unwrap();
    }
    // Nobody has it: it is as it was at first.
    let check = long(&farm, three, 20_000).await;
    assert!(bring(&farm, &check, "bits", 20_000).await.has_ended);
}

pub(super) async fn two_workers_that_do_not_bring_a_check_keep_it_from_no_other(farm: Farm) {
    farm.job(1).await;
    let [first, one, two, three] = named(&farm, ["first", "one", "two", "three"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    bring(&farm, &all, "bits", 0).await;
    let check = long(&farm, one, 0).await;
    let taken = long(&farm, two, 2000).await;
    for grant in [&check, &taken] {
        assert_eq!(outstanding(&farm, grant, 32_999).await, 15);
    }
    assert!(farm.claim(three, 100, 32_999).await.is_none());
    let last = long(&farm, three, 33_000).await;
    assert_eq!(last.lease.nodes, all.lease.nodes);
    let answer = farm.bring(&taken, with_digest(&all.nodes[..5], "bits"), 33_000).await.unwrap();
    assert!(answer.checks.has_ended, "it had it once");
    assert_eq!(outstanding(&farm, &check, 33_000).await, 10);
    assert!(bring(&farm, &last, "bits", 33_000).await.has_ended);
}

pub(super) async fn the_second_of_two_holders_of_a_check_decides_a_dispute(farm: Farm) {
    farm.job(1).await;
    let [first, one, two] = named(&farm, ["first", "one", "two"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    bring(&farm, &all, "right", 0).await;
    let check = long(&farm, one, 0).await;
    let taken = long(&farm, two, 2000).await;
    let disputed = bring(&farm, &check, "wrong", 2000).await;
    assert!(disputed.has_work && !disputed.has_ended, "{disputed:?}");
    assert_eq!(outstanding(&farm, &taken, 2000).await, 15, "it is at it");
    let decided = bring(&farm, &taken, "right", 2000).await;
    assert!(matches!(decided.quarantined.as_slice(), [(wrong, _)] if *wrong == one), "{decided:?}");
}

pub(super) async fn workers_of_one_name_take_checks_over_from_each_other_and_answer_once(farm: Farm) {
    farm.job(1).await;
    let [first, hung, namesake, third] = named(&farm, ["first", "twin", "twin", "third"]).await;
    let all = farm.claim(first, 100, 0).await.unwrap();
    bring(&farm, &all, "right", 0).await;
    let check = long(&farm, hung, 0).await;
    let taken = long(&farm, namesake, 2000).await;
    assert_eq!(taken.lease.nodes, check.lease.nodes);
    let disputed = bring(&farm, &taken, "wrong", 2000).await;
    assert!(disputed.has_work && !disputed.has_ended, "{disputed:?}");
    assert_eq!([outstanding(&farm, &check, 2000).await, outstanding(&farm, &taken, 2000).await], [0; 2]);
    let decision = farm.claim(third, 100, 2000).await.unwrap();
    assert_eq!(decision.nodes, all.nodes, "neither of the two has it any more");
    assert_eq!(bring(&farm, &check, "right", 2000).await, CheckOutcome::default(), "they have had their say");
    let decided = bring(&farm, &decision, "right", 2000).await;
    assert!(matches!(decided.quarantined.as_slice(), [(wrong, _)] if *wrong == namesake), "{decided:?}");
}
