//! The errors of a frame at a complete round.
//!
//! Frame and reference are read strip by strip, and sums run in the order of the tiles. So the numbers are the same on
//! every machine, whatever its memory, and equal to those of `clerestory compare`.

use std::ops::Range;
use std::sync::Arc;

use clerestory_api::{ContentHash, ConvergencePoint};
use clerestory_film::{
    Comparison, DecodeBudget, FlipComparison, ImageLayers, LayerChoice, MeanLuminance, NoiseMeasure, ReferenceMeasure,
    ReferenceSummary, TileGrid, ToneCurve,
};
use tokio::sync::SemaphorePermit;

use super::error::FilmError;
use super::frame::{Extent, Frame, Reading, strips};
use super::reader::FilmReader;
use crate::blobs::Blobs;
use crate::clock::Clock;
use crate::memory::MemoryBudget;
use crate::model::{CompleteRound, JobRecord, TilePasses};

/// Bytes of a pixel of a reference: its mean and its standard error.
const REFERENCE_PIXEL_BYTES: u64 = 24;

/// A reference of a job, read once from its first row to its last.
#[derive(Clone, Debug)]
pub(crate) struct Reference {
    blobs: Blobs,
    hash: ContentHash,
    budget: DecodeBudget,
    summary: ReferenceSummary,
    /// The exposure at which FLIP shows it and the frame, in stops.
    stops: f64,
}

impl Reference {
    /// The mean square of its standard errors, if it has any.
    pub(crate) fn noise(&self) -> Option<f64> {
        self.summary.noise
    }

    async fn rows(&self, rows: Range<u32>) -> Result<ImageLayers, FilmError> {
        let (file, budget) = (self.blobs.asset_file(self.hash).await?, self.budget);
        Ok(tokio::task::spawn_blocking(move || clerestory_film::picture_rows(file, rows, budget)).await??)
    }
}

/// Measures frames and references. All of them together take no more memory than one.
#[derive(Debug)]
pub(crate) struct FrameMetrics {
    reader: Arc<FilmReader>,
    blobs: Blobs,
    clock: Clock,
    /// Most decoded bytes of one read of a reference.
    decoding: DecodeBudget,
    /// Rows that are measured. Jobs take turns strip by strip, so that none waits for the whole of another's large
    /// frame.
    rows: MemoryBudget,
    /// Rows of frames and references that the filters of FLIP reach.
    flip_rows: MemoryBudget,
}

impl FrameMetrics {
    /// Metrics that take three quarters of these bytes.
    pub(crate) fn new(reader: Arc<FilmReader>, blobs: Blobs, clock: Clock, image_bytes: u64) -> Self {
        Self {
            reader,
            blobs,
            clock,
            decoding: DecodeBudget { pixel_bytes: image_bytes },
            rows: MemoryBudget::new(image_bytes / 2),
            flip_rows: MemoryBudget::new(image_bytes / 4),
        }
    }

    /// Pixels across and down the image of an asset.
    pub(crate) async fn reference_size(&self, hash: ContentHash) -> Result<[u32; 2], FilmError> {
        let file = self.blobs.asset_file(hash).await?;
        Ok(tokio::task::spawn_blocking(move || clerestory_film::picture_size(file)).await??)
    }

    /// Reads a reference for frames of this grid.
    ///
    /// # Errors
    ///
    /// When it cannot be read, or is no image that frames of this grid can be compared with.
    pub(crate) async fn reference(&self, grid: TileGrid, hash: ContentHash) -> Result<Reference, FilmError> {
        let summary = ReferenceSummary { mean_magnitude: 0.0, peak: 0.0, sum: 0.0, noise: None };
        let mut reference = Reference { blobs: self.blobs.clone(), hash, budget: self.decoding, summary, stops: 0.0 };
        let (mut measure, mut luminance) = (ReferenceMeasure::new(grid), MeanLuminance::new());
        for strip in strips(grid, REFERENCE_PIXEL_BYTES, self.rows.bytes()) {
            let _turn = self.turn(grid, strip.len(), REFERENCE_PIXEL_BYTES).await;
            let layers = reference.rows(strip.clone()).await?;
            (measure, luminance) = tokio::task::spawn_blocking(move || {
                luminance.add(&layers.mean);
                measure.add(strip, &layers);
                (measure, luminance)
            })
            .await?;
        }
        let mut exposure = luminance.finish();
        for strip in strips(grid, REFERENCE_PIXEL_BYTES, self.rows.bytes()) {
            let _turn = self.turn(grid, strip.len(), REFERENCE_PIXEL_BYTES).await;
            let layers = reference.rows(strip).await?;
            exposure = tokio::task::spawn_blocking(move || {
                exposure.add(&layers.mean);
                exposure
            })
            .await?;
        }
        reference.summary = measure.finish();
        reference.stops = exposure.finish();
        Ok(reference)
    }

    /// The errors of a frame at a complete round.
    pub(crate) async fn point(
        &self,
        job: &JobRecord,
        complete: &CompleteRound,
        frame: u32,
        tile_passes: &TilePasses,
        reference: Option<&Reference>,
    ) -> Result<ConvergencePoint, FilmError> {
        let image =
            Frame { reader: &self.reader, job, frame, extent: Extent::Round(complete.passes, tile_passes.clone()) };
        let has_standard_error = image.has_standard_error().await?;
        let choice = LayerChoice::measured(has_standard_error);
        let bytes = choice.bytes_per_pixel(&job.grid) + reference.map_or(0, |_| REFERENCE_PIXEL_BYTES);
        let mut reading = Reading::default();
        let mut noise = NoiseMeasure::new(job.grid);
        let mut comparison = reference.map(|reference| Comparison::new(job.grid, reference.summary));
        // For the whole frame. A task that waits here holds no turn.
        let _flip_rows = match reference {
            Some(_) => Some(self.reserve_for_flip(job.grid).await),
            None => None,
        };
        let mut flip =
            reference.map(|reference| FlipComparison::new(job.grid.width, reference.stops, ToneCurve::Filmic));
        for strip in strips(job.grid, bytes, self.rows.bytes()) {
            let _turn = self.turn(job.grid, strip.len(), bytes).await;
            let rows = image.rows(strip.clone(), choice, &mut reading).await?;
            let expected = match reference {
                Some(reference) => Some(reference.rows(strip.clone()).await?),
                None => None,
            };
            let measured = tokio::task::spawn_blocking(move || {
                noise.add(strip.clone(), rows.layers());
                if let (Some(comparison), Some(flip), Some(expected)) = (&mut comparison, &mut flip, &expected) {
                    comparison.add(strip, rows.layers(), expected);
                    flip.add(&rows.layers().mean, &expected.mean)?;
                }
                Ok::<_, FilmError>((noise, comparison, flip))
            });
            (noise, comparison, flip) = measured.await??;
        }
        let flip = match flip {
            Some(flip) => tokio::task::spawn_blocking(move || flip.finish()).await?,
            None => None,
        };
        let metrics = comparison.map(Comparison::finish);
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        Ok(ConvergencePoint {
            frame,
            round: complete.round,
            passes: complete.passes,
            samples_per_pixel: u64::from(complete.passes) * u64::from(job.samples_per_pass),
            core_ms: complete.core_ms,
            wall_ms: complete.completed_ms - job.started_ms.unwrap_or(complete.completed_ms),
            recorded_ms: self.clock.now_ms(),
            mse: metrics.and_then(|metrics| finite(metrics.mse)),
            corrected_mse: metrics.and_then(|metrics| metrics.corrected_mse).and_then(finite),
            rel_mse: metrics.and_then(|metrics| metrics.rel_mse).and_then(finite),
            psnr: metrics.and_then(|metrics| metrics.psnr).and_then(finite),
            flip: flip.and_then(finite),
            estimated_mse: has_standard_error.then(|| noise.finish()).and_then(finite),
        })
    }

    /// Waits until some rows may be in memory.
    async fn turn(&self, grid: TileGrid, rows: usize, bytes_per_pixel: u64) -> SemaphorePermit<'_> {
        self.rows.reserve(rows as u64 * u64::from(grid.width) * bytes_per_pixel).await
    }

    /// Waits until the rows of a frame and its reference that the filters of FLIP reach may be in memory.
    async fn reserve_for_flip(&self, grid: TileGrid) -> SemaphorePermit<'_> {
        self.flip_rows.reserve(FlipComparison::bytes(grid.width)).await
    }
}
