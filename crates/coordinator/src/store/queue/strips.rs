//! Strips of the light plane over the same passes, which are leased together.
//!
//! Their light comes from the same light subpaths, and a worker traces these once for all strips of a lease. Strips
//! that are leased apart have the same bits, and take more time.

use clerestory_film::NodeAddress;

use crate::model::JobRecord;
use crate::store::engine::error::StoreError;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::queue::splits::{Side, split_off};

/// The chosen nodes up to the first strip of the light plane. Where that is the first of them, it and the free strips
/// over the same passes, at most `most`. Frames whose light plane is one strip keep their nodes.
pub(in crate::store) async fn gather_strips(
    connection: &mut Connection,
    job: &JobRecord,
    mut nodes: Vec<NodeAddress>,
    most: u32,
) -> Result<Vec<NodeAddress>, StoreError> {
    let strips = job.grid.light_tiles();
    if strips.len() < 2 {
        return Ok(nodes);
    }
    let is_strip = |node: &NodeAddress| strips.contains(&node.tile);
    let Some(first) = nodes.first().copied().filter(is_strip) else {
        let before = nodes.iter().take_while(|node| !is_strip(node)).count();
        nodes.truncate(before);
        return Ok(nodes);
    };
    let rows = query(
        "select tile from pending where job = $1 and lease is null and frame = $2 and tile >= $3 and level = $4 \
         and idx = $5 order by tile limit $6",
    )
    .bind(job.id.to_string())
    .bind(i64::from(first.frame))
    .bind(i64::from(first.tile))
    .bind(i64::from(first.level))
    .bind(i64::from(first.index))
    .bind(i64::from(most))
    .fetch_all(connection)
    .await?;
    rows.iter().map(|row| Ok(NodeAddress { tile: row.number("tile")?, ..first })).collect()
}

/// Splits the first of some nodes where it is too large for a lease. Strips over the same passes are split alike.
pub(in crate::store) async fn split_first(
    connection: &mut Connection,
    job: &JobRecord,
    nodes: &mut [NodeAddress],
    most_samples: f64,
) -> Result<(), StoreError> {
    let Some((first, others)) = nodes.split_first_mut() else { return Ok(()) };
    let strips = job.grid.light_tiles();
    let is_beside = |node: &NodeAddress| {
        strips.contains(&first.tile)
            && strips.contains(&node.tile)
            && NodeAddress { tile: first.tile, ..*node } == *first
    };
    let beside = others.iter().take_while(|node| is_beside(node)).count();
    *first = split_off(connection, job, *first, most_samples / (1 + beside) as f64, Side::First).await?;
    for node in others.iter_mut().take(beside) {
        let most = job.node_samples(&NodeAddress { tile: node.tile, ..*first });
        *node = split_off(connection, job, *node, most as f64, Side::First).await?;
    }
    Ok(())
}
