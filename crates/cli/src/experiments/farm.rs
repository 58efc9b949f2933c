//! The renders of an experiment as ordinary jobs on a farm.

use std::sync::atomic::Ordering;
use std::time::Duration;

use clerestory_api::{JobId, JobView};
use clerestory_film::{FrameImage, smallest_tile};
use clerestory_render_core::scene::{Asset, SceneBundle};
use serde_json::{Value, json};
use tokio::runtime::Handle;

use super::measure::{Snapshot, TILE};
use super::session::Session;
use crate::commands::submit::{Order, submit};
use crate::commands::watch::check_done;
use crate::connection::Connection;
use crate::failure::Failure;
use crate::follow::until_answered;
use crate::image_file::BUDGET;
use crate::render_limits::RenderLimits;

/// Time between looks at a job.
const PERIOD: Duration = Duration::from_millis(200);

/// A farm that renders for an experiment.
pub(crate) struct Farm {
    connection: Connection,
    runtime: Handle,
    /// The convergence series of its jobs.
    series: Vec<Value>,
}

/// How much a job renders.
#[derive(Clone, Copy, Debug)]
pub(super) enum Amount {
    /// So many samples in each pixel.
    Samples(u32),
    /// As many as there are in so many seconds.
    Seconds(f64),
}

impl Farm {
    /// The farm behind a connection, to be used from threads other than those of the runtime.
    pub(crate) fn new(connection: Connection, runtime: Handle) -> Self {
        Self { connection, runtime, series: Vec::new() }
    }

    /// What a report says of the farm: where it is, who works there, and how the errors of its jobs fell.
    pub(super) fn record(&self) -> Result<Value, Failure> {
        let workers = self.runtime.block_on(self.connection.client.workers());
        let workers = workers.map_err(|error| self.connection.failure(error))?;
        Ok(json!({ "address": self.connection.address(), "workers": workers, "convergence": self.series }))
    }

    /// Renders a scene as a job. The error is measured against the reference, if there is one, at each round.
    pub(super) fn render(
        &mut self,
        session: &Session,
        bundle: &SceneBundle,
        amount: Amount,
        reference: Option<&Asset>,
    ) -> Result<Snapshot, Failure> {
        let mut limits = RenderLimits::default();
        match amount {
            Amount::Samples(samples) => limits.spp = Some(samples),
            Amount::Seconds(seconds) => limits.time = Duration::try_from_secs_f64(seconds).ok(),
        }
        let film = bundle.description().film;
        let order = Order {
            name: Some(session.activity().to_owned()),
            samples_per_pixel: limits.samples_per_pixel(),
            time_limit_ms: limits.time_limit_ms(),
            targets: limits.targets(),
            adaptive: false,
            tile_size: TILE.max(smallest_tile(film.width, film.height)),
            priority: 0,
            reference: reference.cloned(),
        };
        let Self { connection, runtime, series } = self;
        let (snapshot, points) = runtime.block_on(async {
            let job = submit(connection, bundle, order).await?;
            let job = finished(connection, session, job.id).await?;
            check_done(&job)?;
            let client = &connection.client;
            let points = until_answered(connection, session.progress(), || client.convergence(job.id)).await?.points;
            let bytes = until_answered(connection, session.progress(), || client.image(job.id)).await?;
            let image = FrameImage::decode(&bytes, BUDGET).map_err(Failure::BadImage)?;
            Ok::<_, Failure>((snapshot(&job, image), points))
        })?;
        let description = bundle.description();
        series.push(json!({
            "job": session.activity(),
            "integrator": description.integrator,
            "seed": description.seed,
            "points": points,
        }));
        Ok(snapshot)
    }
}

/// Waits for the end of a job; cancels it when the user interrupts.
async fn finished(connection: &Connection, session: &Session, id: JobId) -> Result<JobView, Failure> {
    loop {
        let job = until_answered(connection, session.progress(), || connection.client.job(id)).await?;
        if job.state.is_final() {
            return Ok(job);
        }
        if session.control.cancelled.load(Ordering::Relaxed) {
            // The interruption is what matters, whether or not the farm hears of it.
            let _ = connection.client.cancel_job(id).await;
            return Err(session.interrupted());
        }
        tokio::time::sleep(PERIOD).await;
    }
}

fn snapshot(job: &JobView, image: FrameImage) -> Snapshot {
    let counters = image.metadata().map(|metadata| metadata.counters).unwrap_or_default();
    let samples = image.layers().samples.as_deref().unwrap_or_default();
    let in_image: u64 = samples.iter().map(|samples| u64::from(*samples)).sum();
    let wall_ms = job.finished_ms.unwrap_or_default() - job.started_ms.unwrap_or_default();
    Snapshot {
        samples: in_image / (samples.len() as u64).max(1),
        wall_seconds: wall_ms as f64 / 1000.0,
        core_seconds: job.core_ms as f64 / 1000.0,
        counters,
        image,
    }
}
