//! What the command line does for an experiment: progress on the terminal, files, and jobs on a farm.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clerestory_api::{JobId, JobView};
use clerestory_experiments::{Amount, Farm, FarmOrder, FarmRender, FarmView, Host, HostError};
use clerestory_film::FrameImage;
use tokio::runtime::Handle;

use crate::connection::Connection;
use crate::failure::Failure;
use crate::image_file::BUDGET;
use crate::job_end::check_done;
use crate::outage::until_answered;
use crate::output_file;
use crate::progress::{Advance, Progress};
use crate::render_limits::RenderLimits;
use crate::submission::{JobSettings, submit};

/// Time between two requests for a job.
const POLL_PERIOD: Duration = Duration::from_millis(200);

/// The terminal, the file system and perhaps a farm.
pub(crate) struct ExperimentHost {
    progress: Progress,
    /// The farm, with the runtime that calls it: experiments run on a thread of their own.
    farm: Option<(Connection, Handle)>,
}

impl ExperimentHost {
    pub(crate) fn new(farm: Option<(Connection, Handle)>) -> Self {
        Self { progress: Progress::new(), farm }
    }
}

impl Drop for ExperimentHost {
    /// Removes the progress bar.
    fn drop(&mut self) {
        self.progress.finish();
    }
}

impl Host for ExperimentHost {
    fn show(&mut self, fraction: f64, activity: &str) {
        let activity = Some(activity.to_owned());
        self.progress.show(&Advance { fraction, activity, ..Advance::default() });
    }

    fn note(&self, line: &str) {
        self.progress.note(line);
    }

    fn write(&self, file: &Path, content: &[u8]) -> Result<(), HostError> {
        Ok(output_file::write(file, content)?)
    }

    fn farm(&mut self) -> Option<&mut dyn Farm> {
        if self.farm.is_some() { Some(self) } else { None }
    }
}

impl Farm for ExperimentHost {
    fn render(&mut self, order: &FarmOrder<'_>) -> Result<Option<FarmRender>, HostError> {
        let Some((connection, runtime)) = &self.farm else { return Ok(None) };
        Ok(runtime.block_on(render(connection, &self.progress, order))?)
    }

    fn view(&self) -> Result<FarmView, HostError> {
        let Some((connection, runtime)) = &self.farm else { return Ok(FarmView::default()) };
        let workers = runtime.block_on(connection.client.workers());
        let workers = workers.map_err(|error| connection.failure(error))?;
        Ok(FarmView { address: connection.address().to_owned(), workers })
    }
}

/// Renders a job to its end; `None` when the user interrupts.
async fn render(
    connection: &Connection,
    progress: &Progress,
    order: &FarmOrder<'_>,
) -> Result<Option<FarmRender>, Failure> {
    let mut limits = RenderLimits::default();
    match order.amount {
        Amount::Samples(samples) => limits.spp = Some(samples),
        Amount::Seconds(seconds) => limits.time = Duration::try_from_secs_f64(seconds).ok(),
    }
    let submission = JobSettings {
        name: Some(order.name.to_owned()),
        samples_per_pixel: limits.samples_per_pixel(),
        time_limit_ms: limits.time_limit_ms(),
        targets: limits.targets(),
        adaptive: false,
        tile_size: order.tile_size,
        priority: 0,
        reference: order.reference.cloned(),
        assumptions: Vec::new(),
    };
    let job = submit(connection, order.bundle, submission).await?;
    let Some(job) = finished(connection, progress, job.id, order.cancelled).await? else { return Ok(None) };
    check_done(&job)?;
    let client = &connection.client;
    let points = until_answered(connection, progress, || client.convergence(job.id)).await?.points;
    let bytes = until_answered(connection, progress, || client.image(job.id)).await?;
    let image = FrameImage::decode(&bytes, BUDGET).map_err(Failure::BadImage)?;
    let wall_ms = job.finished_ms.unwrap_or_default() - job.started_ms.unwrap_or_default();
    let [wall_seconds, core_seconds] = [wall_ms, job.core_ms].map(|milliseconds| milliseconds as f64 / 1000.0);
    Ok(Some(FarmRender { image, wall_seconds, core_seconds, points }))
}

/// Waits for the end of a job. Cancels the job and returns `None` when the user interrupts.
async fn finished(
    connection: &Connection,
    progress: &Progress,
    id: JobId,
    cancelled: &AtomicBool,
) -> Result<Option<JobView>, Failure> {
    loop {
        let job = until_answered(connection, progress, || connection.client.job(id)).await?;
        if job.state.is_final() {
            return Ok(Some(job));
        }
        if cancelled.load(Ordering::Relaxed) {
            // The interruption is what matters, whether or not the farm receives the call.
            let _ = connection.client.cancel_job(id).await;
            return Ok(None);
        }
        tokio::time::sleep(POLL_PERIOD).await;
    }
}
