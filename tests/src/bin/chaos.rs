//! The long version of the farm's tests: jobs of all kinds while processes die, stop and sleep at random moments; every
//! image has to have the bits that one process makes.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use clerestory_api::JobState;
use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{DecodeBudget, FrameImage};
use clerestory_tests::exr_files::same_samples;
use clerestory_tests::farm::{Farm, clerestory, succeeded};
use clerestory_tests::random::Random;

/// Renders jobs on a farm whose processes are killed, stopped and suspended at random, and compares every image, bit for
/// bit, with that of one process.
#[derive(Parser)]
struct Arguments {
    /// How long, minutes.
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
    /// Seed of the moments and of the jobs.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Workers at the same time.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..))]
    workers: u8,
}

/// Scenes and integrators of the jobs.
const JOBS: [(&str, &str); 4] = [
    ("references/crown-sphere.json", "cone"),
    ("references/crown-sphere.json", "fnee"),
    ("references/bump-point.json", "fnee"),
    ("room.json", "path"),
];

/// Shortest and longest time between two blows, seconds.
const PAUSES: [f64; 2] = [0.1, 2.0];

/// Leases run out after this time, seconds: some workers sleep for longer.
const LEASE_SECONDS: &str = "2";

/// Longest sleep of a worker, seconds.
const LONGEST_SLEEP: f64 = 4.0;

/// Longest time that a job may take, however often its farm is hit.
const PATIENCE: Duration = Duration::from_secs(600);

/// How often each blow was dealt.
#[derive(Debug, Default)]
struct Blows {
    workers_killed: u32,
    workers_stopped: u32,
    workers_suspended: u32,
    coordinators_killed: u32,
}

/// A farm under attack.
struct Siege {
    farm: Farm,
    random: Random,
    /// Numbers of the workers that run, and when they wake up if they are suspended.
    workers: Vec<(usize, Option<Instant>)>,
    started: usize,
    blows: Blows,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let lease_nodes = (1 + arguments.seed % 7).to_string();
    let options = ["--lease-nodes", &lease_nodes, "--lease-seconds", LEASE_SECONDS];
    let mut siege = Siege {
        farm: Farm::start(None, &options),
        random: Random::new(arguments.seed, 0),
        workers: Vec::new(),
        started: 0,
        blows: Blows::default(),
    };
    for _ in 0..arguments.workers {
        siege.start_worker();
    }
    let end = Instant::now() + Duration::from_secs_f64(arguments.minutes * 60.0);
    let (mut jobs, mut wrong) = (0, 0);
    while Instant::now() < end {
        let result = siege.job();
        jobs += 1;
        wrong += u32::from(result.is_err());
        if let Err(difference) = result {
            println!("WRONG: {difference}");
        }
    }
    println!("{jobs} jobs, {wrong} with other bits; {:?}", siege.blows);
    let Blows { workers_killed, workers_stopped, workers_suspended, coordinators_killed } = siege.blows;
    if [workers_killed, workers_stopped, workers_suspended, coordinators_killed].contains(&0) {
        println!("not every blow was dealt: nothing is shown; give it more --minutes");
        return ExitCode::FAILURE;
    }
    if wrong == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// What was counted while an image was rendered: also that nothing was merged twice.
fn counters(image: &[u8]) -> Option<Counters> {
    let image = FrameImage::decode(image, DecodeBudget { pixel_bytes: 1 << 24 }).ok()?;
    image.metadata().map(|metadata| metadata.counters)
}

impl Siege {
    /// One job under attack; what is wrong with its image.
    fn job(&mut self) -> Result<(), String> {
        let (scene, integrator) = JOBS[self.below(JOBS.len())];
        let samples = (16 * (1 + self.below(21))).to_string();
        let edge = 40 + self.below(60);
        let size = format!("{edge}x{}", 30 + self.below(60));
        let tile = ["8", "16", "64"][self.below(3)];
        let seed = self.below(1000).to_string();
        let scene: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(scene);
        let order = ["--integrator", integrator, "--spp", &samples, "--size", &size, "--seed", &seed, "--tile", tile];
        let start = Instant::now();
        self.farm.submit(&scene, &order);
        let job = loop {
            let pause = PAUSES[0] + (PAUSES[1] - PAUSES[0]) * self.random.uniform();
            std::thread::sleep(Duration::from_secs_f64(pause));
            let job = self.farm.newest_job();
            if !matches!(job.state, JobState::Queued | JobState::Running) {
                break job;
            }
            if start.elapsed() > PATIENCE {
                return Err(format!("{order:?}: not done after {PATIENCE:?}: {job:?}"));
            }
            self.strike();
        };
        if job.state != JobState::Done {
            return Err(format!("{order:?}: {:?}, {:?}", job.state, job.failure));
        }
        let image = self.farm.image(job.id);
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let alone = folder.path().join("alone.exr");
        succeeded(clerestory().arg("render").arg(&scene).args(order).arg("-o").arg(&alone));
        let alone = std::fs::read(&alone).map_err(|error| error.to_string())?;
        println!("{} {order:?}: {:.1} s, {:?}", job.id, start.elapsed().as_secs_f64(), self.blows);
        same_samples(&image, &alone).map_err(|difference| format!("{order:?}: {difference}"))?;
        let [ours, alone] = [counters(&image), counters(&alone)];
        if ours == alone { Ok(()) } else { Err(format!("{order:?}: counted {ours:?}, alone {alone:?}")) }
    }

    fn start_worker(&mut self) {
        self.farm.start_worker(&format!("worker {}", self.started));
        self.workers.push((self.started, None));
        self.started += 1;
    }

    /// Deals one blow at random, and wakes up who has slept enough.
    fn strike(&mut self) {
        for (worker, wakes) in &mut self.workers {
            if wakes.is_some_and(|wakes| wakes <= Instant::now()) {
                self.farm.suspend_worker(*worker, false);
                *wakes = None;
            }
        }
        let victim = self.below(self.workers.len());
        let (worker, wakes) = self.workers[victim];
        match self.below(8) {
            0 | 1 => {
                self.farm.kill_worker(worker);
                self.workers.remove(victim);
                self.start_worker();
                self.blows.workers_killed += 1;
            }
            2 | 3 if wakes.is_none() => {
                assert!(self.farm.stop_worker(worker).success(), "a worker that is asked to stop succeeds");
                self.workers.remove(victim);
                self.start_worker();
                self.blows.workers_stopped += 1;
            }
            4 | 5 if wakes.is_none() => {
                self.farm.suspend_worker(worker, true);
                let sleep = LONGEST_SLEEP * self.random.uniform();
                self.workers[victim].1 = Some(Instant::now() + Duration::from_secs_f64(sleep));
                self.blows.workers_suspended += 1;
            }
            6 => {
                self.farm.kill_coordinator();
                self.farm.restart_coordinator();
                self.blows.coordinators_killed += 1;
            }
            _ => {}
        }
    }

    fn below(&mut self, end: usize) -> usize {
        ((self.random.uniform() * end as f64) as usize).min(end - 1)
    }
}
