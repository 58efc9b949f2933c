//! Checks: a small fraction of all nodes is rendered by a second worker too, and both results must be equal bit for
//! bit.
//!
//! The address of a node and a [key](crate::model::CheckKey) of the farm select it. So a node that is rendered again is
//! checked again, and no worker can predict its checks. When two workers disagree, a third decides. The odd one is
//! quarantined, and [its nodes](crate::store::results::redo) are rendered again. A round is complete when its checks
//! are done. A check is given up when no worker is left for it: none with the job's build fingerprint that does not
//! fail again and again.
//!
//! A machine does not check itself, and is quarantined as a whole. So workers of one name count as one.

use clerestory_api::{JobId, LeaseId, WorkerId};
use clerestory_film::NodeAddress;
use uuid::Uuid;

use crate::model::{CheckOutcome, JobRecord, LeaseRecord};
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::address;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::workers::pins::MATCHES_PIN;

/// A round does not wait for the checks of a worker that has failed this often in a row.
const MOST_FAILURES_IN_A_ROW: u32 = 5;

/// A checked node, as a worker brought it.
#[derive(Clone, Debug)]
pub(in crate::store) struct Brought {
    /// The node.
    pub(in crate::store) address: NodeAddress,
    /// Hash of its bytes.
    pub(in crate::store) digest: String,
}

/// A check that no worker was left for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GivenUp {
    /// The job.
    pub(crate) job: JobId,
    /// The node.
    pub(crate) node: NodeAddress,
    /// Workers that disagree about it, or the one that has rendered it.
    pub(crate) workers: Vec<WorkerId>,
}

/// SQL condition on a row of `checks`: no worker with this name, an SQL expression, has voted on the node.
pub(in crate::store) fn is_new_to(name: &str) -> String {
    format!(
        "not exists (select 1 from votes join workers as bringers on bringers.id = votes.worker \
         where votes.check_id = checks.id and bringers.name = {name})"
    )
}

/// SQL condition on rows of `workers` and `jobs`: a round may wait for this worker to check nodes of the job.
/// `alive_ms`, an SQL expression, is the last heartbeat of an absent worker.
pub(in crate::store) fn is_waited_for(alive_ms: &str) -> String {
    format!(
        "workers.seen_ms >= {alive_ms} and workers.ended_ms is null and workers.quarantine is null \
         and workers.failures_in_a_row < {MOST_FAILURES_IN_A_ROW} and {MATCHES_PIN}"
    )
}

/// Opens checks of nodes that were just accepted, by their rounds, if a worker that can do them was heard of since
/// `alive_ms`.
pub(in crate::store) async fn open(
    connection: &mut Connection,
    lease: &LeaseRecord,
    nodes: &[(i64, Brought)],
    alive_ms: i64,
) -> Result<CheckOutcome, StoreError> {
    let others = query(format!(
        "select 1 from workers join jobs on jobs.id = $3 where {} \
         and workers.name <> (select own.name from workers as own where own.id = $1) limit 1",
        is_waited_for("$2")
    ))
    .bind(lease.worker.to_string())
    .bind(alive_ms)
    .bind(lease.job.to_string())
    .fetch_optional(&mut *connection)
    .await?;
    if others.is_none() {
        return Ok(CheckOutcome::default());
    }
    for (round, node) in nodes {
        let check = Uuid::now_v7().to_string();
        let NodeAddress { frame, tile, level, index } = node.address;
        query("insert into checks (id, job, round, frame, tile, level, idx) values ($1, $2, $3, $4, $5, $6, $7)")
            .bind(&check)
            .bind(lease.job.to_string())
            .bind(*round)
            .bind(i64::from(frame))
            .bind(i64::from(tile))
            .bind(i64::from(level))
            .bind(i64::from(index))
            .execute(&mut *connection)
            .await?;
        cast_vote(connection, &check, lease.worker, &node.digest).await?;
    }
    Ok(CheckOutcome { has_work: true, ..CheckOutcome::default() })
}

/// Releases the checks of a lease. A worker that has taken one over becomes its only holder.
pub(in crate::store) async fn release(connection: &mut Connection, lease: LeaseId) -> Result<(), StoreError> {
    for statement in [
        "update checks set second_lease = null where second_lease = $1",
        "update checks set lease = second_lease, second_lease = null where lease = $1",
    ] {
        query(statement).bind(lease.to_string()).execute(&mut *connection).await?;
    }
    Ok(())
}

pub(in crate::store) async fn cast_vote(
    connection: &mut Connection,
    check: &str,
    worker: WorkerId,
    digest: &str,
) -> Result<(), StoreError> {
    query("insert into votes (check_id, worker, digest) values ($1, $2, $3)")
        .bind(check)
        .bind(worker.to_string())
        .bind(digest)
        .execute(connection)
        .await?;
    Ok(())
}

/// The votes on a check, in the order of the workers.
pub(in crate::store) async fn votes(
    connection: &mut Connection,
    check: &str,
) -> Result<Vec<(WorkerId, String)>, StoreError> {
    let rows = query("select worker, digest from votes where check_id = $1 order by worker")
        .bind(check)
        .fetch_all(connection)
        .await?;
    rows.iter().map(|row| Ok((row.parsed("worker")?, row.text("digest")?))).collect()
}

/// Ends a check without a word.
pub(in crate::store) async fn end(connection: &mut Connection, check: &str) -> Result<(), StoreError> {
    query("delete from checks where id = $1").bind(check).execute(connection).await?;
    Ok(())
}

/// When a check must have been leased to others before one more worker gets it, milliseconds since 1970. The time for
/// which they may keep rendered nodes does not count.
#[derive(Clone, Copy, Debug)]
pub(in crate::store) struct HeldSince {
    /// Where one other has it.
    pub(in crate::store) one_ms: i64,
    /// When two workers hold it. The second one loses it.
    pub(in crate::store) two_ms: i64,
}

/// Nodes of a job that a worker is to check: free ones, or those that others have held since `held_since`.
pub(in crate::store) async fn choose(
    connection: &mut Connection,
    job: &JobRecord,
    worker: WorkerId,
    most: u32,
    held_since: Option<HeldSince>,
) -> Result<Vec<NodeAddress>, StoreError> {
    let is_held_since = |lease: &str, time: &str| {
        format!(
            "exists (select 1 from leases where id = checks.{lease} and worker <> $2 and granted_ms + \
             upload_linger_ms <= {time})"
        )
    };
    // A worker that holds some begins with the first.
    let (whose, order, times) = match held_since {
        None => ("lease is null".to_owned(), "frame, tile, idx", None),
        Some(HeldSince { one_ms, two_ms }) => {
            let (one, two) = (is_held_since("lease", "$4"), is_held_since("second_lease", "$5"));
            let of_two = is_held_since("lease", "$5");
            let held = format!("(second_lease is null and {one} or {two} and {of_two})");
            (held, "frame desc, tile desc, idx desc", Some([one_ms, two_ms]))
        }
    };
    let chosen = query(format!(
        "select frame, tile, level, idx from checks where job = $1 and {whose} and {} \
         order by round, {order} limit $3",
        is_new_to("(select name from workers where id = $2)")
    ))
    .bind(job.id.to_string())
    .bind(worker.to_string())
    .bind(i64::from(most));
    let chosen = times.into_iter().flatten().fold(chosen, |chosen, time| chosen.bind(time));
    let rows = chosen.fetch_all(connection).await?;
    rows.iter().map(address).collect()
}

impl Store {
    /// Gives up checks that no worker heard of since `alive_ms` can do, and answers them.
    pub(crate) async fn give_up_checks(&self, alive_ms: i64) -> Result<Vec<GivenUp>, StoreError> {
        if query("select 1 from checks limit 1").fetch_optional(&self.readers).await?.is_none() {
            return Ok(Vec::new());
        }
        self.write(move |connection| Box::pin(async move { give_up(connection, alive_ms).await })).await
    }
}

async fn give_up(connection: &mut Connection, alive_ms: i64) -> Result<Vec<GivenUp>, StoreError> {
    let rows = query(format!(
        "select checks.id, job, frame, tile, level, idx from checks join jobs on jobs.id = checks.job \
         where lease is null and not exists (select 1 from workers where {} and {})",
        is_waited_for("$1"),
        is_new_to("workers.name")
    ))
    .bind(alive_ms)
    .fetch_all(&mut *connection)
    .await?;
    let mut given_up = Vec::with_capacity(rows.len());
    for row in &rows {
        let check = row.text("id")?;
        let workers = votes(connection, &check).await?.into_iter().map(|(worker, _)| worker).collect();
        end(connection, &check).await?;
        given_up.push(GivenUp { job: row.parsed("job")?, node: address(row)?, workers });
    }
    Ok(given_up)
}

/// Ends all checks of a job that ends without waiting for them. Disputed nodes stay in its image, and the log names
/// them.
pub(in crate::store) async fn abandon(connection: &mut Connection, job: JobId) -> Result<(), StoreError> {
    let disputed = query(
        "select id, frame, tile, level, idx from checks where job = $1 \
         and (select count(distinct digest) from votes where check_id = checks.id) > 1",
    )
    .bind(job.to_string())
    .fetch_all(&mut *connection)
    .await?;
    for row in &disputed {
        let (node, votes) = (address(row)?, votes(connection, &row.text("id")?).await?);
        let workers: Vec<String> = votes.iter().map(|(worker, _)| worker.to_string()).collect();
        tracing::error!(%job, %node, ?workers, "the job ended before a third worker could decide which of two \
                                                rendered a node to wrong bits");
    }
    query("delete from checks where job = $1").bind(job.to_string()).execute(connection).await?;
    Ok(())
}

/// Ends all checks of nodes that share a pass with one of `nodes`.
pub(in crate::store) async fn forget(
    connection: &mut Connection,
    job: JobId,
    nodes: &[NodeAddress],
) -> Result<(), StoreError> {
    let rows = query("select id, frame, tile, level, idx from checks where job = $1")
        .bind(job.to_string())
        .fetch_all(&mut *connection)
        .await?;
    for row in &rows {
        let checked = address(row)?;
        if nodes.iter().any(|node| node.overlaps(&checked)) {
            end(connection, &row.text("id")?).await?;
        }
    }
    Ok(())
}
