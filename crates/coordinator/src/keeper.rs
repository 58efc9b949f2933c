//! The keeper of the film: records rounds as they become complete, and merges what they leave behind.
//!
//! It does this off the path of requests: whoever brings a node waits for its acceptance only. Each job is looked at by one task at a time, so
//! that none waits for another's large frame; what takes much memory, the tasks do in turn. A parent is formed
//! when the round at its middle has been recorded; before that, the round's image needs the two halves apart. The
//! parent is on disk before its row replaces the children's, and a blob is removed when the last node in it has been replaced. Of several
//! coordinators, one at a time keeps the film of a job ([`Claim`]); when it dies, another does.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clerestory_api::{ConvergencePoint, JobId, JobState};
use clerestory_render_core::film::{Node, NodeAddress, store as stored_form};
use futures::stream::{self, StreamExt, TryStreamExt};
use tokio::sync::{Semaphore, mpsc};
use tokio::task::{JoinHandle, JoinSet};
use tokio_util::sync::CancellationToken;

use crate::adaptive::{self, PILOT_ROUND, TilePasses};
use crate::convergence::{self, Reference};
use crate::farm::{Farm, MERGES};
use crate::film::{self, FilmError, film_tile};
use crate::news::News;
use crate::store::{CompleteWave, Ending, JobRecord, Keeping, Merge, NodeRow, StoreError};

/// Jobs whose rounds are recorded at the same time.
const ADVANCING: usize = 16;

/// Pause before a job is looked at again after a failure that may pass, such as a full disk. It doubles with each.
const RETRY: Duration = Duration::from_millis(250);

/// Longest such pause.
const LONGEST_RETRY: Duration = Duration::from_secs(5);

/// How long a coordinator keeps a film without renewing its claim. As long may pass until another goes on when it dies.
const TERM_MS: i64 = 10_000;

/// Least pause before a claim is renewed, also when that has just failed.
const RENEWAL_MS: i64 = 1000;

/// Keeps the film until the coordinator stops.
pub(crate) async fn run(farm: Arc<Farm>, mut grown: mpsc::UnboundedReceiver<JobId>) {
    let turns = Arc::new(Semaphore::new(ADVANCING));
    let mut keeper = Keeper { farm, turns, films: BTreeMap::new(), looks: JoinSet::new() };
    let mut waiting = Vec::new();
    loop {
        tokio::select! {
            () = keeper.farm.stopping.cancelled() => break,
            count = grown.recv_many(&mut waiting, 1024) => {
                if count == 0 {
                    break;
                }
                let jobs: BTreeSet<JobId> = waiting.drain(..).collect();
                for job in jobs {
                    keeper.look(job);
                }
            }
            Some(looked) = keeper.looks.join_next() => match looked {
                Ok((job, kept)) => keeper.has_looked(job, kept),
                Err(error) => tracing::error!(%error, "a look at a film failed"),
            },
        }
    }
    while keeper.looks.join_next().await.is_some() {}
    if let Err(error) = keeper.farm.store.keep_nothing(keeper.farm.coordinator).await {
        tracing::warn!(%error, "films that were kept here are kept by nobody for some seconds");
    }
}

/// Which films are looked at.
struct Keeper {
    farm: Arc<Farm>,
    /// Permits for recording the rounds of a job.
    turns: Arc<Semaphore>,
    films: BTreeMap<JobId, Film>,
    looks: JoinSet<(JobId, Option<Kept>)>,
}

/// The film of a job.
enum Film {
    /// Nobody looks at it.
    Idle(Kept),
    /// It is being looked at.
    Looked {
        /// Whether there have been news of it since.
        again: bool,
    },
}

impl Keeper {
    /// Looks at a job, at once or when the look at it that is under way has ended.
    fn look(&mut self, job: JobId) {
        let kept = match self.films.get_mut(&job) {
            Some(Film::Looked { again }) => {
                *again = true;
                return;
            }
            Some(Film::Idle(kept)) if kept.rests() => return,
            Some(Film::Idle(kept)) => std::mem::take(kept),
            None => Kept::default(),
        };
        self.films.insert(job, Film::Looked { again: false });
        let (farm, turns) = (Arc::clone(&self.farm), Arc::clone(&self.turns));
        self.looks.spawn(async move {
            let looking = (Arc::clone(&farm), turns);
            // In a task of its own: a look that panics is one that failed.
            let looked = tokio::spawn(async move { look(&looking.0, &looking.1, job, kept).await });
            let kept = looked.await.unwrap_or_else(|error| {
                tracing::error!(%job, %error, "keeping the film failed");
                let mut kept = Kept { failures: u32::MAX, ..Kept::default() };
                kept.rest(&farm, job);
                Some(kept)
            });
            (job, kept)
        });
    }

    /// Notes what a look has left; nothing when the job has ended.
    fn has_looked(&mut self, job: JobId, kept: Option<Kept>) {
        let looked = self.films.remove(&job);
        if let Some(kept) = kept {
            self.films.insert(job, Film::Idle(kept));
        }
        if matches!(looked, Some(Film::Looked { again: true })) {
            self.look(job);
        }
    }
}

/// What is known of a job from one look to the next.
#[derive(Debug, Default)]
struct Kept {
    /// Whose the film is, until when.
    claim: Option<(Keeping, i64)>,
    reference: Option<Reference>,
    /// Failures since the last success.
    failures: u32,
    /// A job that has just failed is looked at again then.
    rests_until: Option<Instant>,
}

impl Kept {
    fn rests(&self) -> bool {
        self.rests_until.is_some_and(|until| Instant::now() < until)
    }

    /// Leaves a job alone for a while after a failure.
    fn rest(&mut self, farm: &Farm, job: JobId) {
        let pause = RETRY.saturating_mul(1 << self.failures.min(5)).min(LONGEST_RETRY);
        self.failures = self.failures.saturating_add(1);
        self.rests_until = Some(Instant::now() + pause);
        look_again(farm, job, pause);
    }

    /// Until when the film of a job is kept here. Where it is not, the job is looked at again when the other's claim ends.
    async fn hold(&mut self, farm: &Farm, job: JobId) -> Result<Option<i64>, StoreError> {
        let now_ms = farm.config.clock.now_ms();
        match self.claim {
            // Renewed when half of the term is over, so that few calls write.
            Some((Keeping::Ours, until_ms)) if now_ms < until_ms - TERM_MS / 2 => return Ok(Some(until_ms)),
            Some((Keeping::Theirs { .. }, until_ms)) if now_ms < until_ms => return Ok(None),
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
        self.claim = Some((keeping, until_ms));
        Ok((keeping == Keeping::Ours).then_some(until_ms))
    }
}

/// A claim on the film of a job that is renewed until it is dropped: what takes longer than a term, another would begin as well.
struct Claim {
    /// Cancelled when another may have the film, and when the coordinator stops.
    lost: CancellationToken,
    renewing: JoinHandle<()>,
}

impl Claim {
    /// Renews a claim that ends at some time.
    fn renewed(farm: &Arc<Farm>, job: JobId, until_ms: i64) -> Self {
        let lost = farm.stopping.child_token();
        let (farm, is_lost) = (Arc::clone(farm), lost.clone());
        let renewing = tokio::spawn(async move {
            renew(&farm, job, until_ms).await;
            is_lost.cancel();
        });
        Self { lost, renewing }
    }

    fn is_lost(&self) -> bool {
        self.lost.is_cancelled()
    }

    /// What some work has come to that may be left undone at any moment; nothing when the claim is lost meanwhile.
    async fn while_held<T>(&self, work: impl Future<Output = T>) -> Option<T> {
        self.lost.run_until_cancelled(work).await
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.renewing.abort();
    }
}

/// Renews a claim until another has the film, or may have it since the claim could not be renewed in time.
async fn renew(farm: &Farm, job: JobId, mut until_ms: i64) {
    loop {
        let left_ms = until_ms - farm.config.clock.now_ms();
        if left_ms <= 0 {
            return;
        }
        let pause_ms = (left_ms - TERM_MS / 2).clamp(RENEWAL_MS, TERM_MS);
        tokio::time::sleep(Duration::from_millis(u64::try_from(pause_ms).unwrap_or(0))).await;
        let now_ms = farm.config.clock.now_ms();
        let next_ms = now_ms.saturating_add(TERM_MS);
        match farm.store.keep(job, farm.coordinator, now_ms, next_ms).await {
            Ok(Keeping::Ours) => until_ms = next_ms,
            Ok(Keeping::Theirs { .. }) => return,
            Err(error) => tracing::warn!(%job, %error, "the claim on the film could not be renewed"),
        }
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

/// How far a film is; whatever else about it changes, what was read of it belongs together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stand {
    rounds: u32,
    redone_nodes: u64,
    shared_samples: Option<u64>,
}

impl Stand {
    fn of(job: &JobRecord) -> Self {
        Self { rounds: job.rounds, redone_nodes: job.redone_nodes, shared_samples: job.shared_samples }
    }
}

/// Looks at a job, and answers what is to be known the next time; nothing when the job has ended.
async fn look(farm: &Arc<Farm>, turns: &Semaphore, job: JobId, mut kept: Kept) -> Option<Kept> {
    let mut is_suspected = false;
    loop {
        let mut stand = None;
        let error = match advance(farm, turns, job, &mut kept, &mut stand).await {
            Ok(true) => return None,
            Ok(false) => {
                kept.failures = 0;
                return Some(kept);
            }
            Err(error) => error,
        };
        let mut is_damaged = false;
        if error.is_damage() {
            // Another coordinator that keeps the film as well may have gone on in between, or nodes may have been taken out.
            is_damaged = is_settled(farm, job, &mut kept, stand).await.unwrap_or(false);
            if is_damaged && !is_suspected {
                is_suspected = true;
                continue;
            }
        } else if let FilmError::Lost { node, blob, .. } = &error {
            is_damaged = is_lost(farm, job, *node, blob).await;
        }
        tracing::error!(%job, error = &error as &dyn std::error::Error, is_damaged, "keeping the film failed");
        if !(is_damaged && has_failed(farm, job, &error).await) {
            kept.rest(farm, job);
        }
        return Some(kept);
    }
}

/// Whether a film is where it was when it was read, and is kept here.
async fn is_settled(farm: &Farm, job: JobId, kept: &mut Kept, stand: Option<Stand>) -> Result<bool, StoreError> {
    // Asked anew: another may have it by now.
    kept.claim = None;
    Ok(kept.hold(farm, job).await?.is_some() && farm.store.job(job).await?.as_ref().map(Stand::of) == stand)
}

/// Ends a job whose stored film is damaged, which can never be finished. `false` when that could not be done now.
async fn has_failed(farm: &Farm, job: JobId, error: &FilmError) -> bool {
    let ending = Ending::Failed(format!("the stored film is damaged: {error}"));
    match farm.store.end_job(job, ending, farm.config.clock.now_ms()).await {
        Ok(has_ended) => {
            if has_ended {
                farm.tell(News::Job(job));
            }
            true
        }
        Err(error) => {
            tracing::error!(%job, %error, "the job could not be marked as failed");
            false
        }
    }
}

/// Records every complete round of a job. Answers whether the job has ended and there is nothing left to do; `stand` is how far the film was when it
/// was read last.
async fn advance(
    farm: &Arc<Farm>,
    turns: &Semaphore,
    job: JobId,
    kept: &mut Kept,
    stand: &mut Option<Stand>,
) -> Result<bool, FilmError> {
    let (mut waited, mut claim) = (None, None::<Claim>);
    while !farm.stopping.is_cancelled() {
        let Some(record) = farm.store.job(job).await? else { return Ok(true) };
        // A job that was cancelled or ran out of time may have completed a round just before; no round of a failed one is recorded.
        let wave = match record.state {
            JobState::Failed => None,
            _ => farm.store.complete_wave(&record).await?,
        };
        let Some(wave) = wave else {
            if record.state.is_final() {
                if record.adaptive && record.shared_samples.is_none() {
                    // It ended before its pilot was of use.
                    farm.let_go(farm.store.discard_pilot(job, record.passes).await?).await;
                }
                farm.rates.remove(job);
            }
            return Ok(record.state.is_final());
        };
        let _turn = match waited.take() {
            Some(turn) => turn,
            None => match turns.try_acquire() {
                Ok(turn) => turn,
                Err(_) => {
                    // Another coordinator may have time for it meanwhile. And what was read is old when the turn has come.
                    claim = None;
                    waited = farm.stopping.run_until_cancelled(turns.acquire()).await.and_then(Result::ok);
                    continue;
                }
            },
        };
        if claim.as_ref().is_some_and(Claim::is_lost) {
            (claim, kept.claim) = (None, None);
        }
        let claim = match &mut claim {
            Some(claim) => claim,
            None => {
                let Some(until_ms) = kept.hold(farm, job).await? else { return Ok(false) };
                claim.insert(Claim::renewed(farm, job, until_ms))
            }
        };
        *stand = Some(Stand::of(&record));
        if wave.round == PILOT_ROUND && record.adaptive && record.shared_samples.is_none() {
            let decided = claim.while_held(adaptive::decide(farm, &record)).await;
            let Some(shares) = decided.transpose()? else { continue };
            farm.let_go(adaptive::share_out(farm, &record, shares).await?).await;
            continue;
        }
        let measured = claim.while_held(measure(farm, &record, &wave, &mut kept.reference)).await;
        let Some(points) = measured.transpose()? else { continue };
        // Where another has recorded it, that one merges too.
        if record_round(farm, &record, &wave, points).await? {
            *stand = Some(Stand { rounds: record.rounds + 1, ..Stand::of(&record) });
            merge(farm, &record, wave.round + 1).await?;
        }
    }
    Ok(false)
}

/// Measures the frames of a job at a complete round.
async fn measure(
    farm: &Farm,
    job: &JobRecord,
    wave: &CompleteWave,
    reference: &mut Option<Reference>,
) -> Result<Vec<ConvergencePoint>, FilmError> {
    if let Some(hash) = job.reference
        && reference.is_none()
    {
        *reference = Some(Reference::measure(farm, job.grid, hash).await?);
    }
    let tile_passes = farm.store.tile_passes(job).await?;
    let mut points = Vec::new();
    for frame in 0..job.frames {
        points.push(convergence::point(farm, job, wave, frame, &tile_passes, reference.as_ref()).await?);
    }
    Ok(points)
}

/// Records a round; `false` when that has been done.
async fn record_round(
    farm: &Farm,
    job: &JobRecord,
    wave: &CompleteWave,
    points: Vec<ConvergencePoint>,
) -> Result<bool, FilmError> {
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

/// Merges the nodes of every tile as far as no later round needs them apart, of which the first is `next_round`.
async fn merge(farm: &Farm, job: &JobRecord, next_round: u32) -> Result<(), FilmError> {
    let tile_passes = farm.store.tile_passes(job).await?;
    let held = Held { job, tile_passes: &tile_passes, next_round };
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
    // The semaphore is never closed.
    let _permit = farm.merging.acquire().await.ok();
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
    /// The first round that is still to be recorded.
    next_round: u32,
}

impl Held<'_> {
    /// Where the rounds end that are still to be recorded, in the tile of some nodes, as far as they reach.
    fn of(&self, rows: &[NodeRow]) -> Vec<u32> {
        let Some(NodeAddress { frame, tile, .. }) = rows.first().map(|row| row.address) else { return Vec::new() };
        let ends = rows.iter().map(|row| row.address.passes()).map(|passes| passes.first + passes.count);
        let end = ends.max().unwrap_or(0);
        let boundaries = self.job.boundaries();
        let rounds = (self.next_round..).map_while(|round| boundaries.end(round));
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

#[cfg(test)]
mod tests {
    use clerestory_render_core::film::TileGrid;
    use uuid::Uuid;

    use super::*;
    use crate::config::Config;
    use crate::server;
    use crate::stop::Targets;
    use crate::store::NewJob;

    async fn job(farm: &Farm) -> JobId {
        let id = JobId::from(Uuid::now_v7());
        let job = NewJob {
            id,
            name: "window".to_owned(),
            priority: 0,
            scene: "{}".to_owned(),
            scene_hash: "h".to_owned(),
            integrator: "path".to_owned(),
            missing_light: Vec::new(),
            grid: TileGrid { width: 16, height: 16, tile_size: 16 },
            samples_per_pass: 4,
            samples_per_block: 64,
            passes: 1,
            reference: None,
            time_limit_ms: None,
            targets: Targets::default(),
            adaptive: false,
            assets: BTreeMap::new(),
            created_ms: 0,
        };
        farm.store.insert_job(job).await.unwrap();
        id
    }

    #[tokio::test]
    async fn a_claim_is_renewed_while_it_is_held_and_work_ends_when_another_has_it() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = server::open(Config::new(directory.path())).await.unwrap();
        let (job, other) = (job(&farm).await, Uuid::now_v7());
        let now_ms = || farm.config.clock.now_ms();
        let keep = |coordinator, now_ms| farm.store.keep(job, coordinator, now_ms, now_ms + 1500);
        let begun_ms = now_ms();
        assert_eq!(keep(farm.coordinator, begun_ms).await.unwrap(), Keeping::Ours);
        let claim = Claim::renewed(&farm, job, begun_ms + 1500);
        tokio::time::sleep(Duration::from_secs(2)).await;
        assert!(matches!(keep(other, now_ms()).await.unwrap(), Keeping::Theirs { .. }));
        assert_eq!(claim.while_held(async { 7 }).await, Some(7));
        drop(claim);

        let later_ms = now_ms() + 10 * TERM_MS;
        assert_eq!(keep(other, later_ms).await.unwrap(), Keeping::Ours, "whoever does not renew has nothing");
        let claim = Claim::renewed(&farm, job, now_ms() + 1500);
        assert_eq!(claim.while_held(std::future::pending::<()>()).await, None);
        assert!(claim.is_lost());
    }

    #[tokio::test]
    async fn a_film_that_another_has_gone_on_with_is_not_damaged() {
        let directory = tempfile::tempdir().unwrap();
        let (farm, _bells) = server::open(Config::new(directory.path())).await.unwrap();
        let job = job(&farm).await;
        let stand = Stand::of(&farm.store.job(job).await.unwrap().unwrap());
        let is_settled = async |stand| is_settled(&farm, job, &mut Kept::default(), Some(stand)).await.unwrap();
        assert!(is_settled(stand).await);
        assert!(!is_settled(Stand { rounds: 1, ..stand }).await, "a round has been recorded");
        assert!(!is_settled(Stand { redone_nodes: 1, ..stand }).await, "nodes have been taken out");
        let later_ms = farm.config.clock.now_ms() + 10 * TERM_MS;
        farm.store.keep(job, Uuid::now_v7(), later_ms, later_ms + TERM_MS).await.unwrap();
        assert!(!is_settled(stand).await, "it is another's");
    }
}
