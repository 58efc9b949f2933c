//! Claims: the nodes that a worker gets.
//!
//! Jobs are served by priority, then by age; within a job, the oldest round goes first. Two kinds of overdue work come
//! before free work. Overdue nodes of the next round go before work of later rounds, and overdue nodes of urgent jobs
//! before free work of less urgent ones.
//!
//! Claims run in the one writer, so no two of them read the same free row. A claim that finds too few free rows [cuts
//! more](super::backlog). The largest node is known only when it is leased: one that is too large for the worker is
//! [split](super::splits) then. When the time limit of a job is reached before its first round is complete, only nodes
//! of that round are leased. A worker stays with jobs whose scenes it has built ([`prefer_built`]). Chosen nodes are
//! [granted](crate::store::leases::grant) as a lease.
//!
//! Nodes that need a [check](crate::store::checks) come first, because a round waits for them. A job that is
//! [held](crate::store::leases::expiry) gets no leases. A node with which workers died is leased alone. When nothing
//! is free, a worker [takes over](super::stragglers) what another has held for too long.

use clerestory_film::NodeAddress;

use crate::model::{ClaimTerms, Grant, JobRecord, MeasuredRate};
use crate::store::checks;
use crate::store::checks::HeldSince;
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::address;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::engine::writer::Turn;
use crate::store::errors::WorkerError;
use crate::store::leases::grant::{Leased, Offer, grant};
use crate::store::leases::table as leases;
use crate::store::queue::backlog::fill_ready_queue;
use crate::store::queue::open_jobs::{
    JOBS_AT_ONCE, OpenJob, first_of, last_round, measured_rate, most_samples, open_jobs, prefer_built, withhold_refused,
};
use crate::store::queue::stragglers::{self, HeldLease, TakenOver};
use crate::store::queue::strips::{gather_strips, split_first};
use crate::store::queue::suspects::{Suspects, suspects};
use crate::store::workers::table as workers;
use crate::store::workers::table::Claimant;

/// A check that another worker holds for this many lease times goes to one more worker, before other work. So does one
/// that two workers hold. The factor is high, so that a worker that makes progress keeps its check.
const CHECK_OVERDUE_FACTOR: i64 = 30;

impl Store {
    /// Grants a lease, or `None` when the queue has no work for this worker. A worker that disconnected while waiting
    /// gets no lease, because nobody would render it.
    ///
    /// `terms` is called when the turn of the claim has come, because the lease begins then.
    pub(crate) async fn claim(
        &self,
        terms: impl FnOnce() -> ClaimTerms + Send + 'static,
    ) -> Result<Option<Grant>, WorkerError> {
        self.write_in(Turn::Claim, move |connection| Box::pin(async move { claim(connection, &terms()).await })).await
    }
}

async fn claim(connection: &mut Connection, terms: &ClaimTerms) -> Result<Option<Grant>, WorkerError> {
    let claimant = workers::touch(connection, terms.worker, terms.now_ms).await?;
    if claimant.backoff_until_ms > terms.now_ms {
        return Ok(None);
    }
    let (mut seen, mut without_work) = (0, Vec::<OpenJob>::new());
    // First of the jobs with the priority of the last one.
    let mut equals = 0;
    loop {
        let mut open = open_jobs(connection, &claimant, terms, seen).await?;
        let is_last = open.len() < JOBS_AT_ONCE;
        seen += open.len();
        open.retain(|OpenJob { job, .. }| !job.is_out_of_time(terms.now_ms));
        withhold_refused(connection, &mut open, &claimant, terms).await?;
        prefer_built(connection, &mut open, terms).await?;
        for open in open {
            if without_work.last().is_some_and(|last| last.job.priority != open.job.priority) {
                if let Some(grant) = overdue_work(connection, &without_work[equals..], &claimant, terms).await? {
                    return Ok(Some(grant));
                }
                equals = without_work.len();
            }
            if let Some(grant) = free_work(connection, &open, &claimant, terms).await? {
                return Ok(Some(grant));
            }
            without_work.push(open);
        }
        if is_last {
            if let Some(grant) = overdue_work(connection, &without_work[equals..], &claimant, terms).await? {
                return Ok(Some(grant));
            }
            return Ok(held_work(connection, &without_work, &claimant, terms).await?);
        }
    }
}

/// Free nodes of a job for this worker.
async fn free_work(
    connection: &mut Connection,
    open: &OpenJob,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    let may_have_free = open.has_free || open.can_be_cut();
    if !(open.has_checks || may_have_free) {
        return Ok(None);
    }
    if open.has_checks {
        let nodes = checks::choose(connection, &open.job, terms.worker, terms.most_nodes(), None).await?;
        let grant = lease_checks(connection, open, nodes, claimant, terms).await?;
        if grant.is_some() {
            return Ok(grant);
        }
    }
    if open.has_overdue && may_have_free {
        // All later rounds wait for it.
        let next_round = i64::from(open.job.rounds);
        let grant = overdue_work_up_to(connection, open, next_round, claimant, terms).await?;
        if grant.is_some() {
            return Ok(grant);
        }
    }
    let rate = measured_rate(connection, open, terms).await?;
    let nodes = choose(connection, open, &rate, claimant, terms).await?;
    lease(connection, open, (nodes, Leased::Work, 0), &rate, claimant, terms).await
}

/// Grants a lease on nodes that need a check: the first of them, as many as a lease should have.
async fn lease_checks(
    connection: &mut Connection,
    open: &OpenJob,
    nodes: Vec<NodeAddress>,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    if nodes.is_empty() {
        return Ok(None);
    }
    let rate = measured_rate(connection, open, terms).await?;
    let nodes = first_of(nodes, &open.job, &rate, terms);
    lease(connection, open, (nodes, Leased::Checks, 0), &rate, claimant, terms).await
}

/// Grants a lease on the chosen nodes, if there are any. `repeats` counts earlier leases on them beside a running one.
async fn lease(
    connection: &mut Connection,
    open: &OpenJob,
    (nodes, leased, repeats): (Vec<NodeAddress>, Leased, u32),
    rate: &MeasuredRate,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    if nodes.is_empty() {
        return Ok(None);
    }
    let offer = Offer::new(nodes, leased, repeats, &open.job, rate, terms);
    Ok(Some(grant(connection, &open.job, offer, claimant, terms).await?))
}

/// Overdue nodes of some jobs, for this worker.
async fn overdue_work(
    connection: &mut Connection,
    jobs: &[OpenJob],
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    for open in jobs.iter().filter(|open| open.has_overdue) {
        let last_round = last_round(&open.job, terms);
        let grant = overdue_work_up_to(connection, open, last_round, claimant, terms).await?;
        if grant.is_some() {
            return Ok(grant);
        }
    }
    Ok(None)
}

/// Overdue nodes of one job, up to a round, for this worker.
async fn overdue_work_up_to(
    connection: &mut Connection,
    open: &OpenJob,
    last_round: i64,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    let held = stragglers::overdue(connection, &open.job, last_round, terms).await?;
    held_of(connection, open, held, CHECK_OVERDUE_FACTOR, claimant, terms).await
}

/// Nodes of another worker's lease, if it may be taken over, or checks that others have held for `check_factor` lease
/// times.
async fn held_of(
    connection: &mut Connection,
    open: &OpenJob,
    held: Option<HeldLease>,
    check_factor: i64,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    let seconds = |samples| open.rate_alone(terms).seconds(samples);
    let held = held.filter(|held| held.may_be_taken_over(&open.job, seconds, terms));
    if let Some(held) = held {
        let rate = measured_rate(connection, open, terms).await?;
        let TakenOver { nodes, repeats } = stragglers::take_over(connection, &open.job, &held, &rate, terms).await?;
        let grant = lease(connection, open, (nodes, Leased::Work, repeats), &rate, claimant, terms).await?;
        leases::end_if_empty(connection, held.id).await?;
        return Ok(grant);
    }
    if !open.has_held_checks {
        return Ok(None);
    }
    let since = |factor: i64| terms.now_ms.saturating_sub(terms.target_ms.saturating_mul(factor));
    let held_since = HeldSince { one_ms: since(check_factor), two_ms: since(CHECK_OVERDUE_FACTOR) };
    let nodes = checks::choose(connection, &open.job, terms.worker, terms.most_nodes(), Some(held_since)).await?;
    lease_checks(connection, open, nodes, claimant, terms).await
}

/// When nothing is free: nodes that others have held for longer than this worker would need.
async fn held_work(
    connection: &mut Connection,
    jobs: &[OpenJob],
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    let mut held = stragglers::held_longest(connection, jobs, terms).await?;
    for open in jobs {
        let lease = held.remove(&open.job.id);
        let grant = held_of(connection, open, lease, 1, claimant, terms).await?;
        if grant.is_some() {
            return Ok(grant);
        }
    }
    Ok(None)
}

/// Free nodes of a job for this worker. The first one is split where it is too large. None when all work is leased or
/// done.
async fn choose(
    connection: &mut Connection,
    OpenJob { job, has_suspects, .. }: &OpenJob,
    rate: &MeasuredRate,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Vec<NodeAddress>, StoreError> {
    let (most, wanted) = (terms.most_nodes(), most_samples(job, rate, terms));
    let withheld = match has_suspects {
        true => Some(suspects(connection, job, claimant, terms).await?),
        false => None,
    };
    let mut nodes = free_nodes(connection, job, most, withheld.as_ref(), terms).await?;
    let samples: u64 = nodes.iter().map(|node| job.node_samples(node)).sum();
    let is_enough = !nodes.is_empty() && samples as f64 >= wanted;
    let free = nodes.len() as u32;
    if free < most && !is_enough && fill_ready_queue(connection, job, free, last_round(job, terms), rate).await? {
        nodes = free_nodes(connection, job, most, withheld.as_ref(), terms).await?;
    }
    let mut nodes = gather_strips(connection, job, first_of(nodes, job, rate, terms), most).await?;
    if let Some(suspects) = &withheld {
        suspects.withhold(&mut nodes);
        suspects.set_apart(&mut nodes);
    }
    split_first(connection, job, &mut nodes, wanted).await?;
    Ok(nodes)
}

/// The first free nodes of a job's queue that are not withheld, at most `most`.
async fn free_nodes(
    connection: &mut Connection,
    job: &JobRecord,
    most: u32,
    suspects: Option<&Suspects>,
    terms: &ClaimTerms,
) -> Result<Vec<NodeAddress>, StoreError> {
    let rows = query(
        "select frame, tile, level, idx from pending where job = $1 and lease is null and round <= $2 \
         order by round, frame, tile, idx limit $3",
    )
    .bind(job.id.to_string())
    .bind(last_round(job, terms))
    .bind(i64::from(most) + suspects.map_or(0, |suspects| i64::from(suspects.withheld())))
    .fetch_all(connection)
    .await?;
    let mut nodes = rows.iter().map(address).collect::<Result<Vec<_>, _>>()?;
    if let Some(suspects) = suspects {
        suspects.withhold(&mut nodes);
        nodes.truncate(most as usize);
    }
    Ok(nodes)
}
