//! How PostgreSQL finds rows: by indexes, whatever it believes of the size of tables. It reads that once, when it plans
//! a statement. Then it would scan a table that was small at that time, or all rows of a job.

use std::time::Duration;

use clerestory_api::{WorkerActivity, WorkerId};
use clerestory_film::{NodeAddress, TileGrid};

use crate::model::NewJob;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::tests::pins::worker;
use crate::store::tests::{DeliveredNode, Farm, blob_range, delivered, merge};

/// What grows with a farm and its jobs.
const TABLES: [&str; 10] =
    ["pending", "nodes", "leases", "round_work", "rates", "checks", "votes", "workers", "method_digests", "jobs"];

/// Workers, and how often each claims and brings.
const WORKERS: usize = 4;
const TURNS: i64 = 60;

/// Nodes of a lease.
const NODES: u32 = 16;

/// Rows, and entries of indexes, that a claim and all that follows it may read for each of its nodes: it is looked for
/// when it is claimed, brought, and merged, in a few tables, and what has just been replaced is met with for a while.
const READ: i64 = 40;

/// Claims, renews, brings and merges.
async fn work(farm: &Farm, worker: WorkerId, now_ms: i64) {
    let grant = farm.claim(worker, NODES, now_ms).await.unwrap();
    let (lease, token) = (grant.lease.id, grant.lease.token);
    farm.store.touch_worker(worker, now_ms, WorkerActivity::default()).await.unwrap();
    farm.store.renew(lease, token, now_ms, now_ms + 100).await.unwrap();
    // Some of them are checked, by another.
    let is_selected = |node: &NodeAddress| node.tile.is_multiple_of(50);
    let brought = |node: &NodeAddress| DeliveredNode {
        digest: node.to_string(),
        is_selected: is_selected(node),
        ..delivered(*node)
    };
    farm.bring(&grant, grant.nodes.iter().map(brought).collect(), now_ms).await.unwrap();
    let is_second = |node: &&NodeAddress| node.index % 2 == 1 && grant.nodes.contains(&node.sibling());
    let parents = grant.nodes.iter().filter(is_second).map(NodeAddress::parent);
    let merges: Vec<_> = parents.map(|parent| merge(parent, blob_range("merged", 0))).collect();
    if !merges.is_empty() {
        farm.store.replace(grant.lease.job, 0, merges).await.unwrap();
    }
    farm.next_complete_round(grant.lease.job).await;
}

/// Waits until no other connection is open: then all reads have been counted.
async fn alone(connection: &mut Connection) {
    let all_gone = async {
        while others(connection).await > 0 {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(30), all_gone).await.unwrap();
}

async fn others(connection: &mut Connection) -> i64 {
    let others = query(
        "select count(*) as others from pg_stat_activity where datname = current_database() \
         and pid <> pg_backend_pid() and backend_type = 'client backend'",
    );
    others.fetch_one(connection).await.unwrap().integer("others").unwrap()
}

#[tokio::test]
async fn claims_and_results_read_what_they_are_about_and_little_else() {
    let farm = Farm::in_postgres().await;
    for _ in 0..3 {
        let grid = TileGrid::new(320, 320, 16);
        farm.job_like(|job| NewJob { passes: 8, grid, ..job }).await;
    }
    let mut workers = Vec::new();
    for number in 0..WORKERS {
        // As many as a worker has: their names do not matter, so methods that came later need not be here.
        let methods = ["path", "cone", "fnee", "sms", "mnee", "conic"];
        let digests = methods.map(|method| [format!("{method} 1"), format!("{method} 2")]);
        let digests = digests.each_ref().map(|digests| digests.each_ref().map(String::as_str));
        let digests: Vec<(&str, &[&str])> =
            methods.into_iter().zip(digests.iter().map(<[&str; 2]>::as_slice)).collect();
        workers.push(worker(&farm, &number.to_string(), "first", &digests).await);
    }
    for now_ms in 0..TURNS {
        for worker in &workers {
            work(&farm, *worker, now_ms).await;
        }
    }
    let source = farm.source.clone();
    farm.store.close().await;
    let mut connection = source.writer().await.unwrap();
    alone(&mut connection).await;
    let mut all = 0;
    for table in TABLES {
        let read = query(
            "select cast(coalesce(seq_tup_read, 0) + coalesce(idx_tup_fetch, 0) + (select sum(idx_tup_read) \
             from pg_stat_user_indexes as of_table where of_table.relid = tables.relid) as bigint) as read \
             from pg_stat_user_tables as tables where relname = $1",
        );
        let read = read.bind(table).fetch_one(&mut connection).await.unwrap().integer("read").unwrap();
        println!("{table}: {read}");
        all += read;
    }
    let nodes = WORKERS as i64 * TURNS * i64::from(NODES);
    println!("{all} for {nodes} nodes");
    assert!(all > nodes && all < READ * nodes, "{all} rows and entries were read for {nodes} nodes");
}
