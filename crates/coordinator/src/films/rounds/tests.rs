//! Of several coordinators one keeps a film, and what another does to it meanwhile is no damage.

use std::time::Duration;

use clerestory_api::JobId;
use clerestory_film::TileGrid;
use uuid::Uuid;

use crate::config::Config;
use crate::farm::Farm;
use crate::films::rounds::film_lease::{Claim, TERM_MS};
use crate::films::rounds::finalizer::{FilmVersion, Kept, is_settled};
use crate::model::{FilmLease, NewJob};
use crate::server;
use crate::store::tests::farm::some_job;

async fn job(farm: &Farm) -> JobId {
    let job = NewJob { grid: TileGrid { width: 16, height: 16, tile_size: 16 }, ..some_job() };
    let id = job.id;
    farm.store.insert_job(job).await.unwrap();
    id
}

#[tokio::test]
async fn a_claim_is_renewed_while_it_is_held_and_work_ends_when_another_has_it() {
    let directory = tempfile::tempdir().unwrap();
    let (farm, _bells) = server::open(Config::new(directory.path())).await.unwrap();
    let (job, other) = (job(&farm).await, Uuid::now_v7());
    let now_ms = || farm.config.clock.now_ms();
    let keep = |coordinator, now_ms| farm.store.acquire_film_lease(job, coordinator, now_ms, now_ms + 1500);
    let begun_ms = now_ms();
    assert_eq!(keep(farm.coordinator, begun_ms).await.unwrap(), FilmLease::Held);
    let claim = Claim::renewed(&farm, job, begun_ms + 1500);
    tokio::time::sleep(Duration::from_secs(2)).await;
    assert!(matches!(keep(other, now_ms()).await.unwrap(), FilmLease::HeldElsewhere { .. }));
    assert_eq!(claim.while_held(async { 7 }).await, Some(7));
    drop(claim);

    let later_ms = now_ms() + 10 * TERM_MS;
    assert_eq!(keep(other, later_ms).await.unwrap(), FilmLease::Held, "whoever does not renew has nothing");
    let claim = Claim::renewed(&farm, job, now_ms() + 1500);
    assert_eq!(claim.while_held(std::future::pending::<()>()).await, None);
    assert!(claim.is_lost());
}

#[tokio::test]
async fn a_film_that_another_has_gone_on_with_is_not_damaged() {
    let directory = tempfile::tempdir().unwrap();
    let (farm, _bells) = server::open(Config::new(directory.path())).await.unwrap();
    let job = job(&farm).await;
    let version = FilmVersion::of(&farm.store.job(job).await.unwrap().unwrap());
    let is_settled = async |version| is_settled(&farm, job, &mut Kept::default(), Some(version)).await.unwrap();
    assert!(is_settled(version).await);
    assert!(!is_settled(FilmVersion { rounds: 1, ..version }).await, "a round has been recorded");
    assert!(!is_settled(FilmVersion { redone_nodes: 1, ..version }).await, "nodes have been taken out");
    let later_ms = farm.config.clock.now_ms() + 10 * TERM_MS;
    farm.store.acquire_film_lease(job, Uuid::now_v7(), later_ms, later_ms + TERM_MS).await.unwrap();
    assert!(!is_settled(version).await, "it is another's");
}
