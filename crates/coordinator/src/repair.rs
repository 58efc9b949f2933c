//! Repair: nodes whose stored bytes are lost or damaged are rendered again.
//!
//! A disk loses bits, somebody removes files, or a database and a blob store are restored from backups that were not taken at the same moment. Whoever
//! reads a film and cannot names the node here. What is missing is also looked for when a coordinator starts and once an hour, by comparing the
//! rows with the blobs that there are.

use std::collections::BTreeSet;

use clerestory_api::JobId;

use crate::farm::Farm;
use crate::film::FilmError;
use crate::news::News;
use crate::store::StoredNode;

/// Looks at a node that could not be read, and has it rendered again if it is lost or damaged, with all others of its job whose blobs are missing.
/// Answers whether the film has changed since the failure, by this or otherwise, so that it can be read again.
///
/// # Errors
///
/// When the database or the blob store does not answer: nothing is taken for lost then.
pub(crate) async fn repair(farm: &Farm, job: JobId, failure: &FilmError) -> Result<bool, FilmError> {
    let Some(suspect) = failure.unreadable_node() else { return Ok(false) };
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
