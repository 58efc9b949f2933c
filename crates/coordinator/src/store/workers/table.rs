//! Workers: registered, and last heard of.
//!
//! A process that restarts registers again under the same name. Where it matters what a *machine* computes, in
//! [checks](crate::store::checks) and their consequences, all workers of a name are one.

use std::collections::BTreeSet;

use clerestory_api::{JobId, Quarantine, SceneBuilding, WorkerId, WorkerRegistration, WorkerState, WorkerView};

use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, looked_up, to_json};
use crate::store::engine::row::Row;
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;
use crate::store::errors::WorkerError;
use crate::store::workers::pins;
use crate::store::workers::pins::Pins;

/// Longest backoff after failures in a row.
const LONGEST_BACKOFF_MS: i64 = 60_000;

/// How long a silent worker is listed. One that no row refers to is forgotten after the same time.
const SILENT_KEPT_MS: i64 = 24 * 3600 * 1000;

const VIEW: &str = "select w.*, \
    (select count(*) from pending p join leases l on p.lease = l.id \
     where l.worker = w.id and l.state = 'active') as leased_nodes, \
    (select job from leases l where l.worker = w.id and l.state = 'active' order by token desc limit 1) as job \
    from workers w";

/// A subquery for all workers with the name of the worker that is parameter `$1`, itself included.
pub(in crate::store) const OF_THE_SAME_NAME: &str =
    "(select id from workers where name = (select name from workers where id = $1))";

/// A worker that claims work.
#[derive(Clone, Debug)]
pub(in crate::store) struct Claimant {
    /// Its name, by which its machine is known.
    pub(in crate::store) name: String,
    /// Threads that render.
    pub(in crate::store) cores: u32,
    /// Its build.
    pub(in crate::store) build: String,
    /// End of its backoff after work that could not be used.
    pub(in crate::store) backoff_until_ms: i64,
}

/// Marks a worker as alive. A quarantined worker gets an error.
pub(in crate::store) async fn touch(
    connection: &mut Connection,
    worker: WorkerId,
    now_ms: i64,
) -> Result<Claimant, WorkerError> {
    let row = query(
        "update workers set seen_ms = $2 where id = $1 and ended_ms is null \
         returning name, cores, build, failures_in_a_row, failed_ms, quarantine",
    )
    .bind(worker.to_string())
    .bind(now_ms)
    .fetch_optional(connection)
    .await?
    .ok_or(WorkerError::Unknown(worker))?;
    if let Some(Quarantine { reason, .. }) = row.optional_json("quarantine")? {
        return Err(WorkerError::Quarantined { worker, reason });
    }
    let failures: u32 = row.number("failures_in_a_row")?;
    let backoff_ms = match failures.checked_sub(1) {
        None => 0,
        Some(doublings) => (1000_i64 << doublings.min(10)).min(LONGEST_BACKOFF_MS),
    };
    Ok(Claimant {
        name: row.text("name")?,
        cores: row.number("cores")?,
        build: row.text("build")?,
        backoff_until_ms: row.integer("failed_ms")? + backoff_ms,
    })
}

/// Marks a worker as alive, in any state.
pub(in crate::store) async fn mark_seen(
    connection: &mut Connection,
    worker: WorkerId,
    now_ms: i64,
) -> Result<(), StoreError> {
    query("update workers set seen_ms = $2 where id = $1")
        .bind(worker.to_string())
        .bind(now_ms)
        .execute(connection)
        .await?;
    Ok(())
}

/// The same of several.
pub(in crate::store) async fn mark_all_seen(
    connection: &mut Connection,
    workers: &BTreeSet<WorkerId>,
    now_ms: i64,
) -> Result<(), StoreError> {
    let listed: Vec<[String; 1]> = workers.iter().map(|worker| [worker.to_string()]).collect();
    let found = looked_up(connection.engine(), "workers", 2, &[Kind::Text], "id = c0");
    query(format!("update workers set seen_ms = $1 where {found}"))
        .bind(now_ms)
        .bind(to_json(&listed)?)
        .execute(connection)
        .await?;
    Ok(())
}

impl Store {
    /// Registers a worker. A worker with the name of a quarantined one is refused: it runs on the same machine.
    pub(crate) async fn register_worker(
        &self,
        id: WorkerId,
        registration: WorkerRegistration,
        now_ms: i64,
    ) -> Result<(), WorkerError> {
        self.write(move |connection| {
            Box::pin(async move {
                let known = query(
                    "select id, quarantine from workers where name = $1 and quarantine is not null order by id limit 1",
                )
                .bind(&registration.name)
                .fetch_optional(&mut *connection)
                .await?;
                if let Some(known) = known {
                    let Quarantine { reason, .. } = known.json("quarantine")?;
                    return Err(WorkerError::Quarantined { worker: known.parsed("id")?, reason });
                }
                query(
                    "insert into workers (id, name, cores, build, probe_digest, registered_ms, seen_ms) \
                     values ($1, $2, $3, $4, $5, $6, $6)",
                )
                .bind(id.to_string())
                .bind(registration.name)
                .bind(i64::from(registration.cores))
                .bind(registration.build)
                .bind(registration.probe_digest)
                .bind(now_ms)
                .execute(&mut *connection)
                .await?;
                Ok(pins::insert_digests(connection, id, &registration.method_digests).await?)
            })
        })
        .await
    }

    /// Releases a worker from quarantine, with all others of its name.
    pub(crate) async fn release_worker(&self, worker: WorkerId) -> Result<(), WorkerError> {
        self.write(move |connection| {
            Box::pin(async move {
                let released =
                    query("update workers set quarantine = null where name = (select name from workers where id = $1)")
                        .bind(worker.to_string())
                        .execute(connection)
                        .await?;
                if released == 0 { Err(WorkerError::Unknown(worker)) } else { Ok(()) }
            })
        })
        .await
    }

    /// Ends lost workers: those that were silent for a day, and those that were silent before `silent_before_ms` and
    /// whose name has registered again since. Answers whether there were any.
    pub(crate) async fn end_lost_workers(&self, silent_before_ms: i64, now_ms: i64) -> Result<bool, StoreError> {
        let lost = "ended_ms is null and quarantine is null and (seen_ms < $2 or seen_ms < $1 and exists \
             (select 1 from workers as successors where successors.name = workers.name and successors.registered_ms \
             > workers.seen_ms))";
        let found = query(format!("select 1 from workers where {lost} limit 1"));
        let found = found.bind(silent_before_ms).bind(now_ms - SILENT_KEPT_MS);
        if found.fetch_optional(&self.readers).await?.is_none() {
            return Ok(false);
        }
        self.write(move |connection| {
            Box::pin(async move {
                let ended = query(format!("update workers set ended_ms = $3 where {lost}"));
                let ended = ended.bind(silent_before_ms).bind(now_ms - SILENT_KEPT_MS).bind(now_ms);
                Ok(ended.execute(connection).await? > 0)
            })
        })
        .await
    }

    /// Forgets workers that were silent for a day and that no lease, check or quarantine refers to.
    pub(crate) async fn prune_workers(&self, now_ms: i64) -> Result<(), StoreError> {
        self.write(move |connection| {
            Box::pin(async move {
                let forgotten = "seen_ms < $1 and quarantine is null \
                     and not exists (select 1 from leases where worker = workers.id) \
                     and not exists (select 1 from votes where worker = workers.id)";
                for statement in [
                    format!("delete from rates where worker in (select id from workers where {forgotten})"),
                    format!("delete from workers where {forgotten}"),
                ] {
                    query(statement).bind(now_ms - SILENT_KEPT_MS).execute(&mut *connection).await?;
                }
                Ok(())
            })
        })
        .await
    }

    /// All workers but those that ended before `ended_since_ms`, in order of registration. The newest worker of each
    /// quarantined name is always listed. A worker is silent when its last heartbeat came before `silent_before_ms`.
    pub(crate) async fn workers(
        &self,
        ended_since_ms: i64,
        silent_before_ms: i64,
    ) -> Result<Vec<WorkerView>, StoreError> {
        let views = query(format!(
            "{VIEW} where ended_ms is null or ended_ms >= $1 or quarantine is not null and not exists \
             (select 1 from workers as newer where newer.name = w.name and newer.registered_ms > w.registered_ms) \
             order by registered_ms, id"
        ));
        let rows = views.bind(ended_since_ms).fetch_all(&self.readers).await?;
        let pins = self.pins(None).await?;
        rows.iter().map(|row| worker_view(row, silent_before_ms, &pins)).collect()
    }

    /// One worker.
    pub(crate) async fn worker(&self, worker: WorkerId, silent_before_ms: i64) -> Result<WorkerView, WorkerError> {
        let view = query(format!("{VIEW} where id = $1")).bind(worker.to_string());
        let row = view.fetch_optional(&self.readers).await?.ok_or(WorkerError::Unknown(worker))?;
        Ok(worker_view(&row, silent_before_ms, &self.pins(Some(worker)).await?)?)
    }

    /// Workers heard of since `since_ms` that build the scene of a job.
    pub(crate) async fn building_workers(&self, job: JobId, since_ms: i64) -> Result<u32, StoreError> {
        let rows =
            query("select building from workers where building is not null and ended_ms is null and seen_ms >= $1")
                .bind(since_ms);
        let mut count = 0;
        for row in rows.fetch_all(&self.readers).await? {
            let building: SceneBuilding = row.json("building")?;
            count += u32::from(building.job == job);
        }
        Ok(count)
    }
}

fn worker_view(row: &Row, silent_before_ms: i64, pins: &Pins) -> Result<WorkerView, StoreError> {
    let cores: u32 = row.number("cores")?;
    let samples: u64 = row.number("samples")?;
    let core_ms = row.integer("core_ms")?;
    let seen_ms = row.integer("seen_ms")?;
    let leased_nodes: u32 = row.number("leased_nodes")?;
    let quarantine: Option<Quarantine> = row.optional_json("quarantine")?;
    let state = match leased_nodes {
        _ if quarantine.is_some() => WorkerState::Quarantined,
        _ if row.optional_integer("ended_ms")?.is_some() => WorkerState::Ended,
        _ if seen_ms < silent_before_ms => WorkerState::Silent,
        0 => WorkerState::Idle,
        _ => WorkerState::Rendering,
    };
    let probe_digest = row.optional_text("probe_digest")?;
    let id = row.parsed("id")?;
    Ok(WorkerView {
        passed_over: pins.passed_over(id, probe_digest.as_deref().unwrap_or_default()),
        probe_digest,
        id,
        name: row.text("name")?,
        cores,
        build: row.text("build")?,
        state,
        job: row.optional_parsed("job")?,
        building: row.optional_json("building")?,
        leased_nodes,
        accepted_nodes: row.number("accepted_nodes")?,
        refused_partials: row.number("refused_partials")?,
        samples,
        core_ms,
        samples_per_second: rate(samples, core_ms, cores),
        quarantine,
        registered_ms: row.integer("registered_ms")?,
        seen_ms,
    })
}

/// Samples a second on all cores.
pub(in crate::store) fn rate(samples: u64, core_ms: i64, cores: u32) -> Option<f64> {
    (core_ms > 0 && samples > 0).then(|| samples as f64 / core_ms as f64 * 1000.0 * f64::from(cores))
}
