//! Submissions: validated, then stored as jobs.
//!
//! The coordinator validates the scene's document and counts what its files hold. It reads the headers of PLY files and
//! pictures, and all statements of OBJ files. It builds nothing: a scene can take more memory and time to build than
//! a coordinator has. The first worker that builds the scene reports what only building shows.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use clerestory_api::{ContentHash, JobId, JobSubmission};
use clerestory_film::{ImageError, LARGEST_TILE, OpenExrError, Sampling, Targets, TileGrid, smallest_tile};
use clerestory_render_core::document::{self, MAX_NOTE_CHARACTERS, MAX_NOTES, SceneBundle, SceneDescription};
use clerestory_render_core::scene::Asset;
use uuid::Uuid;

use super::submission_error::SubmissionError;
use super::submission_memory::{Busy, ParsingRoom, Room, SubmissionMemory};
use crate::blobs::{BlobError, Blobs};
use crate::clock::Clock;
use crate::films::FilmError;
use crate::films::assets::Assets;
use crate::films::convergence::FrameMetrics;
use crate::model::{NewJob, check_name, is_read_by_first, is_same_by_first};
use crate::store::{Store, StoreError};
use crate::tasks::to_completion;
use crate::watch::notifications::{Notification, Notifications};

/// Longest name.
const LONGEST_NAME: usize = 200;

/// Longest time limit, in milliseconds: ten years.
const LONGEST_TIME_MS: i64 = 10 * 365 * 24 * 3600 * 1000;

/// Most samples per pixel: the sampler counts no further.
const MOST_SAMPLES: u32 = 1 << 24;

/// What an operator can do for a scene whose files take too much memory.
const WAY_OUT: &str = "a larger `submission_bytes` in the coordinator's configuration";

/// Makes jobs of submissions.
#[derive(Debug)]
pub(crate) struct Submissions {
    store: Store,
    blobs: Blobs,
    assets: Arc<Assets>,
    metrics: Arc<FrameMetrics>,
    notifications: Arc<Notifications>,
    clock: Clock,
    memory: SubmissionMemory,
    /// Memory that the files of one scene may take.
    limit: u64,
}

impl Submissions {
    /// `limit` is the most memory that the files of one scene may take, in bytes.
    pub(crate) fn new(
        store: Store,
        blobs: Blobs,
        assets: Arc<Assets>,
        metrics: Arc<FrameMetrics>,
        notifications: Arc<Notifications>,
        clock: Clock,
        limit: u64,
    ) -> Self {
        let memory = SubmissionMemory::new(limit);
        Self { store, blobs, assets, metrics, notifications, clock, memory, limit }
    }

    /// Waits for memory to receive a body of at most these bytes.
    pub(crate) async fn reserve_body(&self, bytes: u64) -> Result<Room, Busy> {
        self.memory.for_body(bytes).await
    }

    /// Waits for memory to parse a body of these bytes.
    pub(crate) async fn reserve_parsing(&self, bytes: u64) -> Result<ParsingRoom, Busy> {
        self.memory.for_parsing(bytes).await
    }

    /// Validates a submission that was parsed in `room`, and stores it as a job.
    pub(crate) async fn submit(&self, submission: JobSubmission, room: ParsingRoom) -> Result<JobId, SubmissionError> {
        let job = self.job(submission, room).await?;
        let id = job.id;
        tracing::info!(job = %id, name = job.name, scene = job.scene_hash, passes = job.passes, "job submitted");
        let (store, notifications) = (self.store.clone(), Arc::clone(&self.notifications));
        let inserted = to_completion(async move {
            store.insert_job(job).await?;
            notifications.publish(Notification::Job(id));
            Ok::<_, StoreError>(())
        });
        inserted.await??;
        Ok(id)
    }

    async fn job(&self, mut submission: JobSubmission, room: ParsingRoom) -> Result<NewJob, SubmissionError> {
        check_numbers(&submission)?;
        let targets = Targets { mse: submission.target_mse, estimated_mse: submission.target_estimated_mse };
        targets.check(submission.reference.is_some(), None)?;
        // The JSON value is dropped before the scene is parsed from its text.
        let text = serde_json::to_vec(&submission.scene.take())?;
        let description = blocking(move || Ok(SceneDescription::parse(&text)?)).await?;
        let _room = room.parsed();
        check_name("scene.name", &description.name)?;
        if !description.timeline.is_empty() {
            let found = format!("{} frames", description.timeline.len());
            let expected = "a scene without a timeline: clerestory render renders frames, and farms do not yet";
            return Err(SubmissionError::invalid_field("scene.timeline", found, expected));
        }
        let grid = grid(&submission, &description)?;
        let named = check_assets(&submission.assets, &document::asset_names(&description))?;
        let contents: BTreeSet<ContentHash> = named.values().copied().chain(submission.reference).collect();
        let missing = self.assets.missing(contents).await?;
        if !missing.is_empty() {
            return Err(SubmissionError::MissingAssets(missing));
        }
        if let Some(hash) = submission.reference {
            let noise = match self.check_reference(grid, hash).await {
                Err(_) if !self.blobs.keep_if_whole(hash).await.map_err(FilmError::from)? => {
                    self.assets.lose(hash).await?;
                    return Err(SubmissionError::MissingAssets(vec![hash]));
                }
                noise => noise?,
            };
            targets.check(true, noise)?;
        }
        let (bundle, missing_light, _files_room) = self.validated(description, &named).await?;
        let description = bundle.description();
        let sampling = description.sampling;
        let name = submission.name.unwrap_or_else(|| description.name.clone());
        let passes = submission.samples_per_pixel.div_ceil(sampling.samples_per_pass.max(1));
        if submission.adaptive {
            let sampling = Sampling::new(sampling.samples_per_pass, sampling.samples_per_block)?;
            targets
                .adaptation(sampling, passes)
                .map_err(|fewest| too_few_to_share(submission.samples_per_pixel, fewest))?;
        }
        Ok(NewJob {
            id: JobId::from(Uuid::now_v7()),
            name: name.chars().take(LONGEST_NAME).collect(),
            priority: submission.priority,
            scene: document::canonical_json(description),
            scene_hash: bundle.scene_hash().to_string(),
            integrator: description.integrator.kind().to_owned(),
            is_read_by_first: is_read_by_first(description.version, description.integrator.kind(), &grid),
            is_same_by_first: is_same_by_first(description.lights.len()),
            missing_light,
            assumptions: submission.assumptions,
            grid,
            samples_per_pass: sampling.samples_per_pass,
            samples_per_block: sampling.samples_per_block,
            passes,
            reference: submission.reference,
            time_limit_ms: submission.time_limit_ms,
            targets,
            adaptive: submission.adaptive,
            assets: named,
            created_ms: self.clock.now_ms(),
        })
    }

    /// Checks a reference, and answers the mean square of its standard errors, if it has any.
    async fn check_reference(&self, grid: TileGrid, hash: ContentHash) -> Result<Option<f64>, SubmissionError> {
        let invalid = |detail: String, expected: String| SubmissionError::InvalidReference { detail, hash, expected };
        let refused = |error: FilmError| match error {
            FilmError::Image(ImageError::OpenExr(OpenExrError::Read(_))) => error.into(),
            FilmError::Image(error) => {
                invalid(error.to_string(), "an OpenEXR image with finite channels R, G and B".to_owned())
            }
            error => error.into(),
        };
        let [width, height] = self.metrics.reference_size(hash).await.map_err(refused)?;
        if (width, height) != (grid.width, grid.height) {
            let expected = format!("{} x {} pixels, as the scene's film", grid.width, grid.height);
            return Err(invalid(format!("the reference has {width} x {height} pixels"), expected));
        }
        Ok(self.metrics.reference(grid, hash).await.map_err(refused)?.noise())
    }

    /// The scene with its files, which hold no more than a scene may have, the light that an image of it lacks, and the
    /// memory that the files take.
    async fn validated(
        &self,
        description: SceneDescription,
        named: &BTreeMap<String, ContentHash>,
    ) -> Result<(SceneBundle, Vec<String>, Room), SubmissionError> {
        let limit = self.limit;
        let asset_bytes = self.store.asset_bytes(named.values().copied()).await?;
        if asset_bytes > limit {
            return Err(SubmissionError::InvalidScene {
                detail: "the assets of the scene are too large".to_owned(),
                field: "assets".to_owned(),
                value: Some(format!("{asset_bytes} bytes")),
                expected: Some(format!("at most {limit} bytes in all assets; or {WAY_OUT}")),
            });
        }
        let room = self.memory.for_scene(asset_bytes).await?;
        let bundle = self.read(description, named).await?;
        blocking(move || {
            let (memory, missing_light) = bundle.memory_and_missing_light()?;
            memory.check_counts()?;
            Ok((bundle, missing_light, room))
        })
        .await
    }

    /// Reads the assets of a scene into memory.
    async fn read(
        &self,
        description: SceneDescription,
        named: &BTreeMap<String, ContentHash>,
    ) -> Result<SceneBundle, SubmissionError> {
        let (mut assets, mut damaged) = (BTreeMap::new(), Vec::new());
        for (name, hash) in named {
            let content = self.blobs.asset(*hash).await.map_err(|error: BlobError| FilmError::from(error))?;
            let asset = Asset::new(content.to_vec());
            if asset.hash().as_bytes() != hash.as_bytes() {
                self.assets.check(*hash).await?;
                damaged.push(*hash);
            }
            assets.insert(name.clone(), asset);
        }
        if !damaged.is_empty() {
            return Err(SubmissionError::MissingAssets(damaged));
        }
        blocking(move || Ok(SceneBundle::from_parts(description, assets)?)).await
    }
}

fn check_numbers(submission: &JobSubmission) -> Result<(), SubmissionError> {
    if let Some(name) = submission.name.as_ref().filter(|name| name.is_empty() || name.chars().count() > LONGEST_NAME) {
        return Err(SubmissionError::invalid_field("name", name, format!("1 to {LONGEST_NAME} characters")));
    }
    check_name("name", submission.name.as_deref().unwrap_or_default())?;
    if !(1..=MOST_SAMPLES).contains(&submission.samples_per_pixel) {
        let expected = format!("1 to {MOST_SAMPLES}");
        return Err(SubmissionError::invalid_field("samples_per_pixel", submission.samples_per_pixel, expected));
    }
    if !(1..=LARGEST_TILE).contains(&submission.tile_size) {
        return Err(SubmissionError::invalid_field(
            "tile_size",
            submission.tile_size,
            format!("1 to {LARGEST_TILE} pixels"),
        ));
    }
    if submission.assumptions.len() > MAX_NOTES {
        let expected = format!("at most {MAX_NOTES} lines");
        return Err(SubmissionError::invalid_field("assumptions", submission.assumptions.len(), expected));
    }
    if let Some(long) = submission.assumptions.iter().find(|line| line.chars().count() > MAX_NOTE_CHARACTERS) {
        let expected = format!("at most {MAX_NOTE_CHARACTERS} characters in each line");
        return Err(SubmissionError::invalid_field("assumptions", long, expected));
    }
    if let Some(limit_ms) = submission.time_limit_ms.filter(|limit_ms| !(1..=LONGEST_TIME_MS).contains(limit_ms)) {
        let expected = format!("1 to {LONGEST_TIME_MS} milliseconds");
        return Err(SubmissionError::invalid_field("time_limit_ms", limit_ms, expected));
    }
    Ok(())
}

fn grid(submission: &JobSubmission, description: &SceneDescription) -> Result<TileGrid, SubmissionError> {
    let (width, height) = (description.film.width, description.film.height);
    let smallest = smallest_tile(width, height);
    if submission.tile_size < smallest {
        let expected = format!("at least {smallest} pixels for an image of {width} x {height}");
        return Err(SubmissionError::invalid_field("tile_size", submission.tile_size, expected));
    }
    Ok(description.grid(submission.tile_size))
}

/// The assets that the scene names, each of which must be given, and no other.
fn check_assets(
    given: &BTreeMap<String, ContentHash>,
    named: &BTreeSet<&str>,
) -> Result<BTreeMap<String, ContentHash>, SubmissionError> {
    if let Some(missing) = named.iter().find(|name| !given.contains_key(**name)) {
        let field = format!("assets.{missing}");
        return Err(SubmissionError::invalid_field(
            field,
            "absent",
            "the content hash of this file, which the scene names",
        ));
    }
    if let Some((surplus, hash)) = given.iter().find(|(name, _)| !named.contains(name.as_str())) {
        let expected = "only files that the scene names";
        return Err(SubmissionError::invalid_field(format!("assets.{surplus}"), hash, expected));
    }
    Ok(given.clone())
}

fn too_few_to_share(samples_per_pixel: u32, fewest: u32) -> SubmissionError {
    let expected = format!(
        "at least {fewest} for an adaptive job of this scene, in which every pixel gets {} at least",
        fewest.saturating_sub(1)
    );
    SubmissionError::invalid_field("samples_per_pixel", samples_per_pixel, expected)
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, SubmissionError> + Send + 'static,
) -> Result<T, SubmissionError> {
    tokio::task::spawn_blocking(work).await?
}
