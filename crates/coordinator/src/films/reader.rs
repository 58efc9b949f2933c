//! The film of a job: from rows and blobs to nodes.
//!
//! Rows name the nodes, and their blobs never change. So a cache of decoded nodes by blob range is never stale, and
//! everything else is computed from nodes on demand.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use clerestory_api::JobId;
use clerestory_film::{Node, NodeAddress};
use futures::stream::{self, StreamExt, TryStreamExt};

use super::error::FilmError;
use crate::blobs::Blobs;
use crate::model::{BlobRange, NodeRow, Removed};
use crate::store::Store;

/// Blobs read at the same time.
const READS: usize = 8;

/// Reads nodes, and caches decoded ones.
#[derive(Debug)]
pub(crate) struct FilmReader {
    /// The rows of the nodes.
    pub(super) store: Store,
    blobs: Blobs,
    cache: Mutex<NodeCache>,
}

impl FilmReader {
    /// A reader that caches up to `cache_bytes` of nodes.
    pub(crate) fn new(store: Store, blobs: Blobs, cache_bytes: usize) -> Self {
        Self { store, blobs, cache: Mutex::new(NodeCache { limit: cache_bytes, ..NodeCache::default() }) }
    }

    /// The nodes of these rows, in their order. Nodes in one blob are read together.
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

    /// Caches a node that was just stored or read.
    pub(crate) fn cache(&self, blob_range: BlobRange, node: Arc<Node>) {
        self.cache.lock().unwrap_or_else(PoisonError::into_inner).insert(blob_range, node);
    }

    /// Frees what was removed from films: cached nodes, and blobs without an accepted node.
    pub(crate) async fn release(&self, removed: Removed) {
        {
            let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
            removed.blob_ranges.iter().for_each(|blob_range| cache.remove(blob_range));
        }
        self.blobs.remove(removed.blobs).await;
    }

    /// Returns the failure, unless a node was not found because a merge removed it between the read of its row and its
    /// own. Then the caller reads the rows again: they name the parent now.
    pub(crate) async fn unless_merged(&self, job: JobId, failure: FilmError) -> Result<(), FilmError> {
        match &failure {
            FilmError::Lost { node, blob, .. } if self.store.node_at(job, node, blob).await?.is_none() => Ok(()),
            _ => Err(failure),
        }
    }

    /// The first of some nodes that lies beyond the end of its blob.
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
            self.cache(row.blob_range.clone(), Arc::clone(node));
        }
        Ok(rows.into_iter().map(|(number, _)| number).zip(nodes).collect())
    }
}

/// Nodes by their blob range. The least recently used are evicted first.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Work;
    use crate::store::Source;
    use crate::store::tests::farm::some_job;

    #[tokio::test]
    async fn rows_are_read_again_when_a_node_that_is_not_there_has_none_any_more() {
        let directory = tempfile::tempdir().unwrap();
        let store = Store::open(Source::file(&directory.path().join("farm.sqlite"))).await.unwrap();
        let blobs = Blobs::in_directory(directory.path().join("blobs")).unwrap();
        let reader = FilmReader::new(store.clone(), blobs, 0);
        let job = some_job();
        store.insert_job(job.clone()).await.unwrap();
        let blob_range = BlobRange { blob: "merged".to_owned(), offset: 0, length: Some(1) };
        let address = NodeAddress { frame: 0, tile: 0, level: 0, index: 0 };
        let failure = reader.load(&[NodeRow { address, blob_range, work: Work::default() }]).await.unwrap_err();
        assert!(matches!(failure, FilmError::Lost { .. }), "{failure:?}");
        reader.unless_merged(job.id, failure).await.unwrap();
        assert!(matches!(reader.unless_merged(job.id, FilmError::Empty).await, Err(FilmError::Empty)));
    }
}
