//! Jobs whose workers die or fail, and workers that end.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::support::*;
use clerestory_api::{
    BuildWait, EventBody, JobState, JobView, NamedWorker, ProblemCode, WorkerRegistration, WorkerState,
};
use clerestory_coordinator::Clock;
use futures::StreamExt;

/// Longest wait for an event of the farm.
const LONGEST_WAIT: Duration = Duration::from_secs(30);

/// Waits until a lease of a worker has run out.
async fn lost(farm: &TestFarm, worker: &TestWorker) {
    let start = Instant::now();
    let leased =
        async || farm.client.workers().await.unwrap().iter().any(|view| view.id == worker.id && view.leased_nodes > 0);
    while leased().await {
        assert!(start.elapsed() < LONGEST_WAIT, "the lease does not run out");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

fn names(workers: &[NamedWorker]) -> Vec<&str> {
    workers.iter().map(|worker| worker.name.as_str()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_kills_its_workers_is_held_and_goes_on_when_it_is_released() {
    let farm = TestFarm::start_with(|config| config.lease_ttl = Duration::from_millis(200)).await;
    let job = farm.submit(1).await;
    for name in ["one", "two", "three"] {
        let worker = farm.worker_named(name).await;
        assert_eq!(worker.claim().await.unwrap().job, job.id);
        lost(&farm, &worker).await;
    }
    let held = farm.until(job.id, |job: &JobView| job.hold.is_some()).await;
    let hold = held.hold.unwrap();
    assert_eq!((held.state, names(&hold.workers)), (JobState::Running, vec!["one", "two", "three"]));
    assert!(hold.reason.contains("`one`, `two` and `three`"), "{}", hold.reason);
    assert!(farm.client.jobs().await.unwrap()[0].hold.is_some());

    // Others go on meanwhile.
    let other = farm.submit(1).await;
    let worker = farm.worker_named("sound").await;
    worker.drain().await;
    assert_eq!(farm.finished(other.id).await.state, JobState::Done);
    assert_eq!(farm.client.release_job(job.id).await.unwrap().hold, None);
    worker.drain().await;
    assert_eq!(farm.finished(job.id).await.state, JobState::Done);
    assert!(bits(&farm.image(job.id).await) == expected_bits(1));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_method_has_changed_waits_for_a_worker_of_the_old_build() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(2)).await;
    let job = farm.submit(1).await;
    let with_digest = async |name: &str, digest: &str| {
        let method_digests = BTreeMap::from([("path".to_owned(), vec![digest.to_owned()])]);
        farm.worker_like(name, WorkerRegistration { method_digests, ..WorkerRegistration::default() }).await
    };
    let old = with_digest("nave", "old").await;
    let lease = old.claim().await.unwrap();
    old.upload(&lease, noise_partial(&lease, &addresses(&lease))).await.unwrap();
    let changed = with_digest("apse", "new").await;
    assert!(changed.claim().await.is_none());
    assert_eq!(farm.client.job(job.id).await.unwrap().waits_for_build, None, "its worker is there");

    let mut waiting = std::pin::pin!(farm.until(job.id, |job: &JobView| job.waits_for_build.is_some()));
    assert!(futures::poll!(&mut waiting).is_pending());
    old.client.end_worker(old.id).await.unwrap();
    let view = waiting.await;
    let BuildWait { reason, build, machine } = view.waits_for_build.unwrap();
    assert_eq!((build.as_deref(), machine.as_deref()), (Some("test"), Some("nave")));
    assert!(reason.contains("start a worker of build `test`") && reason.contains("submit the job again"), "{reason}");
    assert!(farm.client.jobs().await.unwrap()[0].waits_for_build.is_some());

    let back = with_digest("nave", "old").await;
    farm.until(job.id, |job: &JobView| job.waits_for_build.is_none()).await;
    back.drain().await;
    assert_eq!(farm.finished(job.id).await.state, JobState::Done);
    assert!(bits(&farm.image(job.id).await) == expected_bits(1));
}

#[tokio::test(flavor = "multi_thread")]
async fn damaged_partials_of_one_machine_fail_no_job_and_those_of_three_say_whose_they_were() {
    let clock = Clock::Manual(Arc::default());
    let farm = TestFarm::start_with(|config| config.clock = clock.clone()).await;
    let job = farm.submit(1).await;
    let [bad, worse, worst] =
        [farm.worker_named("bad").await, farm.worker_named("worse").await, farm.worker_named("worst").await];
    for worker in [&bad, &bad, &bad, &bad, &bad, &bad, &worse, &worst] {
        assert_eq!(farm.client.job(job.id).await.unwrap().failure, None);
        let lease = worker.claim().await.unwrap();
        let mut body = noise_partial(&lease, &addresses(&lease));
        body.truncate(body.len() - 7);
        let refused = worker.upload(&lease, body).await.unwrap_err();
        assert_eq!(refused.problem().unwrap().code, ProblemCode::InvalidPartial);
        // For longer than a worker that has failed rests.
        clock.advance(60_000);
    }
    let failed = farm.finished(job.id).await;
    let (failure, node) = (failed.failure.unwrap(), failed.failed_node.unwrap());
    assert!(failure.contains("on 3 machines, `bad`, `worse` and `worst`"), "{failure}");
    assert!(failure.ends_with(&node.message), "{failure}");
    assert_eq!((failed.state, names(&node.workers)), (JobState::Failed, vec!["bad", "worse", "worst"]));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_ends_leaves_the_list_with_an_event() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(200)).await;
    farm.submit(1).await;
    let (ending, other) = (farm.worker_named("ending").await, farm.worker_named("other").await);
    let lease = ending.claim().await.unwrap();
    let mut events = farm.client.events(None, None).await.unwrap();
    farm.client.end_worker(ending.id).await.unwrap();
    farm.client.end_worker(ending.id).await.unwrap();
    let listed = farm.client.workers().await.unwrap();
    assert_eq!(listed.iter().map(|worker| worker.id).collect::<Vec<_>>(), [other.id]);
    assert_eq!(other.claim().await.unwrap().nodes, lease.nodes);
    let unknown = ending.client.claim_lease(&ending.request()).await.unwrap_err();
    assert_eq!(unknown.problem().unwrap().code, ProblemCode::UnknownWorker);
    let told = async {
        loop {
            if let EventBody::Worker { worker } = events.next().await.unwrap().unwrap().body
                && worker.id == ending.id
                && worker.state == WorkerState::Ended
            {
                return;
            }
        }
    };
    tokio::time::timeout(LONGEST_WAIT, told).await.unwrap();
}
