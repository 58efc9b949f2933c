//! Which work a worker gets.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{JobId, JobState, WorkerId};
use clerestory_render_core::film::NodeAddress;
use uuid::Uuid;

use super::farm::terms;
use super::{Farm, LeaseError, TTL_MS};
use crate::store::{ClaimTerms, WorkFailure, WorkerError};

pub(super) async fn concurrent_claimants_never_get_the_same_node(farm: Farm) {
    let job = farm.job(40).await;
    let mut claimants = Vec::new();
    for size in 1..=8 {
        let worker = farm.worker().await;
        let farm = &farm;
        claimants.push(async move {
            let mut mine = Vec::new();
            while let Some(grant) = farm.claim(worker, size, 0).await {
                assert!(grant.nodes.len() <= size as usize);
                mine.extend(grant.nodes);
            }
            mine
        });
    }
    let nodes: Vec<NodeAddress> = futures::future::join_all(claimants).await.into_iter().flatten().collect();
    let distinct: BTreeSet<NodeAddress> = nodes.iter().copied().collect();
    assert_eq!(distinct.len(), nodes.len());
    let mut passes: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for node in &nodes {
        for pass in node.passes().first..node.passes().first + node.passes().count {
            assert!(passes.entry(node.tile).or_default().insert(pass), "{node:?} overlaps another node");
        }
    }
    let grid = farm.store.job(job).await.unwrap().unwrap().grid;
    assert_eq!(passes.len(), grid.len() as usize);
    assert!(passes.values().all(|passes| passes.iter().copied().eq(0..40)));
}

pub(super) async fn jobs_are_served_by_priority_and_then_by_age(farm: Farm) {
    let older = farm.job_with(1, 0, None).await;
    let newer = farm.job_with(1, 0, None).await;
    let urgent = farm.job_with(1, 5, None).await;
    let worker = farm.worker().await;
    let mut order = Vec::new();
    while let Some(grant) = farm.claim(worker, 100, 0).await {
        order.push(grant.lease.job);
    }
    assert_eq!(order, [urgent, older, newer]);
}

pub(super) async fn a_worker_goes_on_with_scenes_that_it_has_unless_nobody_renders_an_older_job(farm: Farm) {
    // 60 nodes each.
    let [older, newer] = [farm.job_with(4, 0, None).await, farm.job_with(4, 0, None).await];
    let urgent = farm.job_with(1, 5, None).await;
    let [here, new] = [farm.worker().await, farm.worker().await];
    let claim = async |worker, built: &[JobId]| {
        let terms = ClaimTerms { built: built.to_vec(), fixed_nodes: Some(10), ..terms(worker, 0) };
        farm.store.claim(terms).await.unwrap().map(|grant| grant.lease.job)
    };
    assert_eq!(claim(new, &[newer]).await, Some(urgent), "what is urgent comes first whatever has to be built");
    assert_eq!(claim(new, &[newer]).await, Some(urgent));
    assert_eq!(claim(new, &[newer]).await, Some(older), "nobody renders it");
    assert_eq!(claim(here, &[newer]).await, Some(newer), "somebody renders the older one");
    assert_eq!(claim(here, &[older, newer]).await, Some(older), "by age where both are at hand");
    assert_eq!(claim(here, &[]).await, Some(older), "by age where none is");
    let mut order = Vec::new();
    while let Some(job) = claim(here, &[newer]).await {
        order.push(job);
    }
    order.dedup();
    assert_eq!(order, [newer, older], "the other when nothing is left of it");
}

pub(super) async fn an_unknown_worker_gets_no_work_and_is_told(farm: Farm) {
    farm.job(1).await;
    let terms = terms(WorkerId::from(Uuid::now_v7()), 0);
    assert!(matches!(farm.store.claim(terms).await, Err(WorkerError::Unknown(_))));
}

pub(super) async fn returned_work_is_free_at_once_and_returning_twice_is_harmless(farm: Farm) {
    farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 3, 0).await.unwrap();
    farm.deliver(&grant, &grant.nodes[..1], 0).await.unwrap();
    for _ in 0..2 {
        farm.store.return_lease(grant.lease.id, grant.lease.token, 0).await.unwrap();
    }
    let again = farm.claim(worker, 2, 0).await.unwrap();
    assert_eq!(again.nodes, grant.nodes[1..]);
    assert!(matches!(farm.deliver(&grant, &grant.nodes, 0).await, Err(LeaseError::Returned)));
}

pub(super) async fn a_worker_that_dies_again_and_again_does_not_fail_the_job(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    for attempt in 0..20 {
        assert!(farm.claim(worker, 1, attempt * TTL_MS).await.is_some());
        farm.store.expire_leases((attempt + 1) * TTL_MS).await.unwrap();
    }
    assert_eq!(farm.state(job).await, JobState::Running);
}

pub(super) async fn a_node_that_nobody_can_bring_fails_its_job_with_the_reason(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let mut now_ms = 0;
    for attempt in 1..=5 {
        assert_eq!(farm.state(job).await, if attempt == 1 { JobState::Queued } else { JobState::Running });
        let grant = farm.claim(worker, 1, now_ms).await.unwrap();
        let failure = WorkFailure {
            lease: grant.lease.id,
            token: grant.lease.token,
            reason: "not a number".to_owned(),
            refused_partials: 1,
            now_ms,
        };
        farm.store.fail_lease(failure).await.unwrap();
        assert!(farm.claim(worker, 1, now_ms).await.is_none(), "a failing worker rests");
        now_ms += 60_000;
    }
    let record = farm.store.job(job).await.unwrap().unwrap();
    assert_eq!(record.state, JobState::Failed);
    assert!(record.failure.unwrap().contains("not a number"));
}
