//! Deadlines: leases that expire, jobs whose time limit is reached, workers that are lost, and checks that no worker is
//! left for.

use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;

use super::claims::Claims;
use super::upload_linger::UploadLinger;
use crate::clock::Clock;
use crate::store::{Observation, Store, StoreError};
use crate::watch::liveness::Liveness;
use crate::watch::notifications::{Notification, Notifications};

/// Longest time between two checks of deadlines.
const LONGEST_TICK: Duration = Duration::from_secs(1);

/// Longest gap in listening that does not count. A worker that sent a heartbeat just before and just after it was
/// silent for less time than others wait for it.
const LONGEST_GAP: Duration = Duration::from_secs(5);

/// Expired leases that one check logs, each with its worker: a power cut ends thousands.
const MOST_EXPIRED_LOGGED: usize = 16;

/// Watches deadlines.
#[derive(Debug)]
pub(crate) struct Deadlines {
    store: Store,
    clock: Clock,
    lease_ttl: Duration,
    notifications: Arc<Notifications>,
    liveness: Arc<Liveness>,
    linger: Arc<UploadLinger>,
    claims: Arc<Claims>,
    stopping: CancellationToken,
}

impl Deadlines {
    /// The deadlines of a farm.
    #[expect(clippy::too_many_arguments, reason = "each is one thing that a deadline concerns")]
    pub(crate) fn new(
        store: Store,
        clock: Clock,
        lease_ttl: Duration,
        notifications: Arc<Notifications>,
        liveness: Arc<Liveness>,
        linger: Arc<UploadLinger>,
        claims: Arc<Claims>,
        stopping: CancellationToken,
    ) -> Self {
        Self { store, clock, lease_ttl, notifications, liveness, linger, claims, stopping }
    }

    /// Checks deadlines until the coordinator stops.
    pub(crate) async fn run(self) {
        let tick = LONGEST_TICK.min(self.lease_ttl / 4).max(Duration::from_millis(1));
        let mut interval = tokio::time::interval(tick);
        // After a pause, one check finds everything.
        interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut checked = Instant::now();
        while self.stopping.run_until_cancelled(interval.tick()).await.is_some() {
            if checked.elapsed() > tick + LONGEST_GAP {
                // The coordinator was suspended or waited for the database, and received no heartbeats meanwhile.
                self.liveness.restart();
            }
            checked = Instant::now();
            if let Err(error) = self.check().await {
                tracing::error!(%error, "deadlines could not be looked at");
                self.liveness.restart();
            }
        }
    }

    /// Checks all deadlines once.
    async fn check(&self) -> Result<(), StoreError> {
        follow_clock(&self.clock, &self.store).await?;
        let now_ms = self.clock.now_ms();
        for job in self.store.end_jobs_out_of_time(now_ms).await? {
            tracing::info!(%job, "time limit reached");
            self.notifications.publish(Notification::Job(job));
        }
        self.expire_leases(now_ms).await?;
        // A worker whose heartbeats nobody could receive is not lost.
        if self.liveness.alive_ms() > i64::MIN
            && self.store.end_lost_workers(self.liveness.silent_before_ms(), now_ms).await?
        {
            self.notifications.publish(Notification::Workers);
        }
        self.give_up_checks().await?;
        self.linger.set_active_leases(self.store.active_leases().await?);
        self.claims.forget_absent();
        let open = self.store.open_jobs().await?;
        if !open.is_empty() {
            // Held work becomes overdue with time alone, and the claimants that a notification woke may have been the
            // wrong ones.
            self.notifications.wake_claimants();
        }
        if self.store.is_shared() {
            // Another coordinator may have died between a change and its notification.
            self.notifications.resync_stored();
        }
        // No round depends on a notification.
        for job in open {
            self.notifications.wake_finalizer(job);
        }
        Ok(())
    }

    /// Takes back expired leases, and holds jobs whose workers die.
    async fn expire_leases(&self, now_ms: i64) -> Result<(), StoreError> {
        let observation =
            Observation { now_ms, listening_ms: self.liveness.listening_ms(), alive_ms: self.liveness.alive_ms() };
        let expiry = self.store.expire_leases(observation).await?;
        for expired in expiry.leases.iter().take(MOST_EXPIRED_LOGGED) {
            tracing::warn!(
                lease = %expired.lease, job = %expired.job, job_name = expired.job_name, worker = %expired.worker,
                worker_name = expired.worker_name, nodes = expired.nodes,
                "a lease ran out; its nodes are in the queue again"
            );
        }
        if let Some(more) = expiry.leases.len().checked_sub(MOST_EXPIRED_LOGGED).filter(|more| *more > 0) {
            tracing::warn!(more, "further leases ran out");
        }
        if !expiry.leases.is_empty() {
            self.notifications.publish(Notification::Work);
        }
        for (job, hold) in expiry.held {
            tracing::error!(%job, reason = hold.reason, "the job is held until somebody releases it");
            self.notifications.publish(Notification::Job(job));
        }
        for job in expiry.unchecked {
            tracing::error!(%job, "workers died again and again with a node that they were to check; it is not \
                                   checked");
            self.notifications.publish(Notification::Round(job));
        }
        for job in self.store.release_jobs_of_returned_workers(now_ms).await? {
            tracing::info!(%job, "a worker that was thought dead is back; the job goes on");
            self.notifications.publish(Notification::Job(job));
        }
        Ok(())
    }

    /// Gives up checks that no worker is left for.
    async fn give_up_checks(&self) -> Result<(), StoreError> {
        for given_up in self.store.give_up_checks(self.liveness.alive_ms()).await? {
            let (job, node) = (given_up.job, given_up.node);
            match given_up.workers.as_slice() {
                [] | [_] => tracing::debug!(%job, %node, "no other worker can check it"),
                workers => {
                    let workers: Vec<String> = workers.iter().map(ToString::to_string).collect();
                    tracing::error!(
                        %job,
                        %node,
                        ?workers,
                        "two workers render a node to different bits, and no third can decide which is wrong"
                    );
                }
            }
            self.notifications.publish(Notification::Round(job));
        }
        Ok(())
    }
}

/// Sets the clock by that of the database, where several coordinators share one.
pub(crate) async fn follow_clock(clock: &Clock, store: &Store) -> Result<(), StoreError> {
    let asked = Instant::now();
    // An answer that took long is out of date, but better than the machine's clock.
    if let Some(now_ms) = store.now_ms().await?
        && (asked.elapsed() < LONGEST_TICK || !clock.follows())
    {
        clock.follow(now_ms);
    }
    Ok(())
}
