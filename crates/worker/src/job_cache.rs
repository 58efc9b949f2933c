//! The scenes of the last few jobs, built and ready to render, and the assets they are made of.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use clerestory_api::{Client, ClientError, ContentHash, JobId, JobScene};
use clerestory_render_core::film::{OpenExrError, PartialHeader, Rendered, TileGrid, partial};
use clerestory_render_core::scene::{Asset, Scene, SceneBundle, SceneDescription, SceneError};
use tracing::{debug, info};

use crate::retry::until_answered;

/// Jobs whose scenes are kept.
const KEPT_JOBS: usize = 4;

/// Bytes of assets that are kept for the scenes to come, which often differ in a few numbers only.
const KEPT_ASSET_BYTES: usize = 256 << 20;

/// Largest edge of a tile that a job may ask for.
const LARGEST_TILE: u32 = 1024;

/// Everything needed to render nodes of a job.
pub(crate) struct JobPlan {
    /// The job.
    pub(crate) job: JobId,
    /// Its scene.
    pub(crate) scene: Scene,
    /// How its image is cut into tiles.
    pub(crate) grid: TileGrid,
}

impl JobPlan {
    /// The partial with these nodes.
    pub(crate) fn encode_partial(&self, nodes: &[Rendered], build: &str) -> Result<Vec<u8>, OpenExrError> {
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
    #[error("the scene cannot be built")]
    Scene(#[from] SceneError),
    #[error("building the scene failed")]
    Panic(#[from] tokio::task::JoinError),
}

/// Plans of the last few jobs.
pub(crate) struct JobCache {
    client: Client,
    /// Last used first.
    plans: VecDeque<Arc<JobPlan>>,
    assets: AssetCache,
}

impl JobCache {
    pub(crate) fn new(client: Client) -> Self {
        Self { client, plans: VecDeque::new(), assets: AssetCache::default() }
    }

    /// The plan of a job, fetched and built unless it is at hand.
    pub(crate) async fn plan(&mut self, job: JobId) -> Result<Arc<JobPlan>, PlanError> {
        let plan = match self.plans.iter().position(|plan| plan.job == job).and_then(|at| self.plans.remove(at)) {
            Some(plan) => plan,
            None => Arc::new(self.fetch(job).await?),
        };
        self.plans.push_front(plan.clone());
        self.plans.truncate(KEPT_JOBS);
        Ok(plan)
    }

    /// The jobs whose plans are at hand.
    pub(crate) fn built(&self) -> Vec<JobId> {
        self.plans.iter().map(|plan| plan.job).collect()
    }

    async fn fetch(&mut self, job: JobId) -> Result<JobPlan, PlanError> {
        let order: JobScene = until_answered("fetch a scene", || self.client.job_scene(job)).await?;
        if !(1..=LARGEST_TILE).contains(&order.tile_size) {
            return Err(PlanError::TileSize { found: order.tile_size });
        }
        let mut assets = BTreeMap::new();
        for (name, hash) in &order.assets {
            assets.insert(name.clone(), self.asset(name, hash).await?);
        }
        let plan = tokio::task::spawn_blocking(move || build(&order, assets)).await??;
        info!(%job, scene = %plan.scene.hash(), "built a scene");
        Ok(plan)
    }

    async fn asset(&mut self, name: &str, hash: &ContentHash) -> Result<Asset, PlanError> {
        if let Some(asset) = self.assets.get(hash) {
            return Ok(asset);
        }
        let bytes = until_answered("fetch an asset", || self.client.asset(hash)).await?;
        let asset = Asset::new(bytes.as_ref());
        if asset.hash().as_bytes() != hash.as_bytes() {
            let found = asset.hash().to_string();
            return Err(PlanError::WrongAsset { name: name.to_owned(), found, expected: *hash });
        }
        debug!(name, %hash, bytes = bytes.len(), "fetched an asset");
        self.assets.put(*hash, asset.clone());
        Ok(asset)
    }
}

fn build(order: &JobScene, assets: BTreeMap<String, Asset>) -> Result<JobPlan, PlanError> {
    let description = SceneDescription::parse(order.scene.to_string().as_bytes())?;
    let bundle = SceneBundle::from_parts(description, assets)?;
    let found = bundle.scene_hash().to_string();
    if found != order.scene_hash {
        return Err(PlanError::WrongScene { found, expected: order.scene_hash.clone() });
    }
    let film = bundle.description().film;
    let grid = TileGrid { width: film.width, height: film.height, tile_size: order.tile_size };
    Ok(JobPlan { job: order.job, scene: Scene::build(&bundle)?, grid })
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
        let mut bytes = 0;
        self.entries.retain(|(_, asset)| {
            bytes += asset.bytes().len();
            bytes <= KEPT_ASSET_BYTES
        });
    }
}
