//! Where a coordinator stores: its data directory, its database and its blobs.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};

use super::error::RunError;
use crate::blobs::{BlobError, Blobs, ClaimError};
use crate::config::Config;
use crate::directory;
use crate::error_chain::in_one_line;
use crate::films::garbage_collection::collect_alone;
use crate::jobs::deadlines::follow_clock;
use crate::store::{Source, Store, StoreError};

/// The opened storage of a farm.
#[derive(Debug)]
pub(super) struct Storage {
    /// The database.
    pub(super) store: Store,
    /// Assets and nodes.
    pub(super) blobs: Blobs,
}

impl Storage {
    /// Opens the storage of a farm, and puts it in order after the end of the last coordinator, however that ended.
    pub(super) async fn open(config: &Config) -> Result<Self, RunError> {
        let file = config.data_directory.join("farm.sqlite");
        let source = config.database.as_ref().map_or_else(|| Ok(Source::file(&file)), Source::postgres);
        let source = source.map_err(|error| RunError::DatabaseAddress { problem: in_one_line(&error) })?;
        let database = source.name().to_owned();
        let store = Store::open(source).await?;
        match Self::open_blobs(config, store.clone(), database).await {
            Ok(opened) => Ok(opened),
            Err(error) => {
                store.close().await;
                Err(error)
            }
        }
    }

    async fn open_blobs(config: &Config, store: Store, database: String) -> Result<Self, RunError> {
        follow_clock(&config.clock, &store).await?;
        let known = store.node_blobs().await?;
        let blobs = blobs(config, &store, &known, database).await?;
        if !store.is_shared() {
            collect_alone(&store, &blobs).await?;
        }
        // Workers have gone on rendering while no coordinator ran. They need a term to say so, unless another
        // coordinator has received their heartbeats.
        let ttl_ms = i64::try_from(config.lease_ttl.as_millis()).unwrap_or(i64::MAX);
        let now_ms = config.clock.now_ms();
        let heard_ms = if store.is_shared() { now_ms.saturating_sub(ttl_ms) } else { i64::MAX };
        store.extend_leases(now_ms.saturating_add(ttl_ms), heard_ms).await?;
        Ok(Self { store, blobs })
    }
}

/// Opens the blobs of a farm.
async fn blobs(config: &Config, store: &Store, known: &BTreeSet<String>, database: String) -> Result<Blobs, RunError> {
    let directory = config.data_directory.join("blobs");
    let (opened, place) = match &config.bucket {
        Some(bucket) => {
            let failed = |source: BlobError| RunError::ObjectStore { bucket: bucket.clone(), source: source.into() };
            (Blobs::in_bucket(bucket).map_err(failed)?, bucket.to_string())
        }
        None => {
            let place = directory.display().to_string();
            let opened = Blobs::in_directory(directory.clone());
            (opened.map_err(|source| RunError::Directory { directory, source })?, place)
        }
    };
    match (claimed(&opened, store, known).await?, &config.bucket) {
        (Ok(()), _) => Ok(opened),
        (Err(error @ (ClaimError::Foreign { .. } | ClaimError::Unknown { .. } | ClaimError::Elsewhere { .. })), _) => {
            Err(RunError::ForeignBlobs { place, database, problem: error.to_string() })
        }
        (Err(ClaimError::Store(source)), Some(bucket)) => {
            Err(RunError::ObjectStore { bucket: bucket.clone(), source: source.into() })
        }
        (Err(ClaimError::Store(error)), None) => Err(error.into()),
    }
}

/// Claims a blob store for a farm, which has one. Coordinators that start together take turns.
async fn claimed(blobs: &Blobs, store: &Store, known: &BTreeSet<String>) -> Result<Result<(), ClaimError>, StoreError> {
    let identity = store.identity().await?;
    if identity.has_blobs {
        // Nothing is marked any more.
        return Ok(blobs.claim(identity, known).await);
    }
    let (blobs, known) = (blobs.clone(), known.clone());
    store.claim_blobs(|identity| Box::pin(async move { blobs.claim(identity, &known).await })).await
}

/// Makes sure that no other coordinator works in the same directory. The lock ends with the process, however that ends.
pub(super) fn lock(config: &Config) -> Result<File, RunError> {
    let directory = config.data_directory.clone();
    let open = || {
        directory::create(&config.data_directory)?;
        File::options().create(true).truncate(false).write(true).open(directory.join("lock"))
    };
    match open() {
        Err(source) => Err(RunError::Directory { directory, source }),
        Ok(file) => match file.try_lock() {
            Ok(()) => Ok(file),
            Err(TryLockError::WouldBlock) => Err(RunError::InUse { directory }),
            Err(TryLockError::Error(source)) => Err(RunError::Directory { directory, source }),
        },
    }
}
