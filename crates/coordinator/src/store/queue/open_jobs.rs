//! Open jobs as a claim reads them, and the size of a lease.

use std::collections::BTreeSet;

use clerestory_api::{JobId, WorkerId};
use clerestory_film::NodeAddress;

use crate::model::{ClaimTerms, JobRecord, MeasuredRate};
use crate::store::checks;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, rows_of, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::jobs;
use crate::store::leases::attempts;
use crate::store::workers::pins::matches_pin_of;
use crate::store::workers::table as workers;
use crate::store::workers::table::Claimant;

/// Open jobs in one read. A claim needs the next read only when all that is left of these is leased.
pub(in crate::store) const JOBS_AT_ONCE: usize = 32;

/// An open job from the view of a claiming worker.
#[derive(Clone, Debug)]
pub(in crate::store) struct OpenJob {
    pub(in crate::store) job: JobRecord,
    /// Whether its queue has free nodes.
    pub(in crate::store) has_free: bool,
    /// Whether it has nodes that this worker can check: free ones, and ones that others hold.
    pub(in crate::store) has_checks: bool,
    pub(in crate::store) has_held_checks: bool,
    /// Whether another worker's lease of it is [overdue](MeasuredRate::overdue_seconds).
    pub(in crate::store) has_overdue: bool,
    /// Whether its queue has nodes with which workers [died](crate::store::leases::expiry).
    pub(in crate::store) has_suspects: bool,
    /// The worker's rate for it; before its first partial, the rate of other workers for each core.
    pub(in crate::store) samples_per_second: Option<f64>,
}

impl OpenJob {
    /// Whether more nodes of it can be cut.
    pub(in crate::store) fn can_be_cut(&self) -> bool {
        self.job
            .boundaries()
            .passes(self.job.cursor[0])
            .is_some_and(|round_passes| !self.job.waits_for_shares(round_passes))
    }

    /// The rate of this worker, as if it were the only one.
    pub(in crate::store) fn rate_alone(&self, terms: &ClaimTerms) -> MeasuredRate {
        MeasuredRate {
            samples_per_second: self.samples_per_second,
            target_seconds: terms.target_ms as f64 / 1000.0,
            workers: 1,
        }
    }
}

/// Withholds jobs whose scenes the machine of a worker refuses, while another machine could build them.
pub(in crate::store) async fn withhold_refused(
    connection: &mut Connection,
    open: &mut Vec<OpenJob>,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<(), StoreError> {
    let mut withheld = BTreeSet::new();
    for OpenJob { job, .. } in open.iter() {
        if job.scene_refusal.as_ref().is_some_and(|refusal| refusal.name == claimant.name)
            && attempts::others_could_build(connection, job.id, &claimant.name, terms.alive_ms).await?
        {
            withheld.insert(job.id);
        }
    }
    open.retain(|OpenJob { job, .. }| !withheld.contains(&job.id));
    Ok(())
}

/// Moves jobs whose scenes the worker has built before jobs of the same priority that have workers already, because
/// each further worker has to build the scene. A job without workers keeps its place, so that no job waits for long.
pub(in crate::store) async fn prefer_built(
    connection: &mut Connection,
    open: &mut [OpenJob],
    terms: &ClaimTerms,
) -> Result<(), StoreError> {
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

/// Those of some jobs that another worker has a lease of.
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

/// Jobs that may have work for a worker, most urgent first: the next [`JOBS_AT_ONCE`] after `without`.
pub(in crate::store) async fn open_jobs(
    connection: &mut Connection,
    claimant: &Claimant,
    terms: &ClaimTerms,
    without: usize,
) -> Result<Vec<OpenJob>, StoreError> {
    let columns = jobs::COLUMNS;
    let can_check = format!("select 1 from checks where job = jobs.id and {}", checks::is_new_to("$4"));
    let matches_pin = matches_pin_of("$1");
    // Not `exists`: PostgreSQL would look for all rows of all jobs at once.
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
         from jobs where state in ('queued', 'running') and hold is null and {matches_pin} \
         order by priority desc, created_ms, id limit $2 offset $3"
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

/// The worker's rate for a job, and the number of workers on it.
pub(in crate::store) async fn measured_rate(
    connection: &mut Connection,
    open: &OpenJob,
    terms: &ClaimTerms,
) -> Result<MeasuredRate, StoreError> {
    let others = query(
        "select count(*) as others from (select distinct worker from leases \
         where job = $1 and state = 'active' and worker <> $2) as other_workers",
    )
    .bind(open.job.id.to_string())
    .bind(terms.worker.to_string())
    .fetch_one(connection)
    .await?;
    Ok(MeasuredRate { workers: others.number::<u32>("others")?.saturating_add(1), ..open.rate_alone(terms) })
}

/// Most samples in a lease.
pub(in crate::store) fn most_samples(job: &JobRecord, rate: &MeasuredRate, terms: &ClaimTerms) -> f64 {
    if terms.fixed_nodes.is_some() {
        return f64::INFINITY;
    }
    let left = job.total_samples().saturating_sub(job.samples);
    rate.lease_samples(left as f64)
}

/// The first nodes, as many as a lease should have.
pub(in crate::store) fn first_of(
    mut nodes: Vec<NodeAddress>,
    job: &JobRecord,
    rate: &MeasuredRate,
    terms: &ClaimTerms,
) -> Vec<NodeAddress> {
    let wanted = most_samples(job, rate, terms);
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

/// The last round of which nodes are leased: past its time limit, a job needs only its first round.
pub(in crate::store) fn last_round(job: &JobRecord, terms: &ClaimTerms) -> i64 {
    if job.is_past_limit(terms.now_ms) { 0 } else { i64::from(u32::MAX) }
}
