//! Merging: the nodes of a recorded round become fewer and larger ones.
//!
//! A parent is formed when the round at its middle has been recorded. Before that, the image of the round needs the two
//! halves apart ([`Held`]). The parent is on disk before its row replaces the rows of its children. A blob is removed
//! when its last node has been replaced. Tiles are merged in batches, few at a time, because their nodes are in memory
//! meanwhile.

use std::sync::Arc;

use clerestory_film::{Node, NodeAddress, store as stored_form};
use futures::stream::{self, StreamExt, TryStreamExt};
use tokio::sync::Semaphore;

use crate::blobs::Blobs;
use crate::films::batches::{batches, film_tile, runs};
use crate::films::{FilmError, FilmReader};
use crate::model::{JobRecord, Merge, NodeRow, Removed, TilePasses};

/// Batches of tiles that are merged at the same time, of all jobs: while one is computed, another waits for the disk.
const MERGES: usize = 2;

/// Nodes that one transaction replaces: a claim may have to wait for it.
const REPLACED: usize = 32;

/// Merges the nodes of films.
#[derive(Debug)]
pub(crate) struct Merger {
    reader: Arc<FilmReader>,
    blobs: Blobs,
    /// Permits for batches of tiles.
    batches: Semaphore,
}

impl Merger {
    /// Merges what this reader reads.
    pub(crate) fn new(reader: Arc<FilmReader>, blobs: Blobs) -> Self {
        Self { reader, blobs, batches: Semaphore::new(MERGES) }
    }

    /// Merges the nodes of every tile as far as no later round needs them apart. The first of those is `next_round`.
    pub(super) async fn merge(&self, job: &JobRecord, next_round: u32) -> Result<(), FilmError> {
        let tile_passes = self.reader.store.tile_passes(job).await?;
        let held = Held { job, tile_passes: &tile_passes, next_round };
        for (frame, tiles) in (0..job.frames).flat_map(|frame| runs(0..job.grid.len()).map(move |tiles| (frame, tiles)))
        {
            let rows = self.reader.store.nodes(job.id, frame, tiles, job.passes).await?;
            let tiles = rows.chunk_by(|a, b| a.address.tile == b.address.tile);
            let tiles = tiles.filter(|rows| can_merge(rows, &held.of(rows))).collect();
            // While some wait for the writer, others are merged.
            let merges: Vec<_> = batches(tiles).into_iter().map(|tiles| self.merge_tiles(job, tiles, &held)).collect();
            stream::iter(merges).buffer_unordered(2 * MERGES).try_collect::<()>().await?;
        }
        Ok(())
    }

    /// Frees what was removed from films.
    pub(super) async fn release(&self, removed: Removed) {
        self.reader.release(removed).await;
    }

    async fn merge_tiles(&self, job: &JobRecord, tiles: Vec<&[NodeRow]>, held: &Held<'_>) -> Result<(), FilmError> {
        // The semaphore is never closed.
        let permit = self.batches.acquire().await.ok();
        let held: Vec<Vec<u32>> = tiles.iter().map(|rows| held.of(rows)).collect();
        let rows = tiles.concat();
        // All at once: the nodes of neighbouring tiles lie in one blob.
        let loaded = self.reader.load(&rows).await?;
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
        let blob_ranges = self.blobs.put_nodes(job.id, encoded).await?;
        let mut merges = Vec::with_capacity(nodes.len());
        for ((node, children), blob_range) in nodes.into_iter().zip(blob_ranges) {
            merges.push(Merge { parent: node.address(), blob_range: blob_range.clone(), children });
            self.reader.cache(blob_range, Arc::new(node));
        }
        // Only the cache holds the nodes now. The writer may be busy for long, so other batches go on.
        drop(permit);
        for merges in merges.chunks(REPLACED) {
            let removed = self.reader.store.replace(job.id, job.redone_nodes, merges.to_vec()).await?;
            self.reader.release(removed).await;
        }
        Ok(())
    }
}

/// The parents that the nodes of a tile make, each with the nodes that it is the sum of.
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

/// The ends of rounds at which the nodes of a tile stay apart.
struct Held<'a> {
    job: &'a JobRecord,
    tile_passes: &'a TilePasses,
    /// The first round that is still to be recorded.
    next_round: u32,
}

impl Held<'_> {
    /// The ends of the unrecorded rounds in the tile of some nodes, up to the last of those.
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

/// Whether two of the nodes are siblings that no later round needs apart.
fn can_merge(rows: &[NodeRow], held: &[u32]) -> bool {
    rows.iter().any(|row| {
        let sibling = row.address.sibling();
        let middle = row.address.passes().first.max(sibling.passes().first);
        !held.contains(&middle) && rows.iter().any(|other| other.address == sibling)
    })
}
