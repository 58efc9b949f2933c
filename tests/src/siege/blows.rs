//! What can happen to the processes of a farm, and for how long.

use std::collections::VecDeque;
use std::fmt;

use super::BLOWS;
use crate::random::Random;

/// Who is hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Victim {
    /// A worker.
    Worker,
    /// A coordinator.
    Coordinator,
    /// PostgreSQL.
    Database,
    /// The server that speaks S3.
    ObjectStore,
}

/// How.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Blow {
    /// Killed by `SIGKILL`, as by a power cut, and another started.
    Killed,
    /// Asked to stop, and another started.
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

/// A blow and whom it hits.
pub(super) type Kind = (Victim, Blow);

/// Every blow on a farm of one coordinator with its own files.
pub(super) const ON_FILES: [Kind; 8] = [
    (Victim::Worker, Blow::Killed),
    (Victim::Worker, Blow::Stopped),
    (Victim::Worker, Blow::Suspended),
    (Victim::Coordinator, Blow::Killed),
    (Victim::Coordinator, Blow::Suspended),
    (Victim::Coordinator, Blow::DiskFull),
    (Victim::Coordinator, Blow::SyncsFail),
    (Victim::Coordinator, Blow::ClockStepped),
];

/// Every blow on a farm of several coordinators on PostgreSQL and S3, which have nothing on disks of their own.
pub(super) const ON_SERVERS: [Kind; 13] = [
    (Victim::Worker, Blow::Killed),
    (Victim::Worker, Blow::Stopped),
    (Victim::Worker, Blow::Suspended),
    (Victim::Coordinator, Blow::Killed),
    (Victim::Coordinator, Blow::Suspended),
    (Victim::Coordinator, Blow::ClockStepped),
    (Victim::Database, Blow::Killed),
    (Victim::Database, Blow::Suspended),
    (Victim::Database, Blow::DiskFull),
    (Victim::Database, Blow::SyncsFail),
    (Victim::ObjectStore, Blow::Killed),
    (Victim::ObjectStore, Blow::Suspended),
    (Victim::ObjectStore, Blow::DiskFull),
];

impl Blow {
    /// Whether it is one of those that take a process away from one moment to the next; they come twice as often as
    /// others.
    pub(super) fn is_sudden(self) -> bool {
        matches!(self, Self::Killed | Self::Suspended)
    }
}

/// How long sleepers sleep and faults last.
#[derive(Clone, Copy, Debug)]
pub struct Durations {
    /// Shortest and longest time between two blows, seconds.
    pub pauses: [f64; 2],
    /// For how long who was killed is away at most, seconds.
    pub away: f64,
    /// For how long a disk is full or fails to sync at most, seconds.
    pub fault: f64,
    /// Longest sleep, seconds.
    pub sleep: f64,
    /// One of so many sleeps lasts as long as it can.
    pub long_sleeps: usize,
}

/// All kinds in a random order, without end: each comes before any comes again.
#[derive(Debug)]
pub(super) struct Rounds {
    kinds: &'static [Kind],
    random: Random,
    rest: Vec<Kind>,
    /// Those that could not happen yet. They come last in their round, so that nothing that is drawn depends on them.
    late: VecDeque<(Kind, u64)>,
    /// The stream of the seed of the blow that was drawn last.
    stream: u64,
}

impl Rounds {
    /// Rounds of these kinds.
    pub(super) fn of(kinds: &'static [Kind], seed: u64) -> Self {
        let random = Random::new(seed, BLOWS);
        Self { kinds, random, rest: Vec::new(), late: VecDeque::new(), stream: BLOWS }
    }

    /// The kinds.
    pub(super) fn kinds(&self) -> &'static [Kind] {
        self.kinds
    }

    /// The next kind, and the stream of the seed that draws whom it hits, for how long, and when the next one comes.
    pub(super) fn next(&mut self) -> (Kind, u64) {
        if self.rest.is_empty() {
            if let Some(late) = self.late.pop_front() {
                return late;
            }
            let sudden = self.kinds.iter().filter(|(_, blow)| blow.is_sudden());
            self.rest.extend(self.kinds.iter().chain(sudden));
        }
        self.stream += 1;
        (self.rest.swap_remove(below(&mut self.random, self.rest.len())), self.stream)
    }

    /// Puts a kind back that could not happen, with its stream.
    pub(super) fn put_back(&mut self, kind: Kind, stream: u64) {
        self.late.push_back((kind, stream));
    }
}

/// A whole number below `end`.
pub(super) fn below(random: &mut Random, end: usize) -> usize {
    ((random.uniform() * end as f64) as usize).min(end - 1)
}

impl fmt::Display for Victim {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Worker => "workers",
            Self::Coordinator => "coordinators",
            Self::Database => "PostgreSQL",
            Self::ObjectStore => "the object server",
        })
    }
}

impl fmt::Display for Blow {
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
