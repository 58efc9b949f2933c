//! Repair: nodes whose stored bytes are lost or damaged are rendered again.
//!
//! A disk loses bits, somebody removes files, or a database and a blob store are restored from backups that were not taken at the same moment. Whoever
//! reads a film and cannot names the node here. What is missing is also looked for when a coordinator starts and once an hour, by comparing the
//! rows with the blobs that there are.
//!
//! Nobody can render a file of a scene or a reference. The jobs that need one which is lost are held until it is uploaded again.

use std::collections::BTreeSet;

use clerestory_api::{ContentHash, JobId};
use futures::stream::{self, StreamExt, TryStreamExt};

use crate::blobs::BlobError;
use crate::farm::Farm;
use crate::films::FilmError;
use crate::model::StoredNode;
use crate::store::StoreError;
use crate::watch::notifications::News;

/// Assets that are looked for at the same time.
const LOOKS: usize = 8;

/// Looks at a node that could not be read, and has it rendered again if it is lost or damaged, with all others of its job whose blobs are missing.
/// Answers whether the film has changed since the failure, by this or otherwise, so that it can be read again.
///
/// # Errors
///
/// When the database or the blob store does not answer: nothing is taken for lost then.
pub(crate) async fn repair(farm: &Farm, job: JobId, failure: &FilmError) -> Result<bool, FilmError> {
    let Some(suspect) = failure.unreadable_node() else {
        check_reference(farm, job, failure).await?;
        return Ok(false);
    };
    // Without a row, it has been merged since, or another has found it lost.
    let Some(row) = farm.store.node_at(job, &suspect.address, &suspect.blob).await? else { return Ok(true) };
    let is_replaced = match farm.film.load(&[row]).await {
        Err(FilmError::Damaged { .. }) => replace(farm, job, BTreeSet::from([suspect.clone()])).await?,
        Err(FilmError::Lost { .. }) => replace_missing(farm, job).await?,
        Ok(_) => return Ok(false),
        Err(error) => return Err(error),
    };
    // Whoever looked at the same time may have been first.
    Ok(is_replaced || farm.store.node_at(job, &suspect.address, &suspect.blob).await?.is_none())
}

/// Has all nodes of a job rendered again whose blobs are missing. Answers whether there were any.
pub(crate) async fn replace_missing(farm: &Farm, job: JobId) -> Result<bool, FilmError> {
    // Rows before blobs: a blob is there before its row.
    let stored = farm.store.stored_nodes(job).await?;
    let there = farm.blobs.node_blobs_of(job).await?;
    if !farm.blobs.is_of(farm.store.identity().await?.farm).await? {
        // Another folder or bucket, in which nothing of the farm is.
        return Ok(false);
    }
    replace(farm, job, stored.into_iter().filter(|node| !there.contains(&node.blob)).collect()).await
}

/// Has nodes rendered again that are missing from the blob store, of all jobs.
pub(crate) async fn replace_all_missing(farm: &Farm) -> Result<(), FilmError> {
    let known = farm.store.node_blobs().await?;
    let there = farm.blobs.node_blobs().await?;
    let missing = &known - &there;
    if missing.is_empty() {
        return Ok(());
    }
    for job in farm.store.jobs_with_nodes_in(&missing).await? {
        replace_missing(farm, job).await?;
    }
    Ok(())
}

/// Holds the open jobs whose files or references are missing from the blob store, and lets those go on that were held for one which is there.
pub(crate) async fn look_for_assets(farm: &Farm) -> Result<(), FilmError> {
    let needed = farm.store.needed_assets().await?;
    let look = |hash: ContentHash| async move { Ok::<_, BlobError>((hash, farm.blobs.has_asset(hash).await?)) };
    let found: Vec<_> = stream::iter(needed).map(look).buffered(LOOKS).try_collect().await?;
    for (hash, is_there) in found {
        if is_there {
            release_for_asset(farm, hash).await?;
        } else {
            lose_asset(farm, hash).await?;
        }
    }
    Ok(())
}

/// Looks at an asset that did not have its content when it was read. If it still has not, it is removed, so that it can be uploaded again, and
/// the jobs that need it are held.
pub(crate) async fn check_asset(farm: &Farm, hash: ContentHash) -> Result<(), FilmError> {
    if farm.blobs.keep_if_whole(hash).await? { Ok(()) } else { lose_asset(farm, hash).await }
}

/// Holds the open jobs that need an asset which is not there.
pub(crate) async fn lose_asset(farm: &Farm, hash: ContentHash) -> Result<(), FilmError> {
    if !farm.blobs.is_of(farm.store.identity().await?.farm).await? {
        // Another folder or bucket, in which nothing of the farm is.
        return Ok(());
    }
    for job in farm.store.hold_for_lost_asset(hash, farm.config.clock.now_ms()).await? {
        tracing::error!(%job, asset = %hash, "a file of the job is lost or damaged; the job is held until it is uploaded again");
        farm.tell(News::Job(job));
    }
    // It may have been uploaded meanwhile.
    if farm.blobs.has_asset(hash).await? {
        release_for_asset(farm, hash).await?;
    }
    Ok(())
}

/// Lets the jobs go on that were held for an asset which is there.
pub(crate) async fn release_for_asset(farm: &Farm, hash: ContentHash) -> Result<(), StoreError> {
    for job in farm.store.release_for_asset(hash, farm.config.clock.now_ms()).await? {
        tracing::info!(%job, asset = %hash, "the job goes on: what it lacked is here");
        farm.tell(News::Job(job));
    }
    Ok(())
}

/// Looks at the reference of a job, if that may be why its film could not be measured.
async fn check_reference(farm: &Farm, job: JobId, failure: &FilmError) -> Result<(), FilmError> {
    if !matches!(failure, FilmError::Blob(_) | FilmError::Image(_)) {
        return Ok(());
    }
    let reference = farm.store.job(job).await?.and_then(|job| job.reference);
    match reference {
        Some(hash) => check_asset(farm, hash).await,
        None => Ok(()),
    }
}

async fn replace(farm: &Farm, job: JobId, lost: BTreeSet<StoredNode>) -> Result<bool, FilmError> {
    if lost.is_empty() {
        return Ok(false);
    }
    let replaced = farm.store.replace_lost(job, lost, farm.config.clock.now_ms()).await?;
    if replaced.nodes == 0 {
        return Ok(false);
    }
    if replaced.is_queued {
        tracing::error!(%job, nodes = replaced.nodes, "stored nodes are lost or damaged; they are rendered again");
    } else {
        tracing::error!(%job, nodes = replaced.nodes, "stored nodes of a job that was stopped are lost or damaged; its image lacks them");
    }
    farm.let_go(replaced.removed).await;
    farm.tell(News::Job(job));
    Ok(true)
}
