//! The film of a job: from rows and blobs to nodes.
//!
//! The rows say which nodes there are; their blobs never change. So decoded nodes can be kept by where they lie
//! without ever being wrong, and everything else is computed from them when it is asked for.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use clerestory_api::JobId;
use clerestory_film::{FilmTile, ImageMetadata, Node, NodeAddress};
use futures::stream::{self, StreamExt, TryStreamExt};

use crate::blobs::Blobs;
use crate::farm::Farm;
use crate::films::FilmError;
use crate::model::{BlobRange, JobRecord, NodeRow};

/// Blobs read at the same time.
const READS: usize = 8;

/// Passes a failure on, unless a node was not found because the keeper has merged and removed it between the read of its row and its own.
/// Then the rows are to be read again: they name its parent now.
pub(crate) async fn unless_merged(farm: &Farm, job: JobId, failure: FilmError) -> Result<(), FilmError> {
    match &failure {
        FilmError::Lost { node, blob, .. } if farm.store.node_at(job, node, blob).await?.is_none() => Ok(()),
        _ => Err(failure),
    }
}

/// Reads nodes, and keeps the decoded ones that may be needed again.
#[derive(Debug)]
pub(crate) struct FilmReader {
    blobs: Blobs,
    cache: Mutex<NodeCache>,
}

impl FilmReader {
    /// A reader that keeps up to `cache_bytes` of nodes.
    pub(crate) fn new(blobs: Blobs, cache_bytes: usize) -> Self {
        Self { blobs, cache: Mutex::new(NodeCache { limit: cache_bytes, ..NodeCache::default() }) }
    }

    /// The nodes of these rows, in their order. Those that lie in one blob are read together.
    pub(crate) async fn load(&self, rows: &[NodeRow]) -> Result<Vec<Arc<Node>>, FilmError> {
        let mut nodes: Vec<Option<Arc<Node>>> = {
            let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
            rows.iter().map(|row| cache.get(&row.blob_range)).collect()
        };
        let mut missing: BTreeMap<&str, Vec<(usize, &NodeRow)>> = BTreeMap::new();
        for (number, (row, node)) in rows.iter().zip(&nodes).enumerate() {
            if node.is_none() {
                missing.entry(&row.blob_range.blob).or_default().push((number, row));
            }
        }
        let reads: Vec<_> = missing.into_iter().map(|(blob, rows)| self.read(blob, rows)).collect();
        let mut reads = stream::iter(reads).buffered(READS);
        while let Some(read) = reads.try_next().await? {
            for (number, node) in read {
                nodes[number] = Some(node);
            }
        }
        // Each was in the cache or has been read.
        Ok(nodes.into_iter().flatten().collect())
    }

    /// Keeps a node that has just been stored.
    pub(crate) fn keep(&self, blob_range: BlobRange, node: Arc<Node>) {
        self.cache.lock().unwrap_or_else(PoisonError::into_inner).insert(blob_range, node);
    }

    /// Lets go of nodes that are not needed any more.
    pub(crate) fn forget<'a>(&self, blob_ranges: impl IntoIterator<Item = &'a BlobRange>) {
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        for blob_range in blob_ranges {
            cache.remove(blob_range);
        }
    }

    /// Names the first of some nodes that a blob is too short for, if it is.
    async fn cut_off(&self, blob: &str, rows: &[(usize, &NodeRow)]) -> Option<FilmError> {
        let bytes = self.blobs.node_blob_bytes(blob).await.ok()?;
        let is_beyond =
            |blob_range: &BlobRange| blob_range.offset.saturating_add(blob_range.length.unwrap_or(0)) > bytes;
        let (_, row) = rows.iter().find(|(_, row)| is_beyond(&row.blob_range))?;
        Some(FilmError::Damaged { node: row.address, blob: blob.to_owned(), source: None })
    }

    /// Reads numbered nodes that lie in one blob.
    async fn read(&self, blob: &str, rows: Vec<(usize, &NodeRow)>) -> Result<Vec<(usize, Arc<Node>)>, FilmError> {
        let blob_ranges: Vec<&BlobRange> = rows.iter().map(|(_, row)| &row.blob_range).collect();
        let lost = |source| match rows.first() {
            Some((_, row)) => FilmError::Lost { node: row.address, blob: blob.to_owned(), source },
            None => source.into(),
        };
        let bytes = match self.blobs.nodes(blob, &blob_ranges).await {
            Ok(bytes) => bytes,
            Err(error) if error.is_missing() => return Err(lost(error)),
            Err(error) => return Err(self.cut_off(blob, &rows).await.unwrap_or(error.into())),
        };
        let addresses: Vec<NodeAddress> = rows.iter().map(|(_, row)| row.address).collect();
        let name = blob.to_owned();
        let decoded = tokio::task::spawn_blocking(move || {
            let decode = |(address, bytes): (NodeAddress, Bytes)| {
                let damaged = |source| FilmError::Damaged { node: address, blob: name.clone(), source };
                let node = clerestory_film::store::decode(&bytes).map_err(|error| damaged(Some(error)))?;
                if node.address() == address { Ok(Arc::new(node)) } else { Err(damaged(None)) }
            };
            addresses.into_iter().zip(bytes).map(decode).collect::<Result<Vec<_>, FilmError>>()
        });
        let nodes = decoded.await??;
        for ((_, row), node) in rows.iter().zip(&nodes) {
            self.keep(row.blob_range.clone(), Arc::clone(node));
        }
        Ok(rows.into_iter().map(|(number, _)| number).zip(nodes).collect())
    }
}

/// Nodes by place, the longest unused of which go first when there are too many.
#[derive(Debug, Default)]
struct NodeCache {
    nodes: BTreeMap<BlobRange, (u64, Arc<Node>)>,
    by_use: BTreeMap<u64, BlobRange>,
    uses: u64,
    bytes: usize,
    limit: usize,
}

impl NodeCache {
    fn get(&mut self, blob_range: &BlobRange) -> Option<Arc<Node>> {
        let (used, node) = self.nodes.get_mut(blob_range)?;
        let node = Arc::clone(node);
        self.uses += 1;
        if let Some(blob_range) = self.by_use.remove(used) {
            self.by_use.insert(self.uses, blob_range);
        }
        *used = self.uses;
        Some(node)
    }

    fn insert(&mut self, blob_range: BlobRange, node: Arc<Node>) {
        self.remove(&blob_range);
        self.uses += 1;
        self.bytes += node.bytes();
        self.by_use.insert(self.uses, blob_range.clone());
        self.nodes.insert(blob_range, (self.uses, node));
        while self.bytes > self.limit {
            let Some((_, oldest)) = self.by_use.pop_first() else { break };
            if let Some((_, node)) = self.nodes.remove(&oldest) {
                self.bytes -= node.bytes();
            }
        }
    }

    fn remove(&mut self, blob_range: &BlobRange) {
        if let Some((used, node)) = self.nodes.remove(blob_range) {
            self.by_use.remove(&used);
            self.bytes -= node.bytes();
        }
    }
}

/// Bytes of nodes in a batch of tiles, unless it is one tile.
const BATCH_BYTES: u64 = 8 << 20;

/// Nodes in a batch, unless it is one tile.
const BATCH_NODES: usize = 512;

/// Tiles whose rows are read from the database at a time: more would be much memory in a large frame.
const TILES_AT_ONCE: u32 = 1024;

/// Tiles in runs whose rows fit into memory together.
pub(crate) fn runs(tiles: Range<u32>) -> impl Iterator<Item = Range<u32>> {
    let end = tiles.end;
    tiles.step_by(TILES_AT_ONCE as usize).map(move |first| first..end.min(first.saturating_add(TILES_AT_ONCE)))
}

/// Tiles, each as its rows, in batches whose nodes fit into memory together.
pub(crate) fn batches(tiles: Vec<&[NodeRow]>) -> Vec<Vec<&[NodeRow]>> {
    let mut batches: Vec<Vec<&[NodeRow]>> = Vec::new();
    let (mut bytes, mut nodes) = (0, 0);
    for rows in tiles {
        // Only nodes that older builds stored do not say how long they are.
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

/// The merge tree of one tile of which these are all nodes; `None` when there are none.
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

/// What the image of a frame says of how it was made, but for the work, which depends on its extent.
pub(crate) async fn metadata(farm: &Farm, job: &JobRecord, frame: u32) -> Result<ImageMetadata, FilmError> {
    let scene: serde_json::Value = match farm.store.job_scene(job.id).await? {
        Some((scene, _)) => serde_json::from_str(&scene)?,
        None => serde_json::Value::Null,
    };
    let elapsed_ms = job.started_ms.zip(job.finished_ms).map(|(started_ms, finished_ms)| finished_ms - started_ms);
    Ok(ImageMetadata {
        scene_hash: job.scene_hash.clone(),
        frame,
        seed: scene.get("seed").and_then(serde_json::Value::as_u64).unwrap_or(0),
        integrator: scene.get("integrator").cloned().unwrap_or_default(),
        sampling: job.sampling()?,
        tile_size: job.grid.tile_size,
        tile_passes: Vec::new(),
        standard_error_tiles: None,
        build: farm.config.build.clone(),
        worker_builds: Vec::new(),
        missing_light: job.missing_light.clone(),
        left_to_chance: job.left_to_chance.clone(),
        counters: Default::default(),
        elapsed_seconds: elapsed_ms.map(|elapsed_ms| elapsed_ms as f64 / 1000.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::model::Work;
    use crate::server;
    use crate::store::tests::farm::some_job;

    #[tokio::test]
    async fn rows_are_read_again_when_a_node_that_is_not_there_has_none_any_more() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = server::open(Config::new(directory.path())).await.unwrap();
        let job = some_job();
        farm.store.insert_job(job.clone()).await.unwrap();
        let blob_range = BlobRange { blob: "merged".to_owned(), offset: 0, length: Some(1) };
        let address = NodeAddress { frame: 0, tile: 0, level: 0, index: 0 };
        let failure = farm.film.load(&[NodeRow { address, blob_range, work: Work::default() }]).await.unwrap_err();
        assert!(matches!(failure, FilmError::Lost { .. }), "{failure:?}");
        unless_merged(&farm, job.id, failure).await.unwrap();
        assert!(matches!(unless_merged(&farm, job.id, FilmError::Empty).await, Err(FilmError::Empty)));
    }
}
