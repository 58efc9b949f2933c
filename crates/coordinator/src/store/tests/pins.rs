//! Jobs are pinned to the build fingerprint of their own method.

use std::collections::BTreeMap;

use clerestory_api::{BuildWait, JobId, WorkerId, WorkerRegistration};
use clerestory_render_core::document::WITH_CAUSTIC;

use crate::model::NewJob;
use crate::store::tests::{Farm, Grant};

/// Registers a worker with a digest of the first probe, empty for none, and digests by method.
pub(super) async fn worker(farm: &Farm, name: &str, first: &str, methods: &[(&str, &[&str])]) -> WorkerId {
    let digests = |(method, digests): &(&str, &[&str])| {
        ((*method).to_owned(), digests.iter().map(|digest| (*digest).to_owned()).collect())
    };
    let registration = WorkerRegistration {
        probe_digest: (!first.is_empty()).then(|| first.to_owned()),
        method_digests: methods.iter().map(digests).collect::<BTreeMap<_, _>>(),
        ..WorkerRegistration::default()
    };
    farm.worker_like(name, registration).await.unwrap()
}

async fn job_with(farm: &Farm, method: &str) -> JobId {
    farm.job_like(|job| NewJob { integrator: method.to_owned(), ..job }).await
}

async fn claimed(farm: &Farm, worker: WorkerId) -> Option<JobId> {
    farm.claim(worker, 1, 0).await.map(|Grant { lease, .. }| lease.job)
}

async fn pin(farm: &Farm, job: JobId) -> String {
    farm.record(job).await.probe_digest.unwrap()
}

async fn wait(farm: &Farm, job: JobId, since_ms: i64) -> Option<BuildWait> {
    let record = farm.record(job).await;
    let wait = farm.store.build_wait(&record, since_ms).await.unwrap();
    assert_eq!(farm.store.jobs_that_wait_for_a_build(since_ms).await.unwrap().contains(&job), wait.is_some());
    wait
}

pub(super) async fn a_job_goes_on_when_another_method_computes_other_bits(farm: Farm) {
    let [path, cone] = [job_with(&farm, "path").await, job_with(&farm, "cone").await];
    let before = worker(&farm, "before", "", &[("path", &["p"]), ("cone", &["c"])]).await;
    assert_eq!(farm.claim(before, 100, 0).await.unwrap().lease.job, path);
    assert_eq!(claimed(&farm, before).await, Some(cone));
    assert_eq!((pin(&farm, path).await, pin(&farm, cone).await), ("p".to_owned(), "c".to_owned()));

    let another = job_with(&farm, "path").await;
    assert_eq!(claimed(&farm, before).await, Some(cone));
    let after = worker(&farm, "after", "", &[("path", &["p"]), ("cone", &["other"]), ("new", &["n"])]).await;
    assert_eq!(claimed(&farm, after).await, Some(another), "the older one needs the other bits");
    assert_eq!(farm.store.worker(after, 0).await.unwrap().passed_over, [cone]);
    assert_eq!(farm.store.worker(before, 0).await.unwrap().passed_over, []);
    let listed = farm.store.workers(i64::MAX, 0).await.unwrap();
    assert_eq!(listed.iter().map(|view| view.passed_over.len()).collect::<Vec<_>>(), [0, 1]);
}

pub(super) async fn a_new_probe_case_strands_no_job(farm: Farm) {
    let begun = job_with(&farm, "sms").await;
    let before = worker(&farm, "before", "", &[("sms", &["one", "two"])]).await;
    assert_eq!(claimed(&farm, before).await, Some(begun));
    let after = worker(&farm, "after", "", &[("sms", &["one", "two", "three"])]).await;
    assert_eq!(farm.claim(after, 100, 0).await.unwrap().lease.job, begun);
    let later = job_with(&farm, "sms").await;
    assert_eq!(claimed(&farm, after).await, Some(later));
    assert_eq!((pin(&farm, begun).await, pin(&farm, later).await), ("two".to_owned(), "three".to_owned()));
    assert_eq!(claimed(&farm, before).await, None, "it may compute other bits in the third case");
}

pub(super) async fn a_job_of_an_older_build_goes_on_with_workers_of_the_same_first_digest(farm: Farm) {
    let begun = job_with(&farm, "path").await;
    let older = worker(&farm, "older", "first", &[]).await;
    assert_eq!(claimed(&farm, older).await, Some(begun));
    assert_eq!(pin(&farm, begun).await, "first");
    let changed = worker(&farm, "changed", "other", &[("path", &["p"])]).await;
    assert_eq!(claimed(&farm, changed).await, None);
    let newer = worker(&farm, "newer", "first", &[("path", &["p"])]).await;
    assert_eq!(farm.claim(newer, 100, 0).await.unwrap().lease.job, begun);

    let of_newer = job_with(&farm, "path").await;
    assert_eq!(claimed(&farm, newer).await, Some(of_newer));
    assert_eq!(claimed(&farm, older).await, None);
    assert_eq!(claimed(&farm, changed).await, Some(of_newer), "its method computes the same bits");
    let of_older = job_with(&farm, "path").await;
    assert_eq!(claimed(&farm, older).await, Some(of_older));
    let also_older = worker(&farm, "also older", "first", &[]).await;
    assert_eq!(claimed(&farm, also_older).await, Some(of_older), "a farm of older workers goes on");
}

pub(super) async fn a_job_of_many_lights_stays_with_the_builds_that_began_it(farm: Farm) {
    let many = async || farm.job_like(|job| NewJob { is_same_by_first: false, ..job }).await;
    let job = many().await;
    let older = worker(&farm, "older", "first", &[]).await;
    let begun = farm.claim(older, 2, 0).await.unwrap();
    farm.deliver(&begun, &begun.nodes[..1], 0).await.unwrap();
    let newer = worker(&farm, "newer", "first", &[("path", &["p"])]).await;
    assert_eq!(claimed(&farm, newer).await, None, "it would choose among the lights that the other asks");
    assert_eq!(farm.store.worker(newer, 0).await.unwrap().passed_over, [job]);
    let also_older = worker(&farm, "also older", "first", &[]).await;
    let continued = farm.claim(also_older, 1, 0).await.unwrap();
    assert_eq!((begun.lease.job, continued.lease.job), (job, job));
    for Grant { lease, .. } in [begun, continued] {
        farm.store.return_lease(lease.id, lease.token, 0).await.unwrap();
        assert!(farm.store.end_worker(lease.worker, 0).await.unwrap());
    }
    assert!(wait(&farm, job, 0).await.unwrap().reason.contains("start a worker"));

    let of_newer = many().await;
    assert_eq!(claimed(&farm, newer).await, Some(of_newer));
    let back = worker(&farm, "back", "first", &[]).await;
    assert_eq!(claimed(&farm, back).await, Some(job));
}

pub(super) async fn a_job_whose_method_has_changed_waits_and_names_the_two_ways_out(farm: Farm) {
    let job = job_with(&farm, "fnee").await;
    let begins = worker(&farm, "nave", "first", &[("fnee", &["old"])]).await;
    let grant = farm.claim(begins, 2, 0).await.unwrap();
    farm.deliver(&grant, &grant.nodes[..1], 0).await.unwrap();
    let changed = worker(&farm, "apse", "second", &[("fnee", &["new"])]).await;
    assert_eq!(wait(&farm, job, 0).await, None, "a lease is active");
    farm.store.return_lease(grant.lease.id, grant.lease.token, 0).await.unwrap();
    assert_eq!(wait(&farm, job, 0).await, None, "the worker that began it is there");

    assert!(farm.store.end_worker(begins, 0).await.unwrap());
    assert_eq!(claimed(&farm, changed).await, None);
    let found = wait(&farm, job, 0).await.unwrap();
    assert_eq!((found.build.as_deref(), found.machine.as_deref()), (Some("b"), Some("nave")));
    assert_eq!(
        found.reason,
        "the workers that began it compute other bits with `fnee` than the workers that are there now; start a worker \
         of build `b` on a machine like `nave`, or submit the job again"
    );
    assert_eq!(wait(&farm, job, 1).await, None, "no worker is there at all");

    let back = worker(&farm, "nave", "first", &[("fnee", &["old"])]).await;
    assert_eq!(wait(&farm, job, 0).await, None);
    assert_eq!(claimed(&farm, back).await, Some(job));
}

pub(super) async fn a_job_that_older_workers_cannot_read_is_left_to_newer_ones(farm: Farm) {
    let job = farm.job_like(|job| NewJob { integrator: "auto".to_owned(), is_read_by_first: false, ..job }).await;
    let older = worker(&farm, "older", "first", &[]).await;
    assert_eq!(claimed(&farm, older).await, None);
    let other = worker(&farm, "other", "first", &[("path", &["p"])]).await;
    assert_eq!(claimed(&farm, other).await, None, "a newer build that lacks the method");
    let reason = wait(&farm, job, 0).await.unwrap().reason;
    assert!(reason.contains("no `auto`") && reason.contains("update the workers"), "{reason}");
    let newer = worker(&farm, "newer", "first", &[("path", &["p"]), ("auto", &["a"])]).await;
    assert_eq!(wait(&farm, job, 0).await, None);
    assert_eq!(claimed(&farm, newer).await, Some(job));
    assert_eq!(pin(&farm, job).await, "a");
}

pub(super) async fn a_job_with_the_layer_caustic_is_left_to_workers_that_know_it(farm: Farm) {
    let with_caustic = |job: NewJob| NewJob { grid: job.grid.with_caustic(true), is_read_by_first: false, ..job };
    let job = farm.job_like(with_caustic).await;
    let before = worker(&farm, "before", "first", &[("path", &["p"])]).await;
    assert_eq!(claimed(&farm, before).await, None);
    let reason = wait(&farm, job, 0).await.unwrap().reason;
    assert!(reason.contains("no layer `caustic`") && reason.contains("update the workers"), "{reason}");
    let without = job_with(&farm, "path").await;
    assert_eq!(farm.claim(before, 1, 0).await.unwrap().lease.job, without, "it knows all of this one");

    let name = format!("path{WITH_CAUSTIC}");
    let newer = worker(&farm, "newer", "first", &[("path", &["p"]), (&name, &["c"])]).await;
    assert_eq!(wait(&farm, job, 0).await, None);
    assert_eq!(claimed(&farm, newer).await, Some(job));
    assert_eq!((pin(&farm, job).await, pin(&farm, without).await), ("c".to_owned(), "p".to_owned()));
    let others = worker(&farm, "others", "first", &[("path", &["p"]), (&name, &["other"])]).await;
    assert_eq!(claimed(&farm, others).await, Some(without), "its caustics have other bits");
    assert!(farm.record(job).await.grid.has_caustic && !farm.record(without).await.grid.has_caustic);
}
