//! From a submission to a job: everything that a worker would stumble over is found here and named.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::thread::available_parallelism;

use clerestory_api::{ContentHash, JobId, JobSubmission, ProblemCode};
use clerestory_film::{ImageError, InvalidTarget, LARGEST_TILE, OpenExrError, Targets, TileGrid, smallest_tile};
use clerestory_render_core::scene::{
    self, Asset, CheckedScene, Scene, SceneBundle, SceneDescription, SceneError, SceneHash, SceneMemory, SceneUse,
};
use futures::stream::{self, StreamExt, TryStreamExt};
use rayon::ThreadPoolBuilder;
use uuid::Uuid;

use crate::farm::Farm;
use crate::films::convergence::Reference;
use crate::films::{FilmError, repair};
use crate::http::problem::ApiError;
use crate::jobs::submission_memory::ParsingRoom;
use crate::model::NewJob;

/// Longest name.
const LONGEST_NAME: usize = 200;

/// Longest time limit, in milliseconds: ten years.
const LONGEST_TIME_MS: i64 = 10 * 365 * 24 * 3600 * 1000;

/// Most samples per pixel: the sampler counts no further.
const MOST_SAMPLES: u32 = 1 << 24;

/// Contents that are looked for at the same time.
const LOOKS: usize = 8;

/// What an operator can do for a scene that takes too much memory.
const WAY_OUT: &str = "a larger `submission_bytes` in the coordinator's configuration";

/// Checks a submission, for which there is room, and makes a job of it.
pub(crate) async fn job(farm: &Farm, mut submission: JobSubmission, room: ParsingRoom) -> Result<NewJob, ApiError> {
    check_numbers(&submission)?;
    let targets = Targets { mse: submission.target_mse, estimated_mse: submission.target_estimated_mse };
    targets.check(submission.reference.is_some(), None).map_err(of_target)?;
    // Of what a scene is read from and into, no more than is needed is in memory together.
    let text = serde_json::to_vec(&submission.scene.take()).map_err(ApiError::internal)?;
    let description = blocking(move || SceneDescription::parse(&text).map_err(of_scene_error)).await?;
    let _room = room.parsed();
    ApiError::check_name("scene.name", &description.name)?;
    let grid = grid(&submission, &description)?;
    let named = check_assets(&submission.assets, &scene::asset_names(&description))?;
    check_uploaded(farm, named.values().copied().chain(submission.reference)).await?;

    if let Some(hash) = submission.reference {
        let noise = match check_reference(farm, grid, hash).await {
            Err(_) if !farm.blobs.keep_if_whole(hash).await? => {
                repair::lose_asset(farm, hash).await?;
                return Err(missing(vec![hash]));
            }
            noise => noise?,
        };
        targets.check(true, noise).map_err(of_target)?;
    }
    let scene = checked(farm, description, &named).await?;
    let Checked { description, facts, hash } = &scene;
    let sampling = description.sampling;
    let name = submission.name.unwrap_or_else(|| description.name.clone());
    let passes = submission.samples_per_pixel.div_ceil(sampling.samples_per_pass.max(1));
    if submission.adaptive {
        targets
            .adaptation(facts.sampling, passes)
            .map_err(|fewest| too_few_to_share(submission.samples_per_pixel, fewest))?;
    }
    Ok(NewJob {
        id: JobId::from(Uuid::now_v7()),
        name: name.chars().take(LONGEST_NAME).collect(),
        priority: submission.priority,
        scene: scene::canonical_json(description),
        scene_hash: hash.to_string(),
        integrator: description.integrator.kind().to_owned(),
        missing_light: description.missing_light(),
        left_to_chance: facts.left_to_chance.clone(),
        grid,
        samples_per_pass: sampling.samples_per_pass,
        samples_per_block: sampling.samples_per_block,
        passes,
        reference: submission.reference,
        time_limit_ms: submission.time_limit_ms,
        targets,
        adaptive: submission.adaptive,
        assets: named,
        created_ms: farm.config.clock.now_ms(),
    })
}

fn check_numbers(submission: &JobSubmission) -> Result<(), ApiError> {
    if let Some(name) = submission.name.as_ref().filter(|name| name.is_empty() || name.chars().count() > LONGEST_NAME) {
        return Err(ApiError::invalid_field("name", name, format!("1 to {LONGEST_NAME} characters")));
    }
    ApiError::check_name("name", submission.name.as_deref().unwrap_or_default())?;
    if !(1..=MOST_SAMPLES).contains(&submission.samples_per_pixel) {
        let expected = format!("1 to {MOST_SAMPLES}");
        return Err(ApiError::invalid_field("samples_per_pixel", submission.samples_per_pixel, expected));
    }
    if !(1..=LARGEST_TILE).contains(&submission.tile_size) {
        return Err(ApiError::invalid_field("tile_size", submission.tile_size, format!("1 to {LARGEST_TILE} pixels")));
    }
    if let Some(limit_ms) = submission.time_limit_ms.filter(|limit_ms| !(1..=LONGEST_TIME_MS).contains(limit_ms)) {
        let expected = format!("1 to {LONGEST_TIME_MS} milliseconds");
        return Err(ApiError::invalid_field("time_limit_ms", limit_ms, expected));
    }
    Ok(())
}

fn grid(submission: &JobSubmission, description: &SceneDescription) -> Result<TileGrid, ApiError> {
    let (width, height) = (description.film.width, description.film.height);
    let smallest = smallest_tile(width, height);
    if submission.tile_size < smallest {
        let expected = format!("at least {smallest} pixels for an image of {width} x {height}");
        return Err(ApiError::invalid_field("tile_size", submission.tile_size, expected));
    }
    Ok(TileGrid { width, height, tile_size: submission.tile_size })
}

/// The assets that the scene names, each of which must be given, and no other.
fn check_assets(
    given: &BTreeMap<String, ContentHash>,
    named: &BTreeSet<&str>,
) -> Result<BTreeMap<String, ContentHash>, ApiError> {
    if let Some(missing) = named.iter().find(|name| !given.contains_key(**name)) {
        let field = format!("assets.{missing}");
        return Err(ApiError::invalid_field(field, "absent", "the content hash of this file, which the scene names"));
    }
    if let Some((surplus, hash)) = given.iter().find(|(name, _)| !named.contains(name.as_str())) {
        let expected = "only files that the scene names";
        return Err(ApiError::invalid_field(format!("assets.{surplus}"), hash, expected));
    }
    Ok(given.clone())
}

async fn check_uploaded(farm: &Farm, hashes: impl Iterator<Item = ContentHash>) -> Result<(), ApiError> {
    let look = |hash| async move { Ok::<_, ApiError>((hash, farm.has_asset(hash).await?)) };
    let found: Vec<_> = stream::iter(hashes.collect::<BTreeSet<_>>()).map(look).buffered(LOOKS).try_collect().await?;
    let lacking: Vec<ContentHash> = found.into_iter().filter(|(_, is_there)| !is_there).map(|(hash, _)| hash).collect();
    if lacking.is_empty() { Ok(()) } else { Err(missing(lacking)) }
}

fn missing(hashes: Vec<ContentHash>) -> ApiError {
    let detail = format!("{} of the named contents must be uploaded first; `missing` lists them", hashes.len());
    ApiError::new(ProblemCode::MissingAssets, detail).missing(hashes)
}

fn too_few_to_share(samples_per_pixel: u32, fewest: u32) -> ApiError {
    let expected = format!(
        "at least {fewest} for an adaptive job of this scene, in which every pixel gets {} at least",
        fewest.saturating_sub(1)
    );
    ApiError::invalid_field("samples_per_pixel", samples_per_pixel, expected)
}

fn of_target(InvalidTarget { field, value, expected }: InvalidTarget) -> ApiError {
    ApiError::invalid_field(field, serde_json::Value::from(value), expected)
}

/// Checks a reference, and answers the mean square of its standard errors, if it has any.
async fn check_reference(farm: &Farm, grid: TileGrid, hash: ContentHash) -> Result<Option<f64>, ApiError> {
    let refuse = |detail: String| ApiError::new(ProblemCode::InvalidReference, detail).field("reference").value(hash);
    let refused = |error: FilmError| match error {
        FilmError::Image(ImageError::OpenExr(OpenExrError::Read(_))) => error.into(),
        FilmError::Image(error) => {
            refuse(error.to_string()).expected("an OpenEXR image with finite channels R, G and B")
        }
        error => error.into(),
    };
    let [width, height] = Reference::size(farm, hash).await.map_err(refused)?;
    if (width, height) != (grid.width, grid.height) {
        return Err(refuse(format!("the reference has {width} x {height} pixels"))
            .expected(format!("{} x {} pixels, as the scene's film", grid.width, grid.height)));
    }
    Ok(Reference::measure(farm, grid, hash).await.map_err(refused)?.noise())
}

/// A scene that can be built.
struct Checked {
    description: SceneDescription,
    facts: CheckedScene,
    hash: SceneHash,
}

/// Checks a scene with the contents of its assets, so that what a worker would stumble over is found here. Memory is taken before assets are
/// read, and, when it is known what they decode to, before they are decoded.
async fn checked(
    farm: &Farm,
    description: SceneDescription,
    named: &BTreeMap<String, ContentHash>,
) -> Result<Checked, ApiError> {
    let limit = farm.config.submission_bytes;
    let asset_bytes = farm.store.asset_bytes(named.values().copied()).await?;
    if asset_bytes > limit {
        let expected = format!("at most {limit} bytes in all assets; or {WAY_OUT}");
        let problem = ApiError::new(ProblemCode::InvalidScene, "the assets of the scene are too large");
        return Err(problem.field("assets").value(format!("{asset_bytes} bytes")).expected(expected));
    }
    let description = Arc::new(description);
    let mut room = farm.submissions.for_scene(asset_bytes).await?;
    let mut bundle = read(farm, &description, named).await?;
    let memory = {
        let bundle = Arc::clone(&bundle);
        blocking(move || Ok(SceneMemory::of(&bundle))).await?
    };
    memory.check(SceneUse::Check, limit, WAY_OUT).map_err(of_scene_error)?;
    let needed = memory.bytes(SceneUse::Check);
    room = match farm.submissions.grow(room, needed) {
        Some(room) => room,
        None => {
            // The room that it had is free meanwhile: two that wait for each other would wait in vain.
            drop(bundle);
            let room = farm.submissions.for_scene(needed).await?;
            bundle = read(farm, &description, named).await?;
            room
        }
    };
    // Threads of its own: neither other submissions nor images wait for those of a large scene.
    let threads = if room.is_small { 1 } else { available_parallelism().map_or(1, NonZeroUsize::get) };
    blocking(move || {
        let _room = room;
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().map_err(ApiError::internal)?;
        let facts = pool.install(|| Scene::check(&bundle)).map_err(of_scene_error)?;
        Ok(Checked { description: bundle.description().clone(), facts, hash: bundle.scene_hash() })
    })
    .await
}

/// Reads the assets of a scene into memory.
async fn read(
    farm: &Farm,
    description: &Arc<SceneDescription>,
    named: &BTreeMap<String, ContentHash>,
) -> Result<Arc<SceneBundle>, ApiError> {
    let (mut assets, mut damaged) = (BTreeMap::new(), Vec::new());
    for (name, hash) in named {
        let asset = Asset::new(farm.blobs.asset(*hash).await?.to_vec());
        if asset.hash().as_bytes() != hash.as_bytes() {
            repair::check_asset(farm, *hash).await?;
            damaged.push(*hash);
        }
        assets.insert(name.clone(), asset);
    }
    if !damaged.is_empty() {
        return Err(missing(damaged));
    }
    let description = SceneDescription::clone(description);
    blocking(move || SceneBundle::from_parts(description, assets).map(Arc::new).map_err(of_scene_error)).await
}

fn of_scene_error(error: SceneError) -> ApiError {
    let field = match error.path() {
        "" | "$" => "scene".to_owned(),
        path => format!("scene.{path}"),
    };
    let mut detail = error.to_string();
    if let (SceneError::Structure { .. }, Some(place)) = (&error, detail.rfind(" at line ")) {
        // It is the place in the scene as it was taken out of the submission, which nobody sees.
        detail.truncate(place);
    }
    let refused = ApiError::new(ProblemCode::InvalidScene, detail).field(field);
    match error {
        SceneError::Value { found, expected, .. } => refused.value(found).expected(expected),
        SceneError::UnsupportedVersion { found } => {
            refused.value(found).expected(scene::description::SCENE_FORMAT_VERSION.to_string())
        }
        SceneError::Asset { name, .. } => refused.value(name),
        _ => refused,
    }
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ApiError> + Send + 'static,
) -> Result<T, ApiError> {
    tokio::task::spawn_blocking(work).await.map_err(ApiError::internal)?
}
