//! Checks: a small part of all nodes is rendered by a second worker too, and both must have the same bits.
//!
//! Which nodes those are follows from their addresses and a [key](CheckKey) of the farm, so that a node that is rendered again is checked again, and no
//! worker can tell which will be. When two workers disagree, a
//! third decides: the odd one is quarantined, and [what it has rendered](super::redo) is rendered again. A round is not complete while nodes
//! of it are to be checked. A check that nobody is left to do is given up: nobody who computes the bits that the job was begun with, and does not fail
//! again and again.
//!
//! A machine does not check itself, and is quarantined as a whole: in all of this, workers of one name are one.

use std::collections::BTreeMap;

use clerestory_api::{JobId, LeaseId, Quarantine, WorkerId};
use clerestory_film::NodeAddress;
use uuid::Uuid;

use super::claim::HAS_BITS;
use super::jobs::JobRecord;
use super::leases::{self, LeaseRecord, address};
use super::nodes::Removed;
use super::row::{is_of_nodes, nodes_json, to_json};
use super::sql::query;
use super::workers::OF_THE_SAME_NAME;
use super::{CheckKey, Connection, Store, StoreError, redo};

/// Opinions with which a check ends, whatever they say.
const MOST_OPINIONS: usize = 3;

/// A round does not wait for the checks of a worker that has failed so often in a row, whatever it was given.
const MOST_FAILURES_IN_A_ROW: u32 = 5;

/// Whether a node is rendered by a second worker too, if `fraction` of all nodes are.
pub(crate) fn is_chosen(key: &CheckKey, job: JobId, node: &NodeAddress, fraction: f64) -> bool {
    let NodeAddress { frame, tile, level, index } = *node;
    let hash = blake3::keyed_hash(&key.0, format!("check {job} {frame} {tile} {level} {index}").as_bytes());
    let [a, b, c, d, ..] = *hash.as_bytes();
    f64::from(u32::from_le_bytes([a, b, c, d])) < fraction * (f64::from(u32::MAX) + 1.0)
}

/// A node that is checked, as a worker brought it.
#[derive(Clone, Debug)]
pub(super) struct Brought {
    /// The node.
    pub(super) address: NodeAddress,
    /// Hash of its bytes.
    pub(super) digest: String,
}

/// What checks have come to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Outcome {
    /// Whether there are checks to be done.
    pub(crate) has_work: bool,
    /// Whether checks have ended.
    pub(crate) has_ended: bool,
    /// Workers that were found to be wrong, and why.
    pub(crate) quarantined: Vec<(WorkerId, Quarantine)>,
    /// Jobs of which nodes are rendered again.
    pub(crate) redone: Vec<JobId>,
    /// What has been taken out of their films.
    pub(crate) removed: Removed,
}

/// A check that nobody was left to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GivenUp {
    /// The job.
    pub(crate) job: JobId,
    /// The node.
    pub(crate) node: NodeAddress,
    /// Workers that disagree about it; one when nobody else has rendered it.
    pub(crate) workers: Vec<WorkerId>,
}

/// A condition on a row of `checks`: no worker of this name, which is an expression of SQL, has an opinion about the node.
pub(super) fn is_new_to(name: &str) -> String {
    format!(
        "not exists (select 1 from opinions join workers as bringers on bringers.id = opinions.worker \
         where opinions.check_id = checks.id and bringers.name = {name})"
    )
}

/// A condition on a row of `workers` and one of `jobs`: a round may wait for this worker to check nodes of the job. It was heard of since a time, which is
/// an expression of SQL.
fn is_waited_for(alive_ms: &str) -> String {
    format!(
        "workers.seen_ms >= {alive_ms} and workers.ended_ms is null and workers.quarantine is null \
         and workers.failures_in_a_row < {MOST_FAILURES_IN_A_ROW} and {HAS_BITS}"
    )
}

/// Opens checks of nodes that have just been accepted, by their rounds, if a worker that can do them was heard of since `alive_ms`.
pub(super) async fn open(
    connection: &mut Connection,
    lease: &LeaseRecord,
    nodes: &[(i64, Brought)],
    alive_ms: i64,
) -> Result<Outcome, StoreError> {
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
        return Ok(Outcome::default());
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
        give_opinion(connection, &check, lease.worker, &node.digest).await?;
    }
    Ok(Outcome { has_work: true, ..Outcome::default() })
}

/// Takes the opinions of a worker about nodes of a lease that are checked, whoever else has them by now. Others change nothing.
pub(super) async fn answer(
    connection: &mut Connection,
    lease: &LeaseRecord,
    nodes: &[Brought],
    now_ms: i64,
) -> Result<Outcome, StoreError> {
    let mut outcome = Outcome::default();
    let mut has_answered = false;
    let leased = nodes.iter().map(|brought| &brought.address).filter(|node| lease.nodes.contains(node));
    let rows = query(format!(
        "select id, frame, tile, level, idx from checks where {} and {}",
        is_of_nodes(connection.engine(), "checks", 1, 2),
        is_new_to("(select name from workers where id = $3)")
    ))
    .bind(lease.job.to_string())
    .bind(nodes_json(leased)?)
    .bind(lease.worker.to_string())
    .fetch_all(&mut *connection)
    .await?;
    for row in rows {
        let (check, node) = (row.text("id")?, address(&row)?);
        let Some(brought) = nodes.iter().find(|brought| brought.address == node) else { continue };
        if !is_open(connection, &check, lease).await? {
            // It went with what has just been found to be wrong.
            continue;
        }
        give_opinion(connection, &check, lease.worker, &brought.digest).await?;
        has_answered = true;
        match judge(&opinions(connection, &check).await?) {
            Judgement::Agreed => end(connection, &check).await?,
            Judgement::Disputed => {
                let_go_by(connection, &check, lease.worker).await?;
                outcome.has_work = true;
                continue;
            }
            Judgement::Odd(worker) => {
                end(connection, &check).await?;
                let why =
                    format!("it rendered node ({node}) of job {} to other bits than two other workers", lease.job);
                quarantine(connection, worker, why, now_ms, &mut outcome).await?;
            }
            Judgement::Unclear(workers) => {
                end(connection, &check).await?;
                let workers: Vec<String> = workers.iter().map(WorkerId::to_string).collect();
                tracing::error!(job = %lease.job, %node, ?workers, "workers render a node to different bits, each to its own");
            }
        }
        outcome.has_ended = true;
    }
    if has_answered {
        query("update workers set failures_in_a_row = 0 where id = $1")
            .bind(lease.worker.to_string())
            .execute(connection)
            .await?;
    }
    Ok(outcome)
}

/// Whether a check can still be answered under a lease.
async fn is_open(connection: &mut Connection, check: &str, lease: &LeaseRecord) -> Result<bool, StoreError> {
    let row = query(
        "select 1 from checks join leases on leases.id = $2 where checks.id = $1 and state in ('active', 'complete')",
    )
    .bind(check)
    .bind(lease.id.to_string())
    .fetch_optional(connection)
    .await?;
    Ok(row.is_some())
}

/// Lets go of the checks that a lease has. Whoever has taken one over is the only one to have it then.
pub(super) async fn let_go(connection: &mut Connection, lease: LeaseId) -> Result<(), StoreError> {
    for statement in [
        "update checks set second_lease = null where second_lease = $1",
        "update checks set lease = second_lease, second_lease = null where lease = $1",
    ] {
        query(statement).bind(lease.to_string()).execute(&mut *connection).await?;
    }
    Ok(())
}

/// Lets go of a check that a worker, or others of its name, may have under whatever lease.
async fn let_go_by(connection: &mut Connection, check: &str, worker: WorkerId) -> Result<(), StoreError> {
    let own = format!("(select id from leases where worker in {OF_THE_SAME_NAME})");
    for statement in [
        format!("update checks set second_lease = null where id = $2 and second_lease in {own}"),
        format!("update checks set lease = second_lease, second_lease = null where id = $2 and lease in {own}"),
    ] {
        query(statement).bind(worker.to_string()).bind(check).execute(&mut *connection).await?;
    }
    Ok(())
}

async fn give_opinion(
    connection: &mut Connection,
    check: &str,
    worker: WorkerId,
    digest: &str,
) -> Result<(), StoreError> {
    query("insert into opinions (check_id, worker, digest) values ($1, $2, $3)")
        .bind(check)
        .bind(worker.to_string())
        .bind(digest)
        .execute(connection)
        .await?;
    Ok(())
}

/// Who brought which bits, in order of the workers.
async fn opinions(connection: &mut Connection, check: &str) -> Result<Vec<(WorkerId, String)>, StoreError> {
    let rows = query("select worker, digest from opinions where check_id = $1 order by worker")
        .bind(check)
        .fetch_all(connection)
        .await?;
    rows.iter().map(|row| Ok((row.parsed("worker")?, row.text("digest")?))).collect()
}

/// What opinions say.
#[derive(Debug, PartialEq, Eq)]
enum Judgement {
    /// All are the same.
    Agreed,
    /// Two differ, and a third has to decide.
    Disputed,
    /// All but one are the same.
    Odd(WorkerId),
    /// No two are the same.
    Unclear(Vec<WorkerId>),
}

fn judge(opinions: &[(WorkerId, String)]) -> Judgement {
    let mut workers: BTreeMap<&str, Vec<WorkerId>> = BTreeMap::new();
    for (worker, digest) in opinions {
        workers.entry(digest).or_default().push(*worker);
    }
    let alone = workers.values().find_map(|workers| <[WorkerId; 1]>::try_from(workers.as_slice()).ok());
    match (workers.len(), alone) {
        (0 | 1, _) => Judgement::Agreed,
        _ if opinions.len() < MOST_OPINIONS => Judgement::Disputed,
        (2, Some([odd])) => Judgement::Odd(odd),
        _ => Judgement::Unclear(opinions.iter().map(|(worker, _)| *worker).collect()),
    }
}

/// Ends a check without a word.
pub(super) async fn end(connection: &mut Connection, check: &str) -> Result<(), StoreError> {
    query("delete from checks where id = $1").bind(check).execute(connection).await?;
    Ok(())
}

/// Gives a worker no work any more, nor any other of its name, and has rendered again what they may have rendered.
async fn quarantine(
    connection: &mut Connection,
    worker: WorkerId,
    reason: String,
    now_ms: i64,
    outcome: &mut Outcome,
) -> Result<(), StoreError> {
    let held = query(format!("select id from leases where worker in {OF_THE_SAME_NAME} and state = 'active'"))
        .bind(worker.to_string())
        .fetch_all(&mut *connection)
        .await?;
    for lease in held {
        leases::release(connection, lease.parsed("id")?).await?;
    }
    // Whatever is brought once more under a lease that is complete is what has just been taken out.
    query(format!("update leases set state = 'returned' where worker in {OF_THE_SAME_NAME} and state = 'complete'"))
        .bind(worker.to_string())
        .execute(&mut *connection)
        .await?;
    // What they think of other nodes does not count.
    query(format!("delete from opinions where worker in {OF_THE_SAME_NAME}"))
        .bind(worker.to_string())
        .execute(&mut *connection)
        .await?;
    let redone = redo::redo(connection, worker, now_ms).await?;
    let quarantine = Quarantine { since_ms: now_ms, reason, ended_jobs: redone.ended };
    query(format!("update workers set quarantine = $2 where id in {OF_THE_SAME_NAME}"))
        .bind(worker.to_string())
        .bind(to_json(&quarantine)?)
        .execute(&mut *connection)
        .await?;
    // A check of their nodes that had no other opinion has none now.
    query("delete from checks where not exists (select 1 from opinions where check_id = checks.id)")
        .execute(&mut *connection)
        .await?;
    outcome.has_work = true;
    outcome.quarantined.push((worker, quarantine));
    outcome.redone.extend(redone.jobs);
    outcome.removed += redone.removed;
    Ok(())
}

/// When others must have been given a check for one more to get it, milliseconds since 1970. The time for which they may keep what they have rendered
/// does not count.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldSince {
    /// Where one other has it.
    pub(super) one_ms: i64,
    /// Where two have it, of whom the second loses it.
    pub(super) two_ms: i64,
}

/// Nodes of a job that a worker is to check: those that nobody has, or those that others have had for so long.
pub(super) async fn choose(
    connection: &mut Connection,
    job: &JobRecord,
    worker: WorkerId,
    most: u32,
    held_since: Option<HeldSince>,
) -> Result<Vec<NodeAddress>, StoreError> {
    let is_held_since = |lease: &str, time: &str| {
        format!(
            "exists (select 1 from leases where id = checks.{lease} and worker <> $2 and granted_ms + gather_ms <= {time})"
        )
    };
    // Whoever has some begins with the first.
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
    /// Gives up checks that no worker which was heard of since `alive_ms` can do or is failing to do, and answers them.
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
        let workers = opinions(connection, &check).await?.into_iter().map(|(worker, _)| worker).collect();
        end(connection, &check).await?;
        given_up.push(GivenUp { job: row.parsed("job")?, node: address(row)?, workers });
    }
    Ok(given_up)
}

/// Ends all checks of a job that ends without waiting for them. What is in dispute stays in its image, and people are told.
pub(super) async fn abandon(connection: &mut Connection, job: JobId) -> Result<(), StoreError> {
    let disputed = query(
        "select id, frame, tile, level, idx from checks where job = $1 \
         and (select count(distinct digest) from opinions where check_id = checks.id) > 1",
    )
    .bind(job.to_string())
    .fetch_all(&mut *connection)
    .await?;
    for row in &disputed {
        let (node, opinions) = (address(row)?, opinions(connection, &row.text("id")?).await?);
        let workers: Vec<String> = opinions.iter().map(|(worker, _)| worker.to_string()).collect();
        tracing::error!(%job, %node, ?workers, "the job ended before a third worker could decide which of two rendered a node to wrong bits");
    }
    query("delete from checks where job = $1").bind(job.to_string()).execute(connection).await?;
    Ok(())
}

/// Ends all checks of what shares a pass with one of some nodes.
pub(super) async fn forget(connection: &mut Connection, job: JobId, nodes: &[NodeAddress]) -> Result<(), StoreError> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundredth_of_all_nodes_is_chosen() {
        let job = JobId::from(Uuid::nil());
        let keys = [1, 2].map(|byte| CheckKey([byte; 32]));
        let chosen_by = |key: &CheckKey, fraction: f64| {
            let nodes = (0..100_000).map(|tile| NodeAddress { frame: 0, tile, level: 0, index: 3 });
            nodes.filter(|node| is_chosen(key, job, node, fraction)).collect::<Vec<_>>()
        };
        let chosen = |fraction: f64| chosen_by(&keys[0], fraction).len();
        // Of 100 000 draws, 1000 and at most five standard errors of 31.5.
        assert!((843..=1157).contains(&chosen(0.01)), "{}", chosen(0.01));
        assert_eq!((chosen(0.0), chosen(1.0)), (0, 100_000));
        let others = chosen_by(&keys[1], 0.01);
        let by_both = chosen_by(&keys[0], 0.01).iter().filter(|node| others.contains(node)).count();
        // 10 by chance.
        assert!(by_both < 30, "{by_both} nodes are chosen by both of two keys");
    }

    #[test]
    fn the_odd_one_of_three_is_found() {
        let [a, b, c] = [1, 2, 3].map(|number| WorkerId::from(Uuid::from_u128(number)));
        let judged = |digests: &[(WorkerId, &str)]| {
            judge(&digests.iter().map(|(worker, digest)| (*worker, (*digest).to_owned())).collect::<Vec<_>>())
        };
        assert_eq!(judged(&[(a, "x"), (b, "x")]), Judgement::Agreed);
        assert_eq!(judged(&[(a, "x"), (b, "y")]), Judgement::Disputed);
        assert_eq!(judged(&[(a, "x"), (b, "y"), (c, "x")]), Judgement::Odd(b));
        assert_eq!(judged(&[(a, "x"), (b, "y"), (c, "y")]), Judgement::Odd(a));
        assert_eq!(judged(&[(a, "x"), (b, "y"), (c, "z")]), Judgement::Unclear(vec![a, b, c]));
    }
}
