//! Reports of workers on scenes that they have built.

use clerestory_api::{BuildOutcome, BuiltScene, JobState};

use crate::model::{Grant, SceneReport};
use crate::store::errors::LeaseError;
use crate::store::tests::{Farm, TTL_MS};

fn built(method: &str) -> BuildOutcome {
    BuildOutcome::Built(BuiltScene {
        left_to_chance: vec!["light of \"sun\"".to_owned()],
        chosen_methods: vec![method.to_owned()],
    })
}

fn refused() -> BuildOutcome {
    BuildOutcome::Refused { reason: "panes[0].thickness: found 0".to_owned() }
}

fn report(grant: &Grant, outcome: BuildOutcome, now_ms: i64) -> SceneReport {
    SceneReport { lease: grant.lease.id, token: grant.lease.token, outcome, now_ms }
}

pub(super) async fn the_first_report_on_a_scene_counts_and_survives(farm: Farm) {
    let job = farm.job(1).await;
    let [first, second] = [farm.worker_named("first").await.unwrap(), farm.worker_named("second").await.unwrap()];
    let grants = [farm.claim(first, 2, 0).await.unwrap(), farm.claim(second, 2, 0).await.unwrap()];
    assert_eq!(farm.record(job).await.built_scene, None);
    let before = farm.store.last_event_id().await.unwrap();
    assert_eq!(farm.store.report_scene(report(&grants[0], built("cone"), 1)).await.unwrap(), Some(job));
    let told = farm.store.last_event_id().await.unwrap();
    assert!(told > before, "pages are told");
    for outcome in [built("cone"), built("fnee"), refused()] {
        assert_eq!(farm.store.report_scene(report(&grants[1], outcome, 2)).await.unwrap(), None);
    }
    assert_eq!(farm.store.last_event_id().await.unwrap(), told);
    let farm = farm.reopened().await;
    let record = farm.record(job).await;
    assert_eq!(record.state, JobState::Running);
    assert_eq!(record.built_scene.map(BuildOutcome::Built), Some(built("cone")));
}

pub(super) async fn a_scene_that_cannot_be_built_fails_its_job_and_counts_against_nobody(farm: Farm) {
    let job = farm.job(1).await;
    let [first, second] = [farm.worker_named("first").await.unwrap(), farm.worker_named("second").await.unwrap()];
    let grants = [farm.claim(first, 2, 0).await.unwrap(), farm.claim(second, 2, 0).await.unwrap()];
    assert_eq!(farm.store.report_scene(report(&grants[0], refused(), 1)).await.unwrap(), Some(job));
    let record = farm.record(job).await;
    assert_eq!((record.state, record.failed_node), (JobState::Failed, None));
    assert_eq!(record.failure.as_deref(), Some("worker `first` cannot build the scene: panes[0].thickness: found 0"));
    for grant in &grants {
        let late = farm.store.report_scene(report(grant, built("cone"), 2)).await;
        assert!(matches!(late, Err(LeaseError::JobNotRunning)), "{late:?}");
    }
    assert_eq!(farm.record(job).await.built_scene, None);
    // Neither worker has to wait before its next lease.
    let next = farm.job(1).await;
    for worker in [first, second] {
        assert_eq!(farm.claim(worker, 1, 2).await.unwrap().lease.job, next);
    }
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
