//! What every store must do, whatever lies under it: each test runs on SQLite and on a real PostgreSQL.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{JobId, JobState, LeaseId, NodeVerdict, StopReason, WorkerId, WorkerRegistration};
use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{NodeAddress, TileGrid};
use clerestory_test_servers::postgres;
use tempfile::TempDir;
use uuid::Uuid;

use super::accept::Acceptance;
use super::sql::query;
use super::{
    ClaimTerms, CompleteWave, DeliveredNode, Delivery, Ending, Grant, Identity, Keeping, LeaseError, Merge, NewJob,
    SchemaError, Source, Store, StoreError, Work, WorkFailure, WorkerError,
};
use crate::blobs::Place;
use crate::stop::Targets;

mod adaptive;
mod checks;
mod model;
mod silence;
mod stragglers;
mod targets;

use adaptive::{
    a_job_that_ends_before_its_pilot_leaves_none_of_it, a_pilot_that_is_not_whole_decides_nothing,
    a_target_leaves_each_tile_what_it_has_at_its_round,
    nodes_beyond_the_share_of_a_round_go_when_a_target_ends_the_job,
    passes_beyond_those_that_all_get_wait_until_they_are_shared_out,
};
use checks::{
    a_check_that_nobody_can_do_does_not_hold_up_the_round, a_job_keeps_to_the_bits_that_it_was_begun_with,
    a_job_whose_passes_a_wrong_pilot_has_shared_out_begins_again,
    a_pilot_that_a_wrong_worker_has_rendered_is_rendered_again,
    a_worker_with_other_bits_than_two_others_is_found_and_its_nodes_are_rendered_again,
    checks_of_a_worker_that_is_gone_go_to_another, points_that_were_measured_with_wrong_nodes_are_taken_back,
    two_who_agree_end_a_check,
};
use stragglers::{
    a_node_is_not_leased_again_without_end, stragglers_do_not_hold_up_the_end,
    what_a_worker_sits_on_is_taken_over_and_the_first_result_wins,
};
use targets::{
    a_round_that_reaches_a_target_ends_the_job_and_what_lies_beyond_it_goes,
    a_target_that_is_not_reached_leaves_the_last_round_to_end_the_job,
    a_target_that_is_reached_after_the_end_changes_nothing,
    errors_and_targets_that_were_absent_at_first_are_stored_later,
};

const TTL_MS: i64 = 1000;

/// A node that is on disk, with counters of its own.
fn delivered(address: NodeAddress) -> DeliveredNode {
    let counters = Counters { rays: 1 + u64::from(address.index), ..Counters::default() };
    DeliveredNode { address, place: place(&Uuid::now_v7().to_string(), 0), counters, digest: None }
}

fn place(blob: &str, offset: u64) -> Place {
    Place { blob: blob.to_owned(), offset, length: Some(10) }
}

/// The merge of the two halves of a node.
fn merge(parent: NodeAddress, place: Place) -> Merge {
    Merge { parent, place, children: parent.children().unwrap().to_vec() }
}

struct Farm {
    store: Store,
    source: Source,
    /// Of a SQLite file.
    _directory: Option<TempDir>,
}

impl Farm {
    async fn in_a_file() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let source = Source::file(&directory.path().join("farm ?#%.sqlite"));
        Self { store: Store::open(source.clone()).await.unwrap(), source, _directory: Some(directory) }
    }

    async fn in_postgres() -> Self {
        let source = Source::postgres(&postgres().new_database().parse().unwrap()).unwrap();
        Self { store: Store::open(source.clone()).await.unwrap(), source, _directory: None }
    }

    async fn reopened(self) -> Self {
        self.store.close().await;
        Self { store: Store::open(self.source.clone()).await.unwrap(), ..self }
    }

    async fn worker(&self) -> WorkerId {
        self.worker_named("w").await.unwrap()
    }

    async fn worker_named(&self, name: &str) -> Result<WorkerId, WorkerError> {
        self.worker_with(name, None).await
    }

    async fn worker_with(&self, name: &str, probe_digest: Option<&str>) -> Result<WorkerId, WorkerError> {
        let id = WorkerId::from(Uuid::now_v7());
        let (name, build) = (name.to_owned(), "b".to_owned());
        let registration = WorkerRegistration { name, cores: 2, build, probe_digest: probe_digest.map(str::to_owned) };
        self.store.register_worker(id, registration, 0).await?;
        Ok(id)
    }

    async fn job(&self, passes: u32) -> JobId {
        self.job_with(passes, 0, None).await
    }

    async fn job_with(&self, passes: u32, priority: i32, time_limit_ms: Option<i64>) -> JobId {
        self.job_like(|job| NewJob { passes, priority, time_limit_ms, ..job }).await
    }

    async fn job_like(&self, change: impl FnOnce(NewJob) -> NewJob) -> JobId {
        let id = JobId::from(Uuid::now_v7());
        let job = NewJob {
            id,
            name: "window".to_owned(),
            priority: 0,
            scene: "{}".to_owned(),
            scene_hash: "h".to_owned(),
            integrator: "path".to_owned(),
            missing_light: Vec::new(),
            grid: TileGrid { width: 70, height: 40, tile_size: 16 },
            samples_per_pass: 4,
            samples_per_block: 64,
            passes: 1,
            reference: None,
            time_limit_ms: None,
            targets: Targets::default(),
            adaptive: false,
            assets: BTreeMap::new(),
            created_ms: 0,
        };
        self.store.insert_job(change(job)).await.unwrap();
        id
    }

    async fn claim(&self, worker: WorkerId, nodes: u32, now_ms: i64) -> Option<Grant> {
        let terms = ClaimTerms {
            worker,
            lease: LeaseId::from(Uuid::now_v7()),
            max_nodes: None,
            fixed_nodes: Some(nodes),
            target_ms: 1000,
            ttl_ms: TTL_MS,
            now_ms,
        };
        self.store.claim(terms).await.unwrap()
    }

    async fn deliver(&self, grant: &Grant, nodes: &[NodeAddress], now_ms: i64) -> Result<Acceptance, LeaseError> {
        let nodes = nodes.iter().map(|address| delivered(*address)).collect();
        self.bring(grant, nodes, now_ms).await
    }

    async fn bring(&self, grant: &Grant, nodes: Vec<DeliveredNode>, now_ms: i64) -> Result<Acceptance, LeaseError> {
        let (lease, token) = (grant.lease.id, grant.lease.token);
        self.store.accept(Delivery { lease, token, nodes, core_ms: 100, now_ms, alive_ms: now_ms - TTL_MS }).await
    }

    async fn addresses(&self, job: JobId) -> Vec<NodeAddress> {
        self.store.nodes(job, 0, 0..u32::MAX).await.unwrap().into_iter().map(|node| node.address).collect()
    }

    async fn state(&self, job: JobId) -> JobState {
        self.store.job(job).await.unwrap().unwrap().state
    }

    async fn next_wave(&self, job: JobId) -> Option<CompleteWave> {
        let record = self.store.job(job).await.unwrap().unwrap();
        self.store.complete_wave(&record).await.unwrap()
    }
}

async fn concurrent_claimants_never_get_the_same_node(farm: Farm) {
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

async fn jobs_are_served_by_priority_and_then_by_age(farm: Farm) {
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

async fn an_expired_lease_is_claimable_again_and_its_late_result_changes_nothing(farm: Farm) {
    let job = farm.job(1).await;
    let (first, second) = (farm.worker().await, farm.worker().await);
    let lost = farm.claim(first, 3, 0).await.unwrap();
    assert_eq!(farm.store.expire_leases(TTL_MS - 1).await.unwrap(), 0);
    assert_eq!(farm.store.expire_leases(TTL_MS).await.unwrap(), 1);
    let again = farm.claim(second, 3, TTL_MS).await.unwrap();
    assert_eq!(again.nodes, lost.nodes);
    assert!(again.lease.token > lost.lease.token);
    let late = farm.deliver(&lost, &lost.nodes, TTL_MS).await;
    assert!(matches!(late, Err(LeaseError::Expired)), "{late:?}");
    assert!(farm.addresses(job).await.is_empty());
    let good = farm.deliver(&again, &again.nodes, TTL_MS).await.unwrap();
    assert_eq!(good.verdicts, [NodeVerdict::Accepted; 3]);
}

async fn a_lease_is_dead_at_its_deadline_even_before_the_sweep(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 1, 0).await.unwrap();
    let late = farm.deliver(&grant, &grant.nodes, TTL_MS).await;
    assert!(matches!(late, Err(LeaseError::Expired)), "{late:?}");
    assert!(farm.addresses(job).await.is_empty());
}

async fn a_renewed_lease_lives_on(farm: Farm) {
    farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 1, 0).await.unwrap();
    farm.store.renew(grant.lease.id, grant.lease.token, 900, 900 + TTL_MS).await.unwrap();
    assert_eq!(farm.store.expire_leases(TTL_MS).await.unwrap(), 0);
    assert!(farm.deliver(&grant, &grant.nodes, 1500).await.is_ok());
}

async fn a_wrong_token_opens_nothing(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let mut grant = farm.claim(worker, 1, 0).await.unwrap();
    grant.lease.token += 1;
    assert!(matches!(farm.deliver(&grant, &grant.nodes, 0).await, Err(LeaseError::StaleToken(_))));
    let renewed = farm.store.renew(grant.lease.id, grant.lease.token, 0, 10).await;
    assert!(matches!(renewed, Err(LeaseError::StaleToken(_))));
    assert!(farm.addresses(job).await.is_empty());
}

async fn a_repeated_upload_is_told_that_all_is_there(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 2, 0).await.unwrap();
    let first = farm.deliver(&grant, &grant.nodes[..1], 0).await.unwrap();
    assert_eq!((first.verdicts, first.outstanding), (vec![NodeVerdict::Accepted], 1));
    let second = farm.deliver(&grant, &grant.nodes, 0).await.unwrap();
    assert_eq!(second.verdicts, [NodeVerdict::Duplicate, NodeVerdict::Accepted]);
    let third = farm.deliver(&grant, &grant.nodes, 0).await.unwrap();
    assert_eq!((third.verdicts, third.outstanding), (vec![NodeVerdict::Duplicate; 2], 0));
    let record = farm.store.job(job).await.unwrap().unwrap();
    assert_eq!((record.accepted_nodes, record.samples), (2, 2 * 16 * 16 * 4));
}

async fn a_node_outside_the_lease_is_refused_and_one_under_an_accepted_ancestor_is_a_duplicate(farm: Farm) {
    let job = farm.job(2).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 100, 0).await.unwrap();
    let outside = NodeAddress { frame: 0, tile: 0, level: 1, index: 0 };
    let answer = farm.deliver(&grant, &[outside], 0).await.unwrap();
    assert_eq!(answer.verdicts, [NodeVerdict::Refused]);
    assert!(farm.addresses(job).await.is_empty());
    let children: Vec<NodeAddress> = outside.children().unwrap().to_vec();
    farm.deliver(&grant, &children, 0).await.unwrap();
    let counters = Counters { rays: 1 + 2, ..Counters::default() };
    farm.store.replace(job, 0, vec![merge(outside, place("parent", 0))]).await.unwrap();
    assert_eq!(farm.addresses(job).await, [outside]);
    let answer = farm.deliver(&grant, &[children[1], outside], 0).await.unwrap();
    assert_eq!(answer.verdicts, [NodeVerdict::Duplicate, NodeVerdict::Duplicate]);
    assert_eq!(farm.addresses(job).await, [outside]);
    let work = Work { counters, builds: BTreeSet::from(["b".to_owned()]) };
    assert_eq!(farm.store.nodes(job, 0, 0..u32::MAX).await.unwrap()[0].work, work, "counted once");
    assert_eq!(farm.store.job(job).await.unwrap().unwrap().counters, counters, "counted once");
}

async fn a_parent_replaces_two_children_or_nothing(farm: Farm) {
    let job = farm.job(2).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 100, 0).await.unwrap();
    let parent = NodeAddress { frame: 0, tile: 0, level: 1, index: 0 };
    let [left, _] = parent.children().unwrap();
    farm.deliver(&grant, &[left], 0).await.unwrap();
    let replaced = farm.store.replace(job, 0, vec![merge(parent, place("parent", 0))]).await;
    assert!(replaced.is_err());
    assert_eq!(farm.addresses(job).await, [left]);
}

async fn a_blob_is_needed_until_the_last_of_its_nodes_has_been_replaced(farm: Farm) {
    let job = farm.job(2).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 100, 0).await.unwrap();
    let parents = [0, 1].map(|tile| NodeAddress { frame: 0, tile, level: 1, index: 0 });
    let children: Vec<NodeAddress> = parents.iter().flat_map(|parent| parent.children().unwrap()).collect();
    let together = |(address, offset): (&NodeAddress, u64)| DeliveredNode {
        place: place("together", offset),
        ..delivered(*address)
    };
    let nodes: Vec<DeliveredNode> = children.iter().zip((0..).step_by(10)).map(together).collect();
    let places: Vec<Place> = nodes.iter().map(|node| node.place.clone()).collect();
    assert_eq!(farm.bring(&grant, nodes, 0).await.unwrap().verdicts, [NodeVerdict::Accepted; 4]);
    let rows = farm.store.nodes(job, 0, 0..u32::MAX).await.unwrap();
    assert!(rows.iter().map(|row| &row.place).eq(&places));

    let [first, second] = parents.map(|parent| merge(parent, place("merged", u64::from(parent.tile) * 10)));
    let removed = farm.store.replace(job, 0, vec![first]).await.unwrap();
    assert_eq!((removed.places.as_slice(), removed.blobs), (&places[..2], vec![]));
    let removed = farm.store.replace(job, 0, vec![second]).await.unwrap();
    assert_eq!((removed.places.as_slice(), removed.blobs), (&places[2..], vec!["together".to_owned()]));
    assert_eq!(farm.addresses(job).await, parents);
    assert_eq!(farm.store.node_blobs().await.unwrap(), BTreeSet::from(["merged".to_owned()]));
}

async fn returned_work_is_free_at_once_and_returning_twice_is_harmless(farm: Farm) {
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

async fn a_cancelled_job_accepts_nothing_more_and_keeps_what_it_has(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 2, 0).await.unwrap();
    farm.deliver(&grant, &grant.nodes[..1], 0).await.unwrap();
    assert!(farm.store.end_job(job, Ending::Cancelled, 0).await.unwrap());
    assert!(!farm.store.end_job(job, Ending::Failed("late".to_owned()), 0).await.unwrap());
    assert!(matches!(farm.deliver(&grant, &grant.nodes[1..], 0).await, Err(LeaseError::JobNotRunning)));
    assert_eq!(farm.state(job).await, JobState::Cancelled);
    assert_eq!(farm.addresses(job).await, grant.nodes[..1]);
    assert!(farm.claim(worker, 1, 0).await.is_none());
}

async fn a_node_that_nobody_can_bring_fails_its_job_with_the_reason(farm: Farm) {
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

async fn a_worker_that_dies_again_and_again_does_not_fail_the_job(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    for attempt in 0..20 {
        assert!(farm.claim(worker, 1, attempt * TTL_MS).await.is_some());
        farm.store.expire_leases((attempt + 1) * TTL_MS).await.unwrap();
    }
    assert_eq!(farm.state(job).await, JobState::Running);
}

async fn nothing_is_lost_when_the_store_is_reopened(farm: Farm) {
    let job = farm.job(3).await;
    let worker = farm.worker().await;
    let held = farm.claim(worker, 4, 0).await.unwrap();
    farm.deliver(&held, &held.nodes[..2], 0).await.unwrap();
    let before = farm.store.nodes(job, 0, 0..u32::MAX).await.unwrap();
    let farm = farm.reopened().await;
    assert_eq!(farm.store.nodes(job, 0, 0..u32::MAX).await.unwrap(), before);
    let rest = farm.deliver(&held, &held.nodes[2..], 0).await.unwrap();
    assert_eq!((rest.verdicts, rest.outstanding), (vec![NodeVerdict::Accepted; 2], 0));
    let next = farm.claim(worker, 1, 0).await.unwrap();
    assert!(next.lease.token > held.lease.token);
    assert!(!held.nodes.contains(&next.nodes[0]));
}

async fn rounds_complete_in_order_and_the_last_ends_the_job(farm: Farm) {
    let job = farm.job(3).await;
    let worker = farm.worker().await;
    let all = farm.claim(worker, 256, 0).await.unwrap();
    let (first, rest): (Vec<_>, Vec<_>) = all.nodes.iter().partition(|node| node.passes().first == 0);
    farm.deliver(&all, &rest, 100).await.unwrap();
    assert_eq!(farm.next_wave(job).await, None, "the first wave is missing");
    farm.deliver(&all, &first[1..], 200).await.unwrap();
    assert_eq!(farm.next_wave(job).await, None, "one tile is missing");
    farm.deliver(&all, &first[..1], 300).await.unwrap();
    for (round, passes) in [(0, 1), (1, 2), (2, 3)] {
        let wave = farm.next_wave(job).await.unwrap();
        assert_eq!((wave.round, wave.passes, wave.completed_ms), (round, passes, 300));
        let record = farm.store.job(job).await.unwrap().unwrap();
        assert_eq!(record.state, JobState::Running);
        assert!(farm.store.record_round(&record, Vec::new(), 400).await.unwrap().is_some());
        assert_eq!(farm.store.record_round(&record, Vec::new(), 400).await.unwrap(), None, "a round is recorded once");
    }
    assert_eq!(farm.state(job).await, JobState::Done);
}

async fn times_beyond_all_numbers_leave_the_farm_usable(farm: Farm) {
    let job = farm.job(2).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 256, 0).await.unwrap();
    for node in &grant.nodes {
        let (lease, token) = (grant.lease.id, grant.lease.token);
        let delivery =
            Delivery { lease, token, nodes: vec![delivered(*node)], core_ms: i64::MAX, now_ms: 0, alive_ms: 0 };
        farm.store.accept(delivery).await.unwrap();
    }
    for _ in 0..2 {
        assert_eq!(farm.next_wave(job).await.unwrap().core_ms, i64::MAX);
        let record = farm.store.job(job).await.unwrap().unwrap();
        assert_eq!(record.core_ms, i64::MAX);
        farm.store.record_round(&record, Vec::new(), 0).await.unwrap();
    }
    assert_eq!(farm.state(job).await, JobState::Done);
    assert_eq!(farm.store.workers(0, 0).await.unwrap()[0].core_ms, i64::MAX);
    let next = farm.job(1).await;
    assert_eq!(farm.claim(worker, 1, 0).await.unwrap().lease.job, next);
}

async fn a_time_limit_counts_from_the_first_lease_and_keeps_what_is_complete(farm: Farm) {
    let job = farm.job_with(100, 0, Some(500)).await;
    let worker = farm.worker().await;
    assert!(farm.store.end_jobs_out_of_time(10_000).await.unwrap().is_empty());
    let grant = farm.claim(worker, 20, 10_000).await.unwrap();
    farm.deliver(&grant, &grant.nodes[..16], 10_100).await.unwrap();
    farm.store.record_round(&farm.store.job(job).await.unwrap().unwrap(), Vec::new(), 10_200).await.unwrap();
    assert!(farm.claim(worker, 2, 10_500).await.is_none(), "no work after the limit");
    assert_eq!(farm.store.end_jobs_out_of_time(10_500).await.unwrap(), [job]);
    assert_eq!(farm.state(job).await, JobState::Done);
    assert_eq!(farm.store.job(job).await.unwrap().unwrap().stopped_by, Some(StopReason::Time));
    let kept: BTreeSet<NodeAddress> = farm.addresses(job).await.into_iter().collect();
    assert_eq!(kept, grant.nodes[..16].iter().copied().collect());
}

async fn a_time_limit_ends_no_job_before_its_first_round_and_then_nothing_else_is_rendered(farm: Farm) {
    let job = farm.job_with(100, 0, Some(500)).await;
    let worker = farm.worker().await;
    let lost = farm.claim(worker, 3, 10_000).await.unwrap();
    farm.deliver(&lost, &lost.nodes[..1], 10_100).await.unwrap();
    assert!(farm.store.end_jobs_out_of_time(20_000).await.unwrap().is_empty(), "there is no image yet");
    farm.store.expire_leases(20_000).await.unwrap();
    let rest = farm.claim(worker, 256, 20_000).await.unwrap();
    let tiles = farm.store.job(job).await.unwrap().unwrap().grid.len();
    assert_eq!(rest.nodes.len() as u32, tiles - 1);
    assert!(rest.nodes.iter().all(|node| node.passes().first == 0), "{:?}", rest.nodes);
    assert!(farm.claim(worker, 1, 20_000).await.is_none(), "nothing but the first round");
    farm.deliver(&rest, &rest.nodes, 20_100).await.unwrap();
    assert_eq!(farm.next_wave(job).await.unwrap().round, 0);
    farm.store.record_round(&farm.store.job(job).await.unwrap().unwrap(), Vec::new(), 20_200).await.unwrap();
    assert_eq!(farm.store.end_jobs_out_of_time(20_300).await.unwrap(), [job]);
    assert_eq!(farm.state(job).await, JobState::Done);
}

async fn an_unknown_worker_gets_no_work_and_is_told(farm: Farm) {
    farm.job(1).await;
    let terms = ClaimTerms {
        worker: WorkerId::from(Uuid::now_v7()),
        lease: LeaseId::from(Uuid::now_v7()),
        max_nodes: None,
        fixed_nodes: None,
        target_ms: 1000,
        ttl_ms: TTL_MS,
        now_ms: 0,
    };
    assert!(matches!(farm.store.claim(terms).await, Err(WorkerError::Unknown(_))));
}

async fn a_failed_write_takes_nothing_else_with_it(farm: Farm) {
    let write = |name: &'static str, then_fail: bool| {
        let store = farm.store.clone();
        async move {
            store
                .write::<(), StoreError, _>(move |connection| {
                    Box::pin(async move {
                        query("insert into sequences (name, value) values ($1, 1)")
                            .bind(name)
                            .execute(connection)
                            .await?;
                        if then_fail { Err(StoreError::Closed) } else { Ok(()) }
                    })
                })
                .await
        }
    };
    let (first, second, again) = tokio::join!(write("a", false), write("b", true), write("a", false));
    let third = write("c", false).await;
    assert!(first.is_ok() && second.is_err() && again.is_err() && third.is_ok());
    let rows = query("select name from sequences where length(name) = 1 order by name");
    let rows = rows.fetch_all(&farm.store.readers).await.unwrap();
    let names: Vec<String> = rows.iter().map(|row| row.text("name").unwrap()).collect();
    assert_eq!(names, ["a", "c"]);
}

async fn a_farm_keeps_its_identity(farm: Farm) {
    let identity = farm.store.identity().await.unwrap();
    assert_eq!(farm.store.identity().await.unwrap(), identity);
    assert_eq!(farm.reopened().await.store.identity().await.unwrap(), identity);
}

async fn a_database_of_a_newer_build_is_refused_with_both_versions(farm: Farm) {
    let newer = farm.store.write::<i64, StoreError, _>(|connection| {
        Box::pin(async move {
            let migrations = "insert into _sqlx_migrations (version, description, success, checksum, execution_time) \
                              select 99, 'later', success, checksum, 0 from _sqlx_migrations where version = 1";
            let known = query("select max(version) as known from _sqlx_migrations").fetch_one(&mut *connection).await?;
            query(migrations).execute(connection).await?;
            known.integer("known")
        })
    });
    let own = newer.await.unwrap();
    farm.store.close().await;
    let error = Store::open(farm.source).await.unwrap_err();
    assert!(matches!(error, SchemaError::Newer { found: 99, known, .. } if known == own), "{error}");
}

async fn a_lost_connection_fails_what_was_under_way_and_nothing_after_it(farm: Farm) {
    let job = farm.job(1).await;
    // The writer's own connection is ended from outside, where there is an outside.
    let ended = query(
        "select pg_terminate_backend(pid) from pg_stat_activity where datname = current_database() \
         and pid <> pg_backend_pid()",
    );
    let has_server = ended.fetch_all(&farm.store.readers).await.is_ok();
    assert_eq!(has_server, farm._directory.is_none());
    let worker = farm.worker().await;
    assert_eq!(farm.claim(worker, 3, 0).await.unwrap().nodes.len(), 3);
    assert_eq!(farm.state(job).await, JobState::Running);
}

async fn a_film_is_kept_by_one_coordinator_until_its_term_is_over(farm: Farm) {
    let job = farm.job(1).await;
    let [one, other] = [(); 2].map(|()| Uuid::now_v7());
    let keep = |coordinator, now_ms| farm.store.keep(job, coordinator, now_ms, now_ms + 100);
    assert_eq!(keep(one, 0).await.unwrap(), Keeping::Ours);
    assert_eq!(keep(other, 50).await.unwrap(), Keeping::Theirs { until_ms: 100 });
    assert_eq!(keep(one, 60).await.unwrap(), Keeping::Ours);
    assert_eq!(keep(other, 159).await.unwrap(), Keeping::Theirs { until_ms: 160 });
    assert_eq!(keep(other, 160).await.unwrap(), Keeping::Ours);
    assert_eq!(keep(one, 170).await.unwrap(), Keeping::Theirs { until_ms: 260 });
    farm.store.keep_nothing(one).await.unwrap();
    assert_eq!(keep(one, 180).await.unwrap(), Keeping::Theirs { until_ms: 260 });
    farm.store.keep_nothing(other).await.unwrap();
    assert_eq!(keep(one, 190).await.unwrap(), Keeping::Ours);
    let gone = JobId::from(Uuid::now_v7());
    assert_eq!(farm.store.keep(gone, one, 0, 100).await.unwrap(), Keeping::Ours, "a job that is gone is no obstacle");
}

/// Several coordinators on one PostgreSQL database.
mod several {
    use futures::future::{BoxFuture, join_all};

    use super::*;

    async fn coordinators(count: usize) -> Vec<Farm> {
        let source = Source::postgres(&postgres().new_database().parse().unwrap()).unwrap();
        // They start together, and each finds the schema as it should be.
        join_all((0..count).map(|_| async {
            Farm { store: Store::open(source.clone()).await.unwrap(), source: source.clone(), _directory: None }
        }))
        .await
    }

    #[tokio::test]
    async fn eight_claimants_share_a_job_and_none_is_sent_away_while_there_is_work() {
        let farms = coordinators(4).await;
        // 300 nodes: more than are cut ahead at once.
        let job = farms[0].job_like(|job| NewJob { passes: 20, ..job }).await;
        let workers = join_all((0..8).map(|k| farms[k % 4].worker())).await;
        let claims = workers.iter().enumerate().map(|(k, worker)| {
            // What it brings goes to another coordinator than the one that gave the work.
            let (farm, other) = (&farms[k % 4], &farms[(k + 1) % 4]);
            async move {
                let mut nodes = Vec::new();
                while let Some(grant) = farm.claim(*worker, 3, 0).await {
                    let acceptance = other.deliver(&grant, &grant.nodes, 1).await.unwrap();
                    assert!(acceptance.verdicts.iter().all(|verdict| *verdict == NodeVerdict::Accepted));
                    nodes.extend(grant.nodes);
                }
                nodes
            }
        });
        let brought: Vec<Vec<NodeAddress>> = join_all(claims).await;
        assert!(brought.iter().all(|nodes| !nodes.is_empty()), "every claimant has had work");
        let passes: Vec<_> = brought.iter().flatten().map(|node| (node.tile, node.passes())).collect();
        let rendered: u32 = passes.iter().map(|(_, passes)| passes.count).sum();
        assert_eq!(rendered, 15 * 20, "each pass of each tile once");
        let record = farms[3].store.job(job).await.unwrap().unwrap();
        assert_eq!(record.samples, record.total_samples());
        assert!(farms[1].store.complete_wave(&record).await.unwrap().is_some());
    }

    #[tokio::test]
    async fn a_coordinator_that_is_suspended_in_a_transaction_does_not_hold_up_the_others() {
        let farms = coordinators(2).await;
        let (begun, has_begun) = tokio::sync::oneshot::channel();
        let (go_on, wait) = tokio::sync::oneshot::channel::<()>();
        let suspended = farms[0].store.clone();
        let suspended = tokio::spawn(async move {
            suspended
                .write::<(), StoreError, _>(|_| {
                    Box::pin(async move {
                        begun.send(()).unwrap();
                        wait.await.unwrap();
                        Ok(())
                    })
                })
                .await
        });
        has_begun.await.unwrap();
        let job = farms[1].job(1).await;
        go_on.send(()).unwrap();
        assert!(suspended.await.unwrap().is_err(), "it has lost its transaction, and says so");
        assert_eq!(farms[0].state(job).await, JobState::Queued);
        farms[0].job(1).await;
    }

    #[tokio::test]
    async fn coordinators_that_start_together_claim_blobs_in_turn() {
        let farms = coordinators(4).await;
        let claims = join_all(farms.iter().map(|farm| async {
            let claim = |identity: Identity| -> BoxFuture<'static, Result<(), bool>> {
                Box::pin(async move { if identity.has_blobs { Err(true) } else { Ok(()) } })
            };
            farm.store.claim_blobs(claim).await.unwrap()
        }))
        .await;
        assert_eq!(claims.iter().filter(|claim| claim.is_ok()).count(), 1, "one is the first: {claims:?}");
        assert!(farms[0].store.identity().await.unwrap().has_blobs);
    }

    #[tokio::test]
    async fn what_one_sends_the_others_hear() {
        let farms = coordinators(2).await;
        let mut listener = farms[1].store.listener().await.unwrap().unwrap();
        farms[0].store.notify("news".to_owned()).await.unwrap();
        assert_eq!(listener.next().await.unwrap(), "news");
    }
}

/// One test for each engine.
macro_rules! on_both {
    ($($name:ident)*) => {
        mod sqlite {
            $(
                #[tokio::test]
                async fn $name() {
                    super::$name(super::Farm::in_a_file().await).await;
                }
            )*
        }

        mod postgres {
            $(
                #[tokio::test]
                async fn $name() {
                    super::$name(super::Farm::in_postgres().await).await;
                }
            )*
        }
    };
}

on_both! {
    a_film_is_kept_by_one_coordinator_until_its_term_is_over
    concurrent_claimants_never_get_the_same_node
    jobs_are_served_by_priority_and_then_by_age
    an_expired_lease_is_claimable_again_and_its_late_result_changes_nothing
    a_lease_is_dead_at_its_deadline_even_before_the_sweep
    a_renewed_lease_lives_on
    a_wrong_token_opens_nothing
    a_repeated_upload_is_told_that_all_is_there
    a_node_outside_the_lease_is_refused_and_one_under_an_accepted_ancestor_is_a_duplicate
    a_parent_replaces_two_children_or_nothing
    a_blob_is_needed_until_the_last_of_its_nodes_has_been_replaced
    what_a_worker_sits_on_is_taken_over_and_the_first_result_wins
    a_node_is_not_leased_again_without_end
    two_who_agree_end_a_check
    a_worker_with_other_bits_than_two_others_is_found_and_its_nodes_are_rendered_again
    points_that_were_measured_with_wrong_nodes_are_taken_back
    a_check_that_nobody_can_do_does_not_hold_up_the_round
    checks_of_a_worker_that_is_gone_go_to_another
    a_job_keeps_to_the_bits_that_it_was_begun_with
    stragglers_do_not_hold_up_the_end
    returned_work_is_free_at_once_and_returning_twice_is_harmless
    a_cancelled_job_accepts_nothing_more_and_keeps_what_it_has
    a_node_that_nobody_can_bring_fails_its_job_with_the_reason
    a_worker_that_dies_again_and_again_does_not_fail_the_job
    nothing_is_lost_when_the_store_is_reopened
    rounds_complete_in_order_and_the_last_ends_the_job
    times_beyond_all_numbers_leave_the_farm_usable
    a_time_limit_counts_from_the_first_lease_and_keeps_what_is_complete
    a_time_limit_ends_no_job_before_its_first_round_and_then_nothing_else_is_rendered
    errors_and_targets_that_were_absent_at_first_are_stored_later
    a_round_that_reaches_a_target_ends_the_job_and_what_lies_beyond_it_goes
    a_target_that_is_not_reached_leaves_the_last_round_to_end_the_job
    a_target_that_is_reached_after_the_end_changes_nothing
    passes_beyond_those_that_all_get_wait_until_they_are_shared_out
    a_pilot_that_is_not_whole_decides_nothing
    a_target_leaves_each_tile_what_it_has_at_its_round
    nodes_beyond_the_share_of_a_round_go_when_a_target_ends_the_job
    a_job_that_ends_before_its_pilot_leaves_none_of_it
    a_pilot_that_a_wrong_worker_has_rendered_is_rendered_again
    a_job_whose_passes_a_wrong_pilot_has_shared_out_begins_again
    an_unknown_worker_gets_no_work_and_is_told
    a_failed_write_takes_nothing_else_with_it
    a_farm_keeps_its_identity
    a_database_of_a_newer_build_is_refused_with_both_versions
    a_lost_connection_fails_what_was_under_way_and_nothing_after_it
}
