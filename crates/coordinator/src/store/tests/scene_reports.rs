//! Reports of workers on scenes that they have built.

use clerestory_api::{BuildOutcome, BuiltScene, JobState};

use crate::model::{Grant, SceneChange, SceneReport, WorkFailure};
use crate::store::errors::LeaseError;
use crate::store::tests::{Farm, TTL_MS};

fn built(method: &str) -> BuildOutcome {
    BuildOutcome::Built(BuiltScene {
        left_to_chance: vec!["light of \"sun\"".to_owned()],
        chosen_methods: vec![method.to_owned()],
        import_notes: vec!["hall.glb: skins are left out (2)".to_owned()],
    })
}

fn refused() -> BuildOutcome {
    BuildOutcome::Refused { reason: "panes[0].thickness: found 0".to_owned() }
}

fn report(grant: &Grant, outcome: BuildOutcome, now_ms: i64) -> SceneReport {
    SceneReport { lease: grant.lease.id, token: grant.lease.token, outcome, now_ms, alive_ms: i64::MIN }
}

impl Farm {
    async fn report(&self, grant: &Grant, outcome: BuildOutcome) -> Result<Option<SceneChange>, LeaseError> {
        self.store.report_scene(report(grant, outcome, 1)).await
    }
}

pub(super) async fn the_first_report_on_a_scene_counts_and_survives(farm: Farm) {
    let job = farm.job(1).await;
    let [first, second] = [farm.worker_named("first").await.unwrap(), farm.worker_named("second").await.unwrap()];
    let grants = [farm.claim(first, 2, 0).await.unwrap(), farm.claim(second, 2, 0).await.unwrap()];
    assert_eq!(farm.record(job).await.built_scene, None);
    let before = farm.store.last_event_id().await.unwrap();
    assert_eq!(farm.report(&grants[0], built("cone")).await.unwrap(), Some(SceneChange::Built(job)));
    let told = farm.store.last_event_id().await.unwrap();
    assert!(told > before, "pages are told");
    for outcome in [built("cone"), built("fnee")] {
        assert_eq!(farm.report(&grants[1], outcome).await.unwrap(), None);
    }
    assert_eq!(farm.store.last_event_id().await.unwrap(), told);
    let farm = farm.reopened().await;
    let record = farm.record(job).await;
    assert_eq!(record.state, JobState::Running);
    assert_eq!(record.built_scene.map(BuildOutcome::Built), Some(built("cone")));
    let next = farm.claim(first, 2, 0).await.unwrap();
    assert_eq!(grants.map(|grant| grant.wants_report), [true, true]);
    assert!(!next.wants_report);
}

pub(super) async fn a_scene_that_two_machines_refuse_fails_its_job_and_counts_against_nobody(farm: Farm) {
    let job = farm.job(1).await;
    let [first, second] = [farm.worker_named("first").await.unwrap(), farm.worker_named("second").await.unwrap()];
    let grant = farm.claim(first, 2, 0).await.unwrap();
    assert_eq!(farm.report(&grant, refused()).await.unwrap(), Some(SceneChange::Freed(job)));
    let farm = farm.reopened().await;
    let record = farm.record(job).await;
    assert_eq!((record.state, record.failure), (JobState::Running, None));
    let refusal = record.scene_refusal.unwrap();
    assert_eq!((refusal.worker, refusal.build.as_str()), (first, "b"));

    // The same machine does not get the job again.
    let again = farm.worker_named("first").await.unwrap();
    assert!(farm.claim(first, 1, 1).await.is_none() && farm.claim(again, 1, 1).await.is_none());
    let grant = farm.claim(second, 2, 1).await.unwrap();
    assert!(grant.lease.job == job && grant.wants_report);
    assert_eq!(farm.report(&grant, refused()).await.unwrap(), Some(SceneChange::Failed(job)));
    let record = farm.record(job).await;
    assert_eq!((record.state, record.failed_node), (JobState::Failed, None));
    let failure = "workers `first` and `second` cannot build the scene: panes[0].thickness: found 0";
    assert_eq!(record.failure.as_deref(), Some(failure));
    let late = farm.report(&grant, built("cone")).await;
    assert!(matches!(late, Err(LeaseError::Returned)), "{late:?}");
    assert_eq!(farm.record(job).await.built_scene, None);
    // No worker has to wait before its next lease.
    let next = farm.job(1).await;
    for worker in [first, second] {
        assert_eq!(farm.claim(worker, 1, 2).await.unwrap().lease.job, next);
    }
}

pub(super) async fn a_machine_that_builds_a_refused_scene_refutes_the_refusal(farm: Farm) {
    let job = farm.job(1).await;
    let [first, second] = [farm.worker_named("first").await.unwrap(), farm.worker_named("second").await.unwrap()];
    let grant = farm.claim(first, 2, 0).await.unwrap();
    farm.report(&grant, refused()).await.unwrap();
    let grant = farm.claim(second, 2, 1).await.unwrap();
    assert_eq!(farm.report(&grant, built("cone")).await.unwrap(), Some(SceneChange::Built(job)));
    let record = farm.record(job).await;
    assert_eq!((record.state, record.scene_refusal), (JobState::Running, None));
}

pub(super) async fn a_refused_scene_fails_its_job_at_once_where_no_other_machine_could_try(farm: Farm) {
    let only = "worker `first` cannot build the scene: panes[0].thickness: found 0";
    let first = farm.worker_named("first").await.unwrap();
    let job = farm.job(1).await;
    let grant = farm.claim(first, 2, 0).await.unwrap();
    assert_eq!(farm.report(&grant, refused()).await.unwrap(), Some(SceneChange::Failed(job)));
    assert_eq!(farm.record(job).await.failure.as_deref(), Some(only));

    // Another that is silent.
    let second = farm.worker_named("second").await.unwrap();
    let job = farm.job(1).await;
    let grant = farm.claim(first, 2, 10).await.unwrap();
    let alone = SceneReport { alive_ms: 5, ..report(&grant, refused(), 10) };
    assert_eq!(farm.store.report_scene(alone).await.unwrap(), Some(SceneChange::Failed(job)));
    assert_eq!(farm.record(job).await.failure.as_deref(), Some(only));

    // Another that has failed on the job, for instance because it has too little memory.
    let job = farm.job(1).await;
    let grant = farm.claim(second, 2, 10).await.unwrap();
    let (lease, token) = (grant.lease.id, grant.lease.token);
    let reason = "too little memory".to_owned();
    let failure = WorkFailure { lease, token, reason, refused_partials: 0, now_ms: 11, alive_ms: i64::MIN };
    assert_eq!(farm.store.fail_lease(failure).await.unwrap(), None);
    let grant = farm.claim(first, 2, 12).await.unwrap();
    assert_eq!(farm.report(&grant, refused()).await.unwrap(), Some(SceneChange::Failed(job)));
}

pub(super) async fn a_worker_that_refuses_a_scene_that_others_render_fails_its_lease_alone(farm: Farm) {
    let first = farm.worker_named("first").await.unwrap();
    let second = farm.worker_named("second").await.unwrap();
    let rendered = farm.job(1).await;
    let grant = farm.claim(first, 2, 0).await.unwrap();
    farm.deliver(&grant, &grant.nodes, 0).await.unwrap();
    farm.store.end_worker(first, 0).await.unwrap();
    let grant = farm.claim(second, 2, 0).await.unwrap();
    assert!(grant.wants_report, "the first worker reports nothing");
    assert_eq!(farm.report(&grant, refused()).await.unwrap(), Some(SceneChange::Freed(rendered)));
    let returned = farm.report(&grant, refused()).await;
    assert!(matches!(returned, Err(LeaseError::Returned)), "{returned:?}");
    let record = farm.record(rendered).await;
    assert_eq!((record.state, record.failure), (JobState::Running, None));
    assert_eq!(farm.claim(second, 2, 1).await.map(|grant| grant.lease.job), None, "it has failed");
}

pub(super) async fn reports_are_forgotten_when_a_job_is_unpinned(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 2, 0).await.unwrap();
    farm.report(&grant, built("cone")).await.unwrap();
    farm.store.return_lease(grant.lease.id, grant.lease.token, 1).await.unwrap();
    assert_eq!(farm.record(job).await.built_scene, None);
    assert!(farm.claim(worker, 2, 1).await.unwrap().wants_report);
}

pub(super) async fn a_report_needs_a_valid_lease(farm: Farm) {
    let job = farm.job(1).await;
    let worker = farm.worker().await;
    let grant = farm.claim(worker, 2, 0).await.unwrap();
    let stale = SceneReport { token: grant.lease.token + 1, ..report(&grant, refused(), 1) };
    assert!(matches!(farm.store.report_scene(stale).await, Err(LeaseError::StaleToken(_))));
    let late = farm.store.report_scene(report(&grant, refused(), TTL_MS)).await;
    assert!(matches!(late, Err(LeaseError::Expired)), "{late:?}");
    farm.store.return_lease(grant.lease.id, grant.lease.token, 1).await.unwrap();
    let returned = farm.store.report_scene(report(&grant, refused(), 1)).await;
    assert!(matches!(returned, Err(LeaseError::Returned)), "{returned:?}");
    let record = farm.record(job).await;
    assert_eq!((record.state, record.built_scene), (JobState::Running, None));
}
