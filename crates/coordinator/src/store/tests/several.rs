//! Several coordinators on one PostgreSQL database, and how they write to it.

use clerestory_api::{JobState, NodeVerdict};
use clerestory_film::NodeAddress;
use clerestory_test_servers::postgres;
use futures::future::{BoxFuture, join_all};

use crate::model::{Identity, NewJob};
use crate::store::engine::error::StoreError;
use crate::store::engine::source::Source;
use crate::store::engine::sql::query;
use crate::store::tests::Farm;

async fn coordinators(count: usize) -> Vec<Farm> {
    let source = Source::postgres(&postgres().new_database().parse().unwrap()).unwrap();
    // They start together, and each finds the schema as it should be.
    join_all((0..count).map(|_| Farm::at(source.clone(), None))).await
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
            // Nothing comes back in this test: what is free now, or could be cut, was there when this claimant was sent
            // away.
            let free = query("select 1 from pending where job = $1 and lease is null").bind(job.to_string());
            assert!(free.fetch_optional(&farm.store.readers).await.unwrap().is_none(), "sent away from free work");
            let record = farm.store.job(job).await.unwrap().unwrap();
            assert!(record.boundaries().passes(record.cursor[0]).is_none(), "sent away before all work was cut");
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
    assert!(farms[1].store.complete_round(&record).await.unwrap().is_some());
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

#[tokio::test]
async fn commits_wait_for_the_disk_whatever_the_database_has_as_its_default() {
    const SETTING: &str = "select current_setting('synchronous_commit') as setting";
    let farm = Farm::in_postgres().await;
    let careless = "do $$ begin \
         execute format('alter database %I set synchronous_commit = off', current_database()); end $$";
    query(careless).execute(&farm.store.readers).await.unwrap();
    // What is set so is for connections that are made from now on.
    let farm = farm.reopened().await;
    let default = query(SETTING).fetch_one(&farm.store.readers).await.unwrap().text("setting").unwrap();
    assert_eq!(default, "off", "what others get");
    let of_writer = async || {
        let setting = farm.store.write::<String, StoreError, _>(|connection| {
            Box::pin(async move { query(SETTING).fetch_one(connection).await?.text("setting") })
        });
        setting.await.unwrap()
    };
    assert_eq!(of_writer().await, "on");
    let ended = query(
        "select pg_terminate_backend(pid) from pg_stat_activity where datname = current_database() \
         and pid <> pg_backend_pid()",
    );
    assert!(!ended.fetch_all(&farm.store.readers).await.unwrap().is_empty());
    assert_eq!(of_writer().await, "on", "the connection after one that was lost");
}
