//! Workers that die with what they were leased, and jobs that are held for it.

use clerestory_api::{ContentHash, JobState, WorkerActivity, WorkerId};
use clerestory_film::{NodeAddress, TileGrid};

use crate::model::NewJob;
use crate::store::leases::expiry::{Expiry, Observation};
use crate::store::tests::{DeliveredNode, Farm, Grant, TTL_MS, delivered};

const ONE_TILE: TileGrid = TileGrid::new(8, 8, 16);

impl Farm {
    /// Takes back expired leases. Only workers heard of since `alive_ms` are alive.
    async fn expire_watched(&self, now_ms: i64, alive_ms: i64) -> Expiry {
        self.store.expire_leases(Observation { now_ms, listening_ms: 0, alive_ms }).await.unwrap()
    }

    /// A process of a machine claims nodes and is never heard of again.
    async fn die(&self, name: &str, nodes: u32, now_ms: i64) -> (WorkerId, Grant, Expiry) {
        let worker = self.worker_named(name).await.unwrap();
        let grant = self.claim(worker, nodes, now_ms).await.unwrap();
        let expiry = self.expire_watched(now_ms + TTL_MS, i64::MIN).await;
        (worker, grant, expiry)
    }
}

pub(super) async fn a_job_that_kills_the_workers_of_three_machines_is_held_until_it_is_released(farm: Farm) {
    let job = farm.job(1).await;
    let other = farm.job(1).await;
    let (one, grant, expiry) = farm.die("one", 3, 0).await;
    let [expired] = expiry.leases.as_slice() else { panic!("{expiry:?}") };
    assert_eq!((expired.job_name.as_str(), expired.worker_name.as_str(), expired.nodes), ("window", "one", 3));
    assert_eq!((expired.job, expired.worker, expiry.held), (job, one, vec![]));
    let suspect = grant.nodes[0];
    let mut workers = vec![one];
    for (name, now_ms, is_held) in [("two", TTL_MS, false), ("three", 2 * TTL_MS, true)] {
        let (worker, grant, expiry) = farm.die(name, 3, now_ms).await;
        assert_eq!(grant.nodes, [suspect], "it is leased alone");
        assert_eq!(expiry.held.len(), usize::from(is_held));
        workers.push(worker);
    }
    let record = farm.record(job).await;
    let hold = record.hold.unwrap();
    assert_eq!(
        (record.state, hold.since_ms, hold.node.map(|node| node.tile)),
        (JobState::Running, 3 * TTL_MS, Some(suspect.tile))
    );
    assert_eq!(hold.workers.iter().map(|worker| worker.id).collect::<Vec<_>>(), workers);
    let why = "workers died on 3 machines with it before it had brought a node: `one`, `two` and `three`";
    assert!(hold.reason.contains(why), "{}", hold.reason);

    let next = farm.worker_named("four").await.unwrap();
    assert_eq!(farm.claim(next, 3, 3 * TTL_MS).await.unwrap().lease.job, other, "others go on");
    assert_eq!(farm.store.release_jobs_of_returned_workers(3 * TTL_MS).await.unwrap(), []);
    assert!(farm.store.release_job(job, 3 * TTL_MS).await.unwrap());
    assert!(!farm.store.release_job(job, 3 * TTL_MS).await.unwrap(), "it is not held any more");
    let grant = farm.claim(next, 3, 3 * TTL_MS).await.unwrap();
    assert_eq!((grant.lease.job, grant.nodes.len()), (job, 3), "all is forgotten");
    assert_eq!(farm.record(job).await.hold, None);
}

pub(super) async fn deaths_side_by_side_count_together_until_the_job_has_brought_a_node(farm: Farm) {
    for has_brought in [false, true] {
        let job = farm.job(1).await;
        let start = if has_brought { 10 * TTL_MS } else { 0 };
        if has_brought {
            let worker = farm.worker_named("first").await.unwrap();
            let grant = farm.claim(worker, 1, start).await.unwrap();
            farm.deliver(&grant, &grant.nodes, start + 1).await.unwrap();
        }
        let mut taken = Vec::new();
        for name in ["one", "two", "three"] {
            let worker = farm.worker_named(name).await.unwrap();
            let grant = farm.claim(worker, 1, start).await.unwrap();
            assert_eq!(grant.lease.job, job);
            taken.extend(grant.nodes);
        }
        let expiry = farm.expire_watched(start + TTL_MS, i64::MIN).await;
        assert_eq!((expiry.leases.len(), expiry.held.len()), (3, usize::from(!has_brought)));
        let hold = farm.record(job).await.hold;
        assert_eq!(hold.map(|hold| hold.workers.len()), (!has_brought).then_some(3));
        if has_brought {
            // All that die with one of the nodes do.
            for (name, now_ms) in [("two", TTL_MS), ("three", 2 * TTL_MS)] {
                assert_eq!(farm.record(job).await.hold, None);
                let (_, grant, _) = farm.die(name, 1, start + now_ms).await;
                assert!(taken.contains(&grant.nodes[0]));
            }
            let reason = farm.record(job).await.hold.unwrap().reason;
            assert!(reason.contains("workers died on 3 machines with node (frame 0, tile "), "{reason}");
        }
    }
}

pub(super) async fn a_job_that_kills_the_only_worker_five_times_is_held(farm: Farm) {
    let job = farm.job(1).await;
    for death in 0..5 {
        assert_eq!(farm.record(job).await.hold, None);
        farm.worker_named("only").await.unwrap();
        farm.die("only", 2, death * TTL_MS).await;
    }
    let reason = farm.record(job).await.hold.unwrap().reason;
    assert!(
        reason.contains("workers died 5 times with it before it had brought a node")
            && reason.contains("`only`, and no other"),
        "{reason}"
    );
}

pub(super) async fn a_node_with_which_one_machine_died_goes_to_another_that_is_there(farm: Farm) {
    farm.job(1).await;
    let two = farm.worker_named("two").await.unwrap();
    let (_, lost, _) = farm.die("one", 2, 0).await;
    let (_, rest, _) = farm.die("one", 2, TTL_MS).await;
    assert!(!rest.nodes.contains(&lost.nodes[0]), "{:?}", rest.nodes);
    assert_eq!(farm.claim(two, 2, 2 * TTL_MS).await.unwrap().nodes, lost.nodes[..1]);
}

pub(super) async fn a_worker_that_comes_back_has_not_died(farm: Farm) {
    let job = farm.job(1).await;
    let mut workers = Vec::new();
    for (name, now_ms) in [("one", 0), ("two", TTL_MS), ("three", 2 * TTL_MS)] {
        workers.push(farm.die(name, 1, now_ms).await.0);
        if name == "one" {
            // Its lease expired while no heartbeat could arrive.
            farm.store.touch_worker(workers[0], TTL_MS + 1, WorkerActivity::default()).await.unwrap();
        }
    }
    assert_eq!(farm.record(job).await.hold, None, "two have died");
    workers.push(farm.die("four", 1, 3 * TTL_MS).await.0);
    let held: Vec<WorkerId> = farm.record(job).await.hold.unwrap().workers.iter().map(|worker| worker.id).collect();
    assert_eq!(held, workers[1..]);
    farm.store.touch_worker(workers[2], 4 * TTL_MS + 1, WorkerActivity::default()).await.unwrap();
    assert_eq!(farm.store.release_jobs_of_returned_workers(4 * TTL_MS + 2).await.unwrap(), [job]);
    assert_eq!(farm.record(job).await.hold, None);
}

pub(super) async fn a_lease_that_has_brought_a_node_is_no_death(farm: Farm) {
    let job = farm.job(2).await;
    for (name, now_ms) in [("one", 0), ("two", 10 * TTL_MS), ("three", 20 * TTL_MS), ("four", 30 * TTL_MS)] {
        let worker = farm.worker_named(name).await.unwrap();
        let grant = farm.claim(worker, 3, now_ms).await.unwrap();
        assert_eq!(grant.nodes.len(), 3, "none is a suspect");
        farm.deliver(&grant, &grant.nodes[..1], now_ms + 1).await.unwrap();
        farm.expire_watched(now_ms + TTL_MS, i64::MIN).await;
    }
    assert_eq!(farm.record(job).await.hold, None);
}

pub(super) async fn a_worker_that_dies_with_a_node_that_another_took_over_counts_too(farm: Farm) {
    let job = farm.job_like(|job| NewJob { grid: ONE_TILE, ..job }).await;
    let one = farm.worker_named("one").await.unwrap();
    let lease = farm.claim(one, 1, 0).await.unwrap().lease;
    farm.store.renew(lease.id, lease.token, 0, 100_000).await.unwrap();
    // The first lease has lost all that it had, and never runs out.
    let (_, taken, expiry) = farm.die("two", 1, 2 * TTL_MS).await;
    assert_eq!((taken.nodes.len(), expiry.leases.len(), expiry.held.len()), (1, 1, 0));
    farm.die("three", 1, 4 * TTL_MS).await;
    let hold = farm.record(job).await.hold.unwrap();
    assert_eq!(hold.workers.iter().map(|worker| worker.name.as_str()).collect::<Vec<_>>(), ["one", "two", "three"]);
}

pub(super) async fn a_check_that_workers_die_with_again_and_again_is_given_up(farm: Farm) {
    let job = farm.job_like(|job| NewJob { grid: ONE_TILE, ..job }).await;
    let [right, other] = [farm.worker_named("right").await.unwrap(), farm.worker_named("other").await.unwrap()];
    let grant = farm.claim(right, 1, 0).await.unwrap();
    let checked =
        |node: &NodeAddress| DeliveredNode { is_selected: true, digest: "bits".to_owned(), ..delivered(*node) };
    farm.bring(&grant, grant.nodes.iter().map(checked).collect(), 1).await.unwrap();
    for death in 1..=5 {
        assert_eq!(farm.next_complete_round(job).await, None, "the round waits for the check");
        assert_eq!(farm.claim(other, 1, death * TTL_MS).await.unwrap().nodes, grant.nodes);
        let expiry = farm.expire_watched((death + 1) * TTL_MS, i64::MIN).await;
        assert_eq!(expiry.unchecked.contains(&job), death == 5);
    }
    assert!(farm.next_complete_round(job).await.is_some());
    assert_eq!(farm.record(job).await.hold, None);
}

pub(super) async fn jobs_whose_content_is_lost_are_held_until_it_is_here(farm: Farm) {
    let [file, reference] = [1, 2].map(|byte| ContentHash::from([byte; 32]));
    for content in [file, reference] {
        farm.store.insert_asset(content, 1, 0).await.unwrap();
    }
    let assets = ["a.obj", "b.obj"].map(|name| (name.to_owned(), file)).into();
    let with_file = farm.job_like(|job| NewJob { assets, reference: Some(reference), ..job }).await;
    let with_reference = farm.job_like(|job| NewJob { reference: Some(reference), ..job }).await;
    let other = farm.job(1).await;
    assert_eq!(farm.store.needed_assets().await.unwrap(), [file, reference].into());
    assert_eq!(farm.store.hold_for_lost_asset(file, 5).await.unwrap(), [with_file]);
    assert_eq!(farm.store.hold_for_lost_asset(reference, 6).await.unwrap(), [with_reference], "one is held already");
    let hold = farm.record(with_file).await.hold.unwrap();
    assert_eq!((hold.since_ms, hold.asset), (5, Some(file)));
    assert!(hold.reason.contains("the file `") && hold.reason.contains("of its scene is lost"), "{}", hold.reason);
    assert!(farm.record(with_reference).await.hold.unwrap().reason.starts_with("its reference is lost"));
    let worker = farm.worker().await;
    assert_eq!(farm.claim(worker, 1, 7).await.unwrap().lease.job, other);
    assert_eq!(farm.store.release_for_asset(file, 8).await.unwrap(), [with_file]);
    assert_eq!(farm.store.release_for_asset(file, 8).await.unwrap(), []);
    assert_eq!(farm.record(with_file).await.hold, None);
    assert!(farm.record(with_reference).await.hold.is_some());
}
