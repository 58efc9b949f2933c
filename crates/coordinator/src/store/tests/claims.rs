//! Which work a worker gets.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{JobId, JobState, NamedWorker, WorkerId, WorkerRegistration};
use clerestory_film::{NodeAddress, TileGrid};
use uuid::Uuid;

use crate::model::{ClaimTerms, Delivery, Ending, Grant, LeaseState, NewJob, WorkFailure};
use crate::store::engine::error::StoreError;
use crate::store::errors::WorkerError;
use crate::store::tests::farm::terms;
use crate::store::tests::{Farm, LeaseError, TTL_MS, delivered, query};

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

/// A tile of 256 samples in a pass.
const ONE_TILE: TileGrid = TileGrid::new(8, 8, 16);

/// Brings all of a lease, as if so much time of two cores had been spent on it.
async fn bring_after(farm: &Farm, grant: &Grant, core_ms: i64) {
    let (lease, token) = (grant.lease.id, grant.lease.token);
    let nodes = grant.nodes.iter().map(|address| delivered(*address)).collect();
    farm.store.accept(Delivery { lease, token, nodes, core_ms, now_ms: 0, alive_ms: 0 }).await.unwrap();
}

/// Claims all that is free, with leases as large as the pace asks.
async fn claim_all(farm: &Farm, worker: WorkerId) -> Vec<NodeAddress> {
    let mut nodes = Vec::new();
    while let Some(grant) = farm.store.claim(move || terms(worker, 0)).await.unwrap() {
        nodes.extend(grant.nodes);
    }
    nodes
}

fn passes_of(nodes: &[NodeAddress]) -> Vec<u32> {
    let mut passes: Vec<u32> =
        nodes.iter().flat_map(|node| node.passes().first..node.passes().first + node.passes().count).collect();
    passes.sort_unstable();
    passes
}

pub(super) async fn a_worker_whose_speed_is_not_known_gets_a_pass_at_a_time(farm: Farm) {
    farm.job_like(|job| NewJob { passes: 32, grid: ONE_TILE, ..job }).await;
    let worker = farm.worker().await;
    let first = farm.store.claim(move || terms(worker, 0)).await.unwrap().unwrap();
    assert_eq!(first.nodes.len(), 1);
    let mut nodes = claim_all(&farm, worker).await;
    nodes.extend(first.nodes);
    assert!(nodes.iter().all(|node| node.level == 0), "{nodes:?}");
    assert!(passes_of(&nodes).into_iter().eq(0..32));
}

pub(super) async fn nodes_that_were_cut_before_are_cut_again_for_a_slower_worker(farm: Farm) {
    farm.job_like(|job| NewJob { passes: 64, grid: ONE_TILE, ..job }).await;
    let worker = farm.worker().await;
    let first = farm.store.claim(move || terms(worker, 0)).await.unwrap().unwrap();
    // A thousand samples a second, so that three passes fit into a lease, and one node of two.
    bring_after(&farm, &first, 512).await;
    let second = farm.store.claim(move || terms(worker, 0)).await.unwrap().unwrap();
    assert_eq!(passes_of(&second.nodes), [1, 2, 3]);
    let rest = claim_all(&farm, worker).await;
    assert!(rest.iter().all(|node| node.level == 1), "{rest:?}");
    assert!(passes_of(&rest).into_iter().eq(4..64));
}

pub(super) async fn strips_of_the_light_plane_are_leased_together(farm: Farm) {
    // Sixteen tiles of the camera plane, and four strips.
    let grid = TileGrid::new(4096, 4096, 1024).with_light_plane(true);
    farm.job_like(|job| NewJob { passes: 24, grid, ..job }).await;
    let registration = WorkerRegistration {
        method_digests: ["path", "light"].map(|method| (method.to_owned(), vec!["same".to_owned()])).into(),
        ..WorkerRegistration::default()
    };
    let worker = farm.worker_like("w", registration).await.unwrap();
    let mut leased: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    while let Some(grant) = farm.store.claim(move || terms(worker, 0)).await.unwrap() {
        // A rate by which leases have several passes.
        bring_after(&farm, &grant, 20).await;
        let strips: Vec<&NodeAddress> = grant.nodes.iter().filter(|node| node.tile >= 16).collect();
        let of_each = strips.chunk_by(|a, b| (a.level, a.index) == (b.level, b.index));
        for together in of_each {
            assert!(together.iter().map(|node| node.tile).eq(16..20), "{:?}", grant.nodes);
        }
        assert!(strips.is_empty() || strips.len() == grant.nodes.len(), "{:?}", grant.nodes);
        for node in grant.nodes {
            let passes = leased.entry(node.tile).or_default();
            let of_node = node.passes();
            assert!((of_node.first..of_node.first + of_node.count).all(|pass| passes.insert(pass)), "{node:?} again");
        }
    }
    assert!(leased.keys().copied().eq(0..20) && leased.values().all(|passes| passes.iter().copied().eq(0..24)));
}

pub(super) async fn times_of_short_nodes_add_up_and_give_a_speed(farm: Farm) {
    let job = farm.job(3).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 15, 0).await.unwrap();
    bring_after(&farm, &grant, 1).await;
    assert_eq!(farm.store.job(job).await.unwrap().unwrap().core_ms, 1);
    let next = farm.store.claim(move || terms(worker, 0)).await.unwrap().unwrap();
    assert!(next.nodes.len() > 1, "{:?}", next.nodes);
}

pub(super) async fn the_speed_of_a_worker_is_that_of_its_last_work(farm: Farm) {
    farm.job_like(|job| NewJob { passes: 3, grid: ONE_TILE, ..job }).await;
    let worker = farm.worker().await;
    for core_ms in [600_000, 60_000] {
        let grant = farm.claim(worker, 1, 0).await.unwrap();
        bring_after(&farm, &grant, core_ms).await;
    }
    let rate = query("select samples, core_us from rates").fetch_one(&farm.store.readers).await.unwrap();
    let [samples, core_us] = ["samples", "core_us"].map(|column| rate.optional_float(column).unwrap().unwrap());
    // Half a minute of two cores at the speed of before, and the same time at that of now.
    assert!((samples - (256.0 / 10.0 + 256.0)).abs() < 1e-6, "{samples}");
    assert!((core_us - 120e6).abs() < 1.0, "{core_us}");
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
        farm.store.claim(move || terms).await.unwrap().map(|grant| grant.lease.job)
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

pub(super) async fn an_unknown_worker_gets_no_work_but_an_error(farm: Farm) {
    farm.job(1).await;
    let terms = terms(WorkerId::from(Uuid::now_v7()), 0);
    assert!(matches!(farm.store.claim(move || terms).await, Err(WorkerError::Unknown(_))));
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

pub(super) async fn leases_that_nobody_could_renew_hold_and_fail_no_job(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    for attempt in 0..20 {
        assert!(farm.claim(worker, 2, attempt * TTL_MS).await.is_some_and(|grant| grant.nodes.len() == 2));
        farm.expire((attempt + 1) * TTL_MS).await;
    }
    let record = farm.record(job).await;
    assert_eq!((record.state, record.hold), (JobState::Running, None));
}

/// Lets a worker claim a node and fail with it.
pub(super) async fn fail(farm: &Farm, worker: WorkerId, now_ms: i64, alive_ms: i64) {
    let grant = farm.claim(worker, 1, now_ms).await.unwrap();
    let failure = WorkFailure {
        lease: grant.lease.id,
        token: grant.lease.token,
        reason: "not a number".to_owned(),
        refused_partials: 1,
        now_ms,
        alive_ms,
    };
    farm.store.fail_lease(failure).await.unwrap();
    assert!(farm.claim(worker, 1, now_ms).await.is_none(), "a failing worker rests");
}

pub(super) async fn a_node_that_nobody_can_bring_fails_its_job_with_the_reason(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    for attempt in 0..5 {
        assert_eq!(farm.state(job).await, if attempt == 0 { JobState::Queued } else { JobState::Running });
        fail(&farm, worker, attempt * 60_000, 0).await;
    }
    let record = farm.store.job(job).await.unwrap().unwrap();
    assert_eq!(record.state, JobState::Failed);
    let (failure, failed) = (record.failure.unwrap(), record.failed_node.unwrap());
    let node = "frame 0, tile 0, level 0, index 0";
    let expected = format!(
        "node ({node}) failed 5 times on `w`, and no other machine was there that could render it; the last failure: \
         not a number"
    );
    assert_eq!(failure, expected);
    assert_eq!((failed.node.tile, failed.message.as_str()), (0, "not a number"));
    assert_eq!(failed.workers, [NamedWorker { id: worker, name: "w".to_owned() }]);
}

pub(super) async fn one_machine_alone_fails_no_job_that_another_could_render(farm: Farm) {
    let job = farm.job(1).await;
    let failing = farm.worker_named("failing").await.unwrap();
    let other = farm.worker_named("other").await.unwrap();
    for attempt in 0..20 {
        fail(&farm, failing, attempt * 60_000, 0).await;
    }
    assert_eq!(farm.state(job).await, JobState::Running);
    farm.store.end_worker(other, 1_200_000).await.unwrap();
    fail(&farm, failing, 1_200_000, 0).await;
    assert_eq!(farm.state(job).await, JobState::Failed, "nobody else is there");
}

pub(super) async fn a_node_that_fails_on_three_machines_fails_the_job_and_names_them(farm: Farm) {
    let job = farm.job(1).await;
    let mut workers = Vec::new();
    for name in ["one", "two", "three", "four"] {
        workers.push(farm.worker_named(name).await.unwrap());
    }
    for (attempt, blob_range) in [(0, 0), (1, 1), (2, 0), (3, 1), (4, 0)] {
        fail(&farm, workers[blob_range], attempt * 60_000, 0).await;
        assert_eq!(farm.state(job).await, JobState::Running);
    }
    fail(&farm, workers[2], 0, 0).await;
    assert_eq!(farm.state(job).await, JobState::Running, "the fourth may be larger");
    farm.store.end_worker(workers[3], 600_000).await.unwrap();
    fail(&farm, workers[2], 600_000, 0).await;
    let record = farm.record(job).await;
    assert_eq!(record.state, JobState::Failed);
    let failure = record.failure.unwrap();
    assert!(
        failure.contains("failed on 3 machines, `two`, `one` and `three`; the last failure: not a number"),
        "{failure}"
    );
    let failed: Vec<WorkerId> = record.failed_node.unwrap().workers.into_iter().map(|worker| worker.id).collect();
    assert_eq!(failed, [workers[1], workers[0], workers[2]]);
}

pub(super) async fn a_node_that_fails_on_ten_machines_fails_the_job_in_any_case(farm: Farm) {
    let job = farm.job(1).await;
    let mut workers = Vec::new();
    for name in 0..20 {
        workers.push(farm.worker_named(&name.to_string()).await.unwrap());
    }
    for (attempt, worker) in (0..10).zip(workers) {
        assert_ne!(farm.state(job).await, JobState::Failed);
        fail(&farm, worker, attempt * 60_000, 0).await;
    }
    assert_eq!(farm.state(job).await, JobState::Failed);
}

pub(super) async fn machines_that_fail_in_turn_fail_the_job(farm: Farm) {
    let job = farm.job(1).await;
    let machines = [farm.worker_named("one").await.unwrap(), farm.worker_named("other").await.unwrap()];
    for attempt in 0..5 {
        assert_eq!(farm.state(job).await, if attempt == 0 { JobState::Queued } else { JobState::Running });
        fail(&farm, machines[attempt as usize % 2], attempt * 60_000, 0).await;
    }
    assert_eq!(farm.state(job).await, JobState::Failed);
}

/// A machine fails on a job that has a node. Another machine is registered, but was not heard of since `alive_ms` or
/// could not render.
async fn fails_soon(farm: &Farm, failing: WorkerId, alive_ms: i64) {
    let job = farm.job(1).await;
    let first_ms = 1_000_000 * (1 + farm.store.jobs().await.unwrap().len() as i64);
    let grant = farm.claim(failing, 1, first_ms - 60_000).await.unwrap();
    farm.deliver(&grant, &grant.nodes, first_ms - 60_000).await.unwrap();
    for attempt in 0..5 {
        assert_eq!(farm.state(job).await, JobState::Running);
        fail(farm, failing, first_ms + attempt * 60_000, alive_ms).await;
    }
    assert_eq!(farm.state(job).await, JobState::Failed);
}

pub(super) async fn failures_count_where_nobody_else_could_try(farm: Farm) {
    let failing = farm.worker_with("failing", Some("bits")).await.unwrap();
    farm.worker_with("other bits", Some("other")).await.unwrap();
    fails_soon(&farm, failing, 0).await;
    farm.worker_with("gone", Some("bits")).await.unwrap();
    fails_soon(&farm, failing, 1).await;
    let quarantine = farm.store.write::<_, StoreError, _>(|connection| {
        Box::pin(
            async move { query("update workers set quarantine = '{}' where name = 'gone'").execute(connection).await },
        )
    });
    assert_eq!(quarantine.await.unwrap(), 1);
    fails_soon(&farm, failing, 0).await;
}

pub(super) async fn a_worker_with_another_fingerprint_could_try_a_job_without_nodes(farm: Farm) {
    let job = farm.job(1).await;
    let failing = farm.worker_with("failing", Some("bits")).await.unwrap();
    let other = farm.worker_with("other bits", Some("other")).await.unwrap();
    for attempt in 0..5 {
        fail(&farm, failing, attempt * 60_000, 0).await;
    }
    assert_eq!(farm.state(job).await, JobState::Running, "one that is busy has not tried it");
    assert!(farm.claim(other, 1, 300_000).await.is_some());
}

/// A worker whose whole lease was taken over may bring it while the job is pinned to its fingerprint.
pub(super) async fn nodes_that_were_taken_over_are_not_accepted_after_the_job_was_unpinned(farm: Farm) {
    farm.job_like(|job| NewJob { passes: 1, grid: TileGrid::new(8, 8, 16), ..job }).await;
    let slow = farm.worker_with("slow", Some("bits")).await.unwrap();
    let quick = farm.worker_with("quick", Some("bits")).await.unwrap();
    let other = farm.worker_with("other", Some("other bits")).await.unwrap();
    let overtaken = farm.claim(slow, 1, 0).await.unwrap();
    farm.store.renew(overtaken.lease.id, overtaken.lease.token, 0, 100_000).await.unwrap();
    let taken = farm.claim(quick, 1, 2000).await.unwrap();
    assert_eq!(farm.store.lease(overtaken.lease.id).await.unwrap().state, LeaseState::Complete);
    farm.store.return_lease(taken.lease.id, taken.lease.token, 2000).await.unwrap();
    let begun = farm.claim(other, 1, 2000).await.unwrap();
    let late = farm.deliver(&overtaken, &overtaken.nodes, 2000).await;
    assert!(matches!(late, Err(LeaseError::Returned)), "{late:?}");
    farm.deliver(&begun, &begun.nodes, 2000).await.unwrap();
}

pub(super) async fn leases_that_ended_long_ago_go_and_the_next_token_is_larger_all_the_same(farm: Farm) {
    const LATER_MS: i64 = 30 * 24 * 3600 * 1000;
    let (ended, running) = (farm.job_with(1, 1, None).await, farm.job(2).await);
    let worker = farm.worker().await;
    let mut old = Vec::new();
    for _ in 0..2 {
        let grant = farm.claim(worker, 5, 0).await.unwrap();
        assert_eq!(grant.lease.job, ended);
        old.push(grant);
    }
    farm.store.end_job(ended, Ending::Cancelled, 0).await.unwrap();
    let kept = farm.claim(worker, 5, 0).await.unwrap();
    assert_eq!(kept.lease.job, running);
    farm.store.return_lease(kept.lease.id, kept.lease.token, 0).await.unwrap();
    farm.store.prune_leases(LATER_MS).await.unwrap();
    for grant in &old {
        assert!(matches!(farm.store.lease(grant.lease.id).await, Err(LeaseError::Unknown(_))));
    }
    assert!(farm.store.lease(kept.lease.id).await.is_ok(), "its job goes on");
    farm.store.end_job(running, Ending::Cancelled, 0).await.unwrap();
    farm.store.prune_leases(LATER_MS).await.unwrap();
    assert!(farm.store.lease(kept.lease.id).await.is_ok(), "the next token is one beyond its own");
    farm.job(1).await;
    assert!(farm.claim(worker, 1, LATER_MS).await.unwrap().lease.token > kept.lease.token);
}

pub(super) async fn a_job_without_nodes_is_unpinned(farm: Farm) {
    let job = farm.job(1).await;
    let one = farm.worker_with("one", Some("bits")).await.unwrap();
    let other = farm.worker_with("other", Some("other bits")).await.unwrap();
    let returned = farm.claim(one, 1, 0).await.unwrap().lease;
    assert!(farm.claim(other, 1, 0).await.is_none(), "who has a lease may bring something");
    let also = farm.claim(one, 1, 0).await.unwrap().lease;
    farm.store.return_lease(returned.id, returned.token, 0).await.unwrap();
    assert!(farm.claim(other, 1, 0).await.is_none(), "so may who has another");
    farm.store.return_lease(also.id, also.token, 0).await.unwrap();
    assert!(farm.claim(other, 1, 0).await.is_some());
    assert!(farm.claim(one, 1, 0).await.is_none());
    assert_eq!(farm.expire(TTL_MS).await, 1);
    let grant = farm.claim(one, 2, TTL_MS).await.unwrap();
    farm.deliver(&grant, &grant.nodes[..1], TTL_MS).await.unwrap();
    farm.store.return_lease(grant.lease.id, grant.lease.token, TTL_MS).await.unwrap();
    assert!(farm.claim(other, 1, TTL_MS).await.is_none(), "its bits are in the image");
    assert_eq!(farm.claim(one, 15, TTL_MS).await.unwrap().nodes.len(), 14);
    assert_eq!(farm.state(job).await, JobState::Running);
}
