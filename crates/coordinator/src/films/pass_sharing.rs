//! Adaptive jobs: the passes of a round are shared out among the tiles by their noise.
//!
//! The pilot tells the noise of a tile. It is a few passes that no image contains ([`clerestory_film::adaptive`]), and
//! work of the round [`PILOT_ROUND`](clerestory_film::PILOT_ROUND), in nodes like any others. When that round is
//! complete, the round finalizer reads the pilot, stores the share of each tile, discards the pilot and records the
//! round. Rounds beyond the passes that every tile gets are cut into nodes once the shares are stored. The decision
//! depends on the scene, its tiles and the samples of the job alone. So every coordinator decides the same, and so does
//! `clerestory render`.

use std::collections::BTreeMap;
use std::sync::Arc;

use clerestory_film::Share;
use clerestory_film::adaptive::{noise, shares};
use futures::stream::{self, StreamExt, TryStreamExt};

use super::batches::runs;
use super::error::FilmError;
use super::reader::FilmReader;
use crate::model::{JobRecord, NodeRow};
use crate::watch::notifications::{Notification, Notifications};

/// Tiles whose pilot is read at the same time.
const TILES: usize = 4;

/// Shares out the passes of adaptive jobs.
#[derive(Debug)]
pub(crate) struct PassSharing {
    reader: Arc<FilmReader>,
    notifications: Arc<Notifications>,
}

impl PassSharing {
    /// Sharing by the pilots that this reader reads.
    pub(crate) fn new(reader: Arc<FilmReader>, notifications: Arc<Notifications>) -> Self {
        Self { reader, notifications }
    }

    /// Decides the shares of the tiles of a job whose pilot is complete, by frame.
    pub(crate) async fn decide(&self, job: &JobRecord) -> Result<BTreeMap<u32, Vec<Share>>, FilmError> {
        let mut by_frame = BTreeMap::new();
        for frame in 0..job.frames {
            let mut noises = Vec::new();
            // In runs: neither all tiles nor all their rows need fit into memory.
            for tiles in runs(0..job.grid.camera_tiles()) {
                let rows = self.reader.store.pilot(job.id, frame, tiles).await?;
                let tiles = rows.chunk_by(|a, b| a.address.tile == b.address.tile);
                let reads: Vec<_> = tiles.map(|rows| self.noise_of(rows)).collect();
                noises.extend(stream::iter(reads).buffered(TILES).try_collect::<Vec<f64>>().await?);
            }
            by_frame.insert(frame, shares(&job.grid, &noises));
        }
        Ok(by_frame)
    }

    /// The noise of a tile whose pilot has these nodes.
    async fn noise_of(&self, rows: &[NodeRow]) -> Result<f64, FilmError> {
        let nodes = self.reader.load(rows).await?;
        Ok(tokio::task::spawn_blocking(move || noise(&nodes)).await?)
    }

    /// Stores the shares of a job and discards its pilot. Changes nothing where shares are stored already.
    pub(crate) async fn apply(&self, job: &JobRecord, shares: BTreeMap<u32, Vec<Share>>) -> Result<(), FilmError> {
        if self.reader.store.share_out(job, shares).await? {
            tracing::info!(job = %job.id, "passes shared out among the tiles");
            self.notifications.publish(Notification::Work);
        }
        self.discard_pilot(job).await
    }

    /// Discards the pilot of a job that does not need it, run by run, so that a claim waits for one run at most. A
    /// pilot that is only partly discarded goes when the job has ended.
    pub(crate) async fn discard_pilot(&self, job: &JobRecord) -> Result<(), FilmError> {
        for (frame, tiles) in (0..job.frames).flat_map(|frame| runs(0..job.grid.len()).map(move |tiles| (frame, tiles)))
        {
            let removed = self.reader.store.discard_pilot(job.id, frame, tiles).await?;
            self.reader.release(removed).await;
        }
        Ok(())
    }
}
