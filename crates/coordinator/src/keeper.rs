//! The keeper of the film: records rounds as they become complete, and merges what they leave behind.
//!
//! One task does this, off the path of requests: whoever brings a node waits for its acceptance only. A parent is formed
//! when the round at its middle has been recorded; before that, the round's image needs the two halves apart. The
//! parent is on disk before its row replaces the children's, and a blob is removed when the last node in it has been replaced. Of several
//! coordinators, one at a time keeps the film of a job ([`Claims`]); when it dies, another does.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clerestory_api::JobId;
use clerestory_render_core::film::{Node, NodeAddress, store as stored_form};
use futures::stream::{self, StreamExt, TryStreamExt};
use tokio::sync::mpsc;

use crate::adaptive::{PILOT_ROUND, TilePasses, share_out};
use crate::convergence::{self, Reference};
use crate::farm::Farm;
use crate::film::{self, FilmError, film_tile};
use crate::news::News;
use crate::store::{CompleteWave, Ending, JobRecord, Keeping, Merge, NodeRow, StoreError};

/// Batches of tiles that are merged at the same time: while one is computed, another waits for the disk.
const MERGES: usize = 2;

/// Pause before a job is looked at again after a failure that may pass, such as a full disk.
const RETRY: Duration = Duration::from_secs(5);

/// How long a coordinator keeps a film without renewing its claim. As long may pass until another goes on when it dies.
const TERM_MS: i64 = 10_000;

/// Keeps the film until the coordinator stops.
pub(crate) async fn run(farm: Arc<Farm>, mut grown: mpsc::UnboundedReceiver<JobId>) {
    let mut references = BTreeMap::new();
    let mut claims = Claims::default();
    let mut waiting = Vec::new();
    while farm.stopping.run_until_cancelled(grown.recv_many(&mut waiting, 1024)).await.is_some_and(|count| count > 0) {
        let jobs: BTreeSet<JobId> = waiting.drain(..).collect();
        for job in jobs {
            if claims.rests.get(&job).is_some_and(|until| Instant::now() < *until) {
                continue;
            }
            claims.rests.remove(&job);
            let mut outcome = advance(&farm, job, &mut claims, &mut references).await;
            if outcome.as_ref().is_err_and(FilmError::is_damage) {
                // Another coordinator may have recorded and merged in between: what is damaged is so when all is read again.
                outcome = advance(&farm, job, &mut claims, &mut references).await;
            }
            if let Err(error) = outcome {
                claims.rests.insert(job, Instant::now() + RETRY);
                failed(&farm, job, error).await;
            }
        }
    }
    if let Err(error) = farm.store.keep_nothing(farm.coordinator).await {
        tracing::warn!(%error, "films that were kept here are kept by nobody for some seconds");
    }
}

/// Until when films are kept here, or by others.
#[derive(Debug, Default)]
struct Claims {
    films: BTreeMap<JobId, (Keeping, i64)>,
    /// Jobs that failed lately, and when they are looked at again.
    rests: BTreeMap<JobId, Instant>,
}

impl Claims {
    /// Whether the film of a job is kept here. Where it is not, the job is looked at again when the other's claim ends.
    async fn holds(&mut self, farm: &Farm, job: JobId) -> Result<bool, StoreError> {
        let now_ms = farm.config.clock.now_ms();
        match self.films.get(&job) {
            // Renewed when half of the term is over, so that few calls write.
            Some((Keeping::Ours, until_ms)) if now_ms < until_ms - TERM_MS / 2 => return Ok(true),
            Some((Keeping::Theirs { .. }, until_ms)) if now_ms < *until_ms => return Ok(false),
            _ => {}
        }
        let until_ms = now_ms.saturating_add(TERM_MS);
        let keeping = farm.store.keep(job, farm.coordinator, now_ms, until_ms).await?;
        let until_ms = match keeping {
            Keeping::Ours => until_ms,
            Keeping::Theirs { until_ms } => {
                // Clocks differ: not at once again, and not after a term.
                let until_ms = until_ms.clamp(now_ms + TERM_MS / 20, now_ms + TERM_MS);
                let left = Duration::from_millis(u64::try_from(until_ms - now_ms).unwrap_or(0));
                look_again(farm, job, left);
                until_ms
            }
        };
        self.films.insert(job, (keeping, until_ms));
        Ok(keeping == Keeping::Ours)
    }

    /// Forgets a job that has ended.
    fn remove(&mut self, job: JobId) {
        self.films.remove(&job);
        self.rests.remove(&job);
    }
}

/// Looks at a job again after some time.
fn look_again(farm: &Farm, job: JobId, after: Duration) {
    let (grown, stopping) = (farm.keeper(), farm.stopping.clone());
    tokio::spawn(async move {
        if stopping.run_until_cancelled(tokio::time::sleep(after)).await.is_some() {
            // The keeper is gone only when the coordinator stops.
            let _ = grown.send(job);
        }
    });
}

/// Records every complete round of a job.
async fn advance(
    farm: &Farm,
    job: JobId,
    claims: &mut Claims,
    references: &mut BTreeMap<JobId, Reference>,
) -> Result<(), FilmError> {
    while !farm.stopping.is_cancelled() {
        let Some(record) = farm.store.job(job).await? else { return Ok(()) };
        // A job that was cancelled or ran out of time may have completed a round just before.
        let Some(wave) = farm.store.complete_wave(&record).await? else {
            if record.state.is_final() {
                if record.adaptive && record.shared_samples.is_none() {
                    // It ended before its pilot was of use.
                    farm.let_go(farm.store.discard_pilot(job, record.passes).await?).await;
                }
                references.remove(&job);
                claims.remove(job);
                farm.rates.remove(job);
            }
            return Ok(());
        };
        if !claims.holds(farm, job).await? {
            return Ok(());
        }
        if wave.round == PILOT_ROUND && record.adaptive && record.shared_samples.is_none() {
            farm.let_go(share_out(farm, &record).await?).await;
            continue;
        }
        // Where another has recorded it, that one merges too.
        if record_round(farm, &record, &wave, references).await? {
            merge(farm, &record, wave.passes).await?;
        }
    }
    Ok(())
}

/// Records a round; `false` when that has been done.
async fn record_round(
    farm: &Farm,
    job: &JobRecord,
    wave: &CompleteWave,
    references: &mut BTreeMap<JobId, Reference>,
) -> Result<bool, FilmError> {
    if let Some(hash) = job.reference
        && let std::collections::btree_map::Entry::Vacant(vacant) = references.entry(job.id)
    {
        vacant.insert(Reference::measure(farm, job.grid, hash).await?);
    }
    let (reference, tile_passes) = (references.get(&job.id), farm.store.tile_passes(job).await?);
    let mut points = Vec::new();
    for frame in 0..job.frames {
        points.push(convergence::point(farm, job, wave, frame, &tile_passes, reference).await?);
    }
    let recorded = farm.store.record_round(job, points, farm.config.clock.now_ms()).await?;
    let is_new = recorded.is_some();
    if let Some(recorded) = recorded {
        tracing::info!(job = %job.id, round = wave.round, passes = wave.passes, "round complete");
        if let Some(reason) = recorded.stopped_by {
            tracing::info!(job = %job.id, reason = reason.name(), "job done");
        }
        farm.tell(News::Job(job.id));
        farm.let_go(recorded.discarded).await;
    }
    Ok(is_new)
}

/// Merges the nodes of every tile as far as no later round needs them apart.
async fn merge(farm: &Farm, job: &JobRecord, recorded_passes: u32) -> Result<(), FilmError> {
    let tile_passes = farm.store.tile_passes(job).await?;
    let held = Held { job, tile_passes: &tile_passes, recorded_passes };
    for (frame, tiles) in
        (0..job.frames).flat_map(|frame| film::runs(0..job.grid.len()).map(move |tiles| (frame, tiles)))
    {
        let rows = farm.store.nodes(job.id, frame, tiles).await?;
        let tiles = rows.chunk_by(|a, b| a.address.tile == b.address.tile);
        let tiles = tiles.filter(|rows| can_merge(rows, &held.of(rows))).collect();
        let batches = film::batches(tiles).into_iter();
        let merges: Vec<_> = batches.map(|tiles| merge_tiles(farm, job, tiles, &held)).collect();
        stream::iter(merges).buffer_unordered(MERGES).try_collect::<()>().await?;
    }
    Ok(())
}

async fn merge_tiles(farm: &Farm, job: &JobRecord, tiles: Vec<&[NodeRow]>, held: &Held<'_>) -> Result<(), FilmError> {
    let mut loaded = Vec::with_capacity(tiles.len());
    for rows in tiles {
        loaded.push((rows.to_vec(), held.of(rows), farm.film.load(rows).await?));
    }
    let record = job.clone();
    let merged = tokio::task::spawn_blocking(move || {
        let tiles = loaded.iter().map(|(rows, held, nodes)| merged_nodes(&record, rows, nodes, held));
        let nodes: Vec<(Node, Vec<NodeAddress>)> =
            tiles.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
        let encoded: Vec<Vec<u8>> = nodes.iter().map(|(node, _)| stored_form::encode(node)).collect();
        Ok::<_, FilmError>((nodes, encoded))
    });
    let (nodes, encoded) = merged.await??;
    let places = farm.blobs.put_nodes(job.id, encoded).await?;
    let mut merges = Vec::with_capacity(nodes.len());
    for ((node, children), place) in nodes.into_iter().zip(places) {
        merges.push(Merge { parent: node.address(), place: place.clone(), children });
        farm.film.keep(place, Arc::new(node));
    }
    farm.let_go(farm.store.replace(job.id, job.redone_nodes, merges).await?).await;
    Ok(())
}

/// What the nodes of a tile make when they are merged, without those that stay as they are, each with the nodes that it is the sum of.
fn merged_nodes(
    job: &JobRecord,
    rows: &[NodeRow],
    nodes: &[Arc<Node>],
    held: &[u32],
) -> Result<Vec<(Node, Vec<NodeAddress>)>, FilmError> {
    let Some(tile) = film_tile(job, nodes, held.iter().copied())? else { return Ok(Vec::new()) };
    let merged = tile.nodes().filter(|node| !rows.iter().any(|row| row.address == node.address()));
    let with_children = merged.map(|node| {
        let children = rows.iter().map(|row| row.address).filter(|row| node.address().overlaps(row));
        (node.clone(), children.collect())
    });
    Ok(with_children.collect())
}

/// Which passes of a tile have to stay apart from those before.
struct Held<'a> {
    job: &'a JobRecord,
    tile_passes: &'a TilePasses,
    recorded_passes: u32,
}

impl Held<'_> {
    /// Where the rounds end that are still to be recorded, in the tile of some nodes, as far as they reach.
    fn of(&self, rows: &[NodeRow]) -> Vec<u32> {
        let Some(NodeAddress { frame, tile, .. }) = rows.first().map(|row| row.address) else { return Vec::new() };
        let ends = rows.iter().map(|row| row.address.passes()).map(|passes| passes.first + passes.count);
        let end = ends.max().unwrap_or(0);
        let boundaries = self.job.boundaries();
        let rounds = (0..).map_while(|round| boundaries.end(round)).filter(|end| *end > self.recorded_passes);
        let in_tile = rounds.map(|passes| self.tile_passes.at(frame, tile, passes));
        in_tile.take_while(|passes| *passes < end).collect()
    }
}

/// Whether any two of the nodes are siblings that no later round needs apart.
fn can_merge(rows: &[NodeRow], held: &[u32]) -> bool {
    rows.iter().any(|row| {
        let sibling = row.address.sibling();
        let middle = row.address.passes().first.max(sibling.passes().first);
        !held.contains(&middle) && rows.iter().any(|other| other.address == sibling)
    })
}

/// A job whose stored film is damaged can never be finished; everything else may pass.
async fn failed(farm: &Farm, job: JobId, error: FilmError) {
    let is_damaged = match &error {
        error if error.is_damage() => true,
        FilmError::Lost { node, blob, .. } => is_lost(farm, job, *node, blob).await,
        _ => false,
    };
    tracing::error!(%job, error = &error as &dyn std::error::Error, is_damaged, "keeping the film failed");
    if is_damaged {
        let ending = Ending::Failed(format!("the stored film is damaged: {error}"));
        match farm.store.end_job(job, ending, farm.config.clock.now_ms()).await {
            Ok(_) => farm.tell(News::Job(job)),
            Err(error) => tracing::error!(%job, %error, "the job could not be marked as failed"),
        }
        return;
    }
    look_again(farm, job, RETRY);
}

/// Whether a node that was not found is gone for good: its row is still there, so that nobody has merged it meanwhile, and so is the
/// mark of the blob store, so that it is the farm's store which does not have it.
async fn is_lost(farm: &Farm, job: JobId, node: NodeAddress, blob: &str) -> bool {
    let is_named = farm.store.is_at(job, &node, blob);
    let is_ours = async {
        let identity = farm.store.identity().await?;
        Ok::<_, FilmError>(farm.blobs.is_of(identity.farm).await?)
    };
    matches!((is_named.await, is_ours.await), (Ok(true), Ok(true)))
}
