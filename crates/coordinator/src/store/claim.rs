//! Claims: which nodes a worker gets.
//!
//! Jobs are served by priority, then age; within a job the oldest wave goes first. Claims run in the one writer, so no two
//! of them see the same free row. Pending rows exist only for the near future: a claim that finds few of them cuts more
//! from where the job's cursor stands. A job whose time is up before its first round is complete is served with the nodes
//! of that round alone. A worker goes on with jobs whose scenes it has at hand ([`prefer_built`]).
//!
//! Nodes that are to be [checked](super::checks) come first, since a round waits for them.
//!
//! A worker for whom nothing is free takes over what another has held for longer than it would need itself ([`take_over`]). The other's
//! lease goes on, and the first result wins.

use std::collections::BTreeMap;

use clerestory_api::{JobId, LeaseId, WorkerId};
use clerestory_render_core::film::{NodeAddress, PassRange};

use super::adaptive::{self, WaveTiles, wave_tiles};
use super::checks;
use super::events::{self, StoredKind};
use super::jobs::{self, JobRecord};
use super::leases::{LeaseRecord, LeaseState, address};
use super::row::{Row, nodes_json, nodes_of, to_json};
use super::sql::{Kind, query, rows_of};
use super::workers::{self, Claimant};
use super::{Connection, Store, StoreError, WorkerError};
use crate::schedule::{Pace, cut};

/// How often a node is leased while another lease has it: whatever the first taker meets with, another may take it once more.
const MOST_REPEATS: i64 = 2;

/// How long a worker may keep what it has rendered before it brings it, in seconds.
const GATHERING_SECONDS: f64 = 1.0;

/// Free rows that a claim can choose from; also the largest lease.
const STOCK: u32 = 256;

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
    /// How long the lease lasts.
    pub(crate) ttl_ms: i64,
    /// Now.
    pub(crate) now_ms: i64,
}

impl ClaimTerms {
    /// Most nodes that the lease may have.
    fn most_nodes(&self) -> u32 {
        self.fixed_nodes.or(self.max_nodes).unwrap_or(STOCK).clamp(1, STOCK)
    }
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

/// An open job, as it stands for the worker that asks.
#[derive(Clone, Debug)]
struct OpenJob {
    job: JobRecord,
    /// Nodes in its queue that nobody has, counted up to [`STOCK`].
    free: u32,
    /// Whether there are nodes of it that this worker can check, which nobody has and which others have.
    has_checks: bool,
    has_held_checks: bool,
    pace: Pace,
}

async fn claim(connection: &mut Connection, terms: &ClaimTerms) -> Result<Option<Grant>, WorkerError> {
    let claimant = workers::touch(connection, terms.worker, terms.now_ms).await?;
    if claimant.rests_until_ms > terms.now_ms {
        return Ok(None);
    }
    let (mut seen, mut without_work) = (0, Vec::new());
    loop {
        let mut open = open_jobs(connection, &claimant, terms, seen).await?;
        let is_last = open.len() < JOBS_AT_ONCE;
        seen += open.len();
        open.retain(|OpenJob { job, .. }| !job.is_out_of_time(terms.now_ms) && has_bits_of(job, &claimant));
        prefer_built(&mut open, &terms.built);
        for open in open {
            if let Some(grant) = free_work(connection, &open, &claimant, terms).await? {
                return Ok(Some(grant));
            }
            without_work.push(open);
        }
        if is_last {
            return Ok(held_work(connection, &without_work, &claimant, terms).await?);
        }
    }
}

/// Puts jobs whose scenes a worker has at hand before others that are as urgent and have workers already: each worker more that begins with one
/// builds its scene. A job that nobody renders keeps its place, so that none is passed over for long.
fn prefer_built(open: &mut [OpenJob], built: &[JobId]) {
    let has_workers_of_its_own = |open: &OpenJob| open.pace.workers > 1 && !built.contains(&open.job.id);
    for equals in open.chunk_by_mut(|a, b| a.job.priority == b.job.priority) {
        if equals.iter().any(|open| built.contains(&open.job.id)) {
            equals.sort_by_key(has_workers_of_its_own);
        }
    }
}

/// Jobs that may still have work, most urgent first, without so many that come first: as many as [`JOBS_AT_ONCE`].
async fn open_jobs(
    connection: &mut Connection,
    claimant: &Claimant,
    terms: &ClaimTerms,
    without: usize,
) -> Result<Vec<OpenJob>, StoreError> {
    let columns = jobs::COLUMNS;
    let can_check = "select 1 from checks where job = jobs.id \
         and not exists (select 1 from opinions where check_id = checks.id and worker = $1)";
    let rows = query(format!(
        "select {columns}, \
         (select count(*) from (select 1 from pending where job = jobs.id and lease is null limit $2) as free_nodes) as free, \
         (select count(distinct worker) from leases where job = jobs.id and state = 'active' and worker <> $1) as others, \
         (select samples from rates where worker = $1 and job = jobs.id) as own_samples, \
         (select core_ms from rates where worker = $1 and job = jobs.id) as own_core_ms, \
         exists({can_check} and lease is null) as has_checks, exists({can_check} and lease is not null) as has_held_checks \
         from jobs where state in ('queued', 'running') order by priority desc, created_ms, id limit $3 offset $4"
    ))
    .bind(terms.worker.to_string())
    .bind(i64::from(STOCK))
    .bind(JOBS_AT_ONCE as i64)
    .bind(without as i64)
    .fetch_all(connection)
    .await?;
    let open = |row: &Row| {
        let job = jobs::record(row)?;
        // Before its first partial, a worker renders as fast as others do for each of their cores.
        let (samples, core_ms) = match row.optional_integer("own_core_ms")? {
            Some(core_ms) => (row.number("own_samples")?, core_ms),
            None => (job.samples, job.core_ms),
        };
        let pace = Pace {
            samples_per_second: workers::rate(samples, core_ms, claimant.cores),
            target_seconds: terms.target_ms as f64 / 1000.0,
            workers: row.number::<u32>("others")?.saturating_add(1),
        };
        let (has_checks, has_held_checks) = (row.integer("has_checks")? != 0, row.integer("has_held_checks")? != 0);
        Ok(OpenJob { job, free: row.number("free")?, has_checks, has_held_checks, pace })
    };
    rows.iter().map(open).collect()
}

/// Nodes of a job that nobody has, for this worker.
async fn free_work(
    connection: &mut Connection,
    open: &OpenJob,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    if open.has_checks {
        let nodes = choose_checks(connection, open, terms, None).await?;
        if !nodes.is_empty() {
            return Ok(Some(grant(connection, &open.job, nodes, Leased::Checks, claimant, terms).await?));
        }
    }
    let nodes = choose(connection, open, terms).await?;
    if nodes.is_empty() {
        return Ok(None);
    }
    Ok(Some(grant(connection, &open.job, nodes, Leased::Work, claimant, terms).await?))
}

/// Nodes of some jobs that others have held for too long, for this worker.
async fn held_work(
    connection: &mut Connection,
    jobs: &[OpenJob],
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Option<Grant>, StoreError> {
    let mut held = held_since(connection, jobs, terms).await?;
    for open in jobs {
        if let Some(granted_ms) = held.remove(&open.job.id) {
            let nodes = take_over(connection, open, granted_ms, terms).await?;
            if !nodes.is_empty() {
                return Ok(Some(grant(connection, &open.job, nodes, Leased::Work, claimant, terms).await?));
            }
        }
        if open.has_held_checks {
            let held_before_ms = terms.now_ms.saturating_sub((open.pace.target_seconds * 1000.0) as i64);
            let nodes = choose_checks(connection, open, terms, Some(held_before_ms)).await?;
            if !nodes.is_empty() {
                return Ok(Some(grant(connection, &open.job, nodes, Leased::Checks, claimant, terms).await?));
            }
        }
    }
    Ok(None)
}

/// Whether a worker computes the bits that a job has so far.
fn has_bits_of(job: &JobRecord, claimant: &Claimant) -> bool {
    job.probe_digest.as_ref().is_none_or(|digest| *digest == claimant.probe_digest)
}

/// Free nodes of a job for this worker; none when all work is leased or done.
async fn choose(
    connection: &mut Connection,
    OpenJob { job, free, pace, .. }: &OpenJob,
    terms: &ClaimTerms,
) -> Result<Vec<NodeAddress>, StoreError> {
    let most = terms.most_nodes();
    if free + stock(connection, job, pace, *free).await? == 0 {
        return Ok(Vec::new());
    }
    let rows = query(
        "select frame, tile, level, idx from pending where job = $1 and lease is null and round <= $2 \
         order by round, frame, tile, idx limit $3",
    )
    .bind(job.id.to_string())
    .bind(last_round(job, terms))
    .bind(i64::from(most))
    .fetch_all(connection)
    .await?;
    let nodes = rows.iter().map(address).collect::<Result<_, _>>()?;
    Ok(first_of(nodes, job, pace, terms))
}

/// Nodes of a job that this worker is to check, [as it can](checks::choose).
async fn choose_checks(
    connection: &mut Connection,
    OpenJob { job, pace, .. }: &OpenJob,
    terms: &ClaimTerms,
    held_before_ms: Option<i64>,
) -> Result<Vec<NodeAddress>, StoreError> {
    let nodes = checks::choose(connection, job, terms.worker, terms.most_nodes(), held_before_ms).await?;
    Ok(first_of(nodes, job, pace, terms))
}

/// As many of some nodes as a lease should have.
fn first_of(mut nodes: Vec<NodeAddress>, job: &JobRecord, pace: &Pace, terms: &ClaimTerms) -> Vec<NodeAddress> {
    let left = job.total_samples().saturating_sub(job.samples);
    let wanted = if terms.fixed_nodes.is_some() { f64::INFINITY } else { pace.lease_samples(left as f64) };
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
fn last_round(job: &JobRecord, terms: &ClaimTerms) -> i64 {
    if job.is_past_limit(terms.now_ms) { 0 } else { i64::from(u32::MAX) }
}

/// Since when others have had leases with nodes of these jobs that may be taken over, if that is long enough for any worker: the oldest of each.
async fn held_since(
    connection: &mut Connection,
    jobs: &[OpenJob],
    terms: &ClaimTerms,
) -> Result<BTreeMap<JobId, i64>, StoreError> {
    let listed: Vec<(String, i64)> =
        jobs.iter().map(|open| (open.job.id.to_string(), last_round(&open.job, terms))).collect();
    let statement = format!(
        "select c0 as job, min(granted_ms) as granted_ms from {} as listed_jobs join leases on leases.job = c0 \
         where state = 'active' and worker <> $2 and granted_ms <= $3 \
         and exists (select 1 from pending where lease = leases.id and repeats < $4 and round <= c1) group by c0",
        rows_of(connection.engine(), 1, &[Kind::Text, Kind::Integer])
    );
    let rows = query(statement)
        .bind(to_json(&listed)?)
        .bind(terms.worker.to_string())
        .bind(terms.now_ms.saturating_sub((GATHERING_SECONDS * 1000.0) as i64))
        .bind(MOST_REPEATS)
        .fetch_all(connection)
        .await?;
    rows.iter().map(|row| Ok((row.parsed("job")?, row.integer("granted_ms")?))).collect()
}

/// Nodes of a job that another worker has held since `granted_ms`, if this one would have needed less for all that is left of that lease: the
/// later half of them, since the other renders them in their order. A node is taken over [`MOST_REPEATS`] times at most.
async fn take_over(
    connection: &mut Connection,
    OpenJob { job, pace, .. }: &OpenJob,
    granted_ms: i64,
    terms: &ClaimTerms,
) -> Result<Vec<NodeAddress>, StoreError> {
    let rows = query(
        "select frame, tile, level, idx from pending where lease = (select id from leases where job = $1 \
         and state = 'active' and worker <> $2 and granted_ms = $3 and exists \
         (select 1 from pending where lease = leases.id and repeats < $4 and round <= $5) order by token limit 1) \
         and repeats < $4 and round <= $5 order by round desc, frame desc, tile desc, idx desc",
    )
    .bind(job.id.to_string())
    .bind(terms.worker.to_string())
    .bind(granted_ms)
    .bind(MOST_REPEATS)
    .bind(last_round(job, terms))
    .fetch_all(&mut *connection)
    .await?;
    let held_seconds = terms.now_ms.saturating_sub(granted_ms) as f64 / 1000.0;
    let held = rows.iter().map(address).collect::<Result<Vec<_>, _>>()?;
    let samples: u64 = held.iter().map(|node| job.node_samples(node)).sum();
    if held_seconds < pace.seconds(samples as f64) + GATHERING_SECONDS {
        return Ok(Vec::new());
    }
    let count = held.len().div_ceil(2).min(terms.most_nodes() as usize);
    let mut taken = held;
    taken.truncate(count);
    taken.reverse();
    let statement = format!(
        "update pending set repeats = repeats + 1 where job = $1 and (frame, tile, level, idx) in {}",
        nodes_of(connection.engine(), 2)
    );
    query(statement).bind(job.id.to_string()).bind(nodes_json(&taken)?).execute(connection).await?;
    Ok(taken)
}

/// Cuts work from the job's cursor on until there are enough free rows or none is left to cut, and answers how many rows those are.
async fn stock(connection: &mut Connection, job: &JobRecord, pace: &Pace, mut free: u32) -> Result<u32, StoreError> {
    let [mut round, mut frame, mut tile] = job.cursor;
    let mut pending = Vec::new();
    while free < STOCK {
        let Some(wave) = job.boundaries().wave(round) else { break };
        if job.waits_for_shares(wave) {
            break;
        }
        if tile == 0 {
            open_wave(connection, job, frame, round, wave).await?;
        }
        let WaveTiles { tiles, next, count } = wave_tiles(connection, job, frame, tile, wave).await?;
        let samples = job.node_samples(&NodeAddress { frame, tile, level: 0, index: 0 });
        let level = pace.largest_level(wave, count, samples as f64);
        let pilot: Vec<u32> = job.pilot_in(round).collect();
        tile = next;
        for (index, passes) in tiles {
            if free >= STOCK {
                tile = index;
                break;
            }
            let nodes = cut(passes, level).chain(pilot.iter().map(|pass| (0, *pass)));
            let before = pending.len();
            pending.extend(nodes.map(|(level, pass)| (round, NodeAddress { frame, tile: index, level, index: pass })));
            free += (pending.len() - before) as u32;
        }
        if tile == job.grid.len() {
            (tile, frame) = (0, frame + 1);
        }
        if frame == job.frames {
            (frame, round) = (0, round + 1);
        }
    }
    insert_pending(connection, job, &pending).await?;
    if [round, frame, tile] != job.cursor {
        query("update jobs set cursor_round = $2, cursor_frame = $3, cursor_tile = $4 where id = $1")
            .bind(job.id.to_string())
            .bind(i64::from(round))
            .bind(i64::from(frame))
            .bind(i64::from(tile))
            .execute(connection)
            .await?;
    }
    Ok(pending.len() as u32)
}

async fn open_wave(
    connection: &mut Connection,
    job: &JobRecord,
    frame: u32,
    round: u32,
    wave: PassRange,
) -> Result<(), StoreError> {
    let end = wave.first + wave.count;
    let tile_passes = adaptive::tile_passes(connection, job).await?;
    let in_tile = |tile| tile_passes.at(frame, tile, end) - tile_passes.at(frame, tile, wave.first);
    let in_images: i64 = (0..job.grid.len()).map(|tile| i64::from(in_tile(tile))).sum();
    let in_pilot = job.pilot_in(round).count() as i64 * i64::from(job.grid.len());
    query("insert into waves (job, frame, round, end_pass, outstanding) values ($1, $2, $3, $4, $5)")
        .bind(job.id.to_string())
        .bind(i64::from(frame))
        .bind(i64::from(round))
        .bind(i64::from(end))
        .bind(in_images + in_pilot)
        .execute(connection)
        .await?;
    Ok(())
}

/// Puts nodes into the queue, each as work of a round.
pub(super) async fn insert_pending(
    connection: &mut Connection,
    job: &JobRecord,
    nodes: &[(u32, NodeAddress)],
) -> Result<(), StoreError> {
    if nodes.is_empty() {
        return Ok(());
    }
    let statement = format!(
        "insert into pending (job, round, frame, tile, level, idx) select $1, c0, c1, c2, c3, c4 from {} as listed_nodes",
        rows_of(connection.engine(), 2, &[Kind::Integer; 5])
    );
    let rows = nodes.iter().map(|(round, node)| [*round, node.frame, node.tile, node.level, node.index]);
    let rows = to_json(&rows.collect::<Vec<_>>())?;
    query(statement).bind(job.id.to_string()).bind(rows).execute(connection).await?;
    Ok(())
}

/// What the nodes of a lease are to the farm.
#[derive(Clone, Copy, Debug)]
enum Leased {
    /// Pending.
    Work,
    /// Accepted, and to be checked.
    Checks,
}

async fn grant(
    connection: &mut Connection,
    job: &JobRecord,
    nodes: Vec<NodeAddress>,
    leased: Leased,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<Grant, StoreError> {
    let listed = nodes_json(&nodes)?;
    let token = events::next_value(connection, "fencing_token").await?;
    let deadline_ms = terms.now_ms.saturating_add(terms.ttl_ms);
    query(
        "insert into leases (id, token, job, worker, state, nodes, granted_ms, deadline_ms) \
         values ($1, $2, $3, $4, 'active', $5, $6, $7)",
    )
    .bind(terms.lease.to_string())
    .bind(token)
    .bind(job.id.to_string())
    .bind(terms.worker.to_string())
    .bind(listed.as_str())
    .bind(terms.now_ms)
    .bind(deadline_ms)
    .execute(&mut *connection)
    .await?;
    let table = match leased {
        Leased::Work => "pending",
        Leased::Checks => "checks",
    };
    let statement = format!(
        "update {table} set lease = $1 where job = $2 and (frame, tile, level, idx) in {}",
        nodes_of(connection.engine(), 3)
    );
    let update = query(statement).bind(terms.lease.to_string()).bind(job.id.to_string()).bind(listed);
    update.execute(&mut *connection).await?;
    if job.probe_digest.is_none() {
        start(connection, job, claimant, terms).await?;
    }
    let token = u64::try_from(token).map_err(|_| StoreError::Corrupt { column: "value", value: token.to_string() })?;
    let lease = LeaseRecord {
        id: terms.lease,
        token,
        job: job.id,
        worker: terms.worker,
        build: claimant.build.clone(),
        state: LeaseState::Active,
        deadline_ms,
        nodes: nodes.iter().copied().collect(),
    };
    Ok(Grant { lease, scene_hash: job.scene_hash.clone(), nodes })
}

/// Notes on a job that its first nodes have been given out, and to whom.
async fn start(
    connection: &mut Connection,
    job: &JobRecord,
    claimant: &Claimant,
    terms: &ClaimTerms,
) -> Result<(), StoreError> {
    // One that an older build has started goes on with whoever comes first.
    query("update jobs set state = 'running', started_ms = coalesce(started_ms, $2), probe_digest = $3 where id = $1")
        .bind(job.id.to_string())
        .bind(terms.now_ms)
        .bind(&claimant.probe_digest)
        .execute(&mut *connection)
        .await?;
    events::record(connection, StoredKind::Job, job.id, terms.now_ms).await
}
