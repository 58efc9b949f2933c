//! Batches of tiles: a frame may be larger than memory.

use std::ops::Range;
use std::sync::Arc;

use clerestory_film::{FilmTile, Node};

use super::error::FilmError;
use crate::model::{JobRecord, NodeRow};

/// Bytes of the nodes in a batch, unless it is one tile.
const BATCH_BYTES: u64 = 8 << 20;

/// Nodes in a batch, unless it is one tile.
const BATCH_NODES: usize = 512;

/// Tiles whose rows one query reads: the rows of a large frame would not fit into memory.
const TILES_AT_ONCE: u32 = 1024;

/// Cuts tiles into runs whose rows fit into memory together.
pub(crate) fn runs(tiles: Range<u32>) -> impl Iterator<Item = Range<u32>> {
    let end = tiles.end;
    tiles.step_by(TILES_AT_ONCE as usize).map(move |first| first..end.min(first.saturating_add(TILES_AT_ONCE)))
}

/// Cuts tiles, each given as its rows, into batches whose nodes fit into memory together.
pub(crate) fn batches(tiles: Vec<&[NodeRow]>) -> Vec<Vec<&[NodeRow]>> {
    let mut batches: Vec<Vec<&[NodeRow]>> = Vec::new();
    let (mut bytes, mut nodes) = (0, 0);
    for rows in tiles {
        // Rows of older builds do not have the length of their node.
        let tile_bytes: u64 = rows.iter().map(|row| row.blob_range.length.unwrap_or(BATCH_BYTES)).sum();
        (bytes, nodes) = (bytes + tile_bytes, nodes + rows.len());
        match batches.last_mut() {
            Some(batch) if bytes <= BATCH_BYTES && nodes <= BATCH_NODES => batch.push(rows),
            _ => {
                (bytes, nodes) = (tile_bytes, rows.len());
                batches.push(vec![rows]);
            }
        }
    }
    batches
}

/// The merge tree of one tile, of which these are all nodes, or `None` when there are none.
pub(crate) fn film_tile(
    job: &JobRecord,
    nodes: &[Arc<Node>],
    holds: impl IntoIterator<Item = u32>,
) -> Result<Option<FilmTile>, FilmError> {
    let Some(first) = nodes.first() else { return Ok(None) };
    let mut tile = FilmTile::new(first.address().frame, first.address().tile, first.tile(), job.sampling()?);
    for passes in holds {
        tile.hold(passes)?;
    }
    for node in nodes {
        tile.insert(Node::clone(node))?;
    }
    Ok(Some(tile))
}
