//! The work of a load: jobs that are submitted as earlier ones are used up, and followed until all rounds are recorded.

use std::collections::BTreeMap;
use std::time::Duration;

use clerestory_api::{Client, JobId, JobState, JobSubmission};
use clerestory_film::{Sampling, TileGrid};
use serde_json::{Value, json};
use tokio::time::Instant;

use crate::error::LoadError;
use crate::tally::Tally;

/// Passes of a job: five rounds and one block, so that every node has its first-hit layers.
pub(crate) const PASSES: u32 = 16;

/// Samples of a pixel in a pass, and in a block: the defaults of scenes.
const SAMPLES: [u32; 2] = [16, 256];

/// Least and most tiles of a job.
const TILES: [u64; 2] = [64, 1024];

/// Most pixels of a job's image, so that large tiles do not make unrealistic images.
const MOST_PIXELS: u64 = 1 << 20;

/// Pixels across and down an image with previews.
const WATCHED_SIZE: [u32; 2] = [1920, 1080];

/// Fewest free passes of tiles, if a job has as many: a second's work of a coordinator.
const LEAST_RESERVE: u64 = 4096;

/// Leases of every worker for which passes stay free, if a job has as many.
const RESERVED_LEASES: u64 = 8;

/// Time between two requests for the jobs.
const PERIOD: Duration = Duration::from_millis(20);

/// Longest time without progress: much longer than a lease, or than merging after a round.
const PROGRESS_TIMEOUT: Duration = Duration::from_secs(300);

/// The image of every job, in tiles of `tile_size` pixels, for `leased_nodes` nodes that are leased at the same time. A
/// job has about as many nodes, so that few jobs run at the same time.
pub(crate) fn grid(tile_size: u32, leased_nodes: u64) -> TileGrid {
    let most = (MOST_PIXELS / (u64::from(tile_size) * u64::from(tile_size))).clamp(1, TILES[1]);
    let tiles = (leased_nodes / u64::from(PASSES)).next_power_of_two().clamp(TILES[0].min(most), most);
    let doublings = tiles.ilog2();
    TileGrid::new(tile_size << doublings.div_ceil(2), tile_size << (doublings / 2), tile_size)
}

/// The image of a job with previews: 1920 x 1080 pixels, or the next whole tiles.
pub(crate) fn watched_grid(tile_size: u32) -> TileGrid {
    let [width, height] = WATCHED_SIZE.map(|length| length.next_multiple_of(tile_size));
    TileGrid::new(width, height, tile_size)
}

/// How the samples of every job are grouped.
pub(crate) fn sampling() -> Sampling {
    let [pass, block] = SAMPLES;
    Sampling::new(pass, block).expect("a block is a power of two of passes")
}

/// Submits jobs and follows them.
#[derive(Debug)]
pub(crate) struct Supply<'a> {
    client: &'a Client,
    tally: &'a Tally,
    grid: TileGrid,
    scene: Value,
    /// Nodes that are leased at the same time.
    leased_nodes: u64,
    /// All jobs of the load, with the complete passes of every tile at the last request.
    jobs: BTreeMap<JobId, u32>,
}

impl<'a> Supply<'a> {
    /// A supply of jobs with this image for workers that lease `leased_nodes` nodes at the same time.
    pub(crate) fn new(client: &'a Client, tally: &'a Tally, grid: TileGrid, leased_nodes: u64) -> Self {
        let scene = scene(grid);
        Self { client, tally, grid, scene, leased_nodes, jobs: BTreeMap::new() }
    }

    /// Passes of tiles in a job.
    fn job_passes(&self) -> u64 {
        u64::from(self.grid.len()) * u64::from(PASSES)
    }

    /// Passes of tiles that stay free: those of a job, but of a large job only those needed until the next exists. All
    /// submitted work must be rendered in the end.
    fn reserve(&self) -> u64 {
        self.job_passes().min((RESERVED_LEASES * self.leased_nodes).max(LEAST_RESERVE))
    }

    /// Jobs that have been submitted.
    pub(crate) fn jobs(&self) -> u64 {
        self.jobs.len() as u64
    }

    /// Submits the first jobs: a lease for every worker, since all may ask at once, and the reserve.
    pub(crate) async fn begin(&mut self) -> Result<(), LoadError> {
        self.fill(self.leased_nodes + self.reserve()).await
    }

    /// Submits jobs until at least `passes` passes of tiles are free.
    async fn fill(&mut self, passes: u64) -> Result<(), LoadError> {
        while self.tally.free_passes() < passes {
            let submission = JobSubmission {
                name: None,
                scene: self.scene.clone(),
                assets: BTreeMap::new(),
                samples_per_pixel: PASSES * SAMPLES[0],
                tile_size: self.grid.tile_size,
                priority: 0,
                reference: None,
                time_limit_ms: None,
                target_mse: None,
                target_estimated_mse: None,
                adaptive: false,
                assumptions: Vec::new(),
            };
            let job = self.client.submit_job(&submission).await?;
            self.jobs.insert(job.id, 0);
            self.tally.supply(self.job_passes());
        }
        Ok(())
    }

    /// Keeps the reserve free for a time.
    pub(crate) async fn keep_full(&mut self, time: Duration) -> Result<(), LoadError> {
        let end = Instant::now() + time;
        while Instant::now() < end {
            self.fill(self.reserve()).await?;
            self.check_workers()?;
            tokio::time::sleep(PERIOD.min(end - Instant::now())).await;
        }
        Ok(())
    }

    /// Passes of tiles that are in recorded rounds now.
    pub(crate) async fn merged_passes(&mut self) -> Result<u64, LoadError> {
        let unfinished: Vec<JobId> =
            self.jobs.iter().filter(|(_, passes)| **passes < PASSES).map(|(&job, _)| job).collect();
        for job in unfinished {
            let passes = self.look(job).await?;
            self.jobs.insert(job, passes);
        }
        Ok(self.jobs.values().map(|passes| u64::from(*passes) * u64::from(self.grid.len())).sum())
    }

    /// Waits until every round of every job is recorded.
    pub(crate) async fn finish(&mut self) -> Result<(), LoadError> {
        let mut last = ((0, 0), Instant::now());
        loop {
            self.check_workers()?;
            let merged = self.merged_passes().await?;
            let left = self.jobs.len() as u64 * self.job_passes() - merged;
            if left == 0 {
                return Ok(());
            }
            let now = (self.tally.counts().accepted, merged);
            if now != last.0 {
                last = (now, Instant::now());
            } else if last.1.elapsed() > PROGRESS_TIMEOUT {
                return Err(LoadError::Ended(format!(
                    "nothing was uploaded and no round recorded for {} s: {left} passes of tiles are not merged, {} \
                     not leased",
                    PROGRESS_TIMEOUT.as_secs(),
                    self.tally.free_passes()
                )));
            }
            tokio::time::sleep(PERIOD).await;
        }
    }

    /// Requests a job, and returns its passes in recorded rounds.
    async fn look(&self, id: JobId) -> Result<u32, LoadError> {
        let job = self.client.job(id).await?;
        if job.state.is_final() && job.state != JobState::Done {
            let reason = job.failure.unwrap_or_else(|| job.state.name().to_owned());
            return Err(LoadError::Ended(format!("a job of the load has ended before it was done: {reason}")));
        }
        self.tally.recorded(id, job.complete_passes);
        Ok(job.complete_passes)
    }

    fn check_workers(&self) -> Result<(), LoadError> {
        self.tally
            .failure()
            .map_or(Ok(()), |reason| Err(LoadError::Ended(format!("a simulated worker has ended: {reason}"))))
    }
}

/// A renderable scene: a wall and a lamp.
fn scene(grid: TileGrid) -> Value {
    json!({
        "version": 1,
        "name": "noise",
        "film": {"width": grid.width, "height": grid.height},
        "camera": {"perspective": {
            "position": [0, 0, 3], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 60
        }},
        "integrator": {"path": {}},
        "sampling": {"samples_per_pass": SAMPLES[0], "samples_per_block": SAMPLES[1]},
        "materials": {"white": {"diffuse": {"reflectance": {"colour": [0.8, 0.8, 0.8]}}}},
        "meshes": [{"name": "wall", "material": "white", "source": {"inline": {
            "positions": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
            "triangles": [[0, 1, 2], [0, 2, 3]]
        }}}],
        "lights": [{"point": {"name": "lamp", "position": [1, 1, 2], "intensity": [5, 5, 5]}}]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_cut_without_remainder_and_grow_with_what_is_leased() {
        #[track_caller]
        fn check(tile: u32, leased: u64, width: u32, height: u32) {
            let grid = grid(tile, leased);
            assert_eq!((grid.width, grid.height, grid.tile_size), (width, height, tile));
            assert_eq!(u64::from(grid.len()) * u64::from(tile) * u64::from(tile), u64::from(width) * u64::from(height));
        }
        check(16, 4, 128, 128);
        check(16, 1600, 256, 128);
        check(16, 16_000, 512, 512);
        check(16, 80_000, 512, 512);
        check(64, 16_000, 1024, 1024);
        check(256, 16_000, 1024, 1024);
    }
}
