//! Leases: expired, renewed, and called under a wrong token.

use clerestory_api::{LeaseId, NodeVerdict};
use uuid::Uuid;

use crate::model::Grant;
use crate::store::errors::LeaseError;
use crate::store::tests::Farm;
use crate::store::tests::farm::TTL_MS;

pub(super) async fn an_expired_lease_is_claimable_again_and_its_late_result_changes_nothing(farm: Farm) {
    let job = farm.job(1).await;
    let (first, second) = (farm.worker().await, farm.worker().await);
    let lost = farm.claim(first, 3, 0).await.unwrap();
    assert_eq!(farm.expire(TTL_MS - 1).await, 0);
    assert_eq!(farm.expire(TTL_MS).await, 1);
    let again = farm.claim(second, 3, TTL_MS).await.unwrap();
    assert_eq!(again.nodes, lost.nodes);
    assert!(again.lease.token > lost.lease.token);
    let late = farm.deliver(&lost, &lost.nodes, TTL_MS).await;
    assert!(matches!(late, Err(LeaseError::Expired)), "{late:?}");
    assert!(farm.addresses(job).await.is_empty());
    let good = farm.deliver(&again, &again.nodes, TTL_MS).await.unwrap();
    assert_eq!(good.verdicts, [NodeVerdict::Accepted; 3]);
}

pub(super) async fn a_lease_is_dead_at_its_deadline_even_before_the_sweep(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 1, 0).await.unwrap();
    let late = farm.deliver(&grant, &grant.nodes, TTL_MS).await;
    assert!(matches!(late, Err(LeaseError::Expired)), "{late:?}");
    assert!(farm.addresses(job).await.is_empty());
}

pub(super) async fn a_renewed_lease_lives_on(farm: Farm) {
    farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 1, 0).await.unwrap();
    farm.store.renew(grant.lease.id, grant.lease.token, 900, 900 + TTL_MS).await.unwrap();
    assert_eq!(farm.expire(TTL_MS).await, 0);
    assert!(farm.deliver(&grant, &grant.nodes, 1500).await.is_ok());
}

pub(super) async fn renewals_that_come_together_are_answered_one_by_one(farm: Farm) {
    farm.job(4).await;
    let (one, other) = (farm.worker().await, farm.worker().await);
    let active = farm.claim(one, 2, 0).await.unwrap();
    let complete = farm.claim(one, 1, 0).await.unwrap();
    farm.deliver(&complete, &complete.nodes, 0).await.unwrap();
    let returned = farm.claim(other, 1, 0).await.unwrap();
    farm.store.return_lease(returned.lease.id, returned.lease.token, 0).await.unwrap();
    let expired = farm.claim(other, 1, 0).await.unwrap();
    let late = farm.claim(other, 1, 500).await.unwrap();
    let store = &farm.store;
    let renew = |grant: &Grant, more: u64, now_ms| {
        let (lease, token) = (grant.lease.id, grant.lease.token + more);
        async move { store.renew(lease, token, now_ms, now_ms + TTL_MS).await }
    };
    let unknown = store.renew(LeaseId::from(Uuid::nil()), 1, 0, TTL_MS);
    let (now_ms, later) = (TTL_MS - 1, TTL_MS + 1);
    let outcomes = futures::join!(
        renew(&active, 0, now_ms),
        renew(&active, 1, now_ms),
        renew(&active, u64::MAX / 2, now_ms),
        renew(&complete, 0, now_ms),
        renew(&returned, 0, now_ms),
        renew(&expired, 0, later),
        renew(&late, 0, later),
        unknown,
    );
    assert!(matches!(outcomes.0, Ok(2)), "{outcomes:?}");
    assert!(matches!(outcomes.1, Err(LeaseError::StaleToken(_))), "{outcomes:?}");
    assert!(matches!(outcomes.2, Err(LeaseError::StaleToken(_))), "{outcomes:?}");
    assert!(matches!(outcomes.3, Ok(0)), "{outcomes:?}");
    assert!(matches!(outcomes.4, Err(LeaseError::Returned)), "{outcomes:?}");
    assert!(matches!(outcomes.5, Err(LeaseError::Expired)), "{outcomes:?}");
    assert!(matches!(outcomes.6, Ok(1)), "{outcomes:?}");
    assert!(matches!(outcomes.7, Err(LeaseError::Unknown(_))), "{outcomes:?}");
    // One batch wrote them: with the latest deadline, and the latest heartbeat of each worker.
    for renewed in [&active, &late] {
        assert_eq!(farm.store.lease(renewed.lease.id).await.unwrap().deadline_ms, later + TTL_MS);
    }
    let views = farm.store.workers(0, 0).await.unwrap();
    assert_eq!(views.iter().map(|view| view.seen_ms).collect::<Vec<_>>(), [later; 2]);
    assert_eq!(farm.expire(later + TTL_MS - 1).await, 1);
    assert!(farm.deliver(&active, &active.nodes, later + TTL_MS - 1).await.is_ok());
}

pub(super) async fn more_renewals_than_are_written_together_are_all_answered(farm: Farm) {
    farm.job(4).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 2, 0).await.unwrap();
    let (lease, token) = (grant.lease.id, grant.lease.token);
    let renewals = (0..600).map(|number| {
        let renewal = farm.store.renew(lease, token + number % 3, 500, 500 + TTL_MS);
        async move { (number, renewal.await) }
    });
    for (number, outcome) in futures::future::join_all(renewals).await {
        match number % 3 {
            0 => assert_eq!(outcome.unwrap(), 2),
            _ => assert!(matches!(outcome, Err(LeaseError::StaleToken(stale)) if stale == token + number % 3)),
        }
    }
    assert!(farm.store.renew(lease, token, 501, 501 + TTL_MS).await.is_ok(), "the next is the first again");
}

pub(super) async fn a_wrong_token_opens_nothing(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let mut grant = farm.claim(worker, 1, 0).await.unwrap();
    grant.lease.token += 1;
    assert!(matches!(farm.deliver(&grant, &grant.nodes, 0).await, Err(LeaseError::StaleToken(_))));
    let renewed = farm.store.renew(grant.lease.id, grant.lease.token, 0, 10).await;
    assert!(matches!(renewed, Err(LeaseError::StaleToken(_))));
    assert!(farm.addresses(job).await.is_empty());
}
