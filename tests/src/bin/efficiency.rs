//! What a farm costs: samples a second of `clerestory farm` beside those of `clerestory render`, and of two workers
//! beside one.
//!
//! Both render the same image of the same scene, in turn, so that whatever else the machine does falls on both. The
//! time of `render` is that of its process. The time of a farm is that of `submit --wait`, which also downloads the
//! image. Each pair gives a ratio. The median counts, because the cores of a shared machine are slower for some minutes
//! and faster for others. It fails when that is less than it should be.
//!
//! ```text
//! tests/run build && target/release/efficiency
//! ```

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;
use clerestory_api::Client;
use clerestory_tests::farm::{Process, clerestory, succeeded};

/// Time between two queries of the workers of a farm that starts.
const LOOK: Duration = Duration::from_millis(10);

/// Compares the speed of a farm with that of one process, and of two workers with that of one.
#[derive(Parser)]
struct Arguments {
    /// The scene [default: the room].
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Samples in each pixel of the comparison with `render`, on all cores; a single thread renders half as many.
    #[arg(long, default_value_t = 64)]
    spp: u32,
    /// Width and height.
    #[arg(long, default_value = "640x480")]
    size: String,
    /// Pairs of renders.
    #[arg(long, default_value_t = 7)]
    pairs: u32,
}

/// What is rendered.
struct Work {
    scene: PathBuf,
    size: String,
    samples_per_pixel: u32,
}

/// Least part of the samples a second of `render` that a farm of one worker should reach.
const OF_RENDER: f64 = 0.97;

/// How many times as fast as one single-threaded worker two should be.
const OF_ONE: f64 = 1.9;

fn main() -> ExitCode {
    let Arguments { scene, spp, size, pairs } = Arguments::parse();
    let room = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/room.json");
    let work = Work { scene: scene.unwrap_or_else(room), size, samples_per_pixel: spp };
    let ratios = compared("one worker", "render", pairs, || farm(&work, 1, &[]), || render(&work));
    let of_render = median(ratios);
    println!("one worker reaches {of_render:.3} of the samples a second of `render` (median of {pairs} pairs)");
    let work = Work { samples_per_pixel: spp.div_ceil(2), ..work };
    let workers = |count| farm(&work, count, &["--threads", "1"]);
    let ratios = compared("two workers", "one", pairs, || workers(2), || workers(1));
    let of_one = median(ratios);
    println!("two workers of one thread are {of_one:.3} times as fast as one (median of {pairs} pairs)");
    if of_render >= OF_RENDER && of_one >= OF_ONE {
        ExitCode::SUCCESS
    } else {
        println!("wanted: at least {OF_RENDER} and {OF_ONE}");
        ExitCode::FAILURE
    }
}

/// How many times as fast the first is as the second, in each pair. Who begins changes from pair to pair.
fn compared(
    first: &str,
    second: &str,
    pairs: u32,
    mut of_first: impl FnMut() -> Duration,
    mut of_second: impl FnMut() -> Duration,
) -> Vec<f64> {
    let pair = |number: u32| {
        let (mut of_first, mut of_second) = (|| of_first().as_secs_f64(), || of_second().as_secs_f64());
        let [of_first, of_second] = if number.is_multiple_of(2) {
            [of_first(), of_second()]
        } else {
            let of_second = of_second();
            [of_first(), of_second]
        };
        let ratio = of_second / of_first;
        println!("{first} {of_first:.2} s, {second} {of_second:.2} s: {ratio:.3}");
        ratio
    };
    (0..pairs).map(pair).collect()
}

/// How long one process takes.
fn render(work: &Work) -> Duration {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut command = clerestory();
    command.arg("render");
    work.order(&mut command).arg("-o").arg(folder.path().join("image.exr"));
    let start = Instant::now();
    succeeded(&mut command);
    start.elapsed()
}

/// Time of a farm with this many workers, without its start.
fn farm(work: &Work, workers: usize, options: &[&str]) -> Duration {
    let data = tempfile::tempdir().expect("a temporary folder");
    let mut command = clerestory();
    command.args(["farm", "--listen", "127.0.0.1:0", "--data"]).arg(data.path()).args(options);
    command.arg("--workers").arg(workers.to_string());
    let (mut process, address) = Process::serving(&mut command);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let client = Client::new(&address, None).expect("an address");
    while runtime.block_on(client.workers()).expect("an answer").len() < workers {
        thread::sleep(LOOK);
    }
    let start = Instant::now();
    let mut order = clerestory();
    order.args(["submit", "--wait"]).env("CLERESTORY_COORDINATOR", &address);
    order.arg("-o").arg(data.path().join("image.exr"));
    succeeded(work.order(&mut order));
    let time = start.elapsed();
    process.ends();
    time
}

impl Work {
    fn order<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        let samples = self.samples_per_pixel.to_string();
        command.arg(&self.scene).args(["--size", &self.size, "--spp", &samples])
    }
}

/// The middle one.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { (values[middle - 1] + values[middle]) / 2.0 }
}
