//! One column of the report: a coordinator, a number of workers, a measured time, and the wait until everything is
//! merged.

use std::ffi::OsString;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use clerestory_api::{Client, WorkerId};
use clerestory_film::TileGrid;
use futures::stream::{self, StreamExt, TryStreamExt};
use tokio::task::JoinSet;
use tokio::time::Instant;
use tokio_util::task::AbortOnDropHandle;

use crate::ceilings::{database_bytes, log_bytes};
use crate::coordinator::Coordinator;
use crate::echo::exchanges_per_second;
use crate::error::LoadError;
use crate::merging;
use crate::partials::Noise;
use crate::process::{Process, Usage, bytes_in};
use crate::report::Line;
use crate::settings::{CHECKED_FRACTION, Settings};
use crate::statistics::Latency;
use crate::supply::{Supply, grid, sampling, watched_grid};
use crate::tally::{Counts, Tally};
use crate::viewer;
use crate::worker::Load;

/// Workers that register at the same time. Several thousand at once would time out and register again.
const REGISTRATIONS: usize = 100;

/// Shortest time under load before times are measured.
const SHORTEST_RAMP: Duration = Duration::from_secs(1);

/// Time between two checks whether the coordinator rests.
const REST_PERIOD: Duration = Duration::from_millis(250);

/// Most processor time of a coordinator at rest in that time.
const REST_PROCESSOR: Duration = Duration::from_millis(20);

/// Longest time for a coordinator without work to come to rest.
const REST_TIMEOUT: Duration = Duration::from_secs(120);

/// A coordinator under load.
pub(crate) struct Measurement<'a> {
    settings: &'a Settings,
    workers: u32,
    grid: TileGrid,
    process: Process,
    client: Client,
    load: Arc<Load>,
}

/// Counts and usage at a moment.
struct Moment {
    time: Instant,
    counts: Counts,
    merged_passes: u64,
    coordinator: Usage,
}

/// Starts a coordinator in `folder`, puts it under the load of `workers` workers, and stops it.
pub(crate) async fn measure(settings: &Settings, folder: &Path, workers: u32) -> Result<Line, LoadError> {
    let data = folder.join("farm");
    let mut arguments: Vec<OsString> =
        ["coordinator", "--listen", "127.0.0.1:0", "--data"].map(OsString::from).to_vec();
    arguments.push(data.clone().into());
    arguments.extend(["--lease-nodes".into(), settings.nodes_per_lease.to_string().into()]);
    arguments.extend(["--checked-fraction".into(), CHECKED_FRACTION.to_string().into()]);
    for (option, value) in [("--database", &settings.database), ("--object-store", &settings.object_store)] {
        arguments.extend(value.iter().flat_map(|value| [option.into(), value.into()]));
    }
    let stored = stored_bytes(settings, &data).await?;
    let log = folder.join("coordinator.log");
    let mut coordinator = Coordinator::start(&settings.clerestory, &arguments, log)?;
    let client = Client::new(&coordinator.address().await?, None)?;
    let Some(id) = coordinator.id() else { return Err(coordinator.ended().await) };
    let measurement = Measurement::new(settings, workers, Process::new(id), client)?;
    let measured = tokio::select! {
        line = measurement.run() => line,
        failure = coordinator.ended() => Err(failure),
    };
    coordinator.stop().await;
    let mut line = measured?;
    let grown = stored_bytes(settings, &data).await?.saturating_sub(stored);
    line.stored_bytes_per_sample = grown as f64 / line.samples.max(1) as f64;
    Ok(line)
}

/// Bytes of the state and of the blobs that are not in a bucket.
async fn stored_bytes(settings: &Settings, data: &Path) -> Result<u64, LoadError> {
    let state = match &settings.database {
        Some(url) => database_bytes(url).await?,
        None => 0,
    };
    Ok(state + bytes_in(data))
}

impl<'a> Measurement<'a> {
    fn new(settings: &'a Settings, workers: u32, process: Process, client: Client) -> Result<Self, LoadError> {
        let leased_nodes = u64::from(workers) * u64::from(settings.nodes_per_lease);
        let grid =
            if settings.watch { watched_grid(settings.tile_size) } else { grid(settings.tile_size, leased_nodes) };
        let load = Arc::new(Load {
            client: client.clone(),
            noise: Noise::new(grid, sampling()),
            tally: Tally::new(grid.len()),
            cycle: settings.rate.map(|rate| Duration::from_secs_f64(leased_nodes as f64 / f64::from(rate.get()))),
        });
        Ok(Self { settings, workers, grid, process, client, load })
    }

    async fn run(&self) -> Result<Line, LoadError> {
        self.check_empty().await?;
        let partial_bytes = self.partial_bytes()?;
        let exchanges_per_second = exchanges_per_second(self.workers, partial_bytes).await?;
        let began = Instant::now();
        let workers = self.register().await?;
        let registration = began.elapsed();

        let tally = &self.load.tally;
        let leased_nodes = u64::from(self.workers) * u64::from(self.settings.nodes_per_lease);
        let mut supply = Supply::new(&self.client, tally, self.grid, leased_nodes);
        // The first leases are not yet spread over time like later ones.
        let ramp = (2 * self.load.cycle.unwrap_or_default()).max(SHORTEST_RAMP);
        supply.begin().await?;
        let own = Process::this();
        let log_start = self.log_bytes().await?;
        let (own_start, start) = (own.processor()?, self.moment(&mut supply).await?);
        let follower = self.follow();
        let mut running = self.start(workers);
        supply.keep_full(ramp).await?;
        tally.measure(true);
        let loaded = self.moment(&mut supply).await?;
        let viewer = self.settings.watch.then(|| self.view());
        supply.keep_full(self.settings.time).await?;
        tally.measure(false);
        let unloaded = self.moment(&mut supply).await?;
        supply.finish().await?;
        drop(follower);
        // All work is done, so no aborted claim takes a lease.
        running.abort_all();
        while running.join_next().await.is_some() {}
        let rested = self.rest().await?;
        let (end, log_end) = (self.moment(&mut supply).await?, self.log_bytes().await?);
        let own_end = own.processor()?;
        if let Some(viewer) = viewer {
            viewer.await.map_err(|panic| LoadError::Ended(format!("looking at the image failed: {panic}")))?;
        }

        let (times, merges) = (tally.times(), tally.merge_times());
        let in_load = unloaded.time - loaded.time;
        let rate = |count: u64| count as f64 / in_load.as_secs_f64();
        let counts = end.counts;
        let nodes_per_pass = counts.accepted as f64 / counts.accepted_passes.max(1) as f64;
        let merged = |passes: u64| (passes as f64 * nodes_per_pass).round() as u64;
        let received = counts.bytes.max(1);
        let logged = log_start.zip(log_end).map(|(start, end)| end.saturating_sub(start));
        Ok(Line {
            workers: self.workers,
            tile_size: self.grid.tile_size,
            nodes_per_lease: self.settings.nodes_per_lease,
            offered_nodes_per_second: self.settings.rate,
            jobs: supply.jobs(),
            load_seconds: in_load.as_secs_f64(),
            drain_seconds: (rested - unloaded.time).as_secs_f64(),
            registration_seconds: registration.as_secs_f64(),
            leases_per_second: rate(unloaded.counts.leases - loaded.counts.leases),
            leased_per_second: rate(unloaded.counts.leased - loaded.counts.leased),
            uploaded_per_second: rate(unloaded.counts.accepted - loaded.counts.accepted),
            merged_per_second: rate(merged(unloaded.merged_passes - loaded.merged_passes)),
            sustained_per_second: counts.accepted as f64 / (rested - start.time).as_secs_f64(),
            partials_per_second: rate(unloaded.counts.partials - loaded.counts.partials),
            partial_megabytes_per_second: rate(unloaded.counts.bytes - loaded.counts.bytes) / 1e6,
            exchanges_per_second,
            partial_bytes: partial_bytes as u64,
            claim: Latency::of(times.claims),
            upload: Latency::of(times.uploads),
            round_merge: Latency::of(merges.rounds),
            upload_merge: Latency::of(merges.uploads),
            encoding: Latency::of(times.encodings),
            preview_age: Latency::of(times.ages),
            preview_replaced_age: Latency::of(times.replaced_ages),
            preview: Latency::of(times.previews),
            failed_previews: tally.counts().failed_previews,
            leases: counts.leases,
            leased_nodes: counts.leased,
            uploaded_nodes: counts.accepted,
            merged_nodes: merged(end.merged_passes),
            duplicate_nodes: counts.duplicate,
            refused_nodes: counts.refused,
            late_nodes: counts.late,
            late_nodes_under_load: unloaded.counts.late,
            lost_nodes: counts.accepted.saturating_sub(merged(end.merged_passes)),
            repeated_calls: counts.repeated,
            samples: counts.accepted_passes * self.pass_samples(),
            coordinator_peak_megabytes: end.coordinator.peak_bytes as f64 / 1e6,
            coordinator_megabytes_under_load: unloaded.coordinator.resident_bytes as f64 / 1e6,
            coordinator_sockets: unloaded.coordinator.sockets,
            coordinator_processor_seconds: (end.coordinator.processor - start.coordinator.processor).as_secs_f64(),
            generator_processor_seconds: (own_end - own_start).as_secs_f64(),
            write_amplification: (end.coordinator.written_bytes - start.coordinator.written_bytes) as f64
                / received as f64,
            database_log_amplification: logged.map(|bytes| bytes as f64 / received as f64),
            stored_bytes_per_sample: 0.0,
        })
    }

    /// The farm must have no work, because noise must not reach another film.
    async fn check_empty(&self) -> Result<(), LoadError> {
        let jobs = self.client.jobs().await?;
        match jobs.iter().find(|job| !job.state.is_final()) {
            None => Ok(()),
            Some(job) => Err(LoadError::Usage(format!(
                "the farm has the unfinished job {}, to which simulated workers would bring noise: expected a farm \
                 without work",
                job.id
            ))),
        }
    }

    /// Bytes of a partial with all nodes of a lease.
    fn partial_bytes(&self) -> Result<usize, LoadError> {
        let count = self.settings.nodes_per_lease.min(self.grid.len());
        let node = |tile| clerestory_api::NodeAddress { frame: 0, tile, level: 0, index: 0 };
        let nodes: Vec<_> = (0..count).map(node).collect();
        // As long as real identities.
        let (job, scene_hash) = ("0".repeat(36), "0".repeat(64));
        let partial = self.load.noise.partial(job, scene_hash, &nodes);
        Ok(partial.map_err(|error| LoadError::Ended(format!("cannot make a partial: {error}")))?.len())
    }

    /// Registers all workers.
    async fn register(&self) -> Result<Vec<WorkerId>, LoadError> {
        let registrations = (1..=self.workers).map(|number| self.load.register(number)).collect::<Vec<_>>();
        let registered = stream::iter(registrations).buffer_unordered(REGISTRATIONS).try_collect().await;
        Ok(registered?)
    }

    /// Starts the workers. Their first claims are spread over the time from one lease of a worker to its next.
    fn start(&self, workers: Vec<WorkerId>) -> JoinSet<()> {
        let (start, count) = (Instant::now(), self.workers);
        let mut running = JoinSet::new();
        for (number, worker) in (0..).zip(workers) {
            let share = f64::from(number) / f64::from(count);
            running.spawn(self.load.clone().work(worker, start + self.load.cycle.unwrap_or_default().mul_f64(share)));
        }
        running
    }

    /// Follows complete rounds until the handle is dropped.
    fn follow(&self) -> AbortOnDropHandle<()> {
        let load = self.load.clone();
        AbortOnDropHandle::new(tokio::spawn(async move { merging::follow(&load.client, &load.tally).await }))
    }

    /// Fetches previews while times are measured and the handle is not dropped.
    fn view(&self) -> AbortOnDropHandle<()> {
        let load = self.load.clone();
        AbortOnDropHandle::new(tokio::spawn(async move { viewer::look(&load.client, &load.tally).await }))
    }

    async fn moment(&self, supply: &mut Supply<'_>) -> Result<Moment, LoadError> {
        let (time, counts) = (Instant::now(), self.load.tally.counts());
        let coordinator = self.process.usage()?;
        Ok(Moment { time, counts, merged_passes: supply.merged_passes().await?, coordinator })
    }

    /// Bytes of the database server's log so far, if it reports them.
    async fn log_bytes(&self) -> Result<Option<u64>, LoadError> {
        match &self.settings.database {
            Some(url) => log_bytes(url).await,
            None => Ok(None),
        }
    }

    /// Waits until the coordinator rests, and returns when that began.
    async fn rest(&self) -> Result<Instant, LoadError> {
        let start = Instant::now();
        loop {
            let (time, before) = (Instant::now(), self.process.processor()?);
            tokio::time::sleep(REST_PERIOD).await;
            if self.process.processor()? - before <= REST_PROCESSOR {
                return Ok(time);
            }
            if start.elapsed() > REST_TIMEOUT {
                let seconds = REST_TIMEOUT.as_secs();
                return Err(LoadError::Ended(format!(
                    "the coordinator still works {seconds} s after the end of all jobs"
                )));
            }
        }
    }

    /// Camera samples in a pass of a tile.
    fn pass_samples(&self) -> u64 {
        let edge = u64::from(self.grid.tile_size);
        edge * edge * u64::from(sampling().samples_per_pass())
    }
}
