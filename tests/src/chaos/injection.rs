//! Injects faults and recovers from them.

use std::time::{Duration, Instant};

use super::faults::{Fault, FaultKind, Target, below};
use super::{Chaos, Coordinator, RESTART, Recovery, STEP, Servers};
use crate::random::Random;

impl Chaos {
    /// Runs due recoveries, restarts, and the next fault.
    pub(super) fn tick(&mut self) {
        let now = Instant::now();
        while let Some(place) = self.due.iter().position(|(when, _)| *when <= now) {
            let (_, recovery) = self.due.swap_remove(place);
            if self.is_unnoticed(recovery) {
                self.due.push((now + RESTART, recovery));
            } else {
                self.recover(recovery);
            }
        }
        self.start_what_has_ended();
        let is_over = self.is_over || !self.plan.is_long && self.missing_faults().is_empty();
        if self.next_fault <= now && !is_over {
            let (kind, stream) = self.schedule.next();
            self.random = Random::new(self.plan.seed, stream);
            let [shortest, longest] = self.plan.durations.pauses;
            let pause = shortest + (longest - shortest) * self.random.uniform();
            self.next_fault = Instant::now() + Duration::from_secs_f64(pause);
            if self.inject(kind) {
                *self.injected.entry(kind).or_default() += 1;
            } else {
                self.schedule.defer(kind, stream);
            }
        }
    }

    /// Starts a worker.
    pub(super) fn start_worker(&mut self) {
        self.farm.start_worker(&format!("worker {}", self.started));
        self.workers.push((self.started, false));
        self.started += 1;
    }

    /// Injects a fault. False when no target can have it now.
    fn inject(&mut self, (target, fault): FaultKind) -> bool {
        match target {
            Target::Worker => self.inject_worker_fault(fault),
            Target::Coordinator => self.inject_coordinator_fault(fault),
            Target::Database => self.inject_database_fault(fault),
            Target::ObjectStore => self.inject_object_store_fault(fault),
        }
    }

    fn inject_worker_fault(&mut self, fault: Fault) -> bool {
        let place = below(&mut self.random, self.workers.len());
        let (worker, is_suspended) = self.workers[place];
        match fault {
            Fault::Killed => self.farm.kill_worker(worker),
            // A suspended worker cannot react.
            _ if is_suspended => return false,
            Fault::Stopped => self.farm.ask_worker_to_stop(worker),
            Fault::Suspended => {
                self.farm.suspend_worker(worker, true);
                self.workers[place].1 = true;
                let sleep = self.suspension();
                self.schedule_recovery(sleep, Recovery::ResumeWorker(worker));
                return true;
            }
            _ => return false,
        }
        self.workers.remove(place);
        self.start_worker();
        true
    }

    fn inject_coordinator_fault(&mut self, fault: Fault) -> bool {
        let index = below(&mut self.random, self.coordinators.len());
        let Coordinator { is_suspended, has_faults, has_answered, is_down, clock_step, .. } = self.coordinators[index];
        // A coordinator that is starting may give up at a fault. It may be killed at any time.
        let may_be_faulted = !is_down && (has_answered || fault == Fault::Killed);
        // A coordinator that has given up is not killed again.
        if !may_be_faulted || !self.farm.coordinator_runs(index) {
            return false;
        }
        let (away, disk_fault) =
            (self.random_seconds(self.plan.durations.away), self.random_seconds(self.plan.durations.fault));
        match fault {
            Fault::Killed => {
                self.farm.kill_coordinator(index);
                self.coordinators[index].is_down = true;
                self.coordinators[index].is_suspended = false;
                self.schedule_recovery(away, Recovery::StartCoordinator(index));
            }
            Fault::Suspended if !is_suspended => {
                self.farm.suspend_coordinator(index, true);
                self.coordinators[index].is_suspended = true;
                let sleep = self.suspension();
                self.schedule_recovery(sleep, Recovery::ResumeCoordinator(index));
            }
            Fault::DiskFull | Fault::SyncsFail if !has_faults => {
                let Some(faults) = self.farm.faults(index) else { return false };
                let failures = faults.failures();
                if fault == Fault::DiskFull {
                    faults.fill_disk(true)
                } else {
                    faults.fail_syncs(true)
                };
                self.coordinators[index].has_faults = true;
                self.schedule_recovery(disk_fault, Recovery::RepairCoordinatorDisk(index, failures));
            }
            Fault::ClockStepped => {
                let others: Vec<i64> = [-STEP, 0, STEP].into_iter().filter(|step| *step != clock_step).collect();
                let step = others[below(&mut self.random, others.len())];
                self.step_clock(index, step);
            }
            _ => return false,
        }
        true
    }

    fn inject_database_fault(&mut self, fault: Fault) -> bool {
        let (away, disk_fault, sleep) = (
            self.random_seconds(self.plan.durations.away),
            self.random_seconds(self.plan.durations.fault),
            self.suspension(),
        );
        let Some(servers) = self.servers.as_mut().filter(|_| !self.database_is_faulty) else { return false };
        if servers.database.has_ended() {
            return false;
        }
        let (recovery, seconds) = match (fault, servers.database.faults()) {
            (Fault::Killed, _) => {
                servers.database.kill();
                (Recovery::StartDatabase, away)
            }
            (Fault::Suspended, _) => {
                servers.database.suspend(true);
                (Recovery::ResumeDatabase, sleep)
            }
            (Fault::DiskFull, Some(faults)) => {
                let failures = faults.failures();
                faults.fill_disk(true);
                (Recovery::RepairDatabaseDisk(failures), disk_fault)
            }
            (Fault::SyncsFail, Some(faults)) => {
                let failures = faults.failures();
                faults.fail_syncs(true);
                (Recovery::RepairDatabaseDisk(failures), disk_fault)
            }
            _ => return false,
        };
        self.database_is_faulty = true;
        self.schedule_recovery(seconds, recovery);
        true
    }

    fn inject_object_store_fault(&mut self, fault: Fault) -> bool {
        let (away, disk_fault, sleep) = (
            self.random_seconds(self.plan.durations.away),
            self.random_seconds(self.plan.durations.fault),
            self.suspension(),
        );
        let Some(servers) = self.servers.as_mut().filter(|_| !self.objects_are_faulty) else { return false };
        if servers.objects.has_ended() {
            return false;
        }
        let (recovery, seconds) = match (fault, servers.objects.faults()) {
            (Fault::Killed, _) => {
                servers.objects.kill();
                (Recovery::StartObjects, away)
            }
            (Fault::Suspended, _) => {
                servers.objects.suspend(true);
                (Recovery::ResumeObjects, sleep)
            }
            (Fault::DiskFull, Some(faults)) => {
                let failures = faults.failures();
                faults.fill_disk(true);
                (Recovery::RepairObjectsDisk(failures), disk_fault)
            }
            _ => return false,
        };
        self.objects_are_faulty = true;
        self.schedule_recovery(seconds, recovery);
        true
    }

    /// Sets the offset of a coordinator's clock.
    pub(super) fn step_clock(&mut self, index: usize, seconds: i64) {
        if let Some(faults) = self.farm.faults(index) {
            faults.step_clock(seconds);
            self.coordinators[index].clock_step = seconds;
        }
    }

    /// Whether no call has met the fault of a disk yet. Databases write and sync all the time, unless all of their
    /// coordinators are down. A server that is ending meets no further fault.
    fn is_unnoticed(&mut self, recovery: Recovery) -> bool {
        let (faults, failures, has_ended) = match (recovery, &mut self.servers) {
            (Recovery::RepairCoordinatorDisk(index, failures), _) => (self.farm.faults(index), failures, false),
            (Recovery::RepairDatabaseDisk(failures), Some(Servers { database, .. })) => {
                let has_ended = database.has_ended();
                (database.faults(), failures, has_ended)
            }
            (Recovery::RepairObjectsDisk(failures), Some(Servers { objects, .. })) => {
                let has_ended = objects.has_ended();
                (objects.faults(), failures, has_ended)
            }
            _ => return false,
        };
        !has_ended && faults.is_some_and(|faults| faults.failures() == failures)
    }

    /// Recovers a target.
    pub(super) fn recover(&mut self, recovery: Recovery) {
        match recovery {
            Recovery::ResumeWorker(worker) => {
                if let Some(sleeper) = self.workers.iter_mut().find(|(number, _)| *number == worker) {
                    sleeper.1 = false;
                    self.farm.suspend_worker(worker, false);
                }
            }
            Recovery::StartCoordinator(index) => self.start_coordinator(index),
            Recovery::ResumeCoordinator(index) => {
                if std::mem::take(&mut self.coordinators[index].is_suspended) {
                    self.farm.suspend_coordinator(index, false);
                }
            }
            Recovery::RepairCoordinatorDisk(index, _) => {
                self.coordinators[index].has_faults = false;
                if let Some(faults) = self.farm.faults(index) {
                    faults.fill_disk(false);
                    faults.fail_syncs(false);
                }
            }
            Recovery::StartDatabase | Recovery::ResumeDatabase | Recovery::RepairDatabaseDisk(_) => {
                self.recover_database(recovery)
            }
            Recovery::StartObjects | Recovery::ResumeObjects | Recovery::RepairObjectsDisk(_) => {
                self.recover_objects(recovery)
            }
        }
    }

    fn recover_database(&mut self, recovery: Recovery) {
        let Some(Servers { database, .. }) = &mut self.servers else { return };
        self.database_is_faulty = false;
        match recovery {
            Recovery::StartDatabase => {
                self.wrong.extend(database.restart().err().map(|error| format!("PostgreSQL: {error}")))
            }
            Recovery::ResumeDatabase => database.suspend(false),
            _ => {
                if let Some(faults) = database.faults() {
                    faults.fill_disk(false);
                    faults.fail_syncs(false);
                }
            }
        }
    }

    fn recover_objects(&mut self, recovery: Recovery) {
        let Some(Servers { objects, .. }) = &mut self.servers else { return };
        self.objects_are_faulty = false;
        match recovery {
            Recovery::StartObjects => self.wrong.extend(objects.restart().err().map(|error| format!("S3: {error}"))),
            Recovery::ResumeObjects => objects.suspend(false),
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

    /// Restarts processes that have ended by themselves, as a supervisor of services does. A coordinator that starts
    /// without its database or on a full disk may give up. A coordinator that has answered may not, nor may a worker.
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
            *self.restarts.entry(Target::Coordinator).or_default() += 1;
            self.start_coordinator(index);
        }
        if let Some(servers) = self.servers.as_mut().filter(|_| !self.database_is_faulty)
            && servers.database.has_ended()
        {
            *self.restarts.entry(Target::Database).or_default() += 1;
            self.recover_database(Recovery::StartDatabase);
        }
        if let Some(servers) = self.servers.as_mut().filter(|_| !self.objects_are_faulty)
            && servers.objects.has_ended()
        {
            *self.restarts.entry(Target::ObjectStore).or_default() += 1;
            self.recover_objects(Recovery::StartObjects);
        }
    }

    /// Whether a coordinator could answer.
    pub(super) fn is_up(&self, index: usize) -> bool {
        let Coordinator { is_down, is_suspended, .. } = self.coordinators[index];
        !is_down && !is_suspended
    }

    fn schedule_recovery(&mut self, seconds: f64, recovery: Recovery) {
        self.due.push((Instant::now() + Duration::from_secs_f64(seconds), recovery));
    }

    /// A random time of up to `longest` seconds, and at least a tenth of it.
    fn random_seconds(&mut self, longest: f64) -> f64 {
        longest * (0.1 + 0.9 * self.random.uniform())
    }

    /// The time of a suspension, seconds.
    fn suspension(&mut self) -> f64 {
        let longest = self.plan.durations.sleep;
        let is_long = below(&mut self.random, self.plan.durations.long_sleeps) == 0;
        if is_long { longest } else { self.random_seconds(longest / 4.0) }
    }
}
