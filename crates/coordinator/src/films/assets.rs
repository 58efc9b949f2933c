//! Assets: content that scenes and references name, stored under its hash.
//!
//! No worker can render the file of a scene or a reference again. A job that needs a lost one is held until somebody
//! uploads it.

use std::sync::Arc;

use bytes::Bytes;
use clerestory_api::ContentHash;
use futures::stream::{self, BoxStream, Stream, StreamExt, TryStreamExt};

use super::error::FilmError;
use crate::blobs::{BlobError, Blobs, UploadError};
use crate::clock::Clock;
use crate::store::{Store, StoreError};
use crate::watch::notifications::{Notification, Notifications};

/// Assets that are looked up at the same time.
const LOOKUPS: usize = 8;

/// An asset of the farm: its size, and its bytes as they are read.
pub(crate) type AssetStream = (u64, BoxStream<'static, Result<Bytes, BlobError>>);

/// An asset cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AssetError {
    /// It was never uploaded, or it is lost.
    #[error(
        "no asset with the hash {0} is here: it has not been uploaded, or it is lost; upload it, or submit its scene \
         again"
    )]
    Unknown(ContentHash),
    /// The database or the blob store failed.
    #[error(transparent)]
    Film(#[from] FilmError),
}

impl From<BlobError> for AssetError {
    fn from(error: BlobError) -> Self {
        Self::Film(error.into())
    }
}

impl From<StoreError> for AssetError {
    fn from(error: StoreError) -> Self {
        Self::Film(error.into())
    }
}

/// An upload failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AssetUploadError<E> {
    /// It did not arrive as promised, or could not be stored.
    #[error("the upload failed")]
    Upload(UploadError<E>),
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// The assets of a farm.
#[derive(Debug)]
pub(crate) struct Assets {
    store: Store,
    blobs: Blobs,
    notifications: Arc<Notifications>,
    clock: Clock,
}

impl Assets {
    /// Assets in a blob store.
    pub(crate) fn new(store: Store, blobs: Blobs, notifications: Arc<Notifications>, clock: Clock) -> Self {
        Self { store, blobs, notifications, clock }
    }

    /// Whether an asset was uploaded and is still there. A blob store that was restored may lack assets that the
    /// database knows.
    pub(crate) async fn has(&self, hash: ContentHash) -> Result<bool, FilmError> {
        Ok(self.store.has_asset(hash).await? && self.blobs.has_asset(hash).await?)
    }

    /// Those of some assets that are not there, in their order.
    pub(crate) async fn missing(
        &self,
        hashes: impl IntoIterator<Item = ContentHash>,
    ) -> Result<Vec<ContentHash>, FilmError> {
        let look_up = |hash| async move { Ok::<_, FilmError>((hash, self.has(hash).await?)) };
        let found = stream::iter(hashes).map(look_up).buffered(LOOKUPS);
        let found: Vec<(ContentHash, bool)> = found.try_collect().await?;
        Ok(found.into_iter().filter(|(_, is_there)| !is_there).map(|(hash, _)| hash).collect())
    }

    /// Stores an upload of at most `limit` bytes.
    pub(crate) async fn put<S, E>(&self, hash: ContentHash, limit: u64, source: S) -> Result<(), AssetUploadError<E>>
    where
        S: Stream<Item = Result<Bytes, E>> + Unpin,
    {
        let size = self.blobs.put_asset(hash, limit, source).await.map_err(AssetUploadError::Upload)?;
        self.store.insert_asset(hash, size, self.clock.now_ms()).await?;
        tracing::info!(asset = %hash, size, "asset stored");
        Ok(self.release_jobs(hash).await?)
    }

    /// Opens an asset.
    pub(crate) async fn open(&self, hash: ContentHash) -> Result<AssetStream, AssetError> {
        if !self.store.has_asset(hash).await? {
            return Err(AssetError::Unknown(hash));
        }
        let (size, stream) = match self.blobs.asset_stream(hash).await {
            Err(error) if error.is_missing() => {
                self.lose(hash).await?;
                return Err(AssetError::Unknown(hash));
            }
            asset => asset?,
        };
        // Nothing would be read of an empty file, so that its damage would stay unseen.
        if size != self.store.asset_bytes(std::iter::once(hash)).await? {
            self.check(hash).await?;
            return Err(AssetError::Unknown(hash));
        }
        Ok((size, stream))
    }

    /// Checks an asset that did not have its content when it was read. A damaged asset is removed, so that it can be
    /// uploaded again, and the jobs that need it are held.
    pub(crate) async fn check(&self, hash: ContentHash) -> Result<(), FilmError> {
        if self.blobs.keep_if_whole(hash).await? { Ok(()) } else { self.lose(hash).await }
    }

    /// Holds the open jobs that need an asset which is not there.
    pub(crate) async fn lose(&self, hash: ContentHash) -> Result<(), FilmError> {
        if !self.blobs.is_of(self.store.identity().await?.farm).await? {
            // This is another folder or bucket, which holds nothing of the farm.
            return Ok(());
        }
        for job in self.store.hold_for_lost_asset(hash, self.clock.now_ms()).await? {
            tracing::error!(%job, asset = %hash, "a file of the job is lost or damaged; the job is held until it is \
                                                  uploaded again");
            self.notifications.publish(Notification::Job(job));
        }
        // It may have been uploaded meanwhile.
        if self.blobs.has_asset(hash).await? {
            self.release_jobs(hash).await?;
        }
        Ok(())
    }

    /// Releases the jobs that were held for an asset which is there.
    pub(crate) async fn release_jobs(&self, hash: ContentHash) -> Result<(), StoreError> {
        for job in self.store.release_for_asset(hash, self.clock.now_ms()).await? {
            tracing::info!(%job, asset = %hash, "the job goes on: what it lacked is here");
            self.notifications.publish(Notification::Job(job));
        }
        Ok(())
    }

    /// Holds the open jobs whose assets are missing, and releases the jobs whose assets are back.
    pub(crate) async fn check_all(&self) -> Result<(), FilmError> {
        let needed = self.store.needed_assets().await?;
        let look_up = |hash: ContentHash| async move { Ok::<_, BlobError>((hash, self.blobs.has_asset(hash).await?)) };
        let found: Vec<_> = stream::iter(needed).map(look_up).buffered(LOOKUPS).try_collect().await?;
        for (hash, is_there) in found {
            if is_there {
                self.release_jobs(hash).await?;
            } else {
                self.lose(hash).await?;
            }
        }
        Ok(())
    }
}
