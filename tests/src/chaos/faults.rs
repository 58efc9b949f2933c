//! The faults of a farm's processes, and their durations.

use std::collections::VecDeque;
use std::fmt;

use super::FAULTS;
use crate::random::Random;

/// The target of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Target {
    /// A worker.
    Worker,
    /// A coordinator.
    Coordinator,
    /// PostgreSQL.
    Database,
    /// The server that speaks S3.
    ObjectStore,
}

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fault {
    /// Killed by `SIGKILL`, as by a power cut, and replaced.
    Killed,
    /// Asked to stop, and replaced.
    Stopped,
    /// Suspended by `SIGSTOP` for some seconds.
    Suspended,
    /// Its disk is full for a second or two.
    DiskFull,
    /// Its disk fails to sync for a second or two.
    SyncsFail,
    /// Its clock is a minute off from now on, or right again.
    ClockStepped,
}

/// A target and its fault.
pub(super) type FaultKind = (Target, Fault);

/// Every fault on a farm of one coordinator with its own files.
pub(super) const ON_FILES: [FaultKind; 8] = [
    (Target::Worker, Fault::Killed),
    (Target::Worker, Fault::Stopped),
    (Target::Worker, Fault::Suspended),
    (Target::Coordinator, Fault::Killed),
    (Target::Coordinator, Fault::Suspended),
    (Target::Coordinator, Fault::DiskFull),
    (Target::Coordinator, Fault::SyncsFail),
    (Target::Coordinator, Fault::ClockStepped),
];

/// Every fault on a farm of several coordinators on PostgreSQL and S3. These coordinators have no data on their own
/// disks.
pub(super) const ON_SERVERS: [FaultKind; 13] = [
    (Target::Worker, Fault::Killed),
    (Target::Worker, Fault::Stopped),
    (Target::Worker, Fault::Suspended),
    (Target::Coordinator, Fault::Killed),
    (Target::Coordinator, Fault::Suspended),
    (Target::Coordinator, Fault::ClockStepped),
    (Target::Database, Fault::Killed),
    (Target::Database, Fault::Suspended),
    (Target::Database, Fault::DiskFull),
    (Target::Database, Fault::SyncsFail),
    (Target::ObjectStore, Fault::Killed),
    (Target::ObjectStore, Fault::Suspended),
    (Target::ObjectStore, Fault::DiskFull),
];

impl Fault {
    /// Whether it stops a process without warning. Such faults come twice as often as others.
    pub(super) fn is_sudden(self) -> bool {
        matches!(self, Self::Killed | Self::Suspended)
    }
}

/// Durations of suspensions and faults.
#[derive(Clone, Copy, Debug)]
pub struct Durations {
    /// Shortest and longest time between two faults, seconds.
    pub pauses: [f64; 2],
    /// Longest downtime of a killed process, seconds.
    pub away: f64,
    /// Longest fault of a disk, seconds.
    pub fault: f64,
    /// Longest suspension, seconds.
    pub sleep: f64,
    /// One of this many suspensions has the longest time.
    pub long_sleeps: usize,
}

/// All kinds in random order, without end. Each comes before any comes again.
#[derive(Debug)]
pub(super) struct Schedule {
    kinds: &'static [FaultKind],
    random: Random,
    rest: Vec<FaultKind>,
    /// Deferred kinds. They come last in their round, so that no draw depends on them.
    late: VecDeque<(FaultKind, u64)>,
    /// The stream of the last fault.
    stream: u64,
}

impl Schedule {
    /// A schedule of these kinds.
    pub(super) fn of(kinds: &'static [FaultKind], seed: u64) -> Self {
        let random = Random::new(seed, FAULTS);
        Self { kinds, random, rest: Vec::new(), late: VecDeque::new(), stream: FAULTS }
    }

    /// The kinds.
    pub(super) fn kinds(&self) -> &'static [FaultKind] {
        self.kinds
    }

    /// The next kind, and its stream of the seed. The stream draws the target, the duration, and the pause after it.
    pub(super) fn next(&mut self) -> (FaultKind, u64) {
        if self.rest.is_empty() {
            if let Some(late) = self.late.pop_front() {
                return late;
            }
            let sudden = self.kinds.iter().filter(|(_, fault)| fault.is_sudden());
            self.rest.extend(self.kinds.iter().chain(sudden));
        }
        self.stream += 1;
        (self.rest.swap_remove(below(&mut self.random, self.rest.len())), self.stream)
    }

    /// Defers a kind that cannot happen now, with its stream.
    pub(super) fn defer(&mut self, kind: FaultKind, stream: u64) {
        self.late.push_back((kind, stream));
    }
}

/// A whole number below `end`.
pub(super) fn below(random: &mut Random, end: usize) -> usize {
    ((random.uniform() * end as f64) as usize).min(end - 1)
}

impl fmt::Display for Target {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Worker => "workers",
            Self::Coordinator => "coordinators",
            Self::Database => "PostgreSQL",
            Self::ObjectStore => "the object server",
        })
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Killed => "killed",
            Self::Stopped => "asked to stop",
            Self::Suspended => "suspended",
            Self::DiskFull => "on a full disk",
            Self::SyncsFail => "on a disk that fails to sync",
            Self::ClockStepped => "with a stepped clock",
        })
    }
}
