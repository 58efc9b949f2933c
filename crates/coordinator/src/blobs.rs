//! The blob store: bytes that are written once and never changed.
//!
//! Assets are named by their content, nodes by an identity of their own. A blob is on disk, synced, before its name is
//! written into the database; that row is the commit. A blob without a row belongs to nobody: it is left by a crash
//! between the two, and swept away when the coordinator starts.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use bytes::Bytes;
use clerestory_api::{ContentHash, JobId};
use futures::stream::{BoxStream, Stream, StreamExt, TryStreamExt};
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt, WriteMultipart};
use uuid::Uuid;

/// Chunks of an upload that may wait for the disk.
const CHUNKS_IN_FLIGHT: usize = 2;

/// Where blobs are kept. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Blobs {
    store: Arc<LocalFileSystem>,
}

/// The blob store failed.
#[derive(Debug, thiserror::Error)]
#[error("the blob store failed")]
pub(crate) struct BlobError(#[from] object_store::Error);

impl BlobError {
    /// Whether the blob is not there.
    pub(crate) fn is_missing(&self) -> bool {
        matches!(self.0, object_store::Error::NotFound { .. })
    }
}

/// An upload failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum UploadError<E> {
    /// The bytes stopped coming.
    #[error("the upload was cut off")]
    Source(E),
    /// More bytes came than are allowed.
    #[error("the upload is larger than {limit} bytes")]
    TooLarge {
        /// Most bytes.
        limit: u64,
    },
    /// The bytes have another hash.
    #[error("the content has the hash {found}")]
    HashMismatch {
        /// Their hash.
        found: ContentHash,
    },
    /// They could not be stored.
    #[error(transparent)]
    Store(#[from] BlobError),
}

impl<E> From<object_store::Error> for UploadError<E> {
    fn from(error: object_store::Error) -> Self {
        Self::Store(error.into())
    }
}

impl Blobs {
    /// Opens the store in a directory, which is made if there is none.
    pub(crate) fn open(directory: PathBuf) -> io::Result<Self> {
        fs::create_dir_all(&directory)?;
        remove_unfinished(&directory)?;
        let store = LocalFileSystem::new_with_prefix(&directory).map_err(io::Error::other)?.with_fsync(true);
        Ok(Self { store: Arc::new(store) })
    }

    /// Stores the bytes of an asset as they come, if they have the promised hash and are not too many. Answers their
    /// number.
    pub(crate) async fn put_asset<S, E>(
        &self,
        hash: ContentHash,
        limit: u64,
        mut source: S,
    ) -> Result<u64, UploadError<E>>
    where
        S: Stream<Item = Result<Bytes, E>> + Unpin,
    {
        let mut upload = WriteMultipart::new(self.store.put_multipart(&asset_path(hash)).await?);
        let mut hasher = blake3::Hasher::new();
        let mut size = 0_u64;
        let outcome = loop {
            match source.next().await {
                None => break Ok(()),
                Some(Err(error)) => break Err(UploadError::Source(error)),
                Some(Ok(bytes)) => {
                    size += bytes.len() as u64;
                    if size > limit {
                        break Err(UploadError::TooLarge { limit });
                    }
                    hasher.update(&bytes);
                    upload.wait_for_capacity(CHUNKS_IN_FLIGHT).await?;
                    upload.put(bytes);
                }
            }
        };
        let found = ContentHash::from(*hasher.finalize().as_bytes());
        let outcome = outcome.and(if found == hash { Ok(()) } else { Err(UploadError::HashMismatch { found }) });
        match outcome {
            Ok(()) => {
                upload.finish().await?;
                Ok(size)
            }
            Err(error) => {
                upload.abort().await?;
                Err(error)
            }
        }
    }

    /// The bytes of an asset.
    pub(crate) async fn asset(&self, hash: ContentHash) -> Result<Bytes, BlobError> {
        Ok(self.store.get(&asset_path(hash)).await?.bytes().await?)
    }

    /// Size of an asset, and its bytes as they are read.
    pub(crate) async fn asset_stream(
        &self,
        hash: ContentHash,
    ) -> Result<(u64, BoxStream<'static, Result<Bytes, BlobError>>), BlobError> {
        let asset = self.store.get(&asset_path(hash)).await?;
        Ok((asset.meta.size, asset.into_stream().map_err(BlobError).boxed()))
    }

    /// Stores a node under a new name, which is answered when the bytes are safe on disk.
    pub(crate) async fn put_node(&self, job: JobId, bytes: Vec<u8>) -> Result<String, BlobError> {
        let name = format!("nodes/{job}/{}", Uuid::now_v7());
        self.store.put(&Path::from(name.as_str()), bytes.into()).await?;
        Ok(name)
    }

    /// The bytes of a node.
    pub(crate) async fn node(&self, name: &str) -> Result<Bytes, BlobError> {
        Ok(self.store.get(&Path::from(name)).await?.bytes().await?)
    }

    /// Removes nodes. One that cannot be removed is left for the sweep at the next start.
    pub(crate) async fn remove_nodes(&self, names: Vec<String>) {
        for name in names {
            if let Err(error) = self.store.delete(&Path::from(name.as_str())).await {
                tracing::warn!(blob = name, %error, "a node that is not needed any more could not be removed");
            }
        }
    }

    /// Removes all nodes but those, and answers how many.
    pub(crate) async fn sweep_nodes(&self, known: &BTreeSet<String>) -> Result<usize, BlobError> {
        let found: Vec<_> = self.store.list(Some(&Path::from("nodes"))).try_collect().await?;
        let orphans: Vec<String> =
            found.into_iter().map(|blob| blob.location.to_string()).filter(|name| !known.contains(name)).collect();
        let count = orphans.len();
        self.remove_nodes(orphans).await;
        Ok(count)
    }
}

/// Spread over directories by the first byte, since some file systems are slow with very large directories.
fn asset_path(hash: ContentHash) -> Path {
    let hash = hash.to_string();
    let (directory, _) = hash.split_at(2);
    Path::from(format!("assets/{directory}/{hash}"))
}

/// Removes what uploads had written when the coordinator was killed: `LocalFileSystem` writes to `NAME#NUMBER` and
/// renames.
fn remove_unfinished(directory: &std::path::Path) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            remove_unfinished(&entry.path())?;
        } else if entry.file_name().to_string_lossy().contains('#') {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use futures::stream;

    use super::*;

    fn source(pieces: &[&'static str]) -> impl Stream<Item = Result<Bytes, String>> + Unpin {
        stream::iter(pieces.iter().map(|piece| Ok(Bytes::from_static(piece.as_bytes()))).collect::<Vec<_>>())
    }

    fn hash(content: &str) -> ContentHash {
        ContentHash::from(*blake3::hash(content.as_bytes()).as_bytes())
    }

    fn files(directory: &std::path::Path) -> usize {
        let entries = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap());
        entries.map(|entry| if entry.path().is_dir() { files(&entry.path()) } else { 1 }).sum()
    }

    #[tokio::test]
    async fn an_asset_is_kept_only_when_it_is_what_its_name_says() {
        let directory = tempfile::tempdir().unwrap();
        let blobs = Blobs::open(directory.path().to_owned()).unwrap();
        assert_eq!(blobs.put_asset(hash("glass"), 100, source(&["gl", "ass"])).await.unwrap(), 5);
        assert_eq!(blobs.asset(hash("glass")).await.unwrap(), "glass");
        let wrong = blobs.put_asset(hash("lead"), 100, source(&["glass"])).await.unwrap_err();
        assert!(matches!(wrong, UploadError::HashMismatch { found } if found == hash("glass")));
        let large = blobs.put_asset(hash("glass"), 4, source(&["glass"])).await.unwrap_err();
        assert!(matches!(large, UploadError::TooLarge { limit: 4 }));
        let cut_off = stream::iter([Ok(Bytes::from_static(b"le")), Err("gone")]);
        assert!(matches!(blobs.put_asset(hash("lead"), 100, cut_off).await, Err(UploadError::Source("gone"))));
        assert!(blobs.asset(hash("lead")).await.is_err());
        assert_eq!(files(directory.path()), 1, "refused uploads leave nothing behind");
    }

    #[tokio::test]
    async fn the_sweep_removes_what_no_row_names_and_what_was_half_written() {
        let directory = tempfile::tempdir().unwrap();
        let blobs = Blobs::open(directory.path().to_owned()).unwrap();
        let job = JobId::from(Uuid::now_v7());
        let kept = blobs.put_node(job, b"kept".to_vec()).await.unwrap();
        let orphan = blobs.put_node(job, b"orphan".to_vec()).await.unwrap();
        fs::write(directory.path().join(format!("{kept}#1")), b"half").unwrap();
        let blobs = Blobs::open(directory.path().to_owned()).unwrap();
        assert_eq!(blobs.sweep_nodes(&BTreeSet::from([kept.clone()])).await.unwrap(), 1);
        assert_eq!(blobs.node(&kept).await.unwrap(), "kept");
        assert!(blobs.node(&orphan).await.is_err());
        assert_eq!(files(directory.path()), 1);
    }
}
