//! The scenes of the last few jobs, built or being built, and the assets they are made of.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, MutexGuard, PoisonError, Weak};
use std::time::Instant;

use clerestory_api::{
    BuildOutcome, BuiltScene, Client, ClientError, ContentHash, JobId, JobScene, LONGEST_REFUSAL, ProblemCode,
    SceneBuilding, WorkerActivity,
};
use clerestory_film::{LARGEST_TILE, OpenExrError, PartialHeader, Rendered, TileGrid, partial};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::description::FilmDescription;
use clerestory_render_core::scene::{Asset, SceneError};
use tokio::sync::{Mutex, watch};
use tokio_util::task::AbortOnDropHandle;
use tracing::{debug, info};

use crate::retry::until_answered;
use crate::scene_budget::{MemoryLimit, Reservation, SceneBudget};

/// Jobs whose scenes are kept, as far as they fit into memory.
const KEPT_JOBS: usize = 4;

/// Bytes of assets that are kept for later scenes, which often use the same ones.
const KEPT_ASSET_BYTES: usize = 256 << 20;

/// Everything needed to render nodes of a job.
pub(crate) struct JobPlan {
    /// The job.
    pub(crate) job: JobId,
    /// Its scene.
    pub(crate) scene: PreparedScene,
    /// How its image is cut into tiles.
    pub(crate) grid: TileGrid,
    /// What a report on the scene says.
    built: BuiltScene,
    /// The memory of the scene, released when the scene is dropped.
    _memory: Reservation,
}

impl JobPlan {
    /// The report on the scene.
    pub(crate) fn report(&self) -> BuildOutcome {
        BuildOutcome::Built(self.built.clone())
    }

    /// The partial with these nodes.
    pub(crate) fn encode_partial<'a>(
        &self,
        nodes: impl Iterator<Item = &'a Rendered>,
        build: &str,
    ) -> Result<Vec<u8>, OpenExrError> {
        let header = PartialHeader {
            job: self.job.to_string(),
            scene_hash: self.scene.hash().to_string(),
            build: build.to_owned(),
        };
        partial::encode(nodes, &header, &self.grid)
    }
}

/// Why a job cannot be rendered here.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PlanError {
    #[error("cannot fetch the scene from the coordinator")]
    Fetch(#[from] ClientError),
    #[error("the asset `{name}` arrived with the content hash {found}, expected {expected}")]
    WrongAsset { name: String, found: String, expected: ContentHash },
    #[error("the scene has the hash {found} here and {expected} at the coordinator: different builds of Clerestory")]
    WrongScene { found: String, expected: String },
    #[error("the job has tiles of {found} pixels, expected 1 to {LARGEST_TILE}")]
    TileSize { found: u32 },
    #[error("this build cannot read the scene")]
    Unreadable(#[source] SceneError),
    #[error("the scene takes too much memory for this worker")]
    TooLarge(#[source] SceneError),
    #[error("the scene cannot be built")]
    Scene(#[source] SceneError),
    #[error("building the scene failed")]
    Panic(#[from] tokio::task::JoinError),
    #[error("building the scene was given up")]
    Dropped,
}

impl PlanError {
    /// Whether the coordinator lacks a file of the scene. Then it holds the job until somebody uploads it again.
    pub(crate) fn is_of_lost_asset(&self) -> bool {
        let Self::Fetch(failure) = self else { return false };
        failure.problem().is_some_and(|problem| problem.code == ProblemCode::UnknownAsset)
    }

    /// The report on a scene that cannot be built for a reason that lies in the scene.
    pub(crate) fn report(&self) -> Option<BuildOutcome> {
        match self {
            Self::Scene(source) => {
                Some(BuildOutcome::Refused { reason: source.to_string().chars().take(LONGEST_REFUSAL).collect() })
            }
            _ => None,
        }
    }
}

/// Plans of the last few jobs, built or being built. A plan that takes longer than a lease is built to its end, and
/// serves the next lease of its job.
pub(crate) struct JobCache {
    builder: Arc<PlanBuilder>,
    plans: Arc<Plans>,
}

/// The plans. A plan that is being built may evict others.
#[derive(Default)]
struct Plans {
    /// Last used first.
    entries: std::sync::Mutex<VecDeque<Entry>>,
}

impl Plans {
    fn lock(&self) -> MutexGuard<'_, VecDeque<Entry>> {
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Drops the least recently used plan that is built. False when there is none.
    fn drop_oldest(&self) -> bool {
        let mut entries = self.lock();
        let oldest = entries.iter().rposition(Entry::is_ready).and_then(|at| entries.remove(at));
        drop(entries);
        if let Some(entry) = &oldest {
            info!(job = %entry.job, "dropping a scene to make room for another");
        }
        oldest.is_some()
    }
}

/// A plan that is built or being built.
struct Entry {
    job: JobId,
    outcome: watch::Receiver<Option<Outcome>>,
    _task: AbortOnDropHandle<()>,
}

/// The result of building a plan. Every lease that waits for it gets it.
type Outcome = Result<Arc<JobPlan>, Arc<PlanError>>;

impl Entry {
    fn begin(builder: Arc<PlanBuilder>, job: JobId) -> Self {
        let (result, outcome) = watch::channel(None);
        let task = tokio::spawn(async move {
            let plan = builder.build_plan(job).await.map(Arc::new).map_err(Arc::new);
            result.send_replace(Some(plan));
        });
        Self { job, outcome, _task: AbortOnDropHandle::new(task) }
    }

    fn is_ready(&self) -> bool {
        matches!(*self.outcome.borrow(), Some(Ok(_)))
    }

    fn has_failed(&self) -> bool {
        let gone = self.outcome.has_changed().is_err();
        self.outcome.borrow().as_ref().map_or(gone, Result::is_err)
    }
}

impl JobCache {
    pub(crate) fn new(client: Client, budget: SceneBudget) -> Self {
        let plans = Arc::new(Plans::default());
        let assets = Mutex::new(AssetCache::default());
        let builder =
            PlanBuilder { client, assets, budget, plans: Arc::downgrade(&plans), activity: Activity::default() };
        Self { builder: Arc::new(builder), plans }
    }

    /// The plan of a job, fetched and built unless it is cached. Dropping the future does not stop the build.
    pub(crate) async fn plan(&mut self, job: JobId) -> Outcome {
        let mut outcome = self.entry(job);
        let plan = outcome.wait_for(Option::is_some).await;
        plan.ok().and_then(|plan| plan.clone()).unwrap_or_else(|| Err(Arc::new(PlanError::Dropped)))
    }

    /// The pending or complete result of building a plan. Starts the build unless the plan is cached.
    fn entry(&self, job: JobId) -> watch::Receiver<Option<Outcome>> {
        let mut entries = self.plans.lock();
        let known = entries.iter().position(|entry| entry.job == job).and_then(|at| entries.remove(at));
        let entry = known.filter(|entry| !entry.has_failed());
        let entry = entry.unwrap_or_else(|| Entry::begin(Arc::clone(&self.builder), job));
        let outcome = entry.outcome.clone();
        entries.push_front(entry);
        let building = self.builder.activity.job();
        let mut kept = 0;
        entries.retain(|entry| {
            kept += 1;
            kept <= KEPT_JOBS || building == Some(entry.job)
        });
        outcome
    }

    /// The jobs whose plans are built or being built.
    pub(crate) fn jobs(&self) -> Vec<JobId> {
        self.plans.lock().iter().filter(|entry| !entry.has_failed()).map(|entry| entry.job).collect()
    }

    /// The scene that is being built, for heartbeats.
    pub(crate) fn activity(&self) -> Activity {
        self.builder.activity.clone()
    }
}

/// The scene that is being built, and the time since its start.
#[derive(Clone, Default)]
pub(crate) struct Activity(Arc<std::sync::Mutex<Option<(JobId, Instant)>>>);

impl Activity {
    /// The activity in a heartbeat.
    pub(crate) fn report(&self) -> WorkerActivity {
        let building = self.0.lock().unwrap_or_else(PoisonError::into_inner).map(|(job, since)| SceneBuilding {
            job,
            for_ms: u64::try_from(since.elapsed().as_millis()).unwrap_or(u64::MAX),
        });
        WorkerActivity { building }
    }

    fn job(&self) -> Option<JobId> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).map(|(job, _)| job)
    }

    fn begin(&self, job: JobId) -> Building<'_> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((job, Instant::now()));
        Building(self)
    }
}

/// A running build. It ends when this is dropped.
struct Building<'a>(&'a Activity);

impl Drop for Building<'_> {
    fn drop(&mut self) {
        *self.0.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

/// Fetches and builds scenes.
struct PlanBuilder {
    client: Client,
    /// Locked while a plan is built: two scenes at a time may take more memory than the machine has.
    assets: Mutex<AssetCache>,
    budget: SceneBudget,
    /// The plans to evict. Weak, because the plans own the tasks that build with this.
    plans: Weak<Plans>,
    activity: Activity,
}

impl PlanBuilder {
    async fn build_plan(&self, job: JobId) -> Result<JobPlan, PlanError> {
        let mut cache = self.assets.lock().await;
        info!(%job, "fetching and building a scene");
        let _building = self.activity.begin(job);
        let begun = Instant::now();
        let order: JobScene = until_answered("fetch a scene", || self.client.job_scene(job)).await?;
        if !(1..=LARGEST_TILE).contains(&order.tile_size) {
            return Err(PlanError::TileSize { found: order.tile_size });
        }
        let mut assets = BTreeMap::new();
        for (name, hash) in &order.assets {
            assets.insert(name.clone(), self.asset(&mut cache, name, hash).await?);
        }
        let (limit, tile_size) = (self.budget.limit(), order.tile_size);
        let (light_plane, caustic) = (order.light_plane, order.caustic);
        let (bundle, bytes) = tokio::task::spawn_blocking(move || bundle(&order, assets, limit)).await??;
        let drop_plan = || self.plans.upgrade().is_some_and(|plans| plans.drop_oldest());
        let memory = self.budget.reserve(bytes, drop_plan).await;
        cache.keep(usize::try_from(self.budget.spare()).unwrap_or(usize::MAX));
        // The thread owns the memory: it builds on when the task is aborted.
        let built = tokio::task::spawn_blocking(move || Ok((build(&bundle)?, memory))).await?;
        let ((scene, built), memory) = built.map_err(PlanError::Scene)?;
        let FilmDescription { width, height } = scene.description().film;
        let grid = TileGrid::new(width, height, tile_size).with_light_plane(light_plane).with_caustic(caustic);
        let plan = JobPlan { job, scene, grid, built, _memory: memory };
        info!(%job, scene = %plan.scene.hash(), seconds = begun.elapsed().as_secs_f64(), "built a scene");
        Ok(plan)
    }

    async fn asset(&self, cache: &mut AssetCache, name: &str, hash: &ContentHash) -> Result<Asset, PlanError> {
        if let Some(asset) = cache.get(hash) {
            return Ok(asset);
        }
        let bytes = until_answered("fetch an asset", || self.client.asset(hash)).await?;
        let asset = Asset::new(bytes.as_ref());
        if asset.hash().as_bytes() != hash.as_bytes() {
            let found = asset.hash().to_string();
            return Err(PlanError::WrongAsset { name: name.to_owned(), found, expected: *hash });
        }
        debug!(name, %hash, bytes = bytes.len(), "fetched an asset");
        cache.put(*hash, asset.clone());
        Ok(asset)
    }
}

/// Makes the bundle of a scene, and counts the bytes that building it takes.
fn bundle(
    order: &JobScene,
    assets: BTreeMap<String, Asset>,
    limit: Option<MemoryLimit>,
) -> Result<(SceneBundle, u64), PlanError> {
    let description = SceneDescription::parse(order.scene.to_string().as_bytes()).map_err(PlanError::Unreadable)?;
    let bundle = SceneBundle::from_parts(description, assets).map_err(PlanError::Unreadable)?;
    let found = bundle.scene_hash().to_string();
    if found != order.scene_hash {
        return Err(PlanError::WrongScene { found, expected: order.scene_hash.clone() });
    }
    let memory = bundle.memory().map_err(PlanError::Scene)?;
    memory.check_counts().map_err(PlanError::Scene)?;
    if let Some(limit) = limit {
        memory.check(limit.bytes, limit.way_out).map_err(PlanError::TooLarge)?;
    }
    Ok((bundle, memory.bytes()))
}

/// Builds a scene, and makes the report on it.
fn build(bundle: &SceneBundle) -> Result<(PreparedScene, BuiltScene), SceneError> {
    let scene = PreparedScene::build(bundle)?;
    let built = BuiltScene {
        left_to_chance: scene.left_to_chance(),
        chosen_methods: scene.chosen_methods(),
        import_notes: scene.import_notes().to_vec(),
    };
    Ok((scene, built))
}

/// Assets by content hash, the least recently used dropped first.
#[derive(Default)]
struct AssetCache {
    /// Last used first.
    entries: VecDeque<(ContentHash, Asset)>,
}

impl AssetCache {
    fn get(&mut self, hash: &ContentHash) -> Option<Asset> {
        let at = self.entries.iter().position(|(held, _)| held == hash)?;
        let entry = self.entries.remove(at)?;
        let asset = entry.1.clone();
        self.entries.push_front(entry);
        Some(asset)
    }

    fn put(&mut self, hash: ContentHash, asset: Asset) {
        self.entries.push_front((hash, asset));
        self.keep(KEPT_ASSET_BYTES);
    }

    /// Evicts assets beyond this number of bytes.
    fn keep(&mut self, most_bytes: usize) {
        let mut bytes = 0;
        self.entries.retain(|(_, asset)| {
            bytes += asset.bytes().len();
            bytes <= most_bytes
        });
    }
}
