//! Workers that end, that are lost, and that are forgotten.

use clerestory_api::{Quarantine, WorkerActivity, WorkerId, WorkerState};

use crate::store::tests::{Farm, LeaseError, StoreError, WorkerError, query};

const DAY_MS: i64 = 24 * 3600 * 1000;

impl Farm {
    /// The workers that a list has now, with their states, when none is silent.
    async fn listed(&self) -> Vec<(WorkerId, WorkerState)> {
        let views = self.store.workers(i64::MAX, i64::MIN).await.unwrap();
        views.into_iter().map(|view| (view.id, view.state)).collect()
    }

    async fn quarantine(&self, worker: WorkerId) {
        let quarantine = Quarantine { since_ms: 0, reason: "bad memory".to_owned(), ended_jobs: Vec::new() };
        let quarantine = serde_json::to_string(&quarantine).unwrap();
        let write = self.store.write::<_, StoreError, _>(move |connection| {
            Box::pin(async move {
                let update = query("update workers set quarantine = $2 where id = $1").bind(worker.to_string());
                update.bind(quarantine).execute(connection).await
            })
        });
        assert_eq!(write.await.unwrap(), 1);
    }
}

pub(super) async fn a_worker_that_ends_gives_all_back_and_leaves_the_list(farm: Farm) {
    farm.job(1).await;
    let [ending, other] = [farm.worker_named("ending").await.unwrap(), farm.worker_named("other").await.unwrap()];
    let grant = farm.claim(ending, 3, 0).await.unwrap();
    assert!(farm.store.end_worker(ending, 10).await.unwrap());
    assert!(!farm.store.end_worker(ending, 20).await.unwrap(), "it has ended");
    assert_eq!(farm.listed().await, [(other, WorkerState::Idle)]);
    let recently = farm.store.workers(10, i64::MIN).await.unwrap();
    assert_eq!(recently.iter().map(|view| view.state).collect::<Vec<_>>(), [WorkerState::Ended, WorkerState::Idle]);
    assert_eq!(farm.claim(other, 3, 10).await.unwrap().nodes, grant.nodes);
    assert!(matches!(farm.deliver(&grant, &grant.nodes, 10).await, Err(LeaseError::Returned)));

    let terms = super::farm::terms(ending, 30);
    assert!(matches!(farm.store.claim(move || terms).await, Err(WorkerError::Unknown(_))));
    assert!(
        matches!(farm.store.touch_worker(ending, 30, WorkerActivity::default()).await, Err(WorkerError::Unknown(_))),
        "it is not revived"
    );
    let unknown = WorkerId::from(uuid::Uuid::nil());
    assert!(matches!(farm.store.end_worker(unknown, 0).await, Err(WorkerError::Unknown(_))));
}

pub(super) async fn a_silent_worker_is_listed_for_a_day_or_until_its_machine_is_back(farm: Farm) {
    let [lost, still] = [farm.worker_named("lost").await.unwrap(), farm.worker_named("still").await.unwrap()];
    farm.store.touch_worker(still, 1000, WorkerActivity::default()).await.unwrap();
    assert!(!farm.store.end_lost_workers(500, 1000).await.unwrap());
    assert_eq!(farm.listed().await.len(), 2);
    assert_eq!(farm.store.workers(i64::MAX, 500).await.unwrap()[0].state, WorkerState::Silent);
    // The first process of the machine was last heard of before the second registered.
    let back = WorkerId::from(uuid::Uuid::now_v7());
    let registration = clerestory_api::WorkerRegistration {
        name: "lost".to_owned(),
        cores: 2,
        build: "b".to_owned(),
        ..Default::default()
    };
    farm.store.register_worker(back, registration, 600).await.unwrap();
    assert!(farm.store.end_lost_workers(500, 1000).await.unwrap());
    let left: Vec<WorkerId> = farm.listed().await.into_iter().map(|(worker, _)| worker).collect();
    assert_eq!(left, [still, back]);
    assert!(!farm.store.end_lost_workers(500, 1000 + DAY_MS - 400).await.unwrap());
    assert!(farm.store.end_lost_workers(500, 1000 + DAY_MS).await.unwrap(), "the other has been silent for a day");
    assert_eq!(farm.listed().await.len(), 1);
    let _ = lost;
}

pub(super) async fn workers_that_nothing_refers_to_are_forgotten_and_quarantined_ones_stay(farm: Farm) {
    farm.job(1).await;
    let [forgotten, leased, wrong] = [
        farm.worker_named("forgotten").await.unwrap(),
        farm.worker_named("leased").await.unwrap(),
        farm.worker_named("wrong").await.unwrap(),
    ];
    farm.claim(leased, 1, 0).await.unwrap();
    farm.quarantine(wrong).await;
    farm.store.end_worker(wrong, 0).await.unwrap();
    farm.store.end_lost_workers(1, 2 * DAY_MS).await.unwrap();
    farm.store.prune_workers(2 * DAY_MS).await.unwrap();
    let known = async |worker| farm.store.worker(worker, 0).await.is_ok();
    assert!(!known(forgotten).await && known(leased).await);
    assert_eq!(farm.listed().await, [(wrong, WorkerState::Quarantined)]);
    assert!(farm.worker_named("wrong").await.is_err(), "its machine is not let in");
}
