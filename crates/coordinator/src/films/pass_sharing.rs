//! Adaptive jobs: the passes of a round are shared out among the tiles by their noise.
//!
//! How noisy a tile is, its pilot says: a few passes that no image contains ([`clerestory_film::adaptive`]). The pilot is
//! work of the round [`PILOT_ROUND`], of nodes like any others. When that round is complete, the keeper of the film reads the pilot, stores
//! the share of each tile, and throws the pilot away; then it records the round. Rounds beyond the passes that every tile gets are cut
//! into nodes when the shares are there, and not before. What is decided depends on the scene, its tiles and the samples of the job alone,
//! so it is the same whoever decides it, and as often as it is decided: `clerestory render` comes to the same.

use std::collections::BTreeMap;

use clerestory_film::Share;
use clerestory_film::adaptive::{noise, shares};
use futures::stream::{self, StreamExt, TryStreamExt};

use crate::farm::Farm;
use crate::films::FilmError;
use crate::films::reader::runs;
use crate::model::{JobRecord, NodeRow};
use crate::watch::notifications::News;

/// Tiles whose pilot is read at the same time.
const TILES: usize = 4;

/// Decides the shares of the tiles of a job whose pilot is complete, by frame.
pub(crate) async fn decide(farm: &Farm, job: &JobRecord) -> Result<BTreeMap<u32, Vec<Share>>, FilmError> {
    let mut by_frame = BTreeMap::new();
    for frame in 0..job.frames {
        let mut noises = Vec::new();
        // Some tiles after others: all of them need not fit into memory, nor their rows.
        for tiles in runs(0..job.grid.len()) {
            let rows = farm.store.pilot(job.id, frame, tiles).await?;
            let tiles = rows.chunk_by(|a, b| a.address.tile == b.address.tile);
            let reads: Vec<_> = tiles.map(|rows| noise_of(farm, rows)).collect();
            noises.extend(stream::iter(reads).buffered(TILES).try_collect::<Vec<f64>>().await?);
        }
        by_frame.insert(frame, shares(&job.grid, &noises));
    }
    Ok(by_frame)
}

/// How noisy a tile is of whose pilot these are all nodes.
async fn noise_of(farm: &Farm, rows: &[NodeRow]) -> Result<f64, FilmError> {
    let nodes = farm.film.load(rows).await?;
    Ok(tokio::task::spawn_blocking(move || noise(&nodes)).await?)
}

/// Stores the shares of a job; changes nothing when that has been done.
pub(crate) async fn share_out(
    farm: &Farm,
    job: &JobRecord,
    shares: BTreeMap<u32, Vec<Share>>,
) -> Result<(), FilmError> {
    if farm.store.share_out(job, shares).await? {
        tracing::info!(job = %job.id, "passes shared out among the tiles");
        farm.tell(News::Work);
    }
    discard_pilot(farm, job).await
}

/// Throws away the pilot of a job that has no need of it, run by run, so that claims wait for one run at most. Where it was cut short, what is left
/// goes when the job has ended.
pub(crate) async fn discard_pilot(farm: &Farm, job: &JobRecord) -> Result<(), FilmError> {
    for (frame, tiles) in (0..job.frames).flat_map(|frame| runs(0..job.grid.len()).map(move |tiles| (frame, tiles))) {
        farm.let_go(farm.store.discard_pilot(job.id, frame, tiles).await?).await;
    }
    Ok(())
}
