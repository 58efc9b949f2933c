//! Claims: which nodes a worker gets.
//!
//! Jobs are served by priority, then age; within a job the oldest wave goes first. Claims run in the one writer, so no two
//! of them see the same free row. Pending rows exist only for the near future: a claim that finds few of them cuts more
//! from where the job's cursor stands. A job whose time is up before its first round is complete is served with the nodes
//! of that round alone.

use clerestory_api::{LeaseId, WorkerId};
use clerestory_render_core::film::{NodeAddress, PassRange};

use super::events::{self, StoredKind};
use super::jobs::{self, JobRecord};
use super::leases::{self, LeaseRecord, LeaseState, address};
use super::row::Columns;
use super::workers::{self, Claimant};
use super::{Connection, Store, StoreError, WorkerError};
use crate::schedule::{Pace, cut};

/// Free rows that a claim can choose from; also the largest lease.
const STOCK: u32 = 256;

/// What a worker asks for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClaimTerms {
    /// Who asks.
    pub(crate) worker: WorkerId,
    /// Identity of the lease, if there will be one.
    pub(crate) lease: LeaseId,
    /// Most nodes that it wants.
    pub(crate) max_nodes: Option<u32>,
    /// Exactly this many nodes, if there are as many: for experiments.
    pub(crate) fixed_nodes: Option<u32>,
    /// How long the work should take.
    pub(crate) target_ms: i64,
    /// How long the lease lasts.
    pub(crate) ttl_ms: i64,
    /// Now.
    pub(crate) now_ms: i64,
}

/// A granted lease.
#[derive(Clone, Debug)]
pub(crate) struct Grant {
    /// The lease.
    pub(crate) lease: LeaseRecord,
    /// Hash of the job's canonical scene.
    pub(crate) scene_hash: String,
    /// Its nodes, most urgent first.
    pub(crate) nodes: Vec<NodeAddress>,
}

impl Store {
    /// Gives work to a worker; `None` when there is none for it now.
    pub(crate) async fn claim(&self, terms: ClaimTerms) -> Result<Option<Grant>, WorkerError> {
        self.write(move |connection| Box::pin(async move { claim(connection, &terms).await })).await
    }
}

async fn claim(connection: &mut Connection, terms: &ClaimTerms) -> Result<Option<Grant>, WorkerError> {
    let claimant = workers::touch(connection, terms.worker, terms.now_ms).await?;
    if claimant.rests_until_ms > terms.now_ms {
        return Ok(None);
    }
    for job in jobs::open_jobs(connection).await? {
        if job.is_out_of_time(terms.now_ms) {
            continue;
        }
        let nodes = choose(connection, &job, &claimant, terms).await?;
        if !nodes.is_empty() {
            return Ok(Some(grant(connection, &job, nodes, terms).await?));
        }
    }
    Ok(None)
}

/// Free nodes of a job for this worker; none when all work is leased or done.
async fn choose(
    connection: &mut Connection,
    job: &JobRecord,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Vec<NodeAddress>, StoreError> {
    let pace = pace(connection, job, claimant, terms).await?;
    let most = terms.fixed_nodes.or(terms.max_nodes).unwrap_or(STOCK).clamp(1, STOCK);
    stock(connection, job, &pace).await?;
    // Past its limit, a job needs its first round to end, and nothing else.
    let last_round = if job.is_past_limit(terms.now_ms) { 0 } else { u32::MAX };
    let rows = sqlx::query(
        "select frame, tile, level, idx from pending where job = $1 and lease is null and round <= $2 \
         order by round, frame, tile, idx limit $3",
    )
    .bind(job.id.to_string())
    .bind(i64::from(last_round))
    .bind(i64::from(most))
    .fetch_all(connection)
    .await?;
    let left = job.total_samples().saturating_sub(job.samples);
    let wanted = if terms.fixed_nodes.is_some() { f64::INFINITY } else { pace.lease_samples(left as f64) };
    let mut nodes = Vec::new();
    let mut samples = 0;
    for row in &rows {
        let node = address(row)?;
        samples += job.node_samples(&node);
        // One node always fits.
        if !nodes.is_empty() && samples as f64 > wanted {
            break;
        }
        nodes.push(node);
    }
    Ok(nodes)
}

/// How fast the worker renders this job; before its first partial, how fast others do for each of their cores.
async fn pace(
    connection: &mut Connection,
    job: &JobRecord,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Pace, StoreError> {
    let rate = sqlx::query("select samples, core_ms from rates where worker = $1 and job = $2")
        .bind(terms.worker.to_string())
        .bind(job.id.to_string())
        .fetch_optional(&mut *connection)
        .await?;
    let (samples, core_ms) = match rate {
        Some(row) => (row.number("samples")?, row.integer("core_ms")?),
        None => (job.samples, job.core_ms),
    };
    let others = sqlx::query(
        "select count(distinct worker) as others from leases where job = $1 and state = 'active' and worker <> $2",
    )
    .bind(job.id.to_string())
    .bind(terms.worker.to_string())
    .fetch_one(connection)
    .await?;
    Ok(Pace {
        samples_per_second: workers::rate(samples, core_ms, claimant.cores),
        target_seconds: terms.target_ms as f64 / 1000.0,
        workers: others.number::<u32>("others")?.saturating_add(1),
    })
}

/// Cuts work from the job's cursor on until there are enough free rows or none is left to cut.
async fn stock(connection: &mut Connection, job: &JobRecord, pace: &Pace) -> Result<(), StoreError> {
    let free = sqlx::query("select count(*) as free from pending where job = $1 and lease is null")
        .bind(job.id.to_string())
        .fetch_one(&mut *connection)
        .await?;
    let mut free: u32 = free.number("free")?;
    let [mut round, mut frame, mut tile] = job.cursor;
    while free < STOCK {
        let Some(wave) = job.boundaries().wave(round) else { break };
        if tile == 0 {
            open_wave(connection, job, frame, round, wave).await?;
        }
        let samples = job.node_samples(&NodeAddress { frame, tile, level: 0, index: 0 });
        let level = pace.largest_level(wave, job.grid.len(), samples as f64);
        for (level, index) in cut(wave, level) {
            insert_pending(connection, job, round, &NodeAddress { frame, tile, level, index }).await?;
            free += 1;
        }
        tile += 1;
        if tile == job.grid.len() {
            (tile, frame) = (0, frame + 1);
        }
        if frame == job.frames {
            (frame, round) = (0, round + 1);
        }
    }
    if [round, frame, tile] != job.cursor {
        sqlx::query("update jobs set cursor_round = $2, cursor_frame = $3, cursor_tile = $4 where id = $1")
            .bind(job.id.to_string())
            .bind(i64::from(round))
            .bind(i64::from(frame))
            .bind(i64::from(tile))
            .execute(connection)
            .await?;
    }
    Ok(())
}

async fn open_wave(
    connection: &mut Connection,
    job: &JobRecord,
    frame: u32,
    round: u32,
    wave: PassRange,
) -> Result<(), StoreError> {
    sqlx::query("insert into waves (job, frame, round, end_pass, outstanding) values ($1, $2, $3, $4, $5)")
        .bind(job.id.to_string())
        .bind(i64::from(frame))
        .bind(i64::from(round))
        .bind(i64::from(wave.first + wave.count))
        .bind(i64::from(wave.count) * i64::from(job.grid.len()))
        .execute(connection)
        .await?;
    Ok(())
}

async fn insert_pending(
    connection: &mut Connection,
    job: &JobRecord,
    round: u32,
    node: &NodeAddress,
) -> Result<(), StoreError> {
    sqlx::query("insert into pending (job, round, frame, tile, level, idx) values ($1, $2, $3, $4, $5, $6)")
        .bind(job.id.to_string())
        .bind(i64::from(round))
        .bind(i64::from(node.frame))
        .bind(i64::from(node.tile))
        .bind(i64::from(node.level))
        .bind(i64::from(node.index))
        .execute(connection)
        .await?;
    Ok(())
}

async fn grant(
    connection: &mut Connection,
    job: &JobRecord,
    nodes: Vec<NodeAddress>,
    terms: &ClaimTerms,
) -> Result<Grant, StoreError> {
    let token = events::next_value(connection, "fencing_token").await?;
    let deadline_ms = terms.now_ms.saturating_add(terms.ttl_ms);
    sqlx::query(
        "insert into leases (id, token, job, worker, state, nodes, granted_ms, deadline_ms) \
         values ($1, $2, $3, $4, 'active', $5, $6, $7)",
    )
    .bind(terms.lease.to_string())
    .bind(token)
    .bind(job.id.to_string())
    .bind(terms.worker.to_string())
    .bind(leases::nodes_json(&nodes))
    .bind(terms.now_ms)
    .bind(deadline_ms)
    .execute(&mut *connection)
    .await?;
    for node in &nodes {
        sqlx::query(
            "update pending set lease = $1 where job = $2 and frame = $3 and tile = $4 and level = $5 and idx = $6",
        )
        .bind(terms.lease.to_string())
        .bind(job.id.to_string())
        .bind(i64::from(node.frame))
        .bind(i64::from(node.tile))
        .bind(i64::from(node.level))
        .bind(i64::from(node.index))
        .execute(&mut *connection)
        .await?;
    }
    let started = sqlx::query("update jobs set state = 'running', started_ms = $2 where id = $1 and state = 'queued'")
        .bind(job.id.to_string())
        .bind(terms.now_ms)
        .execute(&mut *connection)
        .await?;
    if started.rows_affected() > 0 {
        events::record(connection, StoredKind::Job, job.id, terms.now_ms).await?;
    }
    let token = u64::try_from(token).map_err(|_| StoreError::Corrupt { column: "value", value: token.to_string() })?;
    let state = LeaseState::Active;
    let lease = LeaseRecord { id: terms.lease, token, job: job.id, worker: terms.worker, state, deadline_ms };
    Ok(Grant { lease, scene_hash: job.scene_hash.clone(), nodes })
}
