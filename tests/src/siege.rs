//! A farm under attack, while it renders jobs of all kinds. Real processes are killed, suspended and cut off from one
//! another; their disks and clocks fail. A seed draws the faults, one after the other.
//!
//! Whoever is hit recovers after a while, as an operator or a supervisor of services would have it: who was killed is
//! started again. Whatever happens, every job has to end, and every image to have the bits that one process makes.

mod attack;
mod blows;
mod order;
mod servers;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::time::{Duration, Instant};

use clerestory_api::{Client, ClientError, JobId, JobView};
use clerestory_test_servers::Faults;

pub use blows::Durations;
use blows::{Blow, Kind, ON_FILES, ON_SERVERS, Rounds, Victim, below};
use order::{Order, RULES, strangers};
use servers::Servers;

use crate::farm::Farm;
use crate::proxy::{Fate, Protocol, Proxy};
use crate::random::Random;

/// Leases run out after this time, seconds: some sleepers sleep for longer.
const LEASE_SECONDS: &str = "2";

/// Time between two looks at what is due.
const TICK: Duration = Duration::from_millis(20);

/// Time between two looks at the jobs.
const LOOK: Duration = Duration::from_millis(250);

/// How long a coordinator is given for an answer.
const ANSWER: Duration = Duration::from_secs(2);

/// Pause before a coordinator or server that does not start is started again.
const RESTART: Duration = Duration::from_millis(500);

/// How far a clock is off that has been stepped, seconds.
const STEP: i64 = 60;

/// Streams of the seed: of what is ordered, of the leases of coordinators that are started again, and of the order of
/// blows; each blow has one of its own after that. They are far from those of the network, which are the numbers of
/// connections.
const ORDERS: u64 = 1 << 32;
const LEASES: u64 = 2 << 32;
const BLOWS: u64 = 3 << 32;

/// How coordinators size leases.
const LEASE_SIZES: [&str; 2] = ["as each worker's pace asks for", "of a fixed number of nodes"];

/// How a farm is attacked.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Seed of the blows, the network, the leases and the jobs.
    pub seed: u64,
    /// Whether there are two coordinators on PostgreSQL and S3, all of which are hit too, instead of one with its own
    /// files.
    pub servers: bool,
    /// Workers at the same time.
    pub workers: usize,
    /// How long sleepers sleep and faults last.
    pub durations: Durations,
    /// Whether blows go on when each kind has come, some jobs share out their passes or end at a target, and messages
    /// to servers have to meet with every fate.
    pub is_long: bool,
    /// How much rougher than usual the network in front of coordinators is.
    pub roughness: f64,
    /// Most passes of a job.
    pub passes: usize,
    /// Longest time that a job may take, however often its farm is hit, or that whoever was hit may take to come back.
    pub patience: Duration,
    /// What coordinators, workers and commands log, as `CLERESTORY_LOG` has it.
    pub log: &'static str,
}

/// What the siege knows of a coordinator.
struct Coordinator {
    /// Killed, and not to be started yet.
    is_down: bool,
    is_asleep: bool,
    has_faults: bool,
    clock_step: i64,
    /// Whether it has answered since it was started.
    has_answered: bool,
    /// Whether it was started with so many nodes in each lease, and not as many as each worker's pace asks for.
    has_fixed_leases: bool,
    /// When to start it again if it has ended before it answered.
    again: Instant,
}

/// What is due for somebody who was hit.
#[derive(Clone, Copy, Debug)]
enum Relief {
    WakeWorker(usize),
    StartCoordinator(usize),
    WakeCoordinator(usize),
    /// And how often its disk had failed before.
    MendCoordinator(usize, u64),
    StartDatabase,
    WakeDatabase,
    /// How often its disk had failed before.
    MendDatabase(u64),
    StartObjects,
    WakeObjects,
    /// How often its disk had failed before.
    MendObjects(u64),
}

/// A farm under attack.
pub struct Siege {
    plan: Plan,
    farm: Farm,
    servers: Option<Servers>,
    network: Proxy,
    /// Which rule the first order has; the others follow in turn.
    first_rule: usize,
    /// Draws what is ordered.
    wishes: Random,
    /// Draws the leases of coordinators that are started again.
    leases: Random,
    rounds: Rounds,
    /// Draws all else about the blow that is being dealt.
    random: Random,
    /// How often somebody was asked about the jobs.
    looks: usize,
    workers: Vec<(usize, bool)>,
    started: usize,
    coordinators: Vec<Coordinator>,
    database_is_hit: bool,
    objects_are_hit: bool,
    due: Vec<(Instant, Relief)>,
    next_blow: Instant,
    is_over: bool,
    orders: Vec<Order>,
    blows: BTreeMap<Kind, u32>,
    /// Coordinators and servers that had to be started again because they had ended by themselves.
    restarts: BTreeMap<Victim, u32>,
    /// Starts of coordinators that have then answered, for each of [`LEASE_SIZES`].
    starts: [u32; 2],
    checked: BTreeSet<JobId>,
    wrong: Vec<String>,
}

impl Siege {
    /// A farm with its workers.
    ///
    /// # Panics
    ///
    /// When it does not start.
    pub fn lay(plan: Plan) -> Self {
        // The size of leases is left to workers' paces until a coordinator is started again.
        let options = ["--lease-seconds", LEASE_SECONDS];
        let log = ("CLERESTORY_LOG".to_owned(), plan.log.to_owned());
        let (mut farm, servers) = if plan.servers {
            let servers = Servers::start(plan.seed);
            let shared = servers.options();
            let options: Vec<&str> = options.into_iter().chain(shared.iter().map(String::as_str)).collect();
            let environment: Vec<_> = servers.environment().into_iter().chain([log]).collect();
            // A coordinator that starts in the middle of a fault may give up, and nobody starts the first ones again.
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
            is_asleep: false,
            has_faults: false,
            clock_step: 0,
            has_answered: false,
            has_fixed_leases: false,
            again: now,
        };
        let mut wishes = Random::new(plan.seed, ORDERS);
        let mut siege = Self {
            plan,
            coordinators: farm.sockets().into_iter().map(coordinator).collect(),
            farm,
            servers,
            network,
            first_rule: below(&mut wishes, RULES.len()),
            wishes,
            leases: Random::new(plan.seed, LEASES),
            rounds: Rounds::of(if plan.servers { &ON_SERVERS } else { &ON_FILES }, plan.seed),
            random: Random::new(plan.seed, BLOWS),
            looks: 0,
            workers: Vec::new(),
            started: 0,
            database_is_hit: false,
            objects_are_hit: false,
            due: Vec::new(),
            next_blow: now,
            is_over: false,
            orders: Vec::new(),
            blows: BTreeMap::new(),
            restarts: BTreeMap::new(),
            starts: [0; 2],
            checked: BTreeSet::new(),
            wrong: Vec::new(),
        };
        for _ in 0..plan.workers {
            siege.start_worker();
        }
        siege
    }

    /// Renders one or two jobs under attack, and checks their images. Answers how many were asked for.
    pub fn wave(&mut self) -> usize {
        let count = 1 + below(&mut self.wishes, 2);
        let first = self.orders.len();
        for number in first..first + count {
            let rule = if self.plan.is_long { RULES[(self.first_rule + number) % RULES.len()] } else { &[] };
            self.orders.push(Order::draw(&mut self.wishes, number, self.plan.passes, rule));
        }
        self.until_ended(first);
        count
    }

    /// Takes all blows back, waits until all jobs have ended, and checks all images once more.
    pub fn lift(&mut self) {
        self.is_over = true;
        self.network.calm(true);
        for network in self.servers.iter().flat_map(|servers| &servers.network) {
            network.calm(true);
        }
        for (_, relief) in std::mem::take(&mut self.due) {
            self.relieve(relief);
        }
        for index in 0..self.coordinators.len() {
            self.step_clock(index, 0);
        }
        self.checked.clear();
        if let Some(jobs) = self.until_ended(0) {
            self.wrong.extend(strangers(&jobs, &self.orders));
        }
    }

    /// What is wrong, in words.
    pub fn wrong(&self) -> &[String] {
        &self.wrong
    }

    /// Kinds of blows, fates and jobs that there have not been yet.
    pub fn missing(&self) -> Vec<String> {
        let mut missing = self.missing_blows();
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

    /// Rules that no job has had yet, where jobs are to have some. Each has had one after as many jobs as there are
    /// rules.
    pub fn missing_rules(&self) -> Vec<String> {
        let has_come = |rule| !self.plan.is_long || self.orders.iter().any(|order| order.rule == rule);
        let missing = RULES.into_iter().filter(|&rule| !has_come(rule));
        missing.map(|rule| format!("a job with the options {rule:?}")).collect()
    }

    /// Kinds of blows that have not come yet, or have not been felt; and sizes of leases, which change when
    /// coordinators are killed.
    fn missing_blows(&self) -> Vec<String> {
        let kinds = self.rounds.kinds().iter().filter(|kind| !self.blows.contains_key(kind));
        let mut missing: Vec<String> = kinds.map(|(victim, blow)| format!("{victim} {blow}")).collect();
        let sizes = LEASE_SIZES.into_iter().zip(self.starts).filter(|(_, count)| *count == 0);
        missing.extend(sizes.map(|(size, _)| format!("coordinators with leases {size}")));
        let fell_on = |victim: Victim, blow: Blow| self.rounds.kinds().contains(&(victim, blow));
        for (victim, faults) in self.faults() {
            if fell_on(victim, Blow::DiskFull) && faults.iter().all(|faults| faults.failed_writes() == 0) {
                missing.push(format!("writes of {victim} that fail"));
            }
            if fell_on(victim, Blow::SyncsFail) && faults.iter().all(|faults| faults.failed_syncs() == 0) {
                missing.push(format!("syncs of {victim} that fail"));
            }
        }
        missing
    }

    /// How often processes were killed or suspended.
    pub fn sudden(&self) -> u32 {
        self.blows.iter().filter(|((_, blow), _)| blow.is_sudden()).map(|(_, count)| count).sum()
    }

    /// What has happened, in lines.
    pub fn told(&self) -> String {
        let mut text = format!("{} jobs; {} SIGKILLs and SIGSTOPs\n", self.checked.len(), self.sudden());
        for ((victim, blow), count) in &self.blows {
            let _ = writeln!(text, "{count:6} {victim} {blow}");
        }
        for (victim, faults) in self.faults() {
            let (writes, syncs) = faults.iter().fold((0, 0), |(writes, syncs), faults| {
                (writes + faults.failed_writes(), syncs + faults.failed_syncs())
            });
            if writes + syncs > 0 {
                let _ = writeln!(text, "{writes:6} writes and {syncs} syncs of {victim} failed");
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
        for (victim, count) in &self.restarts {
            let _ = writeln!(text, "{count:6} starts of {victim} that had ended by themselves or could not start");
        }
        text
    }

    /// The faults of everybody's disks.
    fn faults(&self) -> [(Victim, Vec<&Faults>); 3] {
        let coordinators = (0..self.coordinators.len()).filter_map(|index| self.farm.faults(index)).collect();
        let database = self.servers.iter().filter_map(|servers| servers.database.faults()).collect();
        let objects = self.servers.iter().filter_map(|servers| servers.objects.faults()).collect();
        [(Victim::Coordinator, coordinators), (Victim::Database, database), (Victim::ObjectStore, objects)]
    }

    /// Waits, under attack, until all jobs of the orders from `first` on have ended and their images are checked.
    /// Answers all jobs of the farm, unless it takes too long.
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
                for order in &mut self.orders[first..] {
                    order.ask(|arguments| self.farm.command(arguments), &jobs);
                }
                if self.orders[first..].iter().all(|order| order.has_ended(&jobs))
                    && self.check_all(index, &jobs, first)
                {
                    return Some(jobs);
                }
            }
            if start.elapsed() > self.plan.patience {
                let told = |job: &JobView| format!("{} is {} ({:.3})", job.name, job.state.name(), job.progress);
                let told: Vec<String> = jobs.iter().map(told).collect();
                self.wrong.push(format!("not done after {:?}: {}", self.plan.patience, told.join(", ")));
                return None;
            }
        }
    }

    /// Checks the jobs of the orders from `first` on that have not been yet; whether all could be.
    fn check_all(&mut self, index: usize, jobs: &[JobView], first: usize) -> bool {
        for job in jobs.iter().filter(|job| job.state.is_final() && !self.checked.contains(&job.id)).collect::<Vec<_>>()
        {
            let Some(place) = self.orders[first..].iter().position(|order| order.name == job.name) else { continue };
            let Some(image) = self.ask(index, async |client| client.image(job.id).await) else { return false };
            let checked = self.orders[first + place].check(job, &image);
            self.wrong.extend(checked.err());
            self.checked.insert(job.id);
        }
        true
    }

    /// All jobs, as a coordinator tells them that answers. They are asked in turn.
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

    /// Asks a coordinator, without the network between.
    fn ask<T>(&self, index: usize, call: impl AsyncFnOnce(&Client) -> Result<T, ClientError>) -> Option<T> {
        let client = Client::new(&format!("http://{}", self.farm.sockets()[index]), None).ok()?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().ok()?;
        runtime.block_on(async { tokio::time::timeout(ANSWER, call(&client)).await.ok()?.ok() })
    }
}
