//! The blob store: bytes that are written once and never change.
//!
//! Assets are named by their content. The nodes of one upload lie one after the other in one blob with an identity of
//! its own. So they cost one sync or one request together. A blob is removed after the last of its nodes.
//!
//! A blob is synced to disk, or acknowledged by the object store, before its name is written into the database. That
//! row is the commit. A crash between the two leaves a blob without a row, which garbage collection removes. A store
//! bears the mark of its farm, so that this never removes a blob that another farm's database names.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::PathBuf;
use std::sync::Arc;

use bytes::Bytes;
use clerestory_api::{ContentHash, JobId, LeaseId};
use futures::stream::{self, BoxStream, Stream, StreamExt, TryStreamExt};
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt, PutMode, PutPayload, WriteMultipart};
use tokio::sync::Mutex;
use uuid::Uuid;

use crate::blobs::bucket::Bucket;
use crate::directory::{self, Folders};
use crate::error_chain::in_one_line;
use crate::model::{BlobRange, Identity};

/// Chunks of an upload that may wait for the disk.
const CHUNKS_IN_FLIGHT: usize = 2;

/// A blob store. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Blobs {
    pub(super) store: Arc<dyn ObjectStore>,
    /// The folders of a directory. `LocalFileSystem` makes folders too, but does not sync the name of one that a
    /// killed process made.
    folders: Option<Arc<Folders>>,
    /// Held while an asset is put into its place, and while a damaged one is checked and removed.
    assets: Arc<Mutex<()>>,
}

/// Folder of the blobs of nodes.
const NODES: &str = "nodes";

/// Name of the blob with the mark of the farm.
const OWNER: &str = ".clerestory-farm";

/// Name of the blob of write tests.
const TRIED: &str = ".clerestory-tried";

/// Bytes of it: more than a file system stores beside a file's name.
const TRIED_BYTES: usize = 8 << 10;

/// A blob store cannot be used by a farm.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ClaimError {
    /// It is another farm's.
    #[error("the blobs there belong to the farm {owner}, and the database to the farm {farm}")]
    Foreign {
        /// Whose it is.
        owner: String,
        /// Who asked.
        farm: Uuid,
    },
    /// It holds nodes without a mark.
    #[error("there are {nodes} nodes there of which the database of the farm {farm} knows none")]
    Unknown {
        /// How many.
        nodes: usize,
        /// Who asked.
        farm: Uuid,
    },
    /// It has no mark, and the farm has another store.
    #[error("the farm {farm} has its blobs elsewhere")]
    Elsewhere {
        /// Who asked.
        farm: Uuid,
    },
    /// It failed.
    #[error(transparent)]
    Store(#[from] BlobError),
}

/// The blob store failed. Its own messages contain their causes, some of them several times.
#[derive(Debug, thiserror::Error)]
#[error("the blob store failed: {}", in_one_line(.0))]
pub(crate) struct BlobError(object_store::Error);

impl From<object_store::Error> for BlobError {
    fn from(error: object_store::Error) -> Self {
        Self(error)
    }
}

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
    pub(crate) fn in_directory(directory: PathBuf) -> io::Result<Self> {
        directory::create(&directory)?;
        remove_unfinished(&directory)?;
        let store = LocalFileSystem::new_with_prefix(&directory).map_err(io::Error::other)?.with_fsync(true);
        Ok(Self { store: Arc::new(store), folders: Some(Arc::new(Folders::below(directory))), assets: Arc::default() })
    }

    /// Opens the store in an existing bucket.
    pub(crate) fn in_bucket(bucket: &Bucket) -> Result<Self, BlobError> {
        Ok(Self { store: Arc::new(bucket.client()?), folders: None, assets: Arc::default() })
    }

    /// Claims the store for a farm whose database names the nodes in `known`. A store without a mark is marked when it
    /// holds no nodes, or some of these, and the farm has no other store.
    pub(crate) async fn claim(&self, identity: Identity, known: &BTreeSet<String>) -> Result<(), ClaimError> {
        let farm = identity.farm;
        if self.owner().await?.is_none() {
            let found = self.node_blobs().await?;
            if identity.has_blobs {
                return Err(ClaimError::Elsewhere { farm });
            }
            if !found.is_empty() && found.iter().all(|name| !known.contains(name)) {
                return Err(ClaimError::Unknown { nodes: found.len(), farm });
            }
            let marked = self.store.put_opts(&Path::from(OWNER), farm.to_string().into(), PutMode::Create.into()).await;
            if let Err(error) = marked
                && !matches!(error, object_store::Error::AlreadyExists { .. })
            {
                return Err(BlobError(error).into());
            }
        }
        // Some stores let two farms that start together both write the mark.
        match self.owner().await? {
            Some(owner) if owner == farm.to_string() => Ok(()),
            owner => Err(ClaimError::Foreign { owner: owner.unwrap_or_default(), farm }),
        }
    }

    /// Whether the store bears the mark of this farm.
    pub(crate) async fn is_of(&self, farm: Uuid) -> Result<bool, BlobError> {
        Ok(self.owner().await?.is_some_and(|owner| owner == farm.to_string()))
    }

    /// The farm whose mark the store bears.
    async fn owner(&self) -> Result<Option<String>, BlobError> {
        match self.store.get(&Path::from(OWNER)).await {
            Ok(found) => Ok(Some(String::from_utf8_lossy(&found.bytes().await?).into_owned())),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Writes a small blob, to prove that the store takes blobs.
    pub(crate) async fn try_to_write(&self) -> Result<(), BlobError> {
        self.store.put(&Path::from(TRIED), Bytes::from_static(&[0; TRIED_BYTES]).into()).await?;
        Ok(())
    }

    /// Names of all blobs of nodes.
    pub(crate) async fn node_blobs(&self) -> Result<BTreeSet<String>, BlobError> {
        self.blobs_under(NODES.to_owned()).await
    }

    /// Names of all blobs of a job's nodes.
    pub(crate) async fn node_blobs_of(&self, job: JobId) -> Result<BTreeSet<String>, BlobError> {
        self.blobs_under(format!("{NODES}/{job}")).await
    }

    async fn blobs_under(&self, folder: String) -> Result<BTreeSet<String>, BlobError> {
        let found = self.store.list(Some(&Path::from(folder)));
        Ok(found.map_ok(|blob| blob.location.to_string()).try_collect().await?)
    }

    /// Whether an asset is there.
    pub(crate) async fn has_asset(&self, hash: ContentHash) -> Result<bool, BlobError> {
        match self.store.head(&asset_path(hash)).await {
            Ok(_) => Ok(true),
            Err(object_store::Error::NotFound { .. }) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Stores the bytes of an asset as they arrive, if they have the promised hash and are not too many. Answers their
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
        let path = asset_path(hash);
        self.make_folder_of(&path).await?;
        let mut upload = WriteMultipart::new(self.store.put_multipart(&path).await?);
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
                    if let Err(error) = upload.wait_for_capacity(CHUNKS_IN_FLIGHT).await {
                        break Err(error.into());
                    }
                    upload.put(bytes);
                }
            }
        };
        let found = ContentHash::from(*hasher.finalize().as_bytes());
        let outcome = outcome.and(if found == hash { Ok(()) } else { Err(UploadError::HashMismatch { found }) });
        match outcome {
            Ok(()) => {
                let _turn = self.assets.lock().await;
                upload.finish().await?;
                Ok(size)
            }
            Err(error) => {
                if let Err(abort) = upload.abort().await {
                    tracing::warn!(error = %abort, "what was stored of a refused upload could not be removed");
                }
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

    /// Removes a damaged asset. Answers whether the asset is there and has its content.
    pub(crate) async fn keep_if_whole(&self, hash: ContentHash) -> Result<bool, BlobError> {
        let _turn = self.assets.lock().await;
        let mut stream = match self.asset_stream(hash).await {
            Ok((_, stream)) => stream,
            Err(error) if error.is_missing() => return Ok(false),
            Err(error) => return Err(error),
        };
        let mut hasher = blake3::Hasher::new();
        while let Some(piece) = stream.try_next().await? {
            hasher.update(&piece);
        }
        let is_whole = hasher.finalize().as_bytes() == hash.as_bytes();
        if !is_whole {
            self.remove(vec![asset_path(hash).to_string()]).await;
        }
        Ok(is_whole)
    }

    /// An asset as a file that is read in pieces.
    pub(crate) async fn asset_file(&self, hash: ContentHash) -> Result<AssetFile, BlobError> {
        let path = asset_path(hash);
        let size = self.store.head(&path).await?.size;
        Ok(AssetFile { store: self.store.clone(), path, size, position: 0, piece: Bytes::new(), piece_start: 0 })
    }

    /// Makes the folder of a blob, in a directory.
    async fn make_folder_of(&self, blob: &Path) -> Result<(), BlobError> {
        let folder = std::path::Path::new(blob.as_ref()).parent();
        let (Some(folders), Some(folder)) = (self.folders.clone(), folder) else { return Ok(()) };
        if folders.has(folder) {
            return Ok(());
        }
        let folder = folder.to_owned();
        let made = tokio::task::spawn_blocking(move || folders.make(&folder));
        let made = made.await.unwrap_or_else(|error| Err(io::Error::other(error)));
        made.map_err(|source| BlobError(object_store::Error::Generic { store: "directory", source: Box::new(source) }))
    }

    /// Stores a piece of a partial under a lease.
    pub(crate) async fn put_piece(&self, lease: LeaseId, hash: ContentHash, piece: Bytes) -> Result<(), BlobError> {
        let path = piece_path(lease, hash);
        self.make_folder_of(&path).await?;
        self.store.put(&path, piece.into()).await?;
        Ok(())
    }

    /// Bytes of a piece of a partial, or `None` when it is not there.
    pub(crate) async fn piece_size(&self, lease: LeaseId, hash: ContentHash) -> Result<Option<u64>, BlobError> {
        match self.store.head(&piece_path(lease, hash)).await {
            Ok(found) => Ok(Some(found.size)),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// A piece of a partial.
    pub(crate) async fn piece(&self, lease: LeaseId, hash: ContentHash) -> Result<Bytes, BlobError> {
        Ok(self.store.get(&piece_path(lease, hash)).await?.bytes().await?)
    }

    /// Removes pieces of a partial.
    pub(crate) async fn remove_pieces(&self, lease: LeaseId, pieces: &[ContentHash]) {
        let names: BTreeSet<String> = pieces.iter().map(|hash| piece_path(lease, *hash).to_string()).collect();
        self.remove(names.into_iter().collect()).await;
    }

    /// Names of all pieces of partials.
    pub(crate) async fn pieces(&self) -> Result<BTreeSet<String>, BlobError> {
        self.blobs_under("pieces".to_owned()).await
    }

    /// Stores nodes in one new blob. Answers their ranges when the bytes are safe on disk.
    pub(crate) async fn put_nodes(&self, job: JobId, nodes: Vec<Vec<u8>>) -> Result<Vec<BlobRange>, BlobError> {
        let blob = format!("{NODES}/{job}/{}", Uuid::now_v7());
        let mut end = 0;
        let blob_range = |node: &Vec<u8>| {
            let (offset, length) = (end, node.len() as u64);
            end += length;
            BlobRange { blob: blob.clone(), offset, length: Some(length) }
        };
        let blob_ranges = nodes.iter().map(blob_range).collect();
        let bytes: PutPayload = nodes.into_iter().map(Bytes::from).collect();
        let path = Path::from(blob.as_str());
        self.make_folder_of(&path).await?;
        self.store.put(&path, bytes).await?;
        Ok(blob_ranges)
    }

    /// The bytes of nodes in one blob.
    pub(crate) async fn nodes(&self, blob: &str, blob_ranges: &[&BlobRange]) -> Result<Vec<Bytes>, BlobError> {
        let path = Path::from(blob);
        let range =
            |blob_range: &&BlobRange| blob_range.length.map(|length| blob_range.offset..blob_range.offset + length);
        match blob_ranges.iter().map(range).collect::<Option<Vec<_>>>() {
            Some(ranges) => Ok(self.store.get_ranges(&path, &ranges).await?),
            None => {
                let bytes = self.store.get(&path).await?.bytes().await?;
                Ok(vec![bytes; blob_ranges.len()])
            }
        }
    }

    /// Bytes of a blob of nodes.
    pub(crate) async fn node_blob_bytes(&self, blob: &str) -> Result<u64, BlobError> {
        Ok(self.store.head(&Path::from(blob)).await?.size)
    }

    /// Removes blobs of nodes. A blob that cannot be removed is left for garbage collection. Answers the number of
    /// removed blobs.
    pub(crate) async fn remove(&self, names: Vec<String>) -> usize {
        let paths = stream::iter(names.into_iter().map(|name| Ok(Path::from(name)))).boxed();
        let mut removed = self.store.delete_stream(paths);
        let mut count = 0;
        while let Some(outcome) = removed.next().await {
            match outcome {
                Ok(_) => count += 1,
                // The store's message names the blob.
                Err(error) => tracing::warn!(%error, "a blob that is not needed any more could not be removed"),
            }
        }
        count
    }
}

/// Bytes of one read of an asset file.
const PIECE: u64 = 1 << 20;

/// An asset that a blocking thread reads in pieces.
#[derive(Debug)]
pub(crate) struct AssetFile {
    store: Arc<dyn ObjectStore>,
    path: Path,
    size: u64,
    position: u64,
    /// The last piece, and its position.
    piece: Bytes,
    piece_start: u64,
}

impl Read for AssetFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.position >= self.size || buffer.is_empty() {
            return Ok(0);
        }
        let is_here = (self.piece_start..self.piece_start + self.piece.len() as u64).contains(&self.position);
        if !is_here {
            let range = self.position..self.size.min(self.position + PIECE);
            let read = self.store.get_range(&self.path, range);
            self.piece = tokio::runtime::Handle::current().block_on(read)?;
            self.piece_start = self.position;
        }
        let ahead = self.piece.get((self.position - self.piece_start) as usize..).unwrap_or_default();
        let count = ahead.len().min(buffer.len());
        buffer[..count].copy_from_slice(&ahead[..count]);
        self.position += count as u64;
        Ok(count)
    }
}

impl Seek for AssetFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let target = match to {
            SeekFrom::Start(position) => Some(position),
            SeekFrom::End(offset) => self.size.checked_add_signed(offset),
            SeekFrom::Current(offset) => self.position.checked_add_signed(offset),
        };
        self.position = target.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}

/// Folders by the first byte, because some file systems are slow with very large folders.
fn asset_path(hash: ContentHash) -> Path {
    let hash = hash.to_string();
    let (directory, _) = hash.split_at(2);
    Path::from(format!("assets/{directory}/{hash}"))
}

fn piece_path(lease: LeaseId, hash: ContentHash) -> Path {
    Path::from(format!("pieces/{lease}-{hash}"))
}

/// Removes unfinished uploads of a killed coordinator: `LocalFileSystem` writes to `NAME#NUMBER` and renames.
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
