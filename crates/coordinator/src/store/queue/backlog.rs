//! The ready queue: the work of a job, cut into nodes shortly before it is leased.
//!
//! Pending rows exist for the near future only. A [claim](super::claim) that finds too few free rows cuts more at the
//! job's cursor: a round, a frame and a tile. It cuts nodes as large as the rates allow, enough for many leases. A
//! round is opened when its first tile is cut. Nodes that must be rendered [again](crate::store::results::redo) enter
//! the queue as well.

use clerestory_film::{NodeAddress, PassRange};

use crate::model::{JobRecord, MOST_NODES, MeasuredRate, cut};
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, rows_of, to_json};
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::films::shares as adaptive;
use crate::store::films::shares::{RoundTiles, round_tiles};

/// Cuts work at the job's cursor, up to a round, until the queue has enough free rows or no work is left. `free` rows
/// exist before. Answers whether any were added.
pub(in crate::store) async fn fill_ready_queue(
    connection: &mut Connection,
    job: &JobRecord,
    mut free: u32,
    last_round: i64,
    rate: &MeasuredRate,
) -> Result<bool, StoreError> {
    if job.reopened_ms.is_some() {
        return Ok(false);
    }
    let [mut round, mut frame, mut tile] = job.cursor;
    let mut pending = Vec::new();
    while free < MOST_NODES && i64::from(round) <= last_round {
        let Some(round_passes) = job.boundaries().passes(round) else { break };
        if job.waits_for_shares(round_passes) {
            break;
        }
        if tile == 0 {
            open_round(connection, job, frame, round, round_passes).await?;
        }
        let RoundTiles { tiles, next, count } = round_tiles(connection, job, frame, tile, round_passes).await?;
        let samples = job.node_samples(&NodeAddress { frame, tile, level: 0, index: 0 });
        let level = rate.largest_level(round_passes, count, samples as f64);
        let pilot: Vec<u32> = job.pilot_in(round).collect();
        tile = next;
        for (index, passes) in tiles {
            let strips = job.grid.light_tiles();
            // Strips of the light plane are leased together.
            if free >= MOST_NODES && !(strips.start + 1..strips.end).contains(&index) {
                tile = index;
                break;
            }
            let pilot = pilot.iter().filter(|_| !strips.contains(&index));
            let nodes = cut(passes, level).chain(pilot.map(|pass| (0, *pass)));
            let before = pending.len();
            pending.extend(nodes.map(|(level, pass)| (round, NodeAddress { frame, tile: index, level, index: pass })));
            free += (pending.len() - before) as u32;
        }
        if tile == job.grid.len() {
            (tile, frame) = (0, frame + 1);
        }
        if frame == job.frames {
            (frame, round) = (0, round + 1);
        }
    }
    insert_pending(connection, job, &pending).await?;
    if [round, frame, tile] != job.cursor {
        query("update jobs set cursor_round = $2, cursor_frame = $3, cursor_tile = $4 where id = $1")
            .bind(job.id.to_string())
            .bind(i64::from(round))
            .bind(i64::from(frame))
            .bind(i64::from(tile))
            .execute(connection)
            .await?;
    }
    Ok(!pending.is_empty())
}

async fn open_round(
    connection: &mut Connection,
    job: &JobRecord,
    frame: u32,
    round: u32,
    round_passes: PassRange,
) -> Result<(), StoreError> {
    let end = round_passes.first + round_passes.count;
    let tile_passes = adaptive::tile_passes(connection, job).await?;
    let in_tile = |tile| tile_passes.at(frame, tile, end) - tile_passes.at(frame, tile, round_passes.first);
    let in_images: i64 = (0..job.grid.len()).map(|tile| i64::from(in_tile(tile))).sum();
    let in_pilot = job.pilot_in(round).count() as i64 * i64::from(job.grid.camera_tiles());
    query("insert into round_work (job, frame, round, end_pass, outstanding) values ($1, $2, $3, $4, $5)")
        .bind(job.id.to_string())
        .bind(i64::from(frame))
        .bind(i64::from(round))
        .bind(i64::from(end))
        .bind(in_images + in_pilot)
        .execute(connection)
        .await?;
    Ok(())
}

/// Inserts nodes into the queue, each as work of a round.
pub(in crate::store) async fn insert_pending(
    connection: &mut Connection,
    job: &JobRecord,
    nodes: &[(u32, NodeAddress)],
) -> Result<(), StoreError> {
    if nodes.is_empty() {
        return Ok(());
    }
    let statement = format!(
        "insert into pending (job, round, frame, tile, level, idx) select $1, c0, c1, c2, c3, c4 from {} as \
         listed_nodes",
        rows_of(connection.engine(), 2, &[Kind::Integer; 5])
    );
    let rows = nodes.iter().map(|(round, node)| [*round, node.frame, node.tile, node.level, node.index]);
    let rows = to_json(&rows.collect::<Vec<_>>())?;
    query(statement).bind(job.id.to_string()).bind(rows).execute(connection).await?;
    Ok(())
}
