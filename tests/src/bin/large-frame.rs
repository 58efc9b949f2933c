//! Renders a frame that is many times as large as the memory of its coordinator, on a farm of real processes. The frame
//! is previewed, downloaded, and compared with the render of one process.
//!
//! The coordinator runs under a limit on its memory that the system keeps: this command has to be allowed to set one.
//! What it keeps of the film and the image take some dozens of gigabytes of disk, below `TMPDIR`.

use std::process::{Child, ExitCode, Stdio};
use std::time::{Duration, Instant};

use clap::Parser;
use clerestory_api::{JobId, PreviewQuery};
use clerestory_tests::cgroup::MemoryGroup;
use clerestory_tests::farm::Farm;
use clerestory_tests::large_frame::{self, OPTIONS, PIXEL_BYTES};
use clerestory_tests::peak_memory::peak_memory;
use clerestory_tests::random::Random;

/// Renders a large frame with all layers on a farm whose coordinator may have little memory, and checks the image.
#[derive(Parser)]
struct Arguments {
    /// Pixels across and down.
    #[arg(long, default_value_t = 16384, value_parser = clap::value_parser!(u32).range(64..=16384))]
    edge: u32,
    /// Edge of a tile in pixels.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1024))]
    tile: u32,
    /// Memory that the coordinator may have, MiB.
    #[arg(long, default_value_t = 512)]
    limit: u64,
    /// Workers of one thread.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..))]
    workers: u8,
    /// Tiles that are compared with what this process renders: the corners, and others by chance.
    #[arg(long, default_value_t = 64)]
    tiles: u32,
}

/// Time between two measurements of the coordinator's memory, and between two previews.
const PAUSE: Duration = Duration::from_secs(1);

const MEBIBYTE: u64 = 1 << 20;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            println!("WRONG: {problem}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), String> {
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let folder = temporary.path();
    let limit = arguments.limit * MEBIBYTE;
    let pixels = u64::from(arguments.edge) * u64::from(arguments.edge);
    println!(
        "{0} x {0} pixels with all layers: {1} MiB; limit for the coordinator: {2} MiB",
        arguments.edge,
        pixels * PIXEL_BYTES / MEBIBYTE,
        arguments.limit
    );
    // The C library keeps memory apart for each thread, and returns little of it.
    let mut farm = Farm::start_in(&[("MALLOC_ARENA_MAX".to_owned(), "2".to_owned())], None, &[]);
    let group = limited(&mut farm, limit)?;
    for number in 0..arguments.workers {
        farm.start_worker(&format!("worker {number}"));
    }

    let scene = large_frame::scene(folder, arguments.edge);
    let image = folder.join("large.exr");
    let mut submit = farm.command(&["submit", "--wait", "--tile", &arguments.tile.to_string()]);
    submit.args(OPTIONS).arg(&scene).arg("--output").arg(&image).stdout(Stdio::null()).stdin(Stdio::null());
    let mut submit = submit.spawn().expect("the command starts");
    let seen = Seen::until_downloaded(&mut farm, &mut submit);
    if seen.is_err() {
        // It would wait for its coordinator. It may have ended by itself.
        let _ = submit.kill();
        let _ = submit.wait();
    }
    let seen = seen?;
    let megabytes = std::fs::metadata(&image).expect("the image is there").len() / MEBIBYTE;
    seen.tell(megabytes);
    let peak = group.peak_bytes().map_err(|error| format!("the group does not say its peak: {error}"))?;
    println!("most memory of the group, with pages of files: {} MiB of {}", peak / MEBIBYTE, arguments.limit);
    if seen.coordinator_peak > limit {
        return Err(format!("the coordinator had {} MiB", seen.coordinator_peak / MEBIBYTE));
    }
    let tiles = some_tiles(arguments);
    large_frame::check(&image, &scene, arguments.tile, &tiles)?;
    println!("all passes are there, and {} tiles have the bits that one process renders", tiles.len());
    Ok(())
}

/// What was seen of a farm until the image had been downloaded.
#[derive(Default)]
struct Seen {
    /// Until the job was done.
    rendered: Option<Duration>,
    /// Until the image was there.
    downloaded: Duration,
    previews: u32,
    slowest_preview: Duration,
    /// Most memory of the coordinator and of the command, bytes.
    coordinator_peak: u64,
    command_peak: u64,
}

impl Seen {
    /// Queries a farm, and the preview of its job as a user does, until the command that submits the job and downloads
    /// its image ends.
    fn until_downloaded(farm: &mut Farm, submit: &mut Child) -> Result<Self, String> {
        let (start, mut seen) = (Instant::now(), Self::default());
        loop {
            if farm.coordinator_process().is_none() {
                return Err("the coordinator has ended; see whether it was for its memory".to_owned());
            }
            seen.coordinator_peak = farm.coordinator_memory().resident;
            if let Some(memory) = peak_memory(submit.id()) {
                seen.command_peak = memory.resident;
            }
            if let Some(status) = submit.try_wait().expect("a process of ours") {
                seen.downloaded = start.elapsed();
                return if status.success() { Ok(seen) } else { Err(format!("`clerestory submit` fails: {status}")) };
            }
            if let Some(job) = farm.newest_job_if_any() {
                if job.state.is_final() {
                    seen.rendered.get_or_insert_with(|| start.elapsed());
                } else if let Some(time) = preview(farm, job.id) {
                    (seen.slowest_preview, seen.previews) = (seen.slowest_preview.max(time), seen.previews + 1);
                }
            }
            std::thread::sleep(PAUSE);
        }
    }

    fn tell(&self, megabytes: u64) {
        let rendered = self.rendered.unwrap_or(self.downloaded).as_secs_f64();
        let downloaded = self.downloaded.as_secs_f64();
        println!(
            "rendered, measured and merged in {rendered:.0} s; downloaded after {downloaded:.0} s: {megabytes} MiB"
        );
        println!("{} previews meanwhile, the slowest in {:.1} s", self.previews, self.slowest_preview.as_secs_f64());
        let [coordinator, command] = [self.coordinator_peak, self.command_peak].map(|bytes| bytes / MEBIBYTE);
        println!("most memory: coordinator {coordinator} MiB, `clerestory submit` {command} MiB");
    }
}

/// Puts the coordinator under a limit on its memory.
fn limited(farm: &mut Farm, limit: u64) -> Result<MemoryGroup, String> {
    let process = farm.coordinator_process().expect("the coordinator runs");
    let group = MemoryGroup::new(&format!("clerestory-large-frame-{process}"), limit);
    let group = group.and_then(|group| group.add(process).map(|()| group));
    group.map_err(|error| format!("no control group keeps the limit: {error}"))
}

/// How long a preview takes.
fn preview(farm: &Farm, job: JobId) -> Option<Duration> {
    let start = Instant::now();
    farm.asked_if_it_answers(async |client| client.preview(job, &PreviewQuery::default()).await)?;
    Some(start.elapsed())
}

/// The corners, and others by chance.
fn some_tiles(arguments: &Arguments) -> Vec<u32> {
    let along = arguments.edge.div_ceil(arguments.tile);
    let mut tiles = vec![0, along - 1, along * (along - 1), along * along - 1];
    let mut random = Random::new(1, 0);
    while tiles.len() < arguments.tiles as usize {
        tiles.push((random.uniform() * f64::from(along * along)) as u32);
    }
    tiles
}
