//! What a worker has rendered that turned out to be wrong is rendered again, and with it what all workers of its name have: they are one machine.
//!
//! Their leases tell which nodes may be their own; what others brought of them in the end is rendered again too, and so is what was merged with
//! them. The points of the series that were measured with them go, and are not measured again: the film has been merged across the ends of
//! their rounds. The next round waits until all passes before it are there again. A job that has ended keeps its image, and is named.
//!
//! A job of which nothing is left begins again, with whatever bits the next worker computes: those that it was begun with may be the bits of the
//! wrong machine alone, and nobody else could go on with it. Where nodes of others are left, others compute the same bits.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{JobId, WorkerId};
use clerestory_film::{NodeAddress, PILOT_ROUND, PassRange};

use crate::model::{JobRecord, Removed, StoredKind, TilePasses, cut};
use crate::store::checks::table as checks;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::big;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::films::{nodes, shares as adaptive};
use crate::store::leases::table::nodes_of;
use crate::store::queue::backlog::insert_pending;
use crate::store::workers::table::OF_THE_SAME_NAME;
use crate::store::{events, jobs};

/// What is rendered again.
#[derive(Debug, Default)]
pub(in crate::store) struct Redone {
    /// Jobs of which nodes are, and those that begin again.
    pub(in crate::store) jobs: Vec<JobId>,
    /// What has been taken out of their films.
    pub(in crate::store) removed: Removed,
    /// Jobs that have ended, with work of the machine in their images.
    pub(in crate::store) ended: Vec<JobId>,
}

/// Takes all that the workers of a worker's name may have rendered out of the films of the jobs that have not ended, and back into the queue.
pub(in crate::store) async fn redo(
    connection: &mut Connection,
    worker: WorkerId,
    now_ms: i64,
) -> Result<Redone, StoreError> {
    let rows = query(format!("select job, nodes from leases where worker in {OF_THE_SAME_NAME}"))
        .bind(worker.to_string())
        .fetch_all(&mut *connection)
        .await?;
    let mut leased: BTreeMap<JobId, BTreeSet<NodeAddress>> = BTreeMap::new();
    for row in &rows {
        leased.entry(row.parsed("job")?).or_default().extend(nodes_of(row)?);
    }
    let mut redone = Redone::default();
    for (id, leased) in leased {
        let Some(job) = jobs::job_in(connection, id).await? else { continue };
        if job.state.is_final() {
            redone.ended.push(id);
            continue;
        }
        let (taken, removed) = nodes::take_out(connection, id, &leased).await?;
        let has_pilot = leased.iter().any(|node| node.passes().first >= job.passes);
        if (has_pilot && job.shared_samples.is_some()) || !nodes::has_any(connection, id).await? {
            redone.removed += restart(connection, &job, removed).await?;
            events::record(connection, StoredKind::Job, id, now_ms).await?;
            redone.jobs.push(id);
            continue;
        }
        if taken.is_empty() {
            continue;
        }
        redone.removed += removed;
        checks::forget(connection, id, &taken).await?;
        // As finely as work was given to it.
        let largest_level = leased.iter().map(|node| node.level).max().unwrap_or(0);
        requeue(connection, &job, &taken, largest_level).await?;
        delete_points(connection, &job, &taken).await?;
        events::record(connection, StoredKind::Job, id, now_ms).await?;
        redone.jobs.push(id);
    }
    Ok(redone)
}

/// Puts the passes of nodes back into the queue, cut at the ends of rounds.
pub(in crate::store) async fn requeue(
    connection: &mut Connection,
    job: &JobRecord,
    taken: &[NodeAddress],
    largest_level: u32,
) -> Result<(), StoreError> {
    let mut pending = Vec::new();
    let mut passes: BTreeMap<(u32, u32), i64> = BTreeMap::new();
    let tile_passes = adaptive::tile_passes(connection, job).await?;
    for node in taken {
        for (round, range) in rounds_of(job, &tile_passes, node) {
            *passes.entry((node.frame, round)).or_default() += i64::from(range.count);
            let addresses = cut(range, largest_level).map(|(level, index)| NodeAddress { level, index, ..*node });
            pending.extend(addresses.map(|address| (round, address)));
        }
    }
    insert_pending(connection, job, &pending).await?;
    for ((frame, round), passes) in passes {
        query(
            "update waves set outstanding = outstanding + $4, completed_ms = null where job = $1 and frame = $2 and round = $3",
        )
        .bind(job.id.to_string())
        .bind(i64::from(frame))
        .bind(i64::from(round))
        .bind(passes)
        .execute(&mut *connection)
        .await?;
    }
    count_taken(connection, job, taken).await
}

/// Notes on a job that nodes have been taken out of its film.
pub(in crate::store) async fn count_taken(
    connection: &mut Connection,
    job: &JobRecord,
    taken: &[NodeAddress],
) -> Result<(), StoreError> {
    let samples: u64 = taken.iter().map(|node| job.node_samples(node)).sum();
    // The film has changed: so does the number by which its images are told apart.
    query(
        "update jobs set samples = samples - $2, redone_nodes = redone_nodes + $3, accepted_nodes = accepted_nodes + 1 \
         where id = $1",
    )
    .bind(job.id.to_string())
    .bind(big(samples))
    .bind(big(taken.len() as u64))
    .execute(connection)
    .await?;
    Ok(())
}

/// The passes of a node by rounds.
fn rounds_of(
    job: &JobRecord,
    tile_passes: &TilePasses,
    node: &NodeAddress,
) -> impl Iterator<Item = (u32, PassRange)> + use<> {
    let (passes, boundaries) = (node.passes(), job.boundaries());
    let end = passes.first + passes.count;
    let (tile_passes, NodeAddress { frame, tile, .. }) = (tile_passes.clone(), *node);
    let in_images = (0..).map_while(move |round| Some((round, boundaries.passes(round)?)));
    let in_images = in_images.filter_map(move |(round, round_passes)| {
        let first = tile_passes.at(frame, tile, round_passes.first).max(passes.first);
        let round_end = tile_passes.at(frame, tile, round_passes.first + round_passes.count);
        let count = round_end.min(end).checked_sub(first).filter(|count| *count > 0)?;
        Some((round, PassRange { first, count }))
    });
    in_images.chain((passes.first >= job.passes).then_some((PILOT_ROUND, passes)))
}

/// Takes a job back to where it was before any work was given out, and answers all that has been taken out of its film, with what was before.
pub(in crate::store) async fn restart(
    connection: &mut Connection,
    job: &JobRecord,
    mut removed: Removed,
) -> Result<Removed, StoreError> {
    removed += nodes::discard(connection, job.id, 0).await?;
    // Their nodes were cut where rounds ended by the old shares, and may have other bits than the job will.
    query("update leases set state = 'returned' where job = $1 and state in ('active', 'complete')")
        .bind(job.id.to_string())
        .execute(&mut *connection)
        .await?;
    for table in ["checks", "pending", "waves", "rounds", "tile_shares"] {
        query(format!("delete from {table} where job = $1")).bind(job.id.to_string()).execute(&mut *connection).await?;
    }
    query(
        "update jobs set cursor_round = 0, cursor_frame = 0, cursor_tile = 0, rounds = 0, complete_passes = 0, samples = 0, \
         shared_samples = null, probe_digest = null, hold = null, redone_nodes = redone_nodes + $2, \
         accepted_nodes = accepted_nodes + 1 where id = $1",
    )
    .bind(job.id.to_string())
    .bind(big(removed.blob_ranges.len() as u64))
    .execute(connection)
    .await?;
    Ok(removed)
}

/// Takes away the points of the series that were measured with some nodes. Their rounds are not recorded again, since the film may have been
/// merged across their ends; the next one waits for all passes before it.
async fn delete_points(connection: &mut Connection, job: &JobRecord, taken: &[NodeAddress]) -> Result<(), StoreError> {
    let tile_passes = adaptive::tile_passes(connection, job).await?;
    let rounds = taken.iter().filter_map(|node| rounds_of(job, &tile_passes, node).map(|(round, _)| round).next());
    let Some(affected) = rounds.min() else { return Ok(()) };
    query("delete from rounds where job = $1 and round >= $2")
        .bind(job.id.to_string())
        .bind(i64::from(affected))
        .execute(connection)
        .await?;
    Ok(())
}
