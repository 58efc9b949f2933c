//! Expired leases, and the conclusions about their nodes.
//!
//! A scene may kill its workers: it needs more memory than a machine has, or triggers a fault of the renderer. An
//! expired lease counts as a death under three conditions. It brought no node, its worker sent no heartbeat afterwards,
//! and the coordinator listened all the time. The death is recorded on the node that the worker rendered first. From
//! then on that node is leased alone ([`suspects`](crate::store::queue::suspects)), so that the next death tells more.
//!
//! A job is held when [enough machines](super::attempts) died with one of its nodes: it gets no leases. It is released
//! by hand, or when one of those workers is heard of again, which was cut off or suspended. Until a job has an accepted
//! node, the deaths with all of its nodes count together: its scene may kill every worker that builds it. Later they do
//! not, so that machines that come and go do not hold a long job.

use std::collections::BTreeSet;

use clerestory_api::{JobHold, JobId, LeaseId, WorkerId};
use clerestory_film::NodeAddress;

use crate::model::{StoredKind, wire_address};
use crate::store::checks;
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, address, rows_of, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::{Query, query};
use crate::store::events;
use crate::store::films::nodes;
use crate::store::leases::attempts::{self, ENOUGH_ATTEMPTS, GivenUp};
use crate::store::leases::table as leases;

/// Recorded deaths of a node.
const KEPT_DEATHS: usize = 16;

/// How the farm has been watched.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Observation {
    /// Now.
    pub(crate) now_ms: i64,
    /// Start of the time in which the coordinator listened without a gap. Earlier renewals may be lost.
    pub(crate) listening_ms: i64,
    /// Last heartbeat of a worker that counts as absent.
    pub(crate) alive_ms: i64,
}

/// A lease that ran out.
#[derive(Clone, Debug)]
pub(crate) struct ExpiredLease {
    /// The lease.
    pub(crate) lease: LeaseId,
    /// The job.
    pub(crate) job: JobId,
    /// Its name.
    pub(crate) job_name: String,
    /// The worker.
    pub(crate) worker: WorkerId,
    /// Its name.
    pub(crate) worker_name: String,
    /// Nodes that went back to the queue.
    pub(crate) nodes: u32,
    granted_ms: i64,
    deadline_ms: i64,
    has_brought: bool,
}

/// The outcome of expired leases.
#[derive(Clone, Debug, Default)]
pub(crate) struct Expiry {
    /// The leases.
    pub(crate) leases: Vec<ExpiredLease>,
    /// Jobs that are held from now on.
    pub(crate) held: Vec<(JobId, JobHold)>,
    /// Jobs with checks that were given up after deaths of workers.
    pub(crate) unchecked: BTreeSet<JobId>,
}

/// A lease that held a node in vain: the worker, its name, and the deadline of the lease.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(in crate::store) struct Holder(
    pub(in crate::store) WorkerId,
    pub(in crate::store) String,
    pub(in crate::store) i64,
);

impl Store {
    /// Takes back all expired leases.
    pub(crate) async fn expire_leases(&self, observation: Observation) -> Result<Expiry, StoreError> {
        self.write(move |connection| Box::pin(async move { expire(connection, observation).await })).await
    }

    /// Releases a job that is held. Answers whether it was.
    pub(crate) async fn release_job(&self, job: JobId, now_ms: i64) -> Result<bool, StoreError> {
        self.write(move |connection| {
            Box::pin(async move {
                for table in ["pending set died_on = null, lost_by = null", "checks set deaths = 0"] {
                    query(format!("update {table} where job = $1"))
                        .bind(job.to_string())
                        .execute(&mut *connection)
                        .await?;
                }
                release(connection, job, now_ms).await
            })
        })
        .await
    }

    /// Releases the jobs whose holds name a worker that was heard of since, and answers which.
    pub(crate) async fn release_jobs_of_returned_workers(&self, now_ms: i64) -> Result<Vec<JobId>, StoreError> {
        let rows = query("select id, hold from jobs where hold is not null").fetch_all(&self.readers).await?;
        let mut released = Vec::new();
        for row in &rows {
            let (job, hold): (JobId, JobHold) = (row.parsed("id")?, row.json("hold")?);
            if !self.is_any_seen_since(&hold).await? {
                continue;
            }
            let is_released = self.write(move |connection| {
                Box::pin(async move {
                    let holders = hold.workers.into_iter().map(|worker| Holder(worker.id, worker.name, hold.since_ms));
                    let holders: Vec<Holder> = holders.collect();
                    let is_over = !seen_again(connection, &holders).await?.is_empty();
                    Ok::<_, StoreError>(is_over && release(connection, job, now_ms).await?)
                })
            });
            released.extend(is_released.await?.then_some(job));
        }
        Ok(released)
    }

    /// Whether one of the workers of a hold was heard of since, as readers see it.
    async fn is_any_seen_since(&self, hold: &JobHold) -> Result<bool, StoreError> {
        for worker in &hold.workers {
            let heard = query("select 1 from workers where id = $1 and seen_ms > $2");
            let heard = heard.bind(worker.id.to_string()).bind(hold.since_ms).fetch_optional(&self.readers).await?;
            if heard.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Ends the hold of a job. Answers whether it had one.
pub(in crate::store) async fn release(
    connection: &mut Connection,
    job: JobId,
    now_ms: i64,
) -> Result<bool, StoreError> {
    let released = query("update jobs set hold = null where id = $1 and hold is not null").bind(job.to_string());
    let is_released = released.execute(&mut *connection).await? > 0;
    if is_released {
        events::record(connection, StoredKind::Job, job, now_ms).await?;
    }
    Ok(is_released)
}

async fn expire(connection: &mut Connection, observation: Observation) -> Result<Expiry, StoreError> {
    let rows = query(
        "select leases.id as lease, job, jobs.name as job_name, worker, workers.name as worker_name, granted_ms, \
         deadline_ms, \
         (due_ms > granted_ms + overdue_after_ms) as has_brought, (select count(*) from pending where lease = \
         leases.id) as nodes \
         from leases join jobs on jobs.id = job join workers on workers.id = worker \
         where leases.state = 'active' and deadline_ms <= $1 order by token",
    );
    let mut expiry = Expiry::default();
    for row in rows.bind(observation.now_ms).fetch_all(&mut *connection).await? {
        let expired = expired_lease(&row)?;
        query("update leases set state = 'expired' where id = $1")
            .bind(expired.lease.to_string())
            .execute(&mut *connection)
            .await?;
        if expired.granted_ms >= observation.listening_ms && !expired.has_brought {
            let hold = record_death(connection, &expired, observation).await?;
            expiry.held.extend(hold.map(|hold| (expired.job, hold)));
            if record_death_with_check(connection, expired.lease).await? {
                expiry.unchecked.insert(expired.job);
            }
        }
        leases::free(connection, expired.lease).await?;
        expiry.leases.push(expired);
    }
    let jobs: BTreeSet<JobId> = expiry.leases.iter().map(|expired| expired.job).collect();
    for job in jobs {
        leases::unpin(connection, job).await?;
    }
    Ok(expiry)
}

fn expired_lease(row: &Row) -> Result<ExpiredLease, StoreError> {
    Ok(ExpiredLease {
        lease: row.parsed("lease")?,
        job: row.parsed("job")?,
        job_name: row.text("job_name")?,
        worker: row.parsed("worker")?,
        worker_name: row.text("worker_name")?,
        nodes: row.number("nodes")?,
        granted_ms: row.integer("granted_ms")?,
        deadline_ms: row.integer("deadline_ms")?,
        has_brought: row.integer("has_brought")? != 0,
    })
}

/// Records the death of a worker on the first node of its lease, and holds the job if that is enough.
async fn record_death(
    connection: &mut Connection,
    expired: &ExpiredLease,
    observation: Observation,
) -> Result<Option<JobHold>, StoreError> {
    let first = query(
        "select frame, tile, level, idx, died_on, lost_by from pending where lease = $1 order by round, frame, tile, \
         idx limit 1",
    );
    let Some(row) = first.bind(expired.lease.to_string()).fetch_optional(&mut *connection).await? else {
        return Ok(None);
    };
    let node = address(&row)?;
    let mut deaths: Vec<Holder> = row.optional_json("died_on")?.unwrap_or_default();
    deaths.extend(row.optional_json::<Vec<Holder>>("lost_by")?.unwrap_or_default());
    deaths.push(Holder(expired.worker, expired.worker_name.clone(), expired.deadline_ms));
    deaths.drain(..deaths.len().saturating_sub(KEPT_DEATHS));
    set_on(connection, expired.job, &node, "died_on", &deaths).await?;
    let has_brought = nodes::has_any(connection, expired.job).await?;
    if !has_brought {
        deaths = all_deaths(connection, expired.job).await?;
    }

    let heard = seen_again(connection, &deaths).await?;
    deaths.retain(|Holder(worker, ..)| !heard.contains(worker));
    let attempts = u32::try_from(deaths.len()).unwrap_or(u32::MAX);
    let machines = attempts::machines(deaths.into_iter().map(|Holder(worker, name, _)| (worker, name)));
    let names: BTreeSet<&str> = machines.iter().map(|machine| machine.name.as_str()).collect();
    let most = attempts::MOST_DEATHS;
    let given_up = attempts::given_up(connection, expired.job, &names, attempts, most, observation.alive_ms).await?;
    let Some(given_up) = given_up else { return Ok(None) };
    let (times, others) = match given_up {
        GivenUp::ByMachines => (format!("on {} machines", machines.len()), ""),
        GivenUp::ByAttempts => (format!("{attempts} times"), ", and no other machine was there that could render it"),
    };
    let names = attempts::names_in_words(&machines);
    let (with, what) = if has_brought {
        (format!("with node ({node})"), "the node")
    } else {
        ("with it before it had brought a node".to_owned(), "nodes of it")
    };
    let reason = format!(
        "workers died {times} {with}: {names}{others}; each was leased {what} and was not heard of again, \
         as when a scene needs more memory than the machine has"
    );
    let hold = JobHold {
        since_ms: observation.now_ms,
        reason,
        node: Some(wire_address(&node)),
        workers: machines,
        asset: None,
    };
    let held = query("update jobs set hold = $2 where id = $1 and hold is null and state in ('queued', 'running')")
        .bind(expired.job.to_string())
        .bind(to_json(&hold)?)
        .execute(&mut *connection)
        .await?;
    if held == 0 {
        return Ok(None);
    }
    events::record(connection, StoredKind::Job, expired.job, observation.now_ms).await?;
    Ok(Some(hold))
}

/// Deaths with all nodes of a job.
async fn all_deaths(connection: &mut Connection, job: JobId) -> Result<Vec<Holder>, StoreError> {
    let rows =
        query("select died_on from pending where job = $1 and died_on is not null order by round, frame, tile, idx");
    let mut deaths = Vec::new();
    for row in rows.bind(job.to_string()).fetch_all(connection).await? {
        deaths.extend(row.json::<Vec<Holder>>("died_on")?);
    }
    Ok(deaths)
}

/// Records the death of a worker on the first check of its lease. Answers whether the check is given up.
async fn record_death_with_check(connection: &mut Connection, lease: LeaseId) -> Result<bool, StoreError> {
    let first = query(
        "select id, deaths from checks where lease = $1 or second_lease = $1 order by round, frame, tile, idx limit 1",
    );
    let Some(row) = first.bind(lease.to_string()).fetch_optional(&mut *connection).await? else { return Ok(false) };
    let check = row.text("id")?;
    if row.integer("deaths")? + 1 >= i64::from(ENOUGH_ATTEMPTS) {
        checks::end(connection, &check).await?;
        return Ok(true);
    }
    query("update checks set deaths = deaths + 1 where id = $1").bind(check).execute(connection).await?;
    Ok(false)
}

/// Records on a node that its lease loses it to another, which may have to know the first holder.
pub(in crate::store) async fn record_loss(
    connection: &mut Connection,
    job: JobId,
    node: &NodeAddress,
    lease: LeaseId,
) -> Result<(), StoreError> {
    let row = query(format!(
        "select worker, name, deadline_ms, (select lost_by from pending where {ON}) as lost_by \
         from leases join workers on workers.id = worker where leases.id = $6"
    ));
    let row = bind_node(row, job, node).bind(lease.to_string()).fetch_one(&mut *connection).await?;
    let mut losers: Vec<Holder> = row.optional_json("lost_by")?.unwrap_or_default();
    losers.push(Holder(row.parsed("worker")?, row.text("name")?, row.integer("deadline_ms")?));
    losers.drain(..losers.len().saturating_sub(KEPT_DEATHS));
    set_on(connection, job, node, "lost_by", &losers).await
}

/// A condition: the row of `pending` is a node. [`bind_node`] binds it.
const ON: &str = "job = $1 and frame = $2 and tile = $3 and level = $4 and idx = $5";

fn bind_node(query: Query, job: JobId, node: &NodeAddress) -> Query {
    let NodeAddress { frame, tile, level, index } = *node;
    [frame, tile, level, index].into_iter().fold(query.bind(job.to_string()), |query, part| query.bind(i64::from(part)))
}

async fn set_on(
    connection: &mut Connection,
    job: JobId,
    node: &NodeAddress,
    column: &'static str,
    holders: &[Holder],
) -> Result<(), StoreError> {
    // A worker that lost a node before its last lease died counts among the deaths from then on.
    let lost = if column == "died_on" { ", lost_by = null" } else { "" };
    let update = bind_node(query(format!("update pending set {column} = $6{lost} where {ON}")), job, node);
    update.bind(to_json(&holders)?).execute(connection).await?;
    Ok(())
}

/// Those of some workers that were heard of after the given times. A forgotten worker was not.
async fn seen_again(connection: &mut Connection, holders: &[Holder]) -> Result<BTreeSet<WorkerId>, StoreError> {
    let listed: Vec<(String, i64)> =
        holders.iter().map(|Holder(worker, _, deadline_ms)| (worker.to_string(), *deadline_ms)).collect();
    let heard = query(format!(
        "select c0 as worker from {} as listed_holders \
         where (select 1 from workers where id = c0 and seen_ms > c1) is not null",
        rows_of(connection.engine(), 1, &[Kind::Text, Kind::Integer])
    ));
    let rows = heard.bind(to_json(&listed)?).fetch_all(connection).await?;
    rows.iter().map(|row| row.parsed("worker")).collect()
}
