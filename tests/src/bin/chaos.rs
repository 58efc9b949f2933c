//! The long version of the farm's tests: jobs of all kinds while processes die, stop and sleep at random moments; every
//! image has to have the bits that one process makes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use clerestory_api::JobState;
use clerestory_render_core::counters::Counters;
use clerestory_render_core::film::{DecodeBudget, FrameImage};
use clerestory_test_servers::{Postgres, S3Server};
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
    /// Two coordinators on PostgreSQL and S3, all of which are hit too, instead of one with its own files.
    #[arg(long)]
    servers: bool,
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

/// Longest sleep of a coordinator, seconds: longer than PostgreSQL lets a transaction wait.
const LONGEST_SLEEP_OF_A_COORDINATOR: f64 = 8.0;

/// Who is hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Victim {
    Worker,
    Coordinator,
    Database,
    ObjectStore,
}

/// How.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Blow {
    /// Killed, as by a power cut, and another started.
    Killed,
    /// Asked to stop, and another started.
    Stopped,
    /// Suspended for some seconds.
    Suspended,
}

/// Every blow on a farm of one coordinator with its own files.
const ON_FILES: [(Victim, Blow); 5] = [
    (Victim::Worker, Blow::Killed),
    (Victim::Worker, Blow::Stopped),
    (Victim::Worker, Blow::Suspended),
    (Victim::Coordinator, Blow::Killed),
    (Victim::Coordinator, Blow::Suspended),
];

/// Every blow on a farm of two coordinators on PostgreSQL and S3.
const ON_SERVERS: [(Victim, Blow); 7] = [
    (Victim::Worker, Blow::Killed),
    (Victim::Worker, Blow::Stopped),
    (Victim::Worker, Blow::Suspended),
    (Victim::Coordinator, Blow::Killed),
    (Victim::Coordinator, Blow::Suspended),
    (Victim::Database, Blow::Killed),
    (Victim::ObjectStore, Blow::Killed),
];

/// The servers behind several coordinators.
struct Servers {
    database: Postgres,
    objects: S3Server,
}

/// A farm under attack.
struct Siege {
    farm: Farm,
    servers: Option<Servers>,
    coordinators: usize,
    random: Random,
    /// Numbers of the workers that run, and when they wake up if they are suspended.
    workers: Vec<(usize, Option<Instant>)>,
    started: usize,
    /// The coordinator that is suspended, and when it wakes up.
    asleep: Option<(usize, Instant)>,
    blows: BTreeMap<(Victim, Blow), u32>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut siege = Siege::lay(&arguments);
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
    let dealt: u32 = siege.blows.values().sum();
    println!("{jobs} jobs, {wrong} with other bits or not done; {dealt} faults: {}", siege.told());
    if let Some(missing) = siege.kinds().iter().find(|kind| !siege.blows.contains_key(kind)) {
        println!("{missing:?} did not happen: nothing is shown; give it more --minutes");
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
    /// A farm with its workers.
    fn lay(arguments: &Arguments) -> Self {
        let lease_nodes = (1 + arguments.seed % 7).to_string();
        let options = ["--lease-nodes", &lease_nodes, "--lease-seconds", LEASE_SECONDS];
        let mut siege = if arguments.servers {
            let (database, objects) = (Postgres::start(), S3Server::start());
            let servers = Servers {
                database: database.expect("PostgreSQL starts"),
                objects: objects.expect("the S3 server starts"),
            };
            let bucket = format!("s3://{}/farm", servers.objects.new_bucket());
            let address = servers.database.new_database();
            let options = [&options[..], &["--database", &address, "--object-store", &bucket]].concat();
            let farm = Farm::start_several(2, &servers.objects.environment(), &options);
            Self::of(farm, Some(servers), 2, arguments.seed)
        } else {
            Self::of(Farm::start(None, &options), None, 1, arguments.seed)
        };
        for _ in 0..arguments.workers {
            siege.start_worker();
        }
        siege
    }

    fn of(farm: Farm, servers: Option<Servers>, coordinators: usize, seed: u64) -> Self {
        Self {
            farm,
            servers,
            coordinators,
            random: Random::new(seed, 0),
            workers: Vec::new(),
            started: 0,
            asleep: None,
            blows: BTreeMap::new(),
        }
    }

    /// What can happen here.
    fn kinds(&self) -> &'static [(Victim, Blow)] {
        if self.servers.is_some() { &ON_SERVERS } else { &ON_FILES }
    }

    /// What has happened, in words.
    fn told(&self) -> String {
        let one = |((victim, blow), count): (&(Victim, Blow), &u32)| format!("{victim:?} {blow:?} {count}");
        self.blows.iter().map(one).collect::<Vec<_>>().join(", ")
    }

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
        self.rest();
        self.farm.submit(&scene, &order);
        let job = loop {
            let pause = PAUSES[0] + (PAUSES[1] - PAUSES[0]) * self.random.uniform();
            std::thread::sleep(Duration::from_secs_f64(pause));
            self.wake();
            // While a server is away or a coordinator asleep, nobody may answer.
            let Some(job) = self.farm.newest_job_if_any() else { continue };
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
        self.rest();
        let image = self.farm.image(job.id);
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let alone = folder.path().join("alone.exr");
        succeeded(clerestory().arg("render").arg(&scene).args(order).arg("-o").arg(&alone));
        let alone = std::fs::read(&alone).map_err(|error| error.to_string())?;
        println!("{} {order:?}: {:.1} s; {}", job.id, start.elapsed().as_secs_f64(), self.told());
        same_samples(&image, &alone).map_err(|difference| format!("{order:?}: {difference}"))?;
        let [ours, alone] = [counters(&image), counters(&alone)];
        if ours == alone { Ok(()) } else { Err(format!("{order:?}: counted {ours:?}, alone {alone:?}")) }
    }

    fn start_worker(&mut self) {
        self.farm.start_worker(&format!("worker {}", self.started));
        self.workers.push((self.started, None));
        self.started += 1;
    }

    /// Wakes up who has slept enough.
    fn wake(&mut self) {
        for (worker, wakes) in &mut self.workers {
            if wakes.is_some_and(|wakes| wakes <= Instant::now()) {
                self.farm.suspend_worker(*worker, false);
                *wakes = None;
            }
        }
        if let Some((coordinator, wakes)) = self.asleep
            && wakes <= Instant::now()
        {
            self.farm.suspend_coordinator(coordinator, false);
            self.asleep = None;
        }
    }

    /// Wakes up all coordinators: what is asked next has to be answered.
    fn rest(&mut self) {
        if let Some((coordinator, _)) = self.asleep.take() {
            self.farm.suspend_coordinator(coordinator, false);
        }
    }

    /// Deals one blow at random.
    fn strike(&mut self) {
        let kinds = self.kinds();
        let kind = kinds[self.below(kinds.len())];
        let victim = self.below(self.workers.len());
        let (worker, wakes) = self.workers[victim];
        let coordinator = self.below(self.coordinators);
        match kind {
            (Victim::Worker, Blow::Killed) => {
                self.farm.kill_worker(worker);
                self.workers.remove(victim);
                self.start_worker();
            }
            // One that sleeps hears nothing.
            (Victim::Worker, Blow::Stopped | Blow::Suspended) if wakes.is_some() => return,
            (Victim::Worker, Blow::Stopped) => {
                self.farm.ask_worker_to_stop(worker);
                self.workers.remove(victim);
                self.start_worker();
            }
            (Victim::Worker, Blow::Suspended) => {
                self.farm.suspend_worker(worker, true);
                self.workers[victim].1 = Some(self.in_up_to(LONGEST_SLEEP));
            }
            (Victim::Coordinator, Blow::Suspended) if self.asleep.is_none() => {
                self.farm.suspend_coordinator(coordinator, true);
                self.asleep = Some((coordinator, self.in_up_to(LONGEST_SLEEP_OF_A_COORDINATOR)));
            }
            (Victim::Coordinator, Blow::Suspended | Blow::Stopped) => return,
            (Victim::Coordinator, Blow::Killed) => {
                self.farm.kill_coordinator(coordinator);
                if self.asleep.is_some_and(|(asleep, _)| asleep == coordinator) {
                    self.asleep = None;
                }
                self.pause();
                self.farm.restart_coordinator(coordinator);
            }
            (Victim::Database | Victim::ObjectStore, _) => {
                let Some(mut servers) = self.servers.take() else { return };
                if kind.0 == Victim::Database {
                    servers.database.kill();
                    self.pause();
                    servers.database.restart();
                } else {
                    servers.objects.kill();
                    self.pause();
                    servers.objects.restart();
                }
                self.servers = Some(servers);
            }
        }
        *self.blows.entry(kind).or_default() += 1;
    }

    /// For how long somebody who was killed is away.
    fn pause(&mut self) {
        std::thread::sleep(Duration::from_secs_f64(PAUSES[1] * self.random.uniform()));
    }

    fn in_up_to(&mut self, seconds: f64) -> Instant {
        Instant::now() + Duration::from_secs_f64(seconds * self.random.uniform())
    }

    fn below(&mut self, end: usize) -> usize {
        ((self.random.uniform() * end as f64) as usize).min(end - 1)
    }
}
