//! Repair: nodes whose stored bytes are lost or damaged are rendered again.
//!
//! Disks lose bits, people remove files, and a database and a blob store may be restored from backups of different
//! moments. A reader that cannot read a node names it here. When a coordinator starts, and once an hour, rows are also
//! compared with the blobs that exist.

use std::collections::BTreeSet;
use std::sync::Arc;

use clerestory_api::JobId;

use super::assets::Assets;
use super::error::FilmError;
use super::reader::FilmReader;
use crate::blobs::Blobs;
use crate::clock::Clock;
use crate::model::StoredNode;
use crate::store::Store;
use crate::watch::notifications::{Notification, Notifications};

/// Has lost and damaged nodes rendered again.
#[derive(Debug)]
pub(crate) struct Repair {
    store: Store,
    blobs: Blobs,
    reader: Arc<FilmReader>,
    assets: Arc<Assets>,
    notifications: Arc<Notifications>,
    clock: Clock,
}

impl Repair {
    /// Repairs films that this reader reads.
    pub(crate) fn new(
        store: Store,
        blobs: Blobs,
        reader: Arc<FilmReader>,
        assets: Arc<Assets>,
        notifications: Arc<Notifications>,
        clock: Clock,
    ) -> Self {
        Self { store, blobs, reader, assets, notifications, clock }
    }

    /// Checks the node that a failure names. A damaged node is rendered again; a lost one with all other nodes of its
    /// job whose blobs are missing. Answers whether the film has changed since the failure, so that it can be read
    /// again.
    ///
    /// # Errors
    ///
    /// When the database or the blob store does not answer. Then nothing is taken for lost.
    pub(crate) async fn repair(&self, job: JobId, failure: &FilmError) -> Result<bool, FilmError> {
        let Some(suspect) = failure.unreadable_node() else {
            self.check_reference(job, failure).await?;
            return Ok(false);
        };
        // A node without a row was merged since, or another reader found it lost.
        let Some(row) = self.store.node_at(job, &suspect.address, &suspect.blob).await? else { return Ok(true) };
        let is_replaced = match self.reader.load(&[row]).await {
            Err(FilmError::Damaged { .. }) => self.replace(job, BTreeSet::from([suspect.clone()])).await?,
            Err(FilmError::Lost { .. }) => self.replace_missing(job).await?,
            Ok(_) => return Ok(false),
            Err(error) => return Err(error),
        };
        // Another reader may have been first.
        Ok(is_replaced || self.store.node_at(job, &suspect.address, &suspect.blob).await?.is_none())
    }

    /// Has all nodes of a job rendered again whose blobs are missing. Answers whether there were any.
    async fn replace_missing(&self, job: JobId) -> Result<bool, FilmError> {
        // Rows before blobs: a blob is stored before its row.
        let stored = self.store.stored_nodes(job).await?;
        let found = self.blobs.node_blobs_of(job).await?;
        if !self.blobs.is_of(self.store.identity().await?.farm).await? {
            // This is another folder or bucket, which holds nothing of the farm.
            return Ok(false);
        }
        self.replace(job, stored.into_iter().filter(|node| !found.contains(&node.blob)).collect()).await
    }

    /// Has the nodes of all jobs rendered again whose blobs are missing.
    pub(crate) async fn replace_all_missing(&self) -> Result<(), FilmError> {
        let known = self.store.node_blobs().await?;
        let found = self.blobs.node_blobs().await?;
        let missing = &known - &found;
        if missing.is_empty() {
            return Ok(());
        }
        for job in self.store.jobs_with_nodes_in(&missing).await? {
            self.replace_missing(job).await?;
        }
        Ok(())
    }

    /// Checks the reference of a job, if that may be why its film could not be measured.
    async fn check_reference(&self, job: JobId, failure: &FilmError) -> Result<(), FilmError> {
        if !matches!(failure, FilmError::Blob(_) | FilmError::Image(_)) {
            return Ok(());
        }
        let reference = self.store.job(job).await?.and_then(|job| job.reference);
        match reference {
            Some(hash) => self.assets.check(hash).await,
            None => Ok(()),
        }
    }

    async fn replace(&self, job: JobId, lost: BTreeSet<StoredNode>) -> Result<bool, FilmError> {
        if lost.is_empty() {
            return Ok(false);
        }
        let replaced = self.store.replace_lost(job, lost, self.clock.now_ms()).await?;
        if replaced.nodes == 0 {
            return Ok(false);
        }
        if replaced.is_queued {
            tracing::error!(%job, nodes = replaced.nodes, "stored nodes are lost or damaged; they are rendered again");
        } else {
            tracing::error!(%job, nodes = replaced.nodes, "stored nodes of a job that was stopped are lost or \
                                                           damaged; its image lacks them");
        }
        self.reader.release(replaced.removed).await;
        self.notifications.publish(Notification::Job(job));
        Ok(true)
    }
}
