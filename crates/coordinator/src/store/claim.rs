//! Claims: which nodes a worker gets.
//!
//! Jobs are served by priority, then age; within a job the oldest wave goes first. What a job's next round waits for and another has had for far
//! too long goes before work of later rounds, and what is left of urgent jobs and was had for far too long before free work of less urgent ones.
//! Claims run in the one writer, so no two of them see the same free row. A claim that finds too few of them [cuts more](super::stock). How large nodes
//! may be is known only when they are given out: one that is too large for the worker that asks is [split](super::parts) then. A job whose time is
//! up before its first round is complete is served with the nodes of that round alone. A worker goes on with jobs whose scenes it has at hand
//! ([`prefer_built`]). What has been chosen is [granted](super::grant) as a lease.
//!
//! Nodes that are to be [checked](super::checks) come first, since a round waits for them.
//!
//! A job that is [held](super::expiry) gets no leases. A node with which workers died is leased alone.
//!
//! A worker for whom nothing is free [takes over](super::take_over) what another has held for too long.

use std::collections::BTreeSet;

use clerestory_api::{JobId, LeaseId, WorkerId};
use clerestory_film::NodeAddress;

use crate::schedule::Pace;
use crate::store::{Connection, Store, StoreError, WorkerError};
use crate::store::checks::{self, HeldSince};
use crate::store::expiry::{self, Suspects};
use crate::store::grant::{Grant, Leased, Offer, grant};
use crate::store::jobs::{self, JobRecord};
use crate::store::leases::{self, address};
use crate::store::parts::{Side, split_off};
use crate::store::row::{Row, to_json};
use crate::store::sql::{Kind, query, rows_of};
use crate::store::stock::{STOCK, stock};
use crate::store::take_over::{self, HeldLease, TakenOver};
use crate::store::workers::{self, Claimant};
use crate::store::writer::Turn;

/// A check that another has had for so many times as long as a lease should take is given to one more, whatever else there is to do, and also when two
/// have had it for so long: only what has stopped may seem to.
const CHECK_PATIENCE: i64 = 30;

/// Open jobs that are looked at together: one after the other has nothing only where all that is left of them is leased.
const JOBS_AT_ONCE: usize = 32;

/// What a worker asks for.
#[derive(Clone, Debug)]
pub(crate) struct ClaimTerms {
    /// Who asks.
    pub(crate) worker: WorkerId,
    /// Jobs whose scenes it has at hand.
    pub(crate) built: Vec<JobId>,
    /// Identity of the lease, if there will be one.
    pub(crate) lease: LeaseId,
    /// Most nodes that it wants.
    pub(crate) max_nodes: Option<u32>,
    /// Exactly this many nodes, if there are as many: for experiments.
    pub(crate) fixed_nodes: Option<u32>,
    /// How long the work should take.
    pub(crate) target_ms: i64,
    /// How long a complete node waits for others in a lease that is long enough.
    pub(crate) gather_ms: i64,
    /// How long the lease lasts.
    pub(crate) ttl_ms: i64,
    /// A worker that was last heard of before this is not there.
    pub(crate) alive_ms: i64,
    /// Now.
    pub(crate) now_ms: i64,
}

impl ClaimTerms {
    /// Most nodes that the lease may have.
    pub(super) fn most_nodes(&self) -> u32 {
        self.fixed_nodes.or(self.max_nodes).unwrap_or(STOCK).clamp(1, STOCK)
    }
}

impl Store {
    /// Gives work to a worker; `None` when there is none for it now. Who has gone away meanwhile gets none: nobody would render it until the lease runs out.
    ///
    /// What it asks for is asked when its turn has come: a lease lasts from then on.
    pub(crate) async fn claim(
        &self,
        terms: impl FnOnce() -> ClaimTerms + Send + 'static,
    ) -> Result<Option<Grant>, WorkerError> {
        self.write_in(Turn::Claim, move |connection| Box::pin(async move { claim(connection, &terms()).await })).await
    }
}

/// An open job, as it stands for the worker that asks.
#[derive(Clone, Debug)]
pub(super) struct OpenJob {
    pub(super) job: JobRecord,
    /// Whether there are nodes in its queue that nobody has.
    has_free: bool,
    /// Whether there are nodes of it that this worker can check, which nobody has and which others have.
    has_checks: bool,
    has_held_checks: bool,
    /// Whether another worker has had a lease of it for [too long](Pace::patience_seconds) without an accepted node.
    has_overdue: bool,
    /// Whether there are nodes in its queue with which workers [died](super::expiry).
    has_suspects: bool,
    /// How fast the worker renders it; before its first partial, how fast others do for each of their cores.
    samples_per_second: Option<f64>,
}

impl OpenJob {
    /// Whether the next nodes of it can be put into the queue.
    fn can_be_cut(&self) -> bool {
        self.job.boundaries().passes(self.job.cursor[0]).is_some_and(|wave| !self.job.waits_for_shares(wave))
    }

    /// How fast the worker renders it, as if no other did.
    fn pace_alone(&self, terms: &ClaimTerms) -> Pace {
        Pace {
            samples_per_second: self.samples_per_second,
            target_seconds: terms.target_ms as f64 / 1000.0,
            workers: 1,
        }
    }
}

async fn claim(connection: &mut Connection, terms: &ClaimTerms) -> Result<Option<Grant>, WorkerError> {
    let claimant = workers::touch(connection, terms.worker, terms.now_ms).await?;
    if claimant.rests_until_ms > terms.now_ms {
        return Ok(None);
    }
    let (mut seen, mut without_work) = (0, Vec::<OpenJob>::new());
    // Where those begin that are as urgent as the last one.
    let mut equals = 0;
    loop {
        let mut open = open_jobs(connection, &claimant, terms, seen).await?;
        let is_last = open.len() < JOBS_AT_ONCE;
        seen += open.len();
        open.retain(|OpenJob { job, .. }| !job.is_out_of_time(terms.now_ms) && has_bits_of(job, &claimant));
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

/// Puts jobs whose scenes a worker has at hand before others that are as urgent and have workers already: each worker more that begins with one
/// builds its scene. A job that nobody renders keeps its place, so that none is passed over for long.
async fn prefer_built(connection: &mut Connection, open: &mut [OpenJob], terms: &ClaimTerms) -> Result<(), StoreError> {
    let is_built = |open: &OpenJob| terms.built.contains(&open.job.id);
    for equals in open.chunk_by_mut(|a, b| a.job.priority == b.job.priority) {
        if equals.iter().any(is_built) && !equals.iter().all(is_built) {
            let others: Vec<[String; 1]> =
                equals.iter().filter(|open| !is_built(open)).map(|open| [open.job.id.to_string()]).collect();
            let with_workers = with_other_workers(connection, &others, terms.worker).await?;
            equals.sort_by_key(|open| with_workers.contains(&open.job.id));
        }
    }
    Ok(())
}

/// Those of some jobs of which another worker has a lease.
async fn with_other_workers(
    connection: &mut Connection,
    jobs: &[[String; 1]],
    worker: WorkerId,
) -> Result<BTreeSet<JobId>, StoreError> {
    let statement = format!(
        "select c0 as job from {} as listed_jobs \
         where (select 1 from leases where job = c0 and state = 'active' and worker <> $2 limit 1) is not null",
        rows_of(connection.engine(), 1, &[Kind::Text])
    );
    let rows = query(statement).bind(to_json(&jobs)?).bind(worker.to_string()).fetch_all(connection).await?;
    rows.iter().map(|row| row.parsed("job")).collect()
}

/// Jobs that may still have work, most urgent first, without so many that come first: as many as [`JOBS_AT_ONCE`].
async fn open_jobs(
    connection: &mut Connection,
    claimant: &Claimant,
    terms: &ClaimTerms,
    without: usize,
) -> Result<Vec<OpenJob>, StoreError> {
    let columns = jobs::COLUMNS;
    let can_check = format!("select 1 from checks where job = jobs.id and {}", checks::is_new_to("$4"));
    // Not `exists`: of that, PostgreSQL would look for all rows of all jobs at once.
    let rows = query(format!(
        "select {columns}, \
         (select 1 from pending where job = jobs.id and lease is null limit 1) is not null as has_free, \
         (select samples from rates where worker = $1 and job = jobs.id) as own_samples, \
         (select core_us from rates where worker = $1 and job = jobs.id) as own_core_us, \
         (select 1 from leases where job = jobs.id and state = 'active' and worker <> $1 and due_ms <= $5 \
         order by due_ms limit 1) is not null as has_overdue, \
         (select 1 from pending where job = jobs.id and died_on is not null limit 1) is not null as has_suspects, \
         ({can_check} and lease is null limit 1) is not null as has_checks, \
         ({can_check} and lease is not null limit 1) is not null as has_held_checks \
         from jobs where state in ('queued', 'running') and hold is null order by priority desc, created_ms, id limit $2 offset $3"
    ))
    .bind(terms.worker.to_string())
    .bind(JOBS_AT_ONCE as i64)
    .bind(without as i64)
    .bind(&claimant.name)
    .bind(terms.now_ms)
    .fetch_all(connection)
    .await?;
    let open = |row: &Row| {
        let job = jobs::record(row)?;
        let samples_per_second = match (row.optional_float("own_samples")?, row.optional_float("own_core_us")?) {
            (Some(samples), Some(core_us)) if samples > 0.0 && core_us > 0.0 => {
                Some(samples / core_us * 1e6 * f64::from(claimant.cores))
            }
            _ => workers::rate(job.samples, job.core_ms, claimant.cores),
        };
        let has = |column| Ok::<_, StoreError>(row.integer(column)? != 0);
        Ok(OpenJob {
            has_free: has("has_free")?,
            has_checks: has("has_checks")?,
            has_held_checks: has("has_held_checks")?,
            has_overdue: has("has_overdue")?,
            has_suspects: has("has_suspects")?,
            samples_per_second,
            job,
        })
    };
    rows.iter().map(open).collect()
}

/// How fast the worker renders a job, and how many others do.
async fn pace(connection: &mut Connection, open: &OpenJob, terms: &ClaimTerms) -> Result<Pace, StoreError> {
    let others = query(
        "select count(*) as others from (select distinct worker from leases \
         where job = $1 and state = 'active' and worker <> $2) as other_workers",
    )
    .bind(open.job.id.to_string())
    .bind(terms.worker.to_string())
    .fetch_one(connection)
    .await?;
    Ok(Pace { workers: others.number::<u32>("others")?.saturating_add(1), ..open.pace_alone(terms) })
}

/// Nodes of a job that nobody has, for this worker.
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
    let pace = pace(connection, open, terms).await?;
    let nodes = choose(connection, open, &pace, claimant, terms).await?;
    lease(connection, open, (nodes, Leased::Work, 0), &pace, claimant, terms).await
}

/// Gives nodes that are to be checked to this worker as a lease, the first of them and no more than a lease should have, if there are any.
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
    let pace = pace(connection, open, terms).await?;
    let nodes = first_of(nodes, &open.job, &pace, terms);
    lease(connection, open, (nodes, Leased::Checks, 0), &pace, claimant, terms).await
}

/// Gives chosen nodes to this worker as a lease, if there are any. They have been given out so often while others had them.
async fn lease(
    connection: &mut Connection,
    open: &OpenJob,
    (nodes, leased, repeats): (Vec<NodeAddress>, Leased, u32),
    pace: &Pace,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    if nodes.is_empty() {
        return Ok(None);
    }
    let offer = Offer::new(nodes, leased, repeats, &open.job, pace, terms);
    Ok(Some(grant(connection, &open.job, offer, claimant, terms).await?))
}

/// Nodes of some jobs that others have had for too long without bringing one, for this worker.
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

/// The same of one job, up to a round.
async fn overdue_work_up_to(
    connection: &mut Connection,
    open: &OpenJob,
    last_round: i64,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    let held = take_over::overdue(connection, &open.job, last_round, terms).await?;
    held_of(connection, open, held, CHECK_PATIENCE, claimant, terms).await
}

/// Nodes of a lease that another holds, if it may be taken over, or checks that others have had for so many times as long as a lease should take, for this
/// worker.
async fn held_of(
    connection: &mut Connection,
    open: &OpenJob,
    held: Option<HeldLease>,
    check_patience: i64,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    let seconds = |samples| open.pace_alone(terms).seconds(samples);
    let held = held.filter(|held| held.may_be_taken_over(&open.job, seconds, terms));
    if let Some(held) = held {
        let pace = pace(connection, open, terms).await?;
        let TakenOver { nodes, repeats } = take_over::take_over(connection, &open.job, &held, &pace, terms).await?;
        let grant = lease(connection, open, (nodes, Leased::Work, repeats), &pace, claimant, terms).await?;
        leases::end_if_empty(connection, held.id).await?;
        return Ok(grant);
    }
    if !open.has_held_checks {
        return Ok(None);
    }
    let since = |patience: i64| terms.now_ms.saturating_sub(terms.target_ms.saturating_mul(patience));
    let held_since = HeldSince { one_ms: since(check_patience), two_ms: since(CHECK_PATIENCE) };
    let nodes = checks::choose(connection, &open.job, terms.worker, terms.most_nodes(), Some(held_since)).await?;
    lease_checks(connection, open, nodes, claimant, terms).await
}

/// Nodes of some jobs that others have held for longer than this worker would need, when there is nothing else for it.
async fn held_work(
    connection: &mut Connection,
    jobs: &[OpenJob],
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    let mut held = take_over::held_longest(connection, jobs, terms).await?;
    for open in jobs {
        let lease = held.remove(&open.job.id);
        let grant = held_of(connection, open, lease, 1, claimant, terms).await?;
        if grant.is_some() {
            return Ok(grant);
        }
    }
    Ok(None)
}

/// Whether a worker computes the bits that a job has so far.
fn has_bits_of(job: &JobRecord, claimant: &Claimant) -> bool {
    job.probe_digest.as_ref().is_none_or(|digest| *digest == claimant.probe_digest)
}

/// The same as [`has_bits_of`], as a condition on a row of `jobs` and one of `workers`.
pub(super) const HAS_BITS: &str =
    "(jobs.probe_digest is null or jobs.probe_digest = coalesce(workers.probe_digest, ''))";

/// Free nodes of a job for this worker, the first a part of one where it is too large; none when all work is leased or done.
async fn choose(
    connection: &mut Connection,
    OpenJob { job, has_suspects, .. }: &OpenJob,
    pace: &Pace,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Vec<NodeAddress>, StoreError> {
    let (most, wanted) = (terms.most_nodes(), most_samples(job, pace, terms));
    let suspects = match has_suspects {
        true => Some(expiry::suspects(connection, job, claimant, terms).await?),
        false => None,
    };
    let mut nodes = free_nodes(connection, job, most, suspects.as_ref(), terms).await?;
    let samples: u64 = nodes.iter().map(|node| job.node_samples(node)).sum();
    let is_enough = !nodes.is_empty() && samples as f64 >= wanted;
    let free = nodes.len() as u32;
    if free < most && !is_enough && stock(connection, job, free, last_round(job, terms), pace).await? {
        nodes = free_nodes(connection, job, most, suspects.as_ref(), terms).await?;
    }
    let mut nodes = first_of(nodes, job, pace, terms);
    if let Some(suspects) = &suspects {
        suspects.set_apart(&mut nodes);
    }
    if let Some(first) = nodes.first_mut() {
        *first = split_off(connection, job, *first, wanted, Side::First).await?;
    }
    Ok(nodes)
}

/// The first nodes of a job's queue that nobody has and that are not withheld, and no more than `most`.
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

/// Samples that a lease should hold at most.
pub(super) fn most_samples(job: &JobRecord, pace: &Pace, terms: &ClaimTerms) -> f64 {
    if terms.fixed_nodes.is_some() {
        return f64::INFINITY;
    }
    let left = job.total_samples().saturating_sub(job.samples);
    pace.lease_samples(left as f64)
}

/// As many of some nodes as a lease should have.
pub(super) fn first_of(
    mut nodes: Vec<NodeAddress>,
    job: &JobRecord,
    pace: &Pace,
    terms: &ClaimTerms,
) -> Vec<NodeAddress> {
    let wanted = most_samples(job, pace, terms);
    let mut samples = 0;
    let fitting = nodes.iter().take_while(|node| {
        samples += job.node_samples(node);
        samples as f64 <= wanted
    });
    // One node always fits.
    let count = fitting.count().max(1);
    nodes.truncate(count);
    nodes
}

/// The last round of a job for which nodes are given out: past its limit, it needs its first to end, and nothing else.
pub(super) fn last_round(job: &JobRecord, terms: &ClaimTerms) -> i64 {
    if job.is_past_limit(terms.now_ms) { 0 } else { i64::from(u32::MAX) }
}
