//! The error of a frame between its rounds, for clients that watch a job converge.
//!
//! It is measured over the pixels that have passes now, and belongs to no pass count. It is never stored and stops
//! nothing. The cache holds the measurement of each tile, so that an update measures only tiles that have grown. A job
//! gets at most one update a second, in at most half of a core's time. The tiles of a large frame are measured over
//! several updates.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use clerestory_api::{ContentHash, JobId, LiveMeasurement};
use clerestory_film::{
    DecodeBudget, ImageLayers, ImageRows, LayerChoice, Plane, ROWS_PER_BLOCK, Tile, TileGrid, TileSum, picture_rows,
};
use tokio::sync::{Mutex as AsyncMutex, SemaphorePermit};

use super::batches::{batches, runs};
use super::error::FilmError;
use super::frame::{LoadedTile, load};
use super::reader::FilmReader;
use super::repair::Repair;
use crate::blobs::Blobs;
use crate::clock::Clock;
use crate::memory::MemoryBudget;
use crate::model::{JobRecord, NodeRow};

/// Shortest time between two updates of a running job.
const FRESH_MS: i64 = 1000;

/// Longest time of an update. The next one goes on where it ended.
const UPDATE_MS: i64 = 1000;

/// Most tiles in the cache, of all jobs: 8 MiB.
const MOST_TILES: u64 = 1 << 18;

/// Bytes of rows of references that are in memory at the same time.
const REFERENCE_BYTES: u64 = 32 << 20;

/// Bytes of a pixel of a reference: its mean and its standard error.
const REFERENCE_PIXEL_BYTES: u64 = 24;

/// Measures jobs between their rounds, and caches the measurements. The least recently used are evicted first.
#[derive(Debug)]
pub(crate) struct LiveErrors {
    reader: Arc<FilmReader>,
    repair: Arc<Repair>,
    blobs: Blobs,
    clock: Clock,
    /// Most decoded bytes of one read of a reference.
    decoding: DecodeBudget,
    /// Rows of references.
    rows: MemoryBudget,
    cache: Mutex<Cache>,
}

#[derive(Debug, Default)]
struct Cache {
    jobs: BTreeMap<JobId, Entry>,
    uses: u64,
}

#[derive(Debug)]
struct Entry {
    used: u64,
    tiles: u64,
    live: Arc<AsyncMutex<Live>>,
}

/// The last measurement of a job.
#[derive(Debug)]
struct Live {
    tiles: Vec<MeasuredTile>,
    /// Where the next update begins.
    next_tile: u32,
    /// Whether the last update measured all tiles.
    is_complete: bool,
    accepted_nodes: u64,
    /// Nodes that had been removed from the film when it was read.
    redone_nodes: u64,
    is_final: bool,
    /// Time of the next update; `None` before the first.
    fresh_until_ms: Option<i64>,
}

/// The measurement of a tile of the camera plane when it had these passes.
#[derive(Clone, Copy, Debug, Default)]
struct MeasuredTile {
    passes: u32,
    /// Those of the light plane at the same time.
    light_passes: u32,
    /// Sum of the squared differences from the reference.
    squares: f64,
    /// Sum of the squared standard errors, where they are known.
    noise: Option<f64>,
}

impl LiveErrors {
    /// Measurements that read references within these bytes at a time.
    pub(crate) fn new(
        reader: Arc<FilmReader>,
        repair: Arc<Repair>,
        blobs: Blobs,
        clock: Clock,
        image_bytes: u64,
    ) -> Self {
        Self {
            reader,
            repair,
            blobs,
            clock,
            decoding: DecodeBudget { pixel_bytes: image_bytes },
            rows: MemoryBudget::new(REFERENCE_BYTES),
            cache: Mutex::default(),
        }
    }

    /// The error of a job's first frame over the pixels that have passes.
    ///
    /// # Errors
    ///
    /// When the film or the reference cannot be read.
    pub(crate) async fn current(&self, job: JobRecord) -> Result<LiveMeasurement, FilmError> {
        match self.current_once(job.clone()).await {
            Err(error) if self.repair.repair(job.id, &error).await? => self.current_once(job).await,
            measured => measured,
        }
    }

    async fn current_once(&self, job: JobRecord) -> Result<LiveMeasurement, FilmError> {
        let mut live = self.cached(&job).lock_owned().await;
        // The lock may have been held by other requests for a while.
        let job = self.reader.store.job(job.id).await?.unwrap_or(job);
        if live.redone_nodes != job.redone_nodes {
            // A tile may have as many passes as before, but others.
            *live = Live::of_nothing(&job);
        }
        let (now_ms, is_final) = (self.clock.now_ms(), job.state.is_final());
        let is_same = live.is_complete && live.accepted_nodes == job.accepted_nodes && live.is_final == is_final;
        if live.fresh_until_ms.is_none_or(|until_ms| !is_same && now_ms >= until_ms) {
            // Also after a failure: otherwise each request would try all of it again.
            (live.is_complete, live.fresh_until_ms) = (false, Some(now_ms + FRESH_MS));
            let is_complete = self.update(&job, &mut live, now_ms).await?;
            (live.is_complete, live.accepted_nodes, live.is_final) = (is_complete, job.accepted_nodes, is_final);
            let end_ms = self.clock.now_ms();
            live.fresh_until_ms = Some((now_ms + FRESH_MS).max(end_ms + (end_ms - now_ms)));
        }
        Ok(live.measurement(&job))
    }

    /// Measures the tiles that have changed, from where the last update ended. `false` when the time was too short for
    /// all.
    async fn update(&self, job: &JobRecord, live: &mut Live, begin_ms: i64) -> Result<bool, FilmError> {
        let mut reference = match job.reference {
            Some(hash) => Some(ReferenceRows::new(self, job.grid, hash).await),
            None => None,
        };
        let (first, end) = (live.next_tile, job.grid.camera_tiles());
        for tiles in under_strips(&job.grid, first..end).into_iter().chain(under_strips(&job.grid, 0..first)) {
            let light = match job.grid.light_over(tiles.start) {
                None => None,
                Some(strip) => match self.light(job, strip).await? {
                    // Without its light, the picture is too dark to be measured.
                    None => continue,
                    light => light,
                },
            };
            for tiles in runs(tiles) {
                let is_complete = loop {
                    match self.measure_run(job, live, tiles.clone(), light.as_ref(), &mut reference, begin_ms).await {
                        Ok(is_complete) => break is_complete,
                        Err(failure) => self.reader.unless_merged(job.id, failure).await?,
                    }
                    if self.clock.now_ms() - begin_ms >= UPDATE_MS {
                        break false;
                    }
                };
                if !is_complete {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// A strip of the light plane, if it has passes.
    async fn light(&self, job: &JobRecord, strip: u32) -> Result<Option<Arc<TileSum>>, FilmError> {
        loop {
            let rows = self.reader.store.nodes(job.id, 0, strip..strip + 1, job.passes).await?;
            if rows.is_empty() {
                return Ok(None);
            }
            match load(&self.reader, vec![&rows]).await {
                Ok(loaded) => {
                    let job = job.clone();
                    let sum = move || loaded.first().map_or(Ok(None), |tile| tile.sum(&job, None));
                    return Ok(tokio::task::spawn_blocking(sum).await??.map(Arc::new));
                }
                Err(failure) => self.reader.unless_merged(job.id, failure).await?,
            }
        }
    }

    /// Measures the tiles of one run that have changed. `false` when the time was too short for all.
    async fn measure_run(
        &self,
        job: &JobRecord,
        live: &mut Live,
        tiles: Range<u32>,
        light: Option<&Arc<TileSum>>,
        reference: &mut Option<ReferenceRows<'_>>,
        begin_ms: i64,
    ) -> Result<bool, FilmError> {
        let complete = self.reader.store.complete_passes(job.id, 0, tiles.clone()).await?;
        let light_passes = light.map_or(0, |light| light.passes);
        let mut changed = Vec::new();
        for (tile, passes) in tiles.zip(complete) {
            let measured = &mut live.tiles[tile as usize];
            if passes == 0 {
                *measured = MeasuredTile::default();
            } else if (measured.passes, measured.light_passes) != (passes, light_passes) {
                changed.push(tile);
            }
        }
        let (Some(first), Some(last)) = (changed.first(), changed.last()) else { return Ok(true) };
        let rows = self.reader.store.nodes(job.id, 0, *first..last + 1, job.passes).await?;
        let of_tiles = rows.chunk_by(|a, b| a.address.tile == b.address.tile);
        let of_changed = of_tiles.filter(|rows| is_of(rows, &changed)).collect();
        for batch in batches(of_changed) {
            for (tile, measured) in measure(job, load(&self.reader, batch).await?, light, reference).await? {
                live.tiles[tile as usize] = measured;
                live.next_tile = (tile + 1) % job.grid.camera_tiles();
            }
            if self.clock.now_ms() - begin_ms >= UPDATE_MS {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The cached measurement of a job, or an empty one.
    fn cached(&self, job: &JobRecord) -> Arc<AsyncMutex<Live>> {
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        cache.uses += 1;
        let used = cache.uses;
        if let Some(entry) = cache.jobs.get_mut(&job.id) {
            entry.used = used;
            return Arc::clone(&entry.live);
        }
        let tiles = u64::from(job.grid.camera_tiles());
        while cache.jobs.values().map(|entry| entry.tiles).sum::<u64>() + tiles > MOST_TILES {
            let idle = cache.jobs.iter().filter(|(_, entry)| Arc::strong_count(&entry.live) == 1);
            let oldest = idle.min_by_key(|(_, entry)| entry.used).map(|(job, _)| *job);
            // The others are in use.
            let Some(oldest) = oldest else { break };
            cache.jobs.remove(&oldest);
        }
        let live = Arc::new(AsyncMutex::new(Live::of_nothing(job)));
        cache.jobs.insert(job.id, Entry { used, tiles, live: Arc::clone(&live) });
        live
    }
}

impl Live {
    fn of_nothing(job: &JobRecord) -> Self {
        Self {
            tiles: vec![MeasuredTile::default(); job.grid.camera_tiles() as usize],
            next_tile: 0,
            is_complete: false,
            accepted_nodes: 0,
            redone_nodes: job.redone_nodes,
            is_final: false,
            fresh_until_ms: None,
        }
    }

    /// The sums over all tiles, in their order.
    fn measurement(&self, job: &JobRecord) -> LiveMeasurement {
        let (mut pixels, mut samples, mut squares, mut noise) = (0, 0, 0.0, Some(0.0));
        for (index, measured) in (0..).zip(&self.tiles) {
            let Some(tile) = job.grid.tile(index).filter(|_| measured.passes > 0) else { continue };
            pixels += tile.pixels() as u64;
            samples += tile.pixels() as u64 * u64::from(measured.passes) * u64::from(job.samples_per_pass);
            squares += measured.squares;
            noise = noise.zip(measured.noise).map(|(sum, of_tile): (f64, f64)| sum + of_tile);
        }
        let count = 3.0 * pixels as f64;
        let mean = |sum: f64| Some(sum / count).filter(|mean| mean.is_finite());
        LiveMeasurement {
            job: job.id,
            covered: pixels as f64 / (f64::from(job.grid.width) * f64::from(job.grid.height)),
            samples_per_pixel: if pixels == 0 { 0.0 } else { samples as f64 / pixels as f64 },
            mse: job.reference.and_then(|_| mean(squares)),
            estimated_mse: noise.and_then(mean),
        }
    }
}

/// Tiles of the camera plane, cut where strips of the light plane end.
fn under_strips(grid: &TileGrid, tiles: Range<u32>) -> Vec<Range<u32>> {
    if !grid.has_light_plane {
        return vec![tiles];
    }
    let cut = |strip| {
        let under = grid.under_light(strip);
        under.start.max(tiles.start)..under.end.min(tiles.end)
    };
    grid.light_tiles().map(cut).filter(|tiles| !tiles.is_empty()).collect()
}

/// Whether nodes belong to one of these sorted tiles.
fn is_of(rows: &[NodeRow], tiles: &[u32]) -> bool {
    rows.first().is_some_and(|row| tiles.binary_search(&row.address.tile).is_ok())
}

/// Measures tiles that have been read, in their order.
async fn measure(
    job: &JobRecord,
    tiles: Vec<LoadedTile>,
    light: Option<&Arc<TileSum>>,
    reference: &mut Option<ReferenceRows<'_>>,
) -> Result<Vec<(u32, MeasuredTile)>, FilmError> {
    let (record, light) = (job.clone(), light.cloned());
    let shown = tokio::task::spawn_blocking(move || {
        tiles.iter().map(|tile| ShownTile::new(tile, &record, light.as_deref())).collect::<Result<Vec<_>, FilmError>>()
    });
    let mut shown = shown.await??;
    if let Some(reference) = reference {
        shown = reference.compare(shown).await?;
    }
    Ok(shown.into_iter().map(|tile| (tile.index, tile.measured)).collect())
}

/// A tile as it is now.
#[derive(Debug)]
struct ShownTile {
    index: u32,
    measured: MeasuredTile,
    /// Its position in the frame and its picture; `None` when it has no pass.
    image: Option<(Tile, ImageRows)>,
}

impl ShownTile {
    fn new(tile: &LoadedTile, job: &JobRecord, light: Option<&TileSum>) -> Result<Self, FilmError> {
        let index = tile.index;
        let Some(mut sum) = tile.sum(job, None)? else {
            return Ok(Self { index, measured: MeasuredTile::default(), image: None });
        };
        // As an image of its own, so that its pixels are rounded as those of the frame are.
        let place = sum.tile;
        let grid = TileGrid::new(place.width, place.height, place.width.max(place.height));
        let grid = grid.with_light_plane(light.is_some()).with_caustic(place.has_caustic);
        (sum.tile_index, sum.tile) = (0, Tile { x: 0, y: 0, ..place });
        // An estimate of the error needs both planes.
        let blocks = light.map_or(sum.blocks(), |light| light.blocks().min(sum.blocks()));
        let mut image = ImageRows::new(grid, 0..grid.height, LayerChoice::measured(blocks >= 2));
        image.fill(&sum)?;
        if let Some(light) = light {
            let mut here = light.cropped(grid.light_tiles().start, place);
            here.tile = Tile { x: 0, y: 0, plane: Plane::Light, ..place };
            image.fill(&here)?;
        }
        let errors = image.layers().standard_error.as_ref();
        let square = |error: &f32| f64::from(*error) * f64::from(*error);
        let noise = errors.map(|errors| errors.as_flattened().iter().map(square).sum());
        let light_passes = light.map_or(0, |light| light.passes);
        let measured = MeasuredTile { passes: sum.passes, light_passes, squares: 0.0, noise };
        Ok(Self { index, measured, image: Some((place, image)) })
    }

    /// Adds the differences from some rows of the reference. Rows come from the top to the bottom.
    fn compare(&mut self, rows: &Range<u32>, frame_width: u32, reference: &ImageLayers) {
        let Some((tile, image)) = &self.image else { return };
        let width = tile.width as usize;
        for y in rows.start.max(tile.y)..rows.end.min(tile.y + tile.height) {
            let in_tile = (y - tile.y) as usize * width;
            let in_rows = (y - rows.start) as usize * frame_width as usize + tile.x as usize;
            let shown = image.layers().mean[in_tile..in_tile + width].as_flattened();
            for (x, r) in shown.iter().zip(reference.mean[in_rows..in_rows + width].as_flattened()) {
                let difference = f64::from(*x) - f64::from(*r);
                self.measured.squares += difference * difference;
            }
        }
    }
}

/// Rows of a reference. The rows of the last read are kept, because the next tiles lie in them too.
struct ReferenceRows<'a> {
    errors: &'a LiveErrors,
    grid: TileGrid,
    hash: ContentHash,
    /// Most rows at a time.
    most_rows: u32,
    last: Option<(Range<u32>, Arc<ImageLayers>)>,
    /// Freed when it is dropped.
    _memory: SemaphorePermit<'a>,
}

impl<'a> ReferenceRows<'a> {
    /// Waits until its memory is free.
    async fn new(errors: &'a LiveErrors, grid: TileGrid, hash: ContentHash) -> Self {
        let row_bytes = (u64::from(grid.width) * REFERENCE_PIXEL_BYTES).max(1);
        let fitting = u32::try_from(REFERENCE_BYTES / row_bytes).unwrap_or(u32::MAX);
        // Rows of whole tiles, if they fit, or else of whole blocks of a file.
        let most_rows =
            if fitting >= grid.tile_size { grid.tile_size } else { (fitting / ROWS_PER_BLOCK).max(1) * ROWS_PER_BLOCK };
        let bytes = (row_bytes * u64::from(most_rows)).min(REFERENCE_BYTES);
        let memory = errors.rows.reserve(bytes).await;
        Self { errors, grid, hash, most_rows, last: None, _memory: memory }
    }

    /// Compares tiles, in their order, with their pixels of the reference.
    async fn compare(&mut self, mut tiles: Vec<ShownTile>) -> Result<Vec<ShownTile>, FilmError> {
        let TileGrid { width, height, tile_size, .. } = self.grid;
        let mut tile_rows: Vec<u32> = tiles.iter().map(|tile| tile.index / self.grid.columns()).collect();
        tile_rows.dedup();
        for tile_row in tile_rows {
            let (first, end) = (tile_row * tile_size, ((tile_row + 1) * tile_size).min(height));
            for start in (first..end).step_by(self.most_rows as usize) {
                let rows = start..end.min(start + self.most_rows);
                let expected = self.read(rows.clone()).await?;
                let compared = tokio::task::spawn_blocking(move || {
                    tiles.iter_mut().for_each(|tile| tile.compare(&rows, width, &expected));
                    tiles
                });
                tiles = compared.await?;
            }
        }
        Ok(tiles)
    }

    async fn read(&mut self, rows: Range<u32>) -> Result<Arc<ImageLayers>, FilmError> {
        if let Some((_, layers)) = self.last.as_ref().filter(|(last, _)| *last == rows) {
            return Ok(Arc::clone(layers));
        }
        self.last = None;
        let file = self.errors.blobs.asset_file(self.hash).await?;
        let budget = self.errors.decoding;
        let wanted = rows.clone();
        let layers = Arc::new(tokio::task::spawn_blocking(move || picture_rows(file, wanted, budget)).await??);
        self.last = Some((rows, Arc::clone(&layers)));
        Ok(layers)
    }
}
