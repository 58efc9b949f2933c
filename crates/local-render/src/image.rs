//! The image that the sums of tiles make.

use std::time::Duration;

use clerestory_film::counters::Counters;
use clerestory_film::{FrameImage, ImageError, ImageMetadata, TileSum};
use clerestory_render_core::integrator::PreparedScene;

use crate::plan::PassPlan;

/// How an image was made, for its metadata.
pub struct Provenance<'a> {
    /// The program.
    pub build: &'a str,
    /// The work on the image.
    pub counters: Counters,
    /// How long it took, where that is known.
    pub elapsed: Option<Duration>,
    /// What was assumed for a file of another program, in words.
    pub assumptions: &'a [String],
}

/// The image that these sums make, with how it was made.
///
/// # Errors
///
/// When the sums are not those of the plan.
pub fn image(
    scene: &PreparedScene,
    plan: &PassPlan,
    sums: &[TileSum],
    provenance: &Provenance<'_>,
) -> Result<FrameImage, ImageError> {
    let description = scene.description();
    let metadata = ImageMetadata {
        scene_hash: scene.hash().to_string(),
        frame: plan.frame,
        seed: description.seed,
        integrator: serde_json::to_value(&description.integrator).expect("settings have a form in JSON"),
        sampling: plan.sampling,
        tile_size: plan.grid.tile_size,
        tile_passes: Vec::new(),
        standard_error_tiles: None,
        build: provenance.build.to_owned(),
        worker_builds: Vec::new(),
        missing_light: description.missing_light(),
        left_to_chance: scene.left_to_chance(),
        chosen_methods: scene.chosen_methods(),
        import_notes: scene.import_notes().to_vec(),
        assumptions: provenance.assumptions.to_vec(),
        counters: provenance.counters,
        elapsed_seconds: provenance.elapsed.map(|elapsed| elapsed.as_secs_f64()),
    };
    FrameImage::assemble(&plan.grid, sums, metadata)
}
