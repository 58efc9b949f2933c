//! Previews: small images of a job while it converges.
//!
//! The cache holds the canvas of each preview with the number of passes that each tile shows. So an update reads only
//! the nodes of tiles that have grown. After nodes were removed from the film, it reads all tiles: a tile may have as
//! many passes as before, but others. A job gets at most one update in a quarter of a second, in at most half of a
//! core's time.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use clerestory_api::JobId;
use clerestory_film::{PreviewSettings, ReducedImage};
use tokio::sync::{Mutex as AsyncMutex, OwnedMutexGuard, OwnedSemaphorePermit};

use super::batches::{batches, runs};
use super::error::FilmError;
use super::frame::load;
use super::reader::FilmReader;
use super::repair::Repair;
use crate::clock::Clock;
use crate::memory::MemoryBudget;
use crate::model::JobRecord;

/// Shortest time between two updates of the preview of a running job.
const FRESH_MS: i64 = 250;

/// Pause between two attempts to get memory: shorter than most updates.
const BUSY: Duration = Duration::from_millis(20);

/// Bytes of a pixel of a canvas.
const PIXEL_BYTES: u64 = size_of::<[f32; 3]>() as u64;

/// A preview.
#[derive(Clone, Debug)]
pub(crate) struct Preview {
    /// As PNG.
    pub(crate) png: Bytes,
    /// Accepted nodes of the job when the preview was begun. It shows those of them that have no gap before them.
    pub(crate) accepted_nodes: u64,
}

/// Makes previews, and caches them. The least recently used are evicted first.
#[derive(Debug)]
pub(crate) struct Previews {
    reader: Arc<FilmReader>,
    repair: Arc<Repair>,
    clock: Clock,
    memory: MemoryBudget,
    cache: Mutex<Cache>,
}

#[derive(Debug, Default)]
struct Cache {
    canvases: BTreeMap<JobId, (u64, Arc<AsyncMutex<Canvas>>)>,
    uses: u64,
}

/// The picture of a preview.
#[derive(Debug)]
struct Canvas {
    image: ReducedImage,
    /// Passes that each tile shows.
    tile_passes: Vec<u32>,
    accepted_nodes: u64,
    /// Nodes that had been removed from the film when it was read.
    redone_nodes: u64,
    is_final: bool,
    /// Time of the next update; `None` before the first.
    fresh_until_ms: Option<i64>,
    png: Option<(PreviewSettings, Bytes)>,
    /// Freed when it is dropped.
    _memory: OwnedSemaphorePermit,
}

impl Canvas {
    /// Clears a canvas of a film from which nodes were removed.
    fn clear(&mut self, redone_nodes: u64) {
        for (tile, passes) in (0..).zip(&mut self.tile_passes) {
            if std::mem::take(passes) > 0 {
                self.image.clear(tile);
            }
        }
        self.redone_nodes = redone_nodes;
        // No request gets the old picture, even if the film cannot be read now.
        (self.fresh_until_ms, self.png) = (None, None);
    }
}

impl Previews {
    /// Previews that cache up to these bytes.
    pub(crate) fn new(reader: Arc<FilmReader>, repair: Arc<Repair>, clock: Clock, bytes: u64) -> Self {
        Self { reader, repair, clock, memory: MemoryBudget::new(bytes), cache: Mutex::default() }
    }

    /// The preview of a job's first frame, in which every tile shows its complete passes.
    ///
    /// # Errors
    ///
    /// [`FilmError::Empty`] when no tile has a pass.
    pub(crate) async fn current(&self, job: JobRecord, settings: PreviewSettings) -> Result<Preview, FilmError> {
        match self.current_once(job.clone(), settings).await {
            Err(error) if self.repair.repair(job.id, &error).await? => self.current_once(job, settings).await,
            preview => preview,
        }
    }

    /// The canvas of a job: the cached one, or a black one for which memory is freed.
    async fn canvas(&self, job: &JobRecord) -> Arc<AsyncMutex<Canvas>> {
        let image = ReducedImage::new(job.grid, self.memory.bytes() / PIXEL_BYTES);
        let bytes = image.pixels() * PIXEL_BYTES;
        let memory = loop {
            if let Some(known) = self.use_cached(job.id) {
                return known;
            }
            match self.memory.try_reserve(bytes) {
                Some(memory) => break memory,
                None if self.evict_one() => {}
                // All other canvases are in use. A use that ends leaves its canvas in the cache and notifies nobody.
                None => tokio::time::sleep(BUSY).await,
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
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        cache.uses += 1;
        let used = cache.uses;
        // Of two that were made at the same time, one is cached.
        Arc::clone(&cache.canvases.entry(job.id).or_insert((used, canvas)).1)
    }

    async fn current_once(&self, job: JobRecord, settings: PreviewSettings) -> Result<Preview, FilmError> {
        let mut canvas = self.canvas(&job).await.lock_owned().await;
        // The lock may have been held by other requests for a while.
        let job = self.reader.store.job(job.id).await?.unwrap_or(job);
        let (now_ms, is_final) = (self.clock.now_ms(), job.state.is_final());
        let is_same = canvas.accepted_nodes == job.accepted_nodes && canvas.is_final == is_final;
        let is_fresh = canvas.fresh_until_ms.is_some_and(|until_ms| is_same || (!is_final && now_ms < until_ms));
        if !is_fresh {
            canvas = update(&self.reader, &job, canvas).await?;
            canvas.png = None;
            (canvas.accepted_nodes, canvas.is_final) = (job.accepted_nodes, is_final);
            let end_ms = self.clock.now_ms();
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

    fn use_cached(&self, job: JobId) -> Option<Arc<AsyncMutex<Canvas>>> {
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        cache.uses += 1;
        let now = cache.uses;
        let (used, canvas) = cache.canvases.get_mut(&job)?;
        *used = now;
        Some(Arc::clone(canvas))
    }

    /// Evicts the least recently used canvas that nobody uses now. Answers whether there was one.
    fn evict_one(&self) -> bool {
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        let idle = cache.canvases.iter().filter(|(_, (_, canvas))| Arc::strong_count(canvas) == 1);
        let oldest = idle.min_by_key(|(_, (used, _))| *used).map(|(job, _)| *job);
        oldest.and_then(|job| cache.canvases.remove(&job)).is_some()
    }
}

/// Brings a canvas up to date.
async fn update(
    reader: &FilmReader,
    job: &JobRecord,
    mut canvas: OwnedMutexGuard<Canvas>,
) -> Result<OwnedMutexGuard<Canvas>, FilmError> {
    if canvas.redone_nodes != job.redone_nodes {
        canvas.clear(job.redone_nodes);
    }
    for Range { start: mut next, end } in runs(0..job.grid.len()) {
        while next < end {
            let complete = reader.store.complete_passes(job.id, 0, next..end).await?;
            let has_changed = |(tile, passes): &(u32, u32)| canvas.tile_passes.get(*tile as usize) != Some(passes);
            let changed: Vec<u32> = (next..end).zip(complete).filter(has_changed).map(|(tile, _)| tile).collect();
            let (updated, missed) = show(reader, job, canvas, &changed).await?;
            canvas = updated;
            next = match missed {
                Some((tile, failure)) => {
                    reader.unless_merged(job.id, failure).await?;
                    tile
                }
                None => end,
            };
        }
    }
    Ok(canvas)
}

/// Draws the current state of some tiles of one run. Answers also the first tile whose nodes could not be read, and
/// why; the tiles before it are drawn.
async fn show(
    reader: &FilmReader,
    job: &JobRecord,
    mut canvas: OwnedMutexGuard<Canvas>,
    changed: &[u32],
) -> Result<(OwnedMutexGuard<Canvas>, Option<(u32, FilmError)>), FilmError> {
    let (Some(first), Some(last)) = (changed.first(), changed.last()) else { return Ok((canvas, None)) };
    let rows = reader.store.nodes(job.id, 0, *first..last + 1, job.passes).await?;
    let tiles = rows.chunk_by(|a, b| a.address.tile == b.address.tile);
    let tiles = tiles.filter(|rows| rows.first().is_some_and(|row| changed.contains(&row.address.tile))).collect();
    for tiles in batches(tiles) {
        let begins_with = tiles.first().and_then(|rows| rows.first()).map_or(*first, |row| row.address.tile);
        let loaded = match load(reader, tiles).await {
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
