//! The film of a job: from rows and blobs to nodes.
//!
//! The rows say which nodes there are; their blobs never change. So decoded nodes can be kept by where they lie
//! without ever being wrong, and everything else is computed from them when it is asked for.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use clerestory_api::JobId;
use clerestory_film::{
    FilmTile, ImageError, ImageMetadata, InsertError, Node, NodeAddress, Sampling, SamplingError, SumError,
};
use futures::stream::{self, StreamExt, TryStreamExt};

use crate::blobs::{BlobError, Blobs, Place};
use crate::farm::Farm;
use crate::store::{JobRecord, NodeRow, StoreError, StoredNode};

/// Blobs read at the same time.
const READS: usize = 8;

/// The film cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FilmError {
    /// No node has been accepted.
    #[error("there is no node yet")]
    Empty,
    /// Nodes were lost or damaged, and are rendered again.
    #[error(
        "stored nodes of this image are lost; they are rendered again, and the image is there when the job is done"
    )]
    RenderedAgain,
    /// A stored node has lost bits or is cut off, or is not the one that its row names.
    #[error("the stored node {node} in {blob} cannot be used")]
    Damaged {
        /// The node.
        node: NodeAddress,
        /// Name of its blob.
        blob: String,
        /// What is wrong, unless it is cut off or another node altogether.
        source: Option<clerestory_film::StoreError>,
    },
    /// A stored node is not there.
    #[error("the stored node {node} is not there: {blob} is missing")]
    Lost {
        /// The node.
        node: NodeAddress,
        /// Name of its blob.
        blob: String,
        /// What the blob store says.
        source: BlobError,
    },
    /// The rows do not make a film.
    #[error("the accepted nodes do not fit together")]
    Inconsistent(#[from] InsertError),
    /// The passes are not all there.
    #[error("the accepted nodes are not the passes that are wanted")]
    Incomplete(#[from] SumError),
    /// The stored sampling is impossible.
    #[error("the job's sampling is impossible")]
    Sampling(#[from] SamplingError),
    /// The sums do not make an image.
    #[error("the sums do not make an image")]
    Image(#[from] ImageError),
    /// A file could not be written.
    #[error("the image cannot be written")]
    Write(#[from] clerestory_film::OpenExrError),
    /// A frame and its reference do not have the same rows.
    #[error("the image and its reference cannot be compared")]
    Flip(#[from] clerestory_film::FlipError),
    /// A preview could not be written.
    #[error("the preview cannot be written")]
    Preview(#[from] clerestory_film::PreviewError),
    /// A file for what is being made cannot be written or read.
    #[error("a temporary file in the data directory failed")]
    Scratch(#[from] std::io::Error),
    /// The stored scene cannot be read.
    #[error("the stored scene cannot be read")]
    Scene(#[from] serde_json::Error),
    /// A blob could not be read.
    #[error(transparent)]
    Blob(#[from] BlobError),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The computation was stopped.
    #[error("the computation was stopped")]
    Stopped(#[from] tokio::task::JoinError),
}

impl FilmError {
    /// Whether the rows do not make a film, as far as what was read belongs together.
    pub(crate) fn is_damage(&self) -> bool {
        matches!(self, Self::Inconsistent(_) | Self::Incomplete(_))
    }

    /// The node that is lost or damaged.
    pub(crate) fn unreadable_node(&self) -> Option<StoredNode> {
        match self {
            Self::Damaged { node, blob, .. } | Self::Lost { node, blob, .. } => {
                Some(StoredNode { address: *node, blob: blob.clone() })
            }
            _ => None,
        }
    }
}

/// Passes a failure on, unless a node was not found because the keeper has merged and removed it between the read of its row and its own.
/// Then the rows are to be read again: they name its parent now.
pub(crate) async fn unless_merged(farm: &Farm, job: JobId, failure: FilmError) -> Result<(), FilmError> {
    match &failure {
        FilmError::Lost { node, blob, .. } if farm.store.node_at(job, node, blob).await?.is_none() => Ok(()),
        _ => Err(failure),
    }
}

impl JobRecord {
    /// How its samples are grouped.
    pub(crate) fn sampling(&self) -> Result<Sampling, SamplingError> {
        Sampling::new(self.samples_per_pass, self.samples_per_block)
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
            rows.iter().map(|row| cache.get(&row.place)).collect()
        };
        let mut missing: BTreeMap<&str, Vec<(usize, &NodeRow)>> = BTreeMap::new();
        for (number, (row, node)) in rows.iter().zip(&nodes).enumerate() {
            if node.is_none() {
                missing.entry(&row.place.blob).or_default().push((number, row));
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
    pub(crate) fn keep(&self, place: Place, node: Arc<Node>) {
        self.cache.lock().unwrap_or_else(PoisonError::into_inner).insert(place, node);
    }

    /// Lets go of nodes that are not needed any more.
    pub(crate) fn forget<'a>(&self, places: impl IntoIterator<Item = &'a Place>) {
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        for place in places {
            cache.remove(place);
        }
    }

    /// Names the first of some nodes that a blob is too short for, if it is.
    async fn cut_off(&self, blob: &str, rows: &[(usize, &NodeRow)]) -> Option<FilmError> {
        let bytes = self.blobs.node_blob_bytes(blob).await.ok()?;
        let is_beyond = |place: &Place| place.offset.saturating_add(place.length.unwrap_or(0)) > bytes;
        let (_, row) = rows.iter().find(|(_, row)| is_beyond(&row.place))?;
        Some(FilmError::Damaged { node: row.address, blob: blob.to_owned(), source: None })
    }

    /// Reads numbered nodes that lie in one blob.
    async fn read(&self, blob: &str, rows: Vec<(usize, &NodeRow)>) -> Result<Vec<(usize, Arc<Node>)>, FilmError> {
        let places: Vec<&Place> = rows.iter().map(|(_, row)| &row.place).collect();
        let lost = |source| match rows.first() {
            Some((_, row)) => FilmError::Lost { node: row.address, blob: blob.to_owned(), source },
            None => source.into(),
        };
        let bytes = match self.blobs.nodes(blob, &places).await {
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
            self.keep(row.place.clone(), Arc::clone(node));
        }
        Ok(rows.into_iter().map(|(number, _)| number).zip(nodes).collect())
    }
}

/// Nodes by place, the longest unused of which go first when there are too many.
#[derive(Debug, Default)]
struct NodeCache {
    nodes: BTreeMap<Place, (u64, Arc<Node>)>,
    by_use: BTreeMap<u64, Place>,
    uses: u64,
    bytes: usize,
    limit: usize,
}

impl NodeCache {
    fn get(&mut self, place: &Place) -> Option<Arc<Node>> {
        let (used, node) = self.nodes.get_mut(place)?;
        let node = Arc::clone(node);
        self.uses += 1;
        if let Some(place) = self.by_use.remove(used) {
            self.by_use.insert(self.uses, place);
        }
        *used = self.uses;
        Some(node)
    }

    fn insert(&mut self, place: Place, node: Arc<Node>) {
        self.remove(&place);
        self.uses += 1;
        self.bytes += node.bytes();
        self.by_use.insert(self.uses, place.clone());
        self.nodes.insert(place, (self.uses, node));
        while self.bytes > self.limit {
            let Some((_, oldest)) = self.by_use.pop_first() else { break };
            if let Some((_, node)) = self.nodes.remove(&oldest) {
                self.bytes -= node.bytes();
            }
        }
    }

    fn remove(&mut self, place: &Place) {
        if let Some((used, node)) = self.nodes.remove(place) {
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
        let tile_bytes: u64 = rows.iter().map(|row| row.place.length.unwrap_or(BATCH_BYTES)).sum();
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
    use crate::server;
    use crate::store::Work;
    use crate::store::tests::farm::some_job;

    #[tokio::test]
    async fn rows_are_read_again_when_a_node_that_is_not_there_has_none_any_more() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = server::open(Config::new(directory.path())).await.unwrap();
        let job = some_job();
        farm.store.insert_job(job.clone()).await.unwrap();
        let place = Place { blob: "merged".to_owned(), offset: 0, length: Some(1) };
        let address = NodeAddress { frame: 0, tile: 0, level: 0, index: 0 };
        let failure = farm.film.load(&[NodeRow { address, place, work: Work::default() }]).await.unwrap_err();
        assert!(matches!(failure, FilmError::Lost { .. }), "{failure:?}");
        unless_merged(&farm, job.id, failure).await.unwrap();
        assert!(matches!(unless_merged(&farm, job.id, FilmError::Empty).await, Err(FilmError::Empty)));
    }
}
