//! Blows dealt and taken back.

use std::time::{Duration, Instant};

use super::blows::{Blow, Kind, Victim, below};
use super::{Coordinator, RESTART, Relief, STEP, Servers, Siege};
use crate::random::Random;

impl Siege {
    /// Does what is due.
    pub(super) fn tick(&mut self) {
        let now = Instant::now();
        while let Some(place) = self.due.iter().position(|(when, _)| *when <= now) {
            let (_, relief) = self.due.swap_remove(place);
            if self.is_yet_to_be_felt(relief) {
                self.due.push((now + RESTART, relief));
            } else {
                self.relieve(relief);
            }
        }
        self.start_what_has_ended();
        let is_over = self.is_over || !self.plan.is_long && self.missing_blows().is_empty();
        if self.next_blow <= now && !is_over {
            let (kind, stream) = self.rounds.next();
            self.random = Random::new(self.plan.seed, stream);
            let [shortest, longest] = self.plan.durations.pauses;
            let pause = shortest + (longest - shortest) * self.random.uniform();
            self.next_blow = Instant::now() + Duration::from_secs_f64(pause);
            if self.deal(kind) {
                *self.blows.entry(kind).or_default() += 1;
            } else {
                self.rounds.put_back(kind, stream);
            }
        }
    }

    /// Starts a worker.
    pub(super) fn start_worker(&mut self) {
        self.farm.start_worker(&format!("worker {}", self.started));
        self.workers.push((self.started, false));
        self.started += 1;
    }

    /// Deals a blow; `false` where nobody can take it now.
    fn deal(&mut self, (victim, blow): Kind) -> bool {
        match victim {
            Victim::Worker => self.hit_worker(blow),
            Victim::Coordinator => self.hit_coordinator(blow),
            Victim::Database => self.hit_database(blow),
            Victim::ObjectStore => self.hit_objects(blow),
        }
    }

    fn hit_worker(&mut self, blow: Blow) -> bool {
        let place = below(&mut self.random, self.workers.len());
        let (worker, is_asleep) = self.workers[place];
        match blow {
            Blow::Killed => self.farm.kill_worker(worker),
            // One that sleeps hears nothing.
            _ if is_asleep => return false,
            Blow::Stopped => self.farm.ask_worker_to_stop(worker),
            Blow::Suspended => {
                self.farm.suspend_worker(worker, true);
                self.workers[place].1 = true;
                let sleep = self.sleep();
                self.in_time(sleep, Relief::WakeWorker(worker));
                return true;
            }
            _ => return false,
        }
        self.workers.remove(place);
        self.start_worker();
        true
    }

    fn hit_coordinator(&mut self, blow: Blow) -> bool {
        let index = below(&mut self.random, self.coordinators.len());
        let Coordinator { is_asleep, has_faults, has_answered, is_down, clock_step, .. } = self.coordinators[index];
        // One that is about to start may give up when it meets a fault; killed it may be at any time.
        let may_be_hit = !is_down && (has_answered || blow == Blow::Killed);
        // One that has given up is not killed again.
        if !may_be_hit || !self.farm.coordinator_runs(index) {
            return false;
        }
        let (away, fault) = (self.some(self.plan.durations.away), self.some(self.plan.durations.fault));
        match blow {
            Blow::Killed => {
                self.farm.kill_coordinator(index);
                self.coordinators[index].is_down = true;
                self.coordinators[index].is_asleep = false;
                self.in_time(away, Relief::StartCoordinator(index));
            }
            Blow::Suspended if !is_asleep => {
                self.farm.suspend_coordinator(index, true);
                self.coordinators[index].is_asleep = true;
                let sleep = self.sleep();
                self.in_time(sleep, Relief::WakeCoordinator(index));
            }
            Blow::DiskFull | Blow::SyncsFail if !has_faults => {
                let Some(faults) = self.farm.faults(index) else { return false };
                let failures = faults.failures();
                if blow == Blow::DiskFull {
                    faults.fill_disk(true)
                } else {
                    faults.fail_syncs(true)
                };
                self.coordinators[index].has_faults = true;
                self.in_time(fault, Relief::MendCoordinator(index, failures));
            }
            Blow::ClockStepped => {
                let others: Vec<i64> = [-STEP, 0, STEP].into_iter().filter(|step| *step != clock_step).collect();
                let step = others[below(&mut self.random, others.len())];
                self.step_clock(index, step);
            }
            _ => return false,
        }
        true
    }

    fn hit_database(&mut self, blow: Blow) -> bool {
        let (away, fault, sleep) =
            (self.some(self.plan.durations.away), self.some(self.plan.durations.fault), self.sleep());
        let Some(servers) = self.servers.as_mut().filter(|_| !self.database_is_hit) else { return false };
        if servers.database.has_ended() {
            return false;
        }
        let (relief, seconds) = match (blow, servers.database.faults()) {
            (Blow::Killed, _) => {
                servers.database.kill();
                (Relief::StartDatabase, away)
            }
            (Blow::Suspended, _) => {
                servers.database.suspend(true);
                (Relief::WakeDatabase, sleep)
            }
            (Blow::DiskFull, Some(faults)) => {
                let failures = faults.failures();
                faults.fill_disk(true);
                (Relief::MendDatabase(failures), fault)
            }
            (Blow::SyncsFail, Some(faults)) => {
                let failures = faults.failures();
                faults.fail_syncs(true);
                (Relief::MendDatabase(failures), fault)
            }
            _ => return false,
        };
        self.database_is_hit = true;
        self.in_time(seconds, relief);
        true
    }

    fn hit_objects(&mut self, blow: Blow) -> bool {
        let (away, fault, sleep) =
            (self.some(self.plan.durations.away), self.some(self.plan.durations.fault), self.sleep());
        let Some(servers) = self.servers.as_mut().filter(|_| !self.objects_are_hit) else { return false };
        if servers.objects.has_ended() {
            return false;
        }
        let (relief, seconds) = match (blow, servers.objects.faults()) {
            (Blow::Killed, _) => {
                servers.objects.kill();
                (Relief::StartObjects, away)
            }
            (Blow::Suspended, _) => {
                servers.objects.suspend(true);
                (Relief::WakeObjects, sleep)
            }
            (Blow::DiskFull, Some(faults)) => {
                let failures = faults.failures();
                faults.fill_disk(true);
                (Relief::MendObjects(failures), fault)
            }
            _ => return false,
        };
        self.objects_are_hit = true;
        self.in_time(seconds, relief);
        true
    }

    /// Sets a coordinator's clock so many seconds off.
    pub(super) fn step_clock(&mut self, index: usize, seconds: i64) {
        if let Some(faults) = self.farm.faults(index) {
            faults.step_clock(seconds);
            self.coordinators[index].clock_step = seconds;
        }
    }

    /// Whether a disk has faults of which nobody has noticed anything so far. Databases write and sync all the time,
    /// but not while all of their coordinators are gone; and a server that is ending of what was before notices nothing
    /// any more.
    fn is_yet_to_be_felt(&mut self, relief: Relief) -> bool {
        let (faults, failures, has_ended) = match (relief, &mut self.servers) {
            (Relief::MendCoordinator(index, failures), _) => (self.farm.faults(index), failures, false),
            (Relief::MendDatabase(failures), Some(Servers { database, .. })) => {
                let has_ended = database.has_ended();
                (database.faults(), failures, has_ended)
            }
            (Relief::MendObjects(failures), Some(Servers { objects, .. })) => {
                let has_ended = objects.has_ended();
                (objects.faults(), failures, has_ended)
            }
            _ => return false,
        };
        !has_ended && faults.is_some_and(|faults| faults.failures() == failures)
    }

    /// Takes back what somebody was hit with.
    pub(super) fn relieve(&mut self, relief: Relief) {
        match relief {
            Relief::WakeWorker(worker) => {
                if let Some(sleeper) = self.workers.iter_mut().find(|(number, _)| *number == worker) {
                    sleeper.1 = false;
                    self.farm.suspend_worker(worker, false);
                }
            }
            Relief::StartCoordinator(index) => self.start_coordinator(index),
            Relief::WakeCoordinator(index) => {
                if std::mem::take(&mut self.coordinators[index].is_asleep) {
                    self.farm.suspend_coordinator(index, false);
                }
            }
            Relief::MendCoordinator(index, _) => {
                self.coordinators[index].has_faults = false;
                if let Some(faults) = self.farm.faults(index) {
                    faults.fill_disk(false);
                    faults.fail_syncs(false);
                }
            }
            Relief::StartDatabase | Relief::WakeDatabase | Relief::MendDatabase(_) => self.relieve_database(relief),
            Relief::StartObjects | Relief::WakeObjects | Relief::MendObjects(_) => self.relieve_objects(relief),
        }
    }

    fn relieve_database(&mut self, relief: Relief) {
        let Some(Servers { database, .. }) = &mut self.servers else { return };
        self.database_is_hit = false;
        match relief {
            Relief::StartDatabase => {
                self.wrong.extend(database.restart().err().map(|error| format!("PostgreSQL: {error}")))
            }
            Relief::WakeDatabase => database.suspend(false),
            _ => {
                if let Some(faults) = database.faults() {
                    faults.fill_disk(false);
                    faults.fail_syncs(false);
                }
            }
        }
    }

    fn relieve_objects(&mut self, relief: Relief) {
        let Some(Servers { objects, .. }) = &mut self.servers else { return };
        self.objects_are_hit = false;
        match relief {
            Relief::StartObjects => self.wrong.extend(objects.restart().err().map(|error| format!("S3: {error}"))),
            Relief::WakeObjects => objects.suspend(false),
            _ => {
                if let Some(faults) = objects.faults() {
                    faults.fill_disk(false);
                }
            }
        }
    }

    fn start_coordinator(&mut self, index: usize) {
        let has_fixed_leases = below(&mut self.leases, 2) == 1;
        let nodes = (1 + below(&mut self.leases, 6)).to_string();
        let options = ["--lease-nodes", &nodes];
        self.farm.launch_coordinator(index, if has_fixed_leases { &options } else { &[] });
        let coordinator = &mut self.coordinators[index];
        coordinator.has_fixed_leases = has_fixed_leases;
        coordinator.is_down = false;
        coordinator.has_answered = false;
        coordinator.again = Instant::now() + RESTART;
    }

    /// Starts what has ended by itself, as a supervisor of services does. A coordinator that starts without its
    /// database or on a full disk may give up; one that has answered may not, nor may a worker.
    fn start_what_has_ended(&mut self) {
        for place in 0..self.workers.len() {
            let (worker, _) = self.workers[place];
            if !self.farm.worker_runs(worker) {
                self.wrong.push(format!("worker {worker} ended by itself"));
                self.workers.remove(place);
                self.start_worker();
                return;
            }
        }
        for index in 0..self.coordinators.len() {
            let Coordinator { is_down, has_answered, again, .. } = self.coordinators[index];
            if is_down || again > Instant::now() || self.farm.coordinator_runs(index) {
                continue;
            }
            if has_answered {
                self.wrong.push(format!("coordinator {index} ended by itself"));
            }
            *self.restarts.entry(Victim::Coordinator).or_default() += 1;
            self.start_coordinator(index);
        }
        if let Some(servers) = self.servers.as_mut().filter(|_| !self.database_is_hit)
            && servers.database.has_ended()
        {
            *self.restarts.entry(Victim::Database).or_default() += 1;
            self.relieve_database(Relief::StartDatabase);
        }
        if let Some(servers) = self.servers.as_mut().filter(|_| !self.objects_are_hit)
            && servers.objects.has_ended()
        {
            *self.restarts.entry(Victim::ObjectStore).or_default() += 1;
            self.relieve_objects(Relief::StartObjects);
        }
    }

    /// Whether a coordinator could answer.
    pub(super) fn is_up(&self, index: usize) -> bool {
        let Coordinator { is_down, is_asleep, .. } = self.coordinators[index];
        !is_down && !is_asleep
    }

    fn in_time(&mut self, seconds: f64, relief: Relief) {
        self.due.push((Instant::now() + Duration::from_secs_f64(seconds), relief));
    }

    /// A time of up to `longest` seconds, and at least a tenth of it.
    fn some(&mut self, longest: f64) -> f64 {
        longest * (0.1 + 0.9 * self.random.uniform())
    }

    /// How long somebody sleeps, seconds.
    fn sleep(&mut self) -> f64 {
        let longest = self.plan.durations.sleep;
        let is_long = below(&mut self.random, self.plan.durations.long_sleeps) == 0;
        if is_long { longest } else { self.some(longest / 4.0) }
    }
}
