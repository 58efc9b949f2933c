//! Pins: which workers may render a job.
//!
//! An image has the bits of one build. So a job is pinned to the build fingerprint of the first worker that gets a
//! lease on it. The fingerprint is the digest of the probe by the job's own method. Other workers render the job only
//! if they registered the same digest. A worker registers a digest for each number of probe cases of a method, so that
//! a build with one more case still matches. The digests for a job whose film has the layer `caustic` are those of
//! images with that layer. So workers that lack it get no lease on the job.
//!
//! Workers of older builds register a single digest of all methods. Their jobs are pinned to that one. Newer workers
//! register it too, and continue such jobs. A job of many lights is not continued, because older builds ask them all.

use std::collections::{BTreeMap, BTreeSet};

use clerestory_api::{BuildWait, JobId, WorkerId};
use clerestory_render_core::document::WITH_CAUSTIC;

use crate::model::JobRecord;
use crate::store::database::Store;
use crate::store::engine::error::StoreError;
use crate::store::engine::lists::{Kind, rows_of, to_json};
use crate::store::engine::source::Connection;
use crate::store::engine::sql::query;

/// SQL condition on rows of `jobs` and `workers`: the worker can read the job's scene, knows the light plane if there
/// is one, and has the build fingerprint that the job is pinned to. Builds with the method `light` know light planes.
pub(in crate::store) const MATCHES_PIN: &str = "(((select 1 from method_digests as own \
     where own.worker = workers.id and own.method = jobs.integrator \
     || (case jobs.caustic when 0 then '' else ' with caustic' end) limit 1) is not null \
     or (jobs.read_by_first = 1 \
     and (select 1 from method_digests as own where own.worker = workers.id limit 1) is null)) \
     and (jobs.probe_digest is null \
     or (jobs.probe_digest = coalesce(workers.probe_digest, '') and (jobs.same_by_first = 1 \
     or (select 1 from method_digests as own where own.worker = workers.id limit 1) is null)) \
     or (select 1 from method_digests as own where own.worker = workers.id and own.digest = jobs.probe_digest \
     limit 1) is not null) \
     and (jobs.light_plane = 0 \
     or (select 1 from method_digests as own where own.worker = workers.id and own.method = 'light' limit 1) is not \
     null))";

/// SQL condition on a row of `workers`: it may get leases, and was heard of since parameter `$1`.
const IS_THERE: &str = "workers.seen_ms >= $1 and workers.ended_ms is null and workers.quarantine is null";

/// SQL condition on a row of `jobs`: the worker with the identity that an SQL expression gives matches its pin.
pub(in crate::store) fn matches_pin_of(worker: &str) -> String {
    format!("(select 1 from workers where workers.id = {worker} and {MATCHES_PIN}) is not null")
}

/// SQL expression on a row of `jobs`: the build fingerprint for it of the worker with this identity, an SQL
/// expression. It is empty if the worker registered none.
pub(in crate::store) fn pin_of(worker: &str) -> String {
    format!(
        "coalesce((select own.digest from method_digests as own where own.worker = {worker} \
         and own.method = jobs.integrator || (case jobs.caustic when 0 then '' else '{WITH_CAUSTIC}' end) \
         order by own.cases desc limit 1), \
         (select workers.probe_digest from workers where workers.id = {worker}), '')"
    )
}

/// SQL condition on a row of `jobs`: no worker can render it, though workers were heard of since parameter `$1`. A
/// job with an active lease does not wait.
fn waits() -> String {
    format!(
        "jobs.state in ('queued', 'running') \
         and (select 1 from leases where leases.job = jobs.id and leases.state = 'active' limit 1) is null \
         and (select 1 from workers where {IS_THERE} and {MATCHES_PIN} limit 1) is null \
         and (select 1 from workers where {IS_THERE} limit 1) is not null"
    )
}

/// Stores the digests of a worker by method.
pub(in crate::store) async fn insert_digests(
    connection: &mut Connection,
    worker: WorkerId,
    digests: &BTreeMap<String, Vec<String>>,
) -> Result<(), StoreError> {
    let of_method = |(method, digests)| (1..).zip(digests).map(move |(cases, digest)| (method, cases, digest));
    let rows: Vec<(&String, u32, &String)> = digests.iter().flat_map(of_method).collect();
    query(format!(
        "insert into method_digests (worker, method, cases, digest) select $1, c0, c1, c2 from {} as listed_digests",
        rows_of(connection.engine(), 2, &[Kind::Text, Kind::Integer, Kind::Text])
    ))
    .bind(worker.to_string())
    .bind(to_json(&rows)?)
    .execute(connection)
    .await?;
    Ok(())
}

/// The pin of a job.
struct Pin {
    job: JobId,
    digest: String,
    /// Whether workers that register a single digest compute the same bits of its scene.
    is_same_by_first: bool,
}

/// The pins of open jobs, and the workers that match them.
pub(in crate::store) struct Pins {
    jobs: Vec<Pin>,
    /// Workers that registered digests by method.
    newer: BTreeSet<WorkerId>,
    /// Workers with one of the digests by method that jobs are pinned to.
    workers: BTreeSet<(WorkerId, String)>,
}

impl Pins {
    /// The jobs that a worker gets no nodes of. `first_digest` is its digest of all methods, empty if it sent none.
    pub(in crate::store) fn passed_over(&self, worker: WorkerId, first_digest: &str) -> Vec<JobId> {
        let matches = |Pin { digest, is_same_by_first, .. }: &Pin| {
            (digest == first_digest && (*is_same_by_first || !self.newer.contains(&worker)))
                || self.workers.contains(&(worker, digest.clone()))
        };
        self.jobs.iter().filter(|pin| !matches(pin)).map(|pin| pin.job).collect()
    }
}

impl Store {
    /// The pins of open jobs, with all workers or with one.
    pub(in crate::store) async fn pins(&self, worker: Option<WorkerId>) -> Result<Pins, StoreError> {
        let pinned = "from jobs where state in ('queued', 'running') and probe_digest is not null";
        let of_workers = if worker.is_some() { "worker = $1" } else { "true" };
        // One statement, so that no job is pinned or unpinned between two.
        let mut pins = query(format!(
            "select id as job, probe_digest as digest, same_by_first, null as worker {pinned} \
             union all select null, digest, null, worker from method_digests \
             where digest in (select probe_digest {pinned}) and {of_workers} \
             union all select null, null, null, worker from method_digests where {of_workers} group by worker \
             order by job"
        ));
        if let Some(worker) = worker {
            pins = pins.bind(worker.to_string());
        }
        let (mut jobs, mut newer, mut workers) = (Vec::new(), BTreeSet::new(), BTreeSet::new());
        for row in pins.fetch_all(&self.readers).await? {
            match (row.optional_parsed("job")?, row.optional_text("digest")?) {
                (Some(job), digest) => {
                    let is_same_by_first = row.optional_integer("same_by_first")? == Some(1);
                    jobs.push(Pin { job, digest: digest.unwrap_or_default(), is_same_by_first });
                }
                (None, Some(digest)) => {
                    workers.insert((row.parsed("worker")?, digest));
                }
                (None, None) => {
                    newer.insert(row.parsed("worker")?);
                }
            }
        }
        Ok(Pins { jobs, newer, workers })
    }

    /// The jobs that wait for a worker with their build fingerprint, while others were heard of since `since_ms`.
    pub(crate) async fn jobs_that_wait_for_a_build(&self, since_ms: i64) -> Result<BTreeSet<JobId>, StoreError> {
        let rows = query(format!("select id from jobs where {}", waits())).bind(since_ms);
        rows.fetch_all(&self.readers).await?.iter().map(|row| row.parsed("id")).collect()
    }

    /// Why a job waits for a worker with its build fingerprint, while others were heard of since `since_ms`; `None`
    /// when it does not wait.
    pub(crate) async fn build_wait(&self, job: &JobRecord, since_ms: i64) -> Result<Option<BuildWait>, StoreError> {
        if job.state.is_final() {
            return Ok(None);
        }
        let waiting = query(format!("select 1 from jobs where jobs.id = $2 and {}", waits()));
        let waiting = waiting.bind(since_ms).bind(job.id.to_string());
        if waiting.fetch_optional(&self.readers).await?.is_none() {
            return Ok(None);
        }
        if job.probe_digest.is_none() {
            return Ok(Some(BuildWait { reason: unread(job), build: None, machine: None }));
        }
        let last = query(format!(
            "select workers.name, workers.build from workers join jobs on jobs.id = $1 where {MATCHES_PIN} \
             order by (workers.quarantine is not null), workers.registered_ms desc, workers.id desc limit 1"
        ));
        let last = last.bind(job.id.to_string()).fetch_optional(&self.readers).await?;
        let build = last.as_ref().map(|row| row.text("build")).transpose()?;
        let machine = last.as_ref().map(|row| row.text("name")).transpose()?;
        Ok(Some(BuildWait { reason: reason(&job.integrator, build.as_deref(), machine.as_deref()), build, machine }))
    }
}

/// Why a job waits that no worker can read.
fn unread(job: &JobRecord) -> String {
    let method = &job.integrator;
    if job.grid.has_caustic {
        return format!(
            "the workers that are there are of older builds, which know no `{method}` or no layer `caustic`; update \
             the workers"
        );
    }
    format!(
        "the workers that are there are of older builds, which know no `{method}` or no version 2 of the scene format; \
         update the workers, or submit the scene as version 1 with another integrator"
    )
}

/// Why a job waits, and the two ways out.
fn reason(method: &str, build: Option<&str>, machine: Option<&str>) -> String {
    let build = build.map_or_else(|| "of the build that began it".to_owned(), |build| format!("of build `{build}`"));
    let machine = machine.map(|machine| format!(" on a machine like `{machine}`")).unwrap_or_default();
    format!(
        "the workers that began it compute other bits with `{method}` than the workers that are there now; start a \
         worker {build}{machine}, or submit the job again"
    )
}
