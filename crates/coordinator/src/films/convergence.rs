//! The error of a frame at a complete round.
//!
//! Frame and reference are read strip by strip, and sums run in the order of the tiles: the numbers are the same on every machine, however
//! much memory it has, and the same that `clerestory compare` finds.

use std::ops::Range;

use clerestory_api::{ContentHash, ConvergencePoint};
use clerestory_film::{
    Comparison, DecodeBudget, FlipComparison, ImageLayers, LayerChoice, MeanLuminance, NoiseMeasure, ReferenceMeasure,
    ReferenceSummary, TileGrid, ToneCurve,
};
use tokio::sync::SemaphorePermit;

use crate::blobs::Blobs;
use crate::farm::Farm;
use crate::films::FilmError;
use crate::films::frame::{Extent, Frame, Reading, strips};
use crate::memory::permits;
use crate::model::{CompleteRound, JobRecord, TilePasses};

/// Bytes of a pixel of a reference: its mean and its standard error.
const REFERENCE_PIXEL_BYTES: u64 = 24;

/// A reference of a job.
#[derive(Clone, Debug)]
pub(crate) struct Reference {
    blobs: Blobs,
    hash: ContentHash,
    budget: DecodeBudget,
    summary: ReferenceSummary,
    /// The exposure at which it and images are shown, in stops.
    stops: f64,
}

impl Reference {
    /// Reads a reference for images of this grid, from its first row to its last.
    ///
    /// # Errors
    ///
    /// When it cannot be read, or is no image that images of this grid can be compared with.
    pub(crate) async fn measure(farm: &Farm, grid: TileGrid, hash: ContentHash) -> Result<Self, FilmError> {
        let budget = DecodeBudget { pixel_bytes: farm.config.image_bytes };
        let summary = ReferenceSummary { mean_magnitude: 0.0, peak: 0.0, sum: 0.0, noise: None };
        let mut reference = Self { blobs: farm.blobs.clone(), hash, budget, summary, stops: 0.0 };
        let (mut measure, mut luminance) = (ReferenceMeasure::new(grid), MeanLuminance::new());
        for strip in strips(grid, REFERENCE_PIXEL_BYTES, farm.strip_bytes()) {
            let _turn = turn(farm, grid, strip.len(), REFERENCE_PIXEL_BYTES).await;
            let layers = reference.rows(strip.clone()).await?;
            (measure, luminance) = tokio::task::spawn_blocking(move || {
                luminance.add(&layers.mean);
                measure.add(strip, &layers);
                (measure, luminance)
            })
            .await?;
        }
        let mut exposure = luminance.finish();
        for strip in strips(grid, REFERENCE_PIXEL_BYTES, farm.strip_bytes()) {
            let _turn = turn(farm, grid, strip.len(), REFERENCE_PIXEL_BYTES).await;
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

    /// The mean square of its standard errors, if it has any.
    pub(crate) fn noise(&self) -> Option<f64> {
        self.summary.noise
    }

    /// Pixels across and down the image of an asset.
    pub(crate) async fn size(farm: &Farm, hash: ContentHash) -> Result<[u32; 2], FilmError> {
        let file = farm.blobs.asset_file(hash).await?;
        Ok(tokio::task::spawn_blocking(move || clerestory_film::picture_size(file)).await??)
    }

    async fn rows(&self, rows: Range<u32>) -> Result<ImageLayers, FilmError> {
        let (file, budget) = (self.blobs.asset_file(self.hash).await?, self.budget);
        Ok(tokio::task::spawn_blocking(move || clerestory_film::picture_rows(file, rows, budget)).await??)
    }
}

/// Waits until some rows may be in memory to be measured. Jobs take turns at it strip by strip, so that none waits until the whole of
/// another's large frame has been measured, and all of them together take no more memory than one.
async fn turn(farm: &Farm, grid: TileGrid, rows: usize, bytes_per_pixel: u64) -> Option<SemaphorePermit<'_>> {
    let bytes = rows as u64 * u64::from(grid.width) * bytes_per_pixel;
    // The semaphore is never closed.
    farm.measuring.acquire_many(permits(bytes.min(farm.strip_bytes()))).await.ok()
}

/// Waits until the rows of a frame and its reference that FLIP's filters reach may be in memory.
async fn by_eye(farm: &Farm, grid: TileGrid) -> Option<SemaphorePermit<'_>> {
    let bytes = FlipComparison::bytes(grid.width).min(farm.config.image_bytes / 4);
    // The semaphore is never closed.
    farm.comparing.acquire_many(permits(bytes)).await.ok()
}

/// The point of the convergence series that a frame makes at a complete round.
pub(crate) async fn point(
    farm: &Farm,
    job: &JobRecord,
    complete: &CompleteRound,
    frame: u32,
    tile_passes: &TilePasses,
    reference: Option<&Reference>,
) -> Result<ConvergencePoint, FilmError> {
    let image = Frame { farm, job, frame, extent: Extent::Round(complete.passes, tile_passes.clone()) };
    let has_standard_error = image.has_standard_error().await?;
    let choice = LayerChoice::measured(has_standard_error);
    let bytes = choice.bytes_per_pixel() + reference.map_or(0, |_| REFERENCE_PIXEL_BYTES);
    let mut reading = Reading::default();
    let mut noise = NoiseMeasure::new(job.grid);
    let mut comparison = reference.map(|reference| Comparison::new(job.grid, reference.summary));
    // For the whole frame: held beside turns, which those who wait here do not have.
    let _rows_by_eye = match reference {
        Some(_) => by_eye(farm, job.grid).await,
        None => None,
    };
    let mut flip = reference.map(|reference| FlipComparison::new(job.grid.width, reference.stops, ToneCurve::Filmic));
    for strip in strips(job.grid, bytes, farm.strip_bytes()) {
        let _turn = turn(farm, job.grid, strip.len(), bytes).await;
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
        recorded_ms: farm.config.clock.now_ms(),
        mse: metrics.and_then(|metrics| finite(metrics.mse)),
        corrected_mse: metrics.and_then(|metrics| metrics.corrected_mse).and_then(finite),
        rel_mse: metrics.and_then(|metrics| metrics.rel_mse).and_then(finite),
        psnr: metrics.and_then(|metrics| metrics.psnr).and_then(finite),
        flip: flip.and_then(finite),
        estimated_mse: has_standard_error.then(|| noise.finish()).and_then(finite),
    })
}
