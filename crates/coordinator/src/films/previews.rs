//! Previews: images as they are now, for whoever looks at a job while it converges.
//!
//! What a preview shows is kept, and with it how many passes of each tile it shows. So an update reads the nodes of those tiles alone that
//! have grown; the cost is in proportion to what has changed. Only where nodes were taken out of the film, to be rendered again, all tiles are
//! read: one may have as many passes as before, and others. However many look, there is one update in a quarter of a second at most, and no
//! more than half of the time of a core goes into those of a job.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use clerestory_api::JobId;
use clerestory_film::{PreviewSettings, ReducedImage};
use tokio::sync::{Mutex as AsyncMutex, OwnedMutexGuard, OwnedSemaphorePermit, Semaphore};

use crate::farm::Farm;
use crate::films::FilmError;
use crate::films::frame::load;
use crate::films::reader::{batches, runs, unless_merged};
use crate::memory::permits;
use crate::model::JobRecord;

/// How long the preview of a running job may stay as it is although its film has grown, if its updates do not take longer.
const FRESH_MS: i64 = 250;

/// How long somebody waits for whom there is no memory until looking whether there is some: less than most updates take.
const BUSY: Duration = Duration::from_millis(20);

/// Bytes of a pixel that is kept.
const PIXEL_BYTES: u64 = size_of::<[f32; 3]>() as u64;

/// A preview.
#[derive(Clone, Debug)]
pub(crate) struct Preview {
    /// As PNG.
    pub(crate) png: Bytes,
    /// How many nodes of the job had been accepted when it was begun: it shows them all, or as much of them as has no gap before it.
    pub(crate) accepted_nodes: u64,
}

/// The previews that may be asked for again. Those unused for longest go when there are too many.
#[derive(Debug)]
pub(crate) struct Previews {
    most_pixels: u64,
    /// Permits for what previews show, one for each kibibyte.
    memory: Arc<Semaphore>,
    all_permits: u32,
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    canvases: BTreeMap<JobId, (u64, Arc<AsyncMutex<Canvas>>)>,
    uses: u64,
}

/// What the preview of a job shows.
#[derive(Debug)]
struct Canvas {
    image: ReducedImage,
    /// Passes of each tile in it.
    tile_passes: Vec<u32>,
    accepted_nodes: u64,
    /// Nodes that had been taken out of the film when it was read.
    redone_nodes: u64,
    is_final: bool,
    /// Until when it may stay as it is; `None` when it was never brought up to date.
    fresh_until_ms: Option<i64>,
    png: Option<(PreviewSettings, Bytes)>,
    /// Returned when it is dropped.
    _memory: OwnedSemaphorePermit,
}

impl Canvas {
    /// Shows nothing, of a film out of which so many nodes have been taken.
    fn restart(&mut self, redone_nodes: u64) {
        for (tile, passes) in (0..).zip(&mut self.tile_passes) {
            if std::mem::take(passes) > 0 {
                self.image.clear(tile);
            }
        }
        self.redone_nodes = redone_nodes;
        // Nobody is shown it again, even if the film cannot be read now.
        (self.fresh_until_ms, self.png) = (None, None);
    }
}

impl Previews {
    /// Keeps up to so many bytes of previews.
    pub(crate) fn new(bytes: u64) -> Self {
        let all_permits = permits(bytes);
        Self {
            most_pixels: bytes / PIXEL_BYTES,
            memory: Arc::new(Semaphore::new(all_permits as usize)),
            all_permits,
            kept: Mutex::default(),
        }
    }

    /// What the preview of a job shows; black, and room is made for it, when that is not known.
    async fn canvas(&self, job: &JobRecord) -> Arc<AsyncMutex<Canvas>> {
        let image = ReducedImage::new(job.grid, self.most_pixels);
        let wanted = permits(image.pixels() * PIXEL_BYTES).min(self.all_permits);
        let memory = loop {
            if let Some(known) = self.use_known(job.id) {
                return known;
            }
            match Arc::clone(&self.memory).try_acquire_many_owned(wanted) {
                Ok(memory) => break memory,
                Err(_) if self.forget_one() => {}
                // All others are being looked at. Whoever is done keeps what it has looked at, so that nothing says when that may go.
                Err(_) => tokio::time::sleep(BUSY).await,
            }
        };
        let canvas = Arc::new(AsyncMutex::new(Canvas {
            image,
            tile_passes: vec![0; job.grid.len() as usize],
            accepted_nodes: 0,
            redone_nodes: job.redone_nodes,
            is_final: false,
            fresh_until_ms: None,
            png: None,
            _memory: memory,
        }));
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.uses += 1;
        let used = kept.uses;
        // Of two that were made at the same time, one is kept.
        Arc::clone(&kept.canvases.entry(job.id).or_insert((used, canvas)).1)
    }

    fn use_known(&self, job: JobId) -> Option<Arc<AsyncMutex<Canvas>>> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.uses += 1;
        let now = kept.uses;
        let (used, canvas) = kept.canvases.get_mut(&job)?;
        *used = now;
        Some(Arc::clone(canvas))
    }

    /// Lets go of the preview that nobody has looked at for longest, if there is one that nobody looks at now.
    fn forget_one(&self) -> bool {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let idle = kept.canvases.iter().filter(|(_, (_, canvas))| Arc::strong_count(canvas) == 1);
        let oldest = idle.min_by_key(|(_, (used, _))| *used).map(|(job, _)| *job);
        oldest.and_then(|job| kept.canvases.remove(&job)).is_some()
    }
}

/// The preview of a job's first frame: every tile as far as it is complete.
///
/// # Errors
///
/// [`FilmError::Empty`] when no tile has a pass.
pub(crate) async fn current(farm: &Farm, job: JobRecord, settings: PreviewSettings) -> Result<Preview, FilmError> {
    let mut canvas = farm.previews.canvas(&job).await.lock_owned().await;
    // Others may have been waited for.
    let job = farm.store.job(job.id).await?.unwrap_or(job);
    let (now_ms, is_final) = (farm.config.clock.now_ms(), job.state.is_final());
    let is_same = canvas.accepted_nodes == job.accepted_nodes && canvas.is_final == is_final;
    let is_fresh = canvas.fresh_until_ms.is_some_and(|until_ms| is_same || (!is_final && now_ms < until_ms));
    if !is_fresh {
        canvas = update(farm, &job, canvas).await?;
        canvas.png = None;
        (canvas.accepted_nodes, canvas.is_final) = (job.accepted_nodes, is_final);
        let end_ms = farm.config.clock.now_ms();
        canvas.fresh_until_ms = Some((now_ms + FRESH_MS).max(end_ms + (end_ms - now_ms)));
    }
    if canvas.tile_passes.iter().all(|passes| *passes == 0) {
        return Err(FilmError::Empty);
    }
    let accepted_nodes = canvas.accepted_nodes;
    if let Some((_, png)) = canvas.png.as_ref().filter(|(known, _)| *known == settings) {
        return Ok(Preview { png: png.clone(), accepted_nodes });
    }
    let encoded = tokio::task::spawn_blocking(move || {
        let png = Bytes::from(canvas.image.encode_png(&settings)?);
        canvas.png = Some((settings, png.clone()));
        Ok(Preview { png, accepted_nodes })
    });
    encoded.await?
}

/// Brings up to date what a preview shows.
async fn update(
    farm: &Farm,
    job: &JobRecord,
    mut canvas: OwnedMutexGuard<Canvas>,
) -> Result<OwnedMutexGuard<Canvas>, FilmError> {
    if canvas.redone_nodes != job.redone_nodes {
        canvas.restart(job.redone_nodes);
    }
    for Range { start: mut next, end } in runs(0..job.grid.len()) {
        while next < end {
            let complete = farm.store.complete_passes(job.id, 0, next..end).await?;
            let has_changed = |(tile, passes): &(u32, u32)| canvas.tile_passes.get(*tile as usize) != Some(passes);
            let changed: Vec<u32> = (next..end).zip(complete).filter(has_changed).map(|(tile, _)| tile).collect();
            let (updated, missed) = show(farm, job, canvas, &changed).await?;
            canvas = updated;
            next = match missed {
                Some((tile, failure)) => {
                    unless_merged(farm, job.id, failure).await?;
                    tile
                }
                None => end,
            };
        }
    }
    Ok(canvas)
}

/// Shows tiles of one run as they are. Answers also from which on their nodes could not be read, and why; those before are shown.
async fn show(
    farm: &Farm,
    job: &JobRecord,
    mut canvas: OwnedMutexGuard<Canvas>,
    changed: &[u32],
) -> Result<(OwnedMutexGuard<Canvas>, Option<(u32, FilmError)>), FilmError> {
    let (Some(first), Some(last)) = (changed.first(), changed.last()) else { return Ok((canvas, None)) };
    let rows = farm.store.nodes(job.id, 0, *first..last + 1, job.passes).await?;
    let tiles = rows.chunk_by(|a, b| a.address.tile == b.address.tile);
    let tiles = tiles.filter(|rows| rows.first().is_some_and(|row| changed.contains(&row.address.tile))).collect();
    for tiles in batches(tiles) {
        let begins_with = tiles.first().and_then(|rows| rows.first()).map_or(*first, |row| row.address.tile);
        let loaded = match load(farm, tiles).await {
            Ok(loaded) => loaded,
            Err(failure) => return Ok((canvas, Some((begins_with, failure)))),
        };
        let job = job.clone();
        let shown = tokio::task::spawn_blocking(move || {
            for tile in &loaded {
                let sum = tile.sum(&job, None)?;
                canvas.tile_passes[tile.index as usize] = sum.as_ref().map_or(0, |sum| sum.passes);
                match sum {
                    Some(sum) => canvas.image.put(&sum)?,
                    None => canvas.image.clear(tile.index),
                }
            }
            Ok::<_, FilmError>(canvas)
        });
        canvas = shown.await??;
    }
    Ok((canvas, None))
}
