//! The film of a job: from rows and blobs to nodes, and from nodes to an image.
//!
//! The rows say which nodes there are; their blobs never change. So decoded nodes can be kept by where they lie
//! without ever being wrong, and everything else is computed from them when it is asked for.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use clerestory_render_core::film::{
    self, FilmTile, FrameImage, ImageError, ImageMetadata, InsertError, Node, NodeAddress, Sampling, SamplingError,
    SumError, TileSum,
};
use futures::stream::{self, StreamExt, TryStreamExt};

use crate::blobs::{BlobError, Blobs, Place};
use crate::farm::Farm;
use crate::store::{JobRecord, NodeRow, StoreError, Work};

/// Blobs read at the same time.
const READS: usize = 8;

/// The film cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FilmError {
    /// No node has been accepted.
    #[error("there is no node yet")]
    Empty,
    /// A stored node has lost bits, or is not the one that its row names.
    #[error("the stored node {node} in {blob} cannot be used")]
    Damaged {
        /// The node.
        node: NodeAddress,
        /// Name of its blob.
        blob: String,
        /// What is wrong, unless it is another node altogether.
        source: Option<film::StoreError>,
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
    Write(#[from] film::OpenExrError),
    /// A preview could not be written.
    #[error("the preview cannot be written")]
    Preview(#[from] film::PreviewError),
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
    /// Whether the film itself is wrong, as far as what was read belongs together.
    pub(crate) fn is_damage(&self) -> bool {
        matches!(self, Self::Damaged { .. } | Self::Inconsistent(_) | Self::Incomplete(_))
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

    /// The nodes of these rows, in their order.
    pub(crate) async fn load(&self, rows: &[NodeRow]) -> Result<Vec<Arc<Node>>, FilmError> {
        let nodes = rows.iter().map(|row| self.node(row));
        stream::iter(nodes.collect::<Vec<_>>()).buffered(READS).try_collect().await
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

    async fn node(&self, row: &NodeRow) -> Result<Arc<Node>, FilmError> {
        let cached = self.cache.lock().unwrap_or_else(PoisonError::into_inner).get(&row.place);
        if let Some(node) = cached {
            return Ok(node);
        }
        let (address, place) = (row.address, &row.place);
        let bytes = self.blobs.node(place).await.map_err(|error| match error {
            error if error.is_missing() => FilmError::Lost { node: address, blob: place.blob.clone(), source: error },
            error => error.into(),
        })?;
        let damaged = |source| FilmError::Damaged { node: address, blob: place.blob.clone(), source };
        let node = tokio::task::spawn_blocking(move || film::store::decode(&bytes)).await?;
        let node = node.map_err(|error| damaged(Some(error)))?;
        if node.address() != address {
            return Err(damaged(None));
        }
        let node = Arc::new(node);
        self.keep(place.clone(), Arc::clone(&node));
        Ok(node)
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

/// Up to which pass an image is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Extent {
    /// The same in every tile, all of which must be complete up to there.
    Passes(u32),
    /// As far as each tile is complete from its first pass on. Such an image can be rendered again from its pass counts;
    /// one with holes could not.
    Complete,
}

/// The image of a frame, with the work that it took. The nodes are those of the rows, in their order.
///
/// # Errors
///
/// [`FilmError::Empty`] when no tile has a complete pass; otherwise when the nodes do not make the image.
pub(crate) fn assemble(
    job: &JobRecord,
    rows: &[NodeRow],
    nodes: &[Arc<Node>],
    extent: Extent,
    mut metadata: ImageMetadata,
) -> Result<FrameImage, FilmError> {
    let mut sums = Vec::new();
    for nodes in nodes.chunk_by(|a, b| a.address().tile == b.address().tile) {
        let hold = match extent {
            Extent::Passes(passes) => Some(passes),
            Extent::Complete => None,
        };
        let Some(tile) = film_tile(job, nodes, hold)? else { continue };
        let passes = hold.unwrap_or_else(|| tile.complete_passes());
        if passes > 0 {
            sums.push(tile.sum(passes)?);
        }
    }
    check_complete(job, &sums, extent)?;
    let work = work_of(rows, &sums);
    metadata.counters = work.counters;
    if !work.builds.iter().eq([&metadata.build]) {
        metadata.worker_builds = work.builds.into_iter().collect();
    }
    Ok(FrameImage::assemble(&job.grid, &sums, metadata)?)
}

/// The work that the sums took; nodes beyond them are not in the image.
fn work_of(rows: &[NodeRow], sums: &[TileSum]) -> Work {
    let summed: BTreeMap<u32, u32> = sums.iter().map(|sum| (sum.tile_index, sum.passes)).collect();
    let mut work = Work::default();
    for row in rows {
        let passes = row.address.passes();
        if summed.get(&row.address.tile).is_some_and(|summed| passes.first + passes.count <= *summed) {
            work += &row.work;
        }
    }
    work
}

fn check_complete(job: &JobRecord, sums: &[TileSum], extent: Extent) -> Result<(), FilmError> {
    match extent {
        _ if sums.is_empty() => Err(FilmError::Empty),
        Extent::Passes(wanted) if (sums.len() as u64) < u64::from(job.grid.len()) => {
            Err(SumError::Incomplete { wanted, complete: 0 }.into())
        }
        _ => Ok(()),
    }
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
        build: farm.config.build.clone(),
        worker_builds: Vec::new(),
        missing_light: job.missing_light.clone(),
        counters: Default::default(),
        elapsed_seconds: elapsed_ms.map(|elapsed_ms| elapsed_ms as f64 / 1000.0),
    })
}
