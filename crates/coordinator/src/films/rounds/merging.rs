//! Merging: the nodes that a recorded round leaves behind become fewer and larger ones.
//!
//! A parent is formed when the round at its middle has been recorded; before that, the round's image needs the two halves apart ([`Held`]). The
//! parent is on disk before its row replaces the children's, and a blob is removed when the last node in it has been replaced. Tiles are
//! merged in batches, few at a time, since their nodes are in memory meanwhile.

use std::sync::Arc;

use clerestory_film::{Node, NodeAddress, store as stored_form};
use futures::stream::{self, StreamExt, TryStreamExt};

use crate::farm::{Farm, MERGES};
use crate::films::reader::film_tile;
use crate::films::{FilmError, reader as film};
use crate::model::{JobRecord, Merge, NodeRow, TilePasses};

/// Nodes that are put in the place of their halves at the same time: a claim may have to wait for it.
const REPLACED: usize = 32;

/// Merges the nodes of every tile as far as no later round needs them apart, of which the first is `next_round`.
pub(super) async fn merge(farm: &Farm, job: &JobRecord, next_round: u32) -> Result<(), FilmError> {
    let tile_passes = farm.store.tile_passes(job).await?;
    let held = Held { job, tile_passes: &tile_passes, next_round };
    for (frame, tiles) in
        (0..job.frames).flat_map(|frame| film::runs(0..job.grid.len()).map(move |tiles| (frame, tiles)))
    {
        let rows = farm.store.nodes(job.id, frame, tiles, job.passes).await?;
        let tiles = rows.chunk_by(|a, b| a.address.tile == b.address.tile);
        let tiles = tiles.filter(|rows| can_merge(rows, &held.of(rows))).collect();
        let batches = film::batches(tiles).into_iter();
        // While some wait for the writer, others are merged.
        let merges: Vec<_> = batches.map(|tiles| merge_tiles(farm, job, tiles, &held)).collect();
        stream::iter(merges).buffer_unordered(2 * MERGES).try_collect::<()>().await?;
    }
    Ok(())
}

async fn merge_tiles(farm: &Farm, job: &JobRecord, tiles: Vec<&[NodeRow]>, held: &Held<'_>) -> Result<(), FilmError> {
    // The semaphore is never closed.
    let permit = farm.merging.acquire().await.ok();
    let held: Vec<Vec<u32>> = tiles.iter().map(|rows| held.of(rows)).collect();
    let rows = tiles.concat();
    // All at once: nodes of neighbouring tiles lie in one blob.
    let loaded = farm.film.load(&rows).await?;
    let record = job.clone();
    let merged = tokio::task::spawn_blocking(move || {
        let mut loaded = loaded.as_slice();
        let tiles = rows.chunk_by(|a, b| a.address.tile == b.address.tile).zip(&held).map(|(rows, held)| {
            let nodes = loaded.split_off(..rows.len()).unwrap_or_default();
            merged_nodes(&record, rows, nodes, held)
        });
        let nodes: Vec<(Node, Vec<NodeAddress>)> =
            tiles.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
        let encoded: Vec<Vec<u8>> = nodes.iter().map(|(node, _)| stored_form::encode(node)).collect();
        Ok::<_, FilmError>((nodes, encoded))
    });
    let (nodes, encoded) = merged.await??;
    let blob_ranges = farm.blobs.put_nodes(job.id, encoded).await?;
    let mut merges = Vec::with_capacity(nodes.len());
    for ((node, children), blob_range) in nodes.into_iter().zip(blob_ranges) {
        merges.push(Merge { parent: node.address(), blob_range: blob_range.clone(), children });
        farm.film.keep(blob_range, Arc::new(node));
    }
    // What is in memory now is the cache's: the writer may be busy for long, and others can go on.
    drop(permit);
    for merges in merges.chunks(REPLACED) {
        farm.let_go(farm.store.replace(job.id, job.redone_nodes, merges.to_vec()).await?).await;
    }
    Ok(())
}

/// What the nodes of a tile make when they are merged, without those that stay as they are, each with the nodes that it is the sum of.
fn merged_nodes(
    job: &JobRecord,
    rows: &[NodeRow],
    nodes: &[Arc<Node>],
    held: &[u32],
) -> Result<Vec<(Node, Vec<NodeAddress>)>, FilmError> {
    let Some(tile) = film_tile(job, nodes, held.iter().copied())? else { return Ok(Vec::new()) };
    let merged = tile.nodes().filter(|node| !rows.iter().any(|row| row.address == node.address()));
    let with_children = merged.map(|node| {
        let children = rows.iter().map(|row| row.address).filter(|row| node.address().overlaps(row));
        (node.clone(), children.collect())
    });
    Ok(with_children.collect())
}

/// Which passes of a tile have to stay apart from those before.
struct Held<'a> {
    job: &'a JobRecord,
    tile_passes: &'a TilePasses,
    /// The first round that is still to be recorded.
    next_round: u32,
}

impl Held<'_> {
    /// Where the rounds end that are still to be recorded, in the tile of some nodes, as far as they reach.
    fn of(&self, rows: &[NodeRow]) -> Vec<u32> {
        let Some(NodeAddress { frame, tile, .. }) = rows.first().map(|row| row.address) else { return Vec::new() };
        let ends = rows.iter().map(|row| row.address.passes()).map(|passes| passes.first + passes.count);
        let end = ends.max().unwrap_or(0);
        let boundaries = self.job.boundaries();
        let rounds = (self.next_round..).map_while(|round| boundaries.end(round));
        let in_tile = rounds.map(|passes| self.tile_passes.at(frame, tile, passes));
        in_tile.take_while(|passes| *passes < end).collect()
    }
}

/// Whether any two of the nodes are siblings that no later round needs apart.
fn can_merge(rows: &[NodeRow], held: &[u32]) -> bool {
    rows.iter().any(|row| {
        let sibling = row.address.sibling();
        let middle = row.address.passes().first.max(sibling.passes().first);
        !held.contains(&middle) && rows.iter().any(|other| other.address == sibling)
    })
}
