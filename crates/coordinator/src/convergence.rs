//! The error of a frame at a complete round.

use std::sync::Arc;

use clerestory_api::{ContentHash, ConvergencePoint};
use clerestory_render_core::film::{self, DecodeBudget, FrameImage};

use crate::blobs::Blobs;
use crate::film::FilmError;
use crate::store::{CompleteWave, JobRecord};

/// Bytes that each pixel of a reference may need in memory, all of its layers together.
const REFERENCE_BYTES_PER_PIXEL: u64 = 128;

/// How much a reference for an image of this size may make the decoder allocate.
pub(crate) fn reference_budget(width: u32, height: u32) -> DecodeBudget {
    DecodeBudget { pixel_bytes: u64::from(width) * u64::from(height) * REFERENCE_BYTES_PER_PIXEL }
}

/// Reads the reference of a job.
pub(crate) async fn reference(blobs: &Blobs, job: &JobRecord, hash: ContentHash) -> Result<Arc<FrameImage>, FilmError> {
    let bytes = blobs.asset(hash).await?;
    let budget = reference_budget(job.grid.width, job.grid.height);
    let image = tokio::task::spawn_blocking(move || FrameImage::decode(&bytes, budget)).await??;
    Ok(Arc::new(image))
}

/// The point of the convergence series that an image makes. Sums run in one fixed order, so the numbers are the same on
/// every machine.
pub(crate) fn point(
    job: &JobRecord,
    wave: &CompleteWave,
    frame: u32,
    image: &FrameImage,
    reference: Option<&FrameImage>,
    now_ms: i64,
) -> ConvergencePoint {
    // Sizes were compared when the job was submitted.
    let metrics = reference.and_then(|reference| film::compare(image, reference).ok());
    let finite = |value: f64| Some(value).filter(|value| value.is_finite());
    ConvergencePoint {
        frame,
        round: wave.round,
        passes: wave.passes,
        samples_per_pixel: u64::from(wave.passes) * u64::from(job.samples_per_pass),
        core_ms: wave.core_ms,
        wall_ms: wave.completed_ms - job.started_ms.unwrap_or(wave.completed_ms),
        recorded_ms: now_ms,
        mse: metrics.and_then(|metrics| finite(metrics.mse)),
        corrected_mse: metrics.and_then(|metrics| metrics.corrected_mse).and_then(finite),
        rel_mse: metrics.and_then(|metrics| metrics.rel_mse).and_then(finite),
        psnr: metrics.and_then(|metrics| metrics.psnr).and_then(finite),
        estimated_mse: film::mean_squared_standard_error(image).and_then(finite),
    }
}
