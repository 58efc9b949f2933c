//! Of several coordinators one holds a film lease, and another's progress is no damage.

use std::sync::Arc;
use std::time::Duration;

use clerestory_api::JobId;
use clerestory_film::TileGrid;
use tempfile::TempDir;
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::film_lease::{FilmLeases, TERM_MS};
use super::film_state::{FilmState, FilmVersion};
use super::finalizer::{FinalizerParts, RoundFinalizer};
use super::merging::Merger;
use crate::blobs::Blobs;
use crate::clock::Clock;
use crate::films::FilmReader;
use crate::films::assets::Assets;
use crate::films::convergence::FrameMetrics;
use crate::films::pass_sharing::PassSharing;
use crate::films::repair::Repair;
use crate::model::{FilmLease, NewJob};
use crate::store::tests::farm::some_job;
use crate::store::{Source, Store};
use crate::watch::notifications::tests::unheard;
use crate::watch::rates::Rates;

/// The leases of a coordinator of a new farm, with a job.
async fn leases(directory: &TempDir) -> (FilmLeases, JobId) {
    let store = Store::open(Source::file(&directory.path().join("farm.sqlite"))).await.unwrap();
    let job = NewJob { grid: TileGrid::new(16, 16, 16), ..some_job() };
    let id = job.id;
    store.insert_job(job).await.unwrap();
    (FilmLeases::new(store, Clock::default(), Uuid::now_v7(), CancellationToken::new()), id)
}

/// The finalizer of that coordinator.
fn finalizer(directory: &TempDir, leases: FilmLeases) -> RoundFinalizer {
    let (store, clock, notifications) = (leases.store.clone(), leases.clock.clone(), unheard());
    let blobs = Blobs::in_directory(directory.path().join("blobs")).unwrap();
    let reader = Arc::new(FilmReader::new(store.clone(), blobs.clone(), 0));
    let assets = Assets::new(store.clone(), blobs.clone(), Arc::clone(&notifications), clock.clone());
    let repair = Repair::new(
        store.clone(),
        blobs.clone(),
        Arc::clone(&reader),
        Arc::new(assets),
        Arc::clone(&notifications),
        clock.clone(),
    );
    let stopping = leases.stopping.clone();
    let parts = FinalizerParts {
        leases,
        metrics: Arc::new(FrameMetrics::new(Arc::clone(&reader), blobs.clone(), clock.clone(), 1 << 20)),
        merger: Merger::new(Arc::clone(&reader), blobs),
        sharing: PassSharing::new(reader, Arc::clone(&notifications)),
        repair: Arc::new(repair),
        rates: Arc::new(Rates::new(0)),
    };
    RoundFinalizer::new(store, clock, notifications, stopping, parts)
}

#[tokio::test]
async fn a_film_lease_is_renewed_while_it_is_held_and_work_ends_when_another_coordinator_has_it() {
    let directory = tempfile::tempdir().unwrap();
    let (leases, job) = leases(&directory).await;
    let other = Uuid::now_v7();
    let now_ms = || leases.clock.now_ms();
    let acquire = |coordinator, now_ms| leases.store.acquire_film_lease(job, coordinator, now_ms, now_ms + 1500);
    let begun_ms = now_ms();
    assert_eq!(acquire(leases.coordinator, begun_ms).await.unwrap(), FilmLease::Held);
    let lease = leases.renewing(job, begun_ms + 1500);
    let renewed = async {
        loop {
            let FilmLease::HeldElsewhere { until_ms } = acquire(other, now_ms()).await.unwrap() else {
                panic!("the lease is not renewed");
            };
            if until_ms > begun_ms + 1500 {
                break;
            }
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(Duration::from_secs(60), renewed).await.expect("the lease is renewed");
    assert_eq!(lease.while_held(async { 7 }).await, Some(7));
    drop(lease);

    let later_ms = now_ms() + 10 * TERM_MS;
    assert_eq!(acquire(other, later_ms).await.unwrap(), FilmLease::Held, "a lease that is not renewed ends");
    let lease = leases.renewing(job, now_ms() + 1500);
    assert_eq!(lease.while_held(std::future::pending::<()>()).await, None);
    assert!(lease.is_lost());
}

#[tokio::test]
async fn a_film_that_another_coordinator_has_worked_on_is_not_damaged() {
    let directory = tempfile::tempdir().unwrap();
    let (leases, job) = leases(&directory).await;
    let finalizer = finalizer(&directory, leases.clone());
    let version = FilmVersion::of(&leases.store.job(job).await.unwrap().unwrap());
    let is_unchanged =
        async |version| finalizer.is_unchanged(job, &mut FilmState::default(), Some(version)).await.unwrap();
    assert!(is_unchanged(version).await);
    assert!(!is_unchanged(FilmVersion { rounds: 1, ..version }).await, "a round has been recorded");
    assert!(!is_unchanged(FilmVersion { redone_nodes: 1, ..version }).await, "nodes have been removed");
    let later_ms = leases.clock.now_ms() + 10 * TERM_MS;
    leases.store.acquire_film_lease(job, Uuid::now_v7(), later_ms, later_ms + TERM_MS).await.unwrap();
    assert!(!is_unchanged(version).await, "another coordinator has it");
}
