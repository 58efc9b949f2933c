//! Scenes that a worker judges when it builds them.

use std::collections::BTreeMap;

use bytes::Bytes;
use clerestory_api::{
    BuildOutcome, BuiltScene, ClientError, JobState, JobSubmission, Lease, LeaseReturn, ProblemCode, SceneReport,
    WorkerRegistration,
};
use clerestory_render_core::document::WITH_CAUSTIC;
use serde_json::json;

use crate::support::*;

impl TestWorker {
    async fn report(&self, lease: &Lease, outcome: BuildOutcome) -> Result<(), ClientError> {
        self.client.report_scene(lease.id, &SceneReport { token: lease.token, outcome }).await
    }
}

/// A worker that knows the layers of scenes with glass.
async fn worker_for_glass(farm: &TestFarm, name: &str) -> TestWorker {
    let digest = |method: String| (method, vec!["digest".to_owned()]);
    let method_digests = BTreeMap::from(["path".to_owned(), format!("path{WITH_CAUSTIC}")].map(digest));
    farm.worker_like(name, WorkerRegistration { method_digests, ..WorkerRegistration::default() }).await
}

fn built(method: &str) -> BuiltScene {
    BuiltScene {
        left_to_chance: vec!["light of the globe".to_owned()],
        chosen_methods: vec![method.to_owned()],
        import_notes: vec!["hall.glb: skins are left out (2)".to_owned()],
    }
}

/// Two panes in one place.
fn touching_panes() -> JobSubmission {
    let pane = |name: &str| {
        json!({"name": name, "centre": [0, 0, 3], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 0.9,
            "height": 0.9, "thickness": 0.004, "front": "flat", "back": "flat"})
    };
    let mut touching = scene();
    touching["panes"] = json!([pane("one"), pane("other")]);
    JobSubmission { scene: touching, ..submission(1) }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_only_building_shows_is_known_after_the_first_report() {
    let farm = TestFarm::start_with(|config| config.lease_nodes = Some(2)).await;
    let assumptions = vec!["The file has no light: a <b>sun</b> was added".to_owned()];
    let submission = JobSubmission { assumptions: assumptions.clone(), ..submission(1) };
    let job = farm.client.submit_job(&submission).await.unwrap();
    assert_eq!((job.left_to_chance, job.chosen_methods, job.import_notes), (None, None, None));
    let [first, second] = [farm.worker_named("first").await, farm.worker_named("second").await];
    let leases = [first.claim().await.unwrap(), second.claim().await.unwrap()];
    assert!(leases[0].wants_report && leases[1].wants_report);

    let mut known = Box::pin(farm.until(job.id, |job| job.chosen_methods.is_some()));
    assert!(futures::poll!(&mut known).is_pending());
    first.report(&leases[0], BuildOutcome::Built(built("cone"))).await.unwrap();
    let known = known.await;
    assert_eq!(known.left_to_chance, Some(built("cone").left_to_chance));
    let next = first.claim().await.unwrap();
    assert!(!next.wants_report);
    let unused = LeaseReturn { token: next.token, failure: None };
    first.client.return_lease(next.id, &unused).await.unwrap();
    second.report(&leases[1], BuildOutcome::Built(built("fnee"))).await.unwrap();
    let farm = farm.restarted().await;
    let shown = farm.client.job(job.id).await.unwrap();
    assert_eq!((shown.state, shown.chosen_methods), (JobState::Running, Some(built("cone").chosen_methods)));
    assert_eq!((shown.import_notes, &shown.assumptions), (Some(built("cone").import_notes), &assumptions));

    // The image says what the first report said.
    for (worker, lease) in [(&first, &leases[0]), (&second, &leases[1])] {
        let worker = TestWorker { client: farm.client.clone(), id: worker.id };
        worker.upload(lease, noise_partial(lease, &addresses(lease))).await.unwrap();
        worker.drain().await;
    }
    assert_eq!(farm.finished(job.id).await.state, JobState::Done);
    let image = farm.image(job.id).await;
    let metadata = image.metadata().unwrap();
    assert_eq!(metadata.chosen_methods, built("cone").chosen_methods);
    assert_eq!((&metadata.import_notes, &metadata.assumptions), (&built("cone").import_notes, &assumptions));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scene_that_cannot_be_built_is_accepted_and_fails_its_job_on_the_first_worker() {
    let farm = TestFarm::start().await;
    let job = farm.client.submit_job(&touching_panes()).await.unwrap();
    let worker = worker_for_glass(&farm, "nave").await;
    let lease = worker.claim().await.unwrap();
    let reason = "panes[1].centre: found a pane in another, must be a place of its own".to_owned();
    worker.report(&lease, BuildOutcome::Refused { reason: reason.clone() }).await.unwrap();
    let failed = farm.finished(job.id).await;
    assert_eq!((failed.state, failed.failed_node), (JobState::Failed, None));
    assert_eq!(failed.failure, Some(format!("worker `nave` cannot build the scene: {reason}")));

    // The worker did not fail: it gets the next lease at once.
    let next = farm.submit(1).await;
    worker.drain().await;
    assert_eq!(farm.finished(next.id).await.state, JobState::Done);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_first_refusal_is_shown_until_another_machine_has_tried() {
    let farm = TestFarm::start().await;
    let [nave, apse] = [worker_for_glass(&farm, "nave").await, worker_for_glass(&farm, "apse").await];
    let reason = "panes[1].centre: found a pane in another, must be a place of its own".to_owned();
    for is_confirmed in [true, false] {
        let job = farm.client.submit_job(&touching_panes()).await.unwrap();
        let lease = nave.claim().await.unwrap();
        let mut shown = Box::pin(farm.until(job.id, |job| job.scene_refusal.is_some()));
        assert!(futures::poll!(&mut shown).is_pending());
        nave.report(&lease, BuildOutcome::Refused { reason: reason.clone() }).await.unwrap();
        let refusal = shown.await.scene_refusal.unwrap();
        assert_eq!((refusal.worker.name.as_str(), &refusal.reason), ("nave", &reason));

        let lease = apse.claim().await.unwrap();
        if is_confirmed {
            apse.report(&lease, BuildOutcome::Refused { reason: reason.clone() }).await.unwrap();
            let failed = farm.finished(job.id).await;
            assert_eq!((failed.state, failed.scene_refusal), (JobState::Failed, None));
        } else {
            apse.report(&lease, BuildOutcome::Built(built("cone"))).await.unwrap();
            let view = farm.client.job(job.id).await.unwrap();
            assert_eq!((view.state, view.scene_refusal), (JobState::Running, None));
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_report_is_refused_without_a_valid_lease_and_with_too_much_to_say() {
    let farm = TestFarm::start().await;
    let job = farm.submit(1).await;
    let worker = farm.worker().await;
    let lease = worker.claim().await.unwrap();
    let refused = |characters: usize| BuildOutcome::Refused { reason: "x".repeat(characters) };
    let lines = vec![String::new(); 1001];
    let long = BuiltScene { chosen_methods: lines, ..BuiltScene::default() };
    let many = BuiltScene { import_notes: vec![String::new(); 101], ..BuiltScene::default() };
    let wordy = BuiltScene { import_notes: vec!["x".repeat(301)], ..BuiltScene::default() };
    let unknown = Lease { id: "00000000-0000-7000-8000-000000000001".parse().unwrap(), ..lease.clone() };
    let calls = [
        (Lease { token: lease.token + 1, ..lease.clone() }, refused(1), ProblemCode::StaleToken),
        (unknown, refused(1), ProblemCode::UnknownLease),
        (lease.clone(), refused(2001), ProblemCode::InvalidField),
        (lease.clone(), BuildOutcome::Built(long), ProblemCode::InvalidField),
        (lease.clone(), BuildOutcome::Built(many), ProblemCode::InvalidField),
        (lease.clone(), BuildOutcome::Built(wordy), ProblemCode::InvalidField),
    ];
    for (lease, outcome, code) in calls {
        let problem = worker.report(&lease, outcome).await.unwrap_err().problem().unwrap().clone();
        assert_eq!(problem.code, code, "{problem}");
    }
    let shown = farm.client.job(job.id).await.unwrap();
    assert_eq!((shown.state, shown.chosen_methods), (JobState::Running, None));
    worker.report(&lease, refused(2000)).await.unwrap();
    assert_eq!(farm.finished(job.id).await.state, JobState::Failed);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_that_cannot_be_read_is_left_to_the_first_worker() {
    let farm = TestFarm::start().await;
    let content = Bytes::from_static(b"no mesh");
    let hash = hash(&content);
    farm.client.upload_asset(&hash, content, |_| ()).await.unwrap();
    let mut scene = scene();
    scene["meshes"][0]["source"] = json!({"ply": {"file": "floor.ply"}});
    let submission = JobSubmission { scene, assets: [("floor.ply".to_owned(), hash)].into(), ..submission(1) };
    assert_eq!(farm.client.submit_job(&submission).await.unwrap().state, JobState::Queued);
}
