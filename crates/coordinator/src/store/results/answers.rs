//! Answers to checks: the votes of workers, and the quarantine of the odd one.

use std::collections::BTreeMap;

use clerestory_api::{Quarantine, WorkerId};

use crate::model::{CheckOutcome, LeaseRecord};
use crate::store::checks::{Brought, cast_vote, end, is_new_to, votes};
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{address, is_of_nodes, nodes_json, to_json};
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::leases::table as leases;
use crate::store::results::redo;
use crate::store::workers::table::OF_THE_SAME_NAME;

/// Votes with which a check ends in any case.
const MOST_VOTES: usize = 3;

/// Takes the votes of a worker on checked nodes of a lease, also when others hold them by now. Other nodes change
/// nothing.
pub(in crate::store) async fn answer(
    connection: &mut Connection,
    lease: &LeaseRecord,
    nodes: &[Brought],
    now_ms: i64,
) -> Result<CheckOutcome, StoreError> {
    let mut outcome = CheckOutcome::default();
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
            // It went with the nodes that were just found to be wrong.
            continue;
        }
        cast_vote(connection, &check, lease.worker, &brought.digest).await?;
        has_answered = true;
        match judge(&votes(connection, &check).await?) {
            Judgement::Agreed => end(connection, &check).await?,
            Judgement::Disputed => {
                release_held_by(connection, &check, lease.worker).await?;
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
                tracing::error!(job = %lease.job, %node, ?workers, "workers render a node to different bits, each to \
                    its own");
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

/// Releases a check that a worker, or another of its name, may hold under any lease.
async fn release_held_by(connection: &mut Connection, check: &str, worker: WorkerId) -> Result<(), StoreError> {
    let own = format!("(select id from leases where worker in {OF_THE_SAME_NAME})");
    for statement in [
        format!("update checks set second_lease = null where id = $2 and second_lease in {own}"),
        format!("update checks set lease = second_lease, second_lease = null where id = $2 and lease in {own}"),
    ] {
        query(statement).bind(worker.to_string()).bind(check).execute(&mut *connection).await?;
    }
    Ok(())
}

/// The result of votes.
#[derive(Debug, PartialEq, Eq)]
enum Judgement {
    /// All are the same.
    Agreed,
    /// Two votes differ, and a third has to decide.
    Disputed,
    /// All but one are the same.
    Odd(WorkerId),
    /// No two are the same.
    Unclear(Vec<WorkerId>),
}

fn judge(votes: &[(WorkerId, String)]) -> Judgement {
    let mut workers: BTreeMap<&str, Vec<WorkerId>> = BTreeMap::new();
    for (worker, digest) in votes {
        workers.entry(digest).or_default().push(*worker);
    }
    let alone = workers.values().find_map(|workers| <[WorkerId; 1]>::try_from(workers.as_slice()).ok());
    match (workers.len(), alone) {
        (0 | 1, _) => Judgement::Agreed,
        _ if votes.len() < MOST_VOTES => Judgement::Disputed,
        (2, Some([odd])) => Judgement::Odd(odd),
        _ => Judgement::Unclear(votes.iter().map(|(worker, _)| *worker).collect()),
    }
}

/// Quarantines a worker and all others of its name, and has everything rendered again that they may have rendered.
async fn quarantine(
    connection: &mut Connection,
    worker: WorkerId,
    reason: String,
    now_ms: i64,
    outcome: &mut CheckOutcome,
) -> Result<(), StoreError> {
    let held = query(format!("select id from leases where worker in {OF_THE_SAME_NAME} and state = 'active'"))
        .bind(worker.to_string())
        .fetch_all(&mut *connection)
        .await?;
    for lease in held {
        leases::release(connection, lease.parsed("id")?).await?;
    }
    // A repeated upload under a complete lease would bring what was just removed.
    query(format!("update leases set state = 'returned' where worker in {OF_THE_SAME_NAME} and state = 'complete'"))
        .bind(worker.to_string())
        .execute(&mut *connection)
        .await?;
    // Their votes on other nodes do not count.
    query(format!("delete from votes where worker in {OF_THE_SAME_NAME}"))
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
    // A check of their nodes without another vote has none now.
    query("delete from checks where not exists (select 1 from votes where check_id = checks.id)")
        .execute(&mut *connection)
        .await?;
    outcome.has_work = true;
    outcome.quarantined.push((worker, quarantine));
    outcome.redone.extend(redone.jobs);
    outcome.removed += redone.removed;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use uuid::Uuid;

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
