//! A farm under attack, while it renders jobs of all kinds. Real processes are killed, suspended and cut off from one
//! another; their disks and clocks fail. A seed draws the faults, one after the other.
//!
//! Every target recovers after a while, as under an operator or a supervisor of services: a killed process is started
//! again. In any case every job has to end, and every image has to have the bits of a render in one process.

mod faults;
mod injection;
mod job_request;
mod servers;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::time::{Duration, Instant};

use clerestory_api::{Client, ClientError, JobId, JobView};
use clerestory_test_servers::Faults;

pub use faults::Durations;
use faults::{Fault, FaultKind, ON_FILES, ON_SERVERS, Schedule, Target, below};
use job_request::{JobRequest, RULES, unknown_jobs};
use servers::Servers;

use crate::farm::Farm;
use crate::proxy::{Fate, Protocol, Proxy};
use crate::random::Random;

/// Leases expire after this time, seconds. Some suspensions last longer.
const LEASE_SECONDS: &str = "2";

/// Time between two checks for due recoveries.
const TICK: Duration = Duration::from_millis(20);

/// Time between two queries of the jobs.
const LOOK: Duration = Duration::from_millis(250);

/// Timeout of a query.
const ANSWER: Duration = Duration::from_secs(2);

/// Pause before a coordinator or server that does not start is started again.
const RESTART: Duration = Duration::from_millis(500);

/// Size of a step of a clock, seconds.
const STEP: i64 = 60;

/// Streams of the seed: of the jobs, of the leases of restarted coordinators, and of the order of faults. Each fault
/// has a stream of its own after that. They are far from those of the network, which are the numbers of connections.
const JOBS: u64 = 1 << 32;
const LEASES: u64 = 2 << 32;
const FAULTS: u64 = 3 << 32;

/// How coordinators size leases.
const LEASE_SIZES: [&str; 2] = ["sized by the rate of each worker", "of a fixed number of nodes"];

/// The plan of an attack.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Seed of the faults, the network, the leases and the jobs.
    pub seed: u64,
    /// Whether there are two coordinators on PostgreSQL and S3, instead of one with its own files. The servers are
    /// targets too.
    pub servers: bool,
    /// Workers at the same time.
    pub workers: usize,
    /// Durations of suspensions and faults.
    pub durations: Durations,
    /// Whether faults continue when each kind was injected. Then some jobs are adaptive or end at a target, and
    /// messages to servers must meet with every fate.
    pub is_long: bool,
    /// Factor of the failures of the network in front of coordinators.
    pub roughness: f64,
    /// Most passes of a job.
    pub passes: usize,
    /// Longest time for a job or for the recovery of a target.
    pub timeout: Duration,
    /// `CLERESTORY_LOG` of coordinators, workers and commands.
    pub log: &'static str,
}

/// The state of a coordinator.
struct Coordinator {
    /// Whether it is killed and not yet started again.
    is_down: bool,
    is_suspended: bool,
    has_faults: bool,
    clock_step: i64,
    /// Whether it has answered since its start.
    has_answered: bool,
    /// Whether its leases have a fixed number of nodes, instead of sizes by the rate of each worker.
    has_fixed_leases: bool,
    /// When to start it again if it ends before it answers.
    again: Instant,
}

/// The recovery of a target.
#[derive(Clone, Copy, Debug)]
enum Recovery {
    ResumeWorker(usize),
    StartCoordinator(usize),
    ResumeCoordinator(usize),
    /// With the number of failures of its disk before the fault.
    RepairCoordinatorDisk(usize, u64),
    StartDatabase,
    ResumeDatabase,
    /// How often its disk had failed before.
    RepairDatabaseDisk(u64),
    StartObjects,
    ResumeObjects,
    /// How often its disk had failed before.
    RepairObjectsDisk(u64),
}

/// A farm under attack.
pub struct Chaos {
    plan: Plan,
    farm: Farm,
    servers: Option<Servers>,
    network: Proxy,
    /// The rule of the first job; the others follow in turn.
    first_rule: usize,
    /// Draws the jobs.
    job_random: Random,
    /// Draws the leases of restarted coordinators.
    leases: Random,
    schedule: Schedule,
    /// Draws the rest about the current fault.
    random: Random,
    /// Number of queries of the jobs.
    looks: usize,
    workers: Vec<(usize, bool)>,
    started: usize,
    coordinators: Vec<Coordinator>,
    database_is_faulty: bool,
    objects_are_faulty: bool,
    due: Vec<(Instant, Recovery)>,
    next_fault: Instant,
    is_over: bool,
    requests: Vec<JobRequest>,
    injected: BTreeMap<FaultKind, u32>,
    /// Restarts of coordinators and servers that had ended by themselves.
    restarts: BTreeMap<Target, u32>,
    /// Starts of coordinators that answered, for each of [`LEASE_SIZES`].
    starts: [u32; 2],
    checked: BTreeSet<JobId>,
    wrong: Vec<String>,
}

impl Chaos {
    /// A farm with its workers.
    ///
    /// # Panics
    ///
    /// When it does not start.
    pub fn start(plan: Plan) -> Self {
        // Leases are sized by the rates of workers until a coordinator is started again.
        let options = ["--lease-seconds", LEASE_SECONDS];
        let log = ("CLERESTORY_LOG".to_owned(), plan.log.to_owned());
        let (mut farm, servers) = if plan.servers {
            let servers = Servers::start(plan.seed);
            let shared = servers.options();
            let options: Vec<&str> = options.into_iter().chain(shared.iter().map(String::as_str)).collect();
            let environment: Vec<_> = servers.environment().into_iter().chain([log]).collect();
            // A coordinator that starts during a fault may give up, and nothing restarts the first ones.
            servers.network.iter().for_each(|network| network.calm(true));
            let farm = Farm::start_with_faults(2, &environment, &options);
            servers.network.iter().for_each(|network| network.calm(false));
            (farm, Some(servers))
        } else {
            (Farm::start_with_faults(1, &[log], &options), None)
        };
        let network = Proxy::start(Protocol::Http, farm.sockets(), plan.seed, plan.roughness).expect("a free port");
        farm.call_through(network.address());
        let now = Instant::now();
        let coordinator = |_| Coordinator {
            is_down: false,
            is_suspended: false,
            has_faults: false,
            clock_step: 0,
            has_answered: false,
            has_fixed_leases: false,
            again: now,
        };
        let mut job_random = Random::new(plan.seed, JOBS);
        let mut chaos = Self {
            plan,
            coordinators: farm.sockets().into_iter().map(coordinator).collect(),
            farm,
            servers,
            network,
            first_rule: below(&mut job_random, RULES.len()),
            job_random,
            leases: Random::new(plan.seed, LEASES),
            schedule: Schedule::of(if plan.servers { &ON_SERVERS } else { &ON_FILES }, plan.seed),
            random: Random::new(plan.seed, FAULTS),
            looks: 0,
            workers: Vec::new(),
            started: 0,
            database_is_faulty: false,
            objects_are_faulty: false,
            due: Vec::new(),
            next_fault: now,
            is_over: false,
            requests: Vec::new(),
            injected: BTreeMap::new(),
            restarts: BTreeMap::new(),
            starts: [0; 2],
            checked: BTreeSet::new(),
            wrong: Vec::new(),
        };
        for _ in 0..plan.workers {
            chaos.start_worker();
        }
        chaos
    }

    /// Renders one or two jobs under attack, and checks their images. Returns their number.
    pub fn render_jobs(&mut self) -> usize {
        let count = 1 + below(&mut self.job_random, 2);
        let first = self.requests.len();
        for number in first..first + count {
            let rule = if self.plan.is_long { RULES[(self.first_rule + number) % RULES.len()] } else { &[] };
            self.requests.push(JobRequest::draw(&mut self.job_random, number, self.plan.passes, rule));
        }
        self.until_ended(first);
        count
    }

    /// Recovers all targets, waits until all jobs have ended, and checks all images once more.
    pub fn recover_all(&mut self) {
        self.is_over = true;
        self.network.calm(true);
        for network in self.servers.iter().flat_map(|servers| &servers.network) {
            network.calm(true);
        }
        for (_, recovery) in std::mem::take(&mut self.due) {
            self.recover(recovery);
        }
        for index in 0..self.coordinators.len() {
            self.step_clock(index, 0);
        }
        self.checked.clear();
        if let Some(jobs) = self.until_ended(0) {
            self.wrong.extend(unknown_jobs(&jobs, &self.requests));
        }
    }

    /// Descriptions of everything that is wrong.
    pub fn wrong(&self) -> &[String] {
        &self.wrong
    }

    /// Kinds of faults, fates and jobs that have not occurred yet.
    pub fn missing(&self) -> Vec<String> {
        let mut missing = self.missing_faults();
        missing.extend(self.missing_rules());
        let fates = self.network.fates();
        let all = [Fate::Delayed, Fate::Dropped, Fate::Cut, Fate::Unanswered, Fate::Duplicated];
        missing.extend(all.iter().filter(|fate| !fates.contains_key(fate)).map(|fate| format!("requests {fate}")));
        let between = self.servers.iter().flat_map(|servers| &servers.network).map(Proxy::fates);
        let all = [Fate::Delayed, Fate::Cut, Fate::Swallowed];
        let unmet = |fate: &&Fate| between.clone().all(|fates| !fates.contains_key(fate));
        if self.plan.is_long && self.servers.is_some() {
            missing.extend(all.iter().filter(unmet).map(|fate| format!("messages to servers {fate}")));
        }
        missing
    }

    /// Rules that no job has had yet, where jobs have rules. They are used in turn.
    pub fn missing_rules(&self) -> Vec<String> {
        let has_come = |rule| !self.plan.is_long || self.requests.iter().any(|request| request.rule == rule);
        let missing = RULES.into_iter().filter(|&rule| !has_come(rule));
        missing.map(|rule| format!("a job with the options {rule:?}")).collect()
    }

    /// Kinds of faults that were not injected or not noticed yet, and sizes of leases, which change when coordinators
    /// are killed.
    fn missing_faults(&self) -> Vec<String> {
        let kinds = self.schedule.kinds().iter().filter(|kind| !self.injected.contains_key(kind));
        let mut missing: Vec<String> = kinds.map(|(target, fault)| format!("{target} {fault}")).collect();
        let sizes = LEASE_SIZES.into_iter().zip(self.starts).filter(|(_, count)| *count == 0);
        missing.extend(sizes.map(|(size, _)| format!("coordinators with leases {size}")));
        let is_scheduled = |target: Target, fault: Fault| self.schedule.kinds().contains(&(target, fault));
        for (target, faults) in self.faults() {
            if is_scheduled(target, Fault::DiskFull) && faults.iter().all(|faults| faults.failed_writes() == 0) {
                missing.push(format!("writes of {target} that fail"));
            }
            if is_scheduled(target, Fault::SyncsFail) && faults.iter().all(|faults| faults.failed_syncs() == 0) {
                missing.push(format!("syncs of {target} that fail"));
            }
        }
        missing
    }

    /// Number of killed and suspended processes.
    pub fn sudden_faults(&self) -> u32 {
        self.injected.iter().filter(|((_, fault), _)| fault.is_sudden()).map(|(_, count)| count).sum()
    }

    /// A summary in lines.
    pub fn summary(&self) -> String {
        let mut text = format!("{} jobs; {} SIGKILLs and SIGSTOPs\n", self.checked.len(), self.sudden_faults());
        for ((target, fault), count) in &self.injected {
            let _ = writeln!(text, "{count:6} {target} {fault}");
        }
        for (target, faults) in self.faults() {
            let (writes, syncs) = faults.iter().fold((0, 0), |(writes, syncs), faults| {
                (writes + faults.failed_writes(), syncs + faults.failed_syncs())
            });
            if writes + syncs > 0 {
                let _ = writeln!(text, "{writes:6} writes and {syncs} syncs of {target} failed");
            }
        }
        for (fate, count) in self.network.fates() {
            let _ = writeln!(text, "{count:6} requests to coordinators {fate}");
        }
        for (name, network) in
            ["PostgreSQL", "the object server"].iter().zip(self.servers.iter().flat_map(|all| &all.network))
        {
            for (fate, count) in network.fates() {
                let _ = writeln!(text, "{count:6} messages between coordinators and {name} {fate}");
            }
        }
        for (size, count) in LEASE_SIZES.into_iter().zip(self.starts) {
            let _ = writeln!(text, "{count:6} starts of coordinators with leases {size}");
        }
        for (target, count) in &self.restarts {
            let _ = writeln!(text, "{count:6} starts of {target} that had ended by themselves or could not start");
        }
        text
    }

    /// The faults of all disks.
    fn faults(&self) -> [(Target, Vec<&Faults>); 3] {
        let coordinators = (0..self.coordinators.len()).filter_map(|index| self.farm.faults(index)).collect();
        let database = self.servers.iter().filter_map(|servers| servers.database.faults()).collect();
        let objects = self.servers.iter().filter_map(|servers| servers.objects.faults()).collect();
        [(Target::Coordinator, coordinators), (Target::Database, database), (Target::ObjectStore, objects)]
    }

    /// Waits, under attack, until the jobs from `first` on have ended and their images are checked. Returns all jobs of
    /// the farm, or `None` at a timeout.
    fn until_ended(&mut self, first: usize) -> Option<Vec<JobView>> {
        let start = Instant::now();
        let mut next_look = Instant::now();
        let mut jobs = Vec::new();
        loop {
            self.tick();
            std::thread::sleep(TICK);
            if next_look > Instant::now() {
                continue;
            }
            next_look = Instant::now() + LOOK;
            if let Some((index, found)) = self.jobs() {
                jobs = found;
                for request in &mut self.requests[first..] {
                    request.submit(|arguments| self.farm.command(arguments), &jobs);
                }
                if self.requests[first..].iter().all(|request| request.has_ended(&jobs))
                    && self.check_all(index, &jobs, first)
                {
                    return Some(jobs);
                }
            }
            if start.elapsed() > self.plan.timeout {
                let told = |job: &JobView| format!("{} is {} ({:.3})", job.name, job.state.name(), job.progress);
                let told: Vec<String> = jobs.iter().map(told).collect();
                self.wrong.push(format!("not done after {:?}: {}", self.plan.timeout, told.join(", ")));
                return None;
            }
        }
    }

    /// Checks the unchecked jobs from `first` on. False when a coordinator did not answer.
    fn check_all(&mut self, index: usize, jobs: &[JobView], first: usize) -> bool {
        for job in jobs.iter().filter(|job| job.state.is_final() && !self.checked.contains(&job.id)).collect::<Vec<_>>()
        {
            let Some(place) = self.requests[first..].iter().position(|request| request.name == job.name) else {
                continue;
            };
            let Some(image) = self.ask(index, async |client| client.image(job.id).await) else { return false };
            let checked = self.requests[first + place].check(job, &image);
            self.wrong.extend(checked.err());
            self.checked.insert(job.id);
        }
        true
    }

    /// All jobs, from the next coordinator in turn that answers.
    fn jobs(&mut self) -> Option<(usize, Vec<JobView>)> {
        let up: Vec<usize> = (0..self.coordinators.len()).filter(|index| self.is_up(*index)).collect();
        self.looks += 1;
        let index = *up.get(self.looks % up.len().max(1))?;
        let jobs = self.ask(index, async |client| client.jobs().await)?;
        let Coordinator { has_answered, has_fixed_leases, .. } = &mut self.coordinators[index];
        if !std::mem::replace(has_answered, true) {
            self.starts[usize::from(*has_fixed_leases)] += 1;
        }
        Some((index, jobs))
    }

    /// Calls a coordinator directly, not through the network.
    fn ask<T>(&self, index: usize, call: impl AsyncFnOnce(&Client) -> Result<T, ClientError>) -> Option<T> {
        let client = Client::new(&format!("http://{}", self.farm.sockets()[index]), None).ok()?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().ok()?;
        runtime.block_on(async { tokio::time::timeout(ANSWER, call(&client)).await.ok()?.ok() })
    }
}
