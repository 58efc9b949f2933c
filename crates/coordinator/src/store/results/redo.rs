//! Redoing: the nodes of a wrong worker are rendered again, with those of all workers of its name, which are one
//! machine.
//!
//! Their leases tell which nodes may be theirs. Nodes that others brought instead are rendered again too, and so are
//! nodes that were merged with them. The points that were measured with them are deleted, and not measured again,
//! because the film has been merged across the ends of their rounds. The next round waits until all passes before it
//! are back. A job that has ended keeps its image, and the quarantine names it.
//!
//! A job of which nothing is left restarts, pinned to the next worker. Its fingerprint may be that of the wrong
//! machine alone, so that no other could continue. Where nodes of other workers are left, others have the same
//! fingerprint.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{JobId, WorkerId};
use clerestory_film::{NodeAddress, PILOT_ROUND, PassRange};

use crate::model::{JobRecord, Removed, StoredKind, TilePasses, cut};
use crate::store::checks;
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
    /// Jobs of which nodes are rendered again, or which restart.
    pub(in crate::store) jobs: Vec<JobId>,
    /// What was removed from their films.
    pub(in crate::store) removed: Removed,
    /// Jobs that have ended with work of the machine in their images.
    pub(in crate::store) ended: Vec<JobId>,
}

/// Returns everything that the workers of one name may have rendered to the queue, in jobs that have not ended.
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
        // As finely as their work was leased.
        let largest_level = leased.iter().map(|node| node.level).max().unwrap_or(0);
        requeue(connection, &job, &taken, largest_level).await?;
        delete_points(connection, &job, &taken).await?;
        events::record(connection, StoredKind::Job, id, now_ms).await?;
        redone.jobs.push(id);
    }
    Ok(redone)
}

/// Queues the passes of nodes again, cut at the ends of rounds.
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
            "update round_work set outstanding = outstanding + $4, completed_ms = null where job = $1 and frame = $2 \
             and round = $3",
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

/// Counts on a job that nodes were removed from its film.
pub(in crate::store) async fn count_taken(
    connection: &mut Connection,
    job: &JobRecord,
    taken: &[NodeAddress],
) -> Result<(), StoreError> {
    let samples: u64 = taken.iter().map(|node| job.node_samples(node)).sum();
    // The film has changed, so the number that tells its images apart changes too.
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

/// Restarts a job, and answers what was removed from its film, together with what was removed before. The build that
/// renders the job reports on its scene.
pub(in crate::store) async fn restart(
    connection: &mut Connection,
    job: &JobRecord,
    mut removed: Removed,
) -> Result<Removed, StoreError> {
    removed += nodes::discard(connection, job.id, 0).await?;
    // Their nodes were cut at the ends of rounds by the old shares, and the job may be pinned to another fingerprint.
    query("update leases set state = 'returned' where job = $1 and state in ('active', 'complete')")
        .bind(job.id.to_string())
        .execute(&mut *connection)
        .await?;
    for table in ["checks", "pending", "round_work", "rounds", "tile_shares"] {
        query(format!("delete from {table} where job = $1")).bind(job.id.to_string()).execute(&mut *connection).await?;
    }
    query(
        "update jobs set cursor_round = 0, cursor_frame = 0, cursor_tile = 0, rounds = 0, complete_passes = 0, \
         samples = 0, \
         shared_samples = null, probe_digest = null, hold = null, scene_is_built = 0, left_to_chance = '[]', \
         chosen_methods = '[]', import_notes = '[]', scene_refusal = null, redone_nodes = redone_nodes + $2, \
         accepted_nodes = accepted_nodes + 1 where id = $1",
    )
    .bind(job.id.to_string())
    .bind(big(removed.blob_ranges.len() as u64))
    .execute(connection)
    .await?;
    Ok(removed)
}

/// Deletes the points that were measured with some nodes. Their rounds are not recorded again, because the film may
/// have been merged across their ends. The next round waits for all passes before it.
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
