//! What an image says of how it was made, so that it can be made again.

use std::path::Path;

use clerestory_film::{ImageLayers, ImageMetadata, TileGrid};
use clerestory_render_core::document::{SamplingDescription, SceneBundle, SceneDescription};
use clerestory_render_core::scene::description::FilmDescription;

use crate::failure::Failure;
use crate::image_file;
use crate::text::counted;

/// How to make an image again.
pub(crate) struct Recipe {
    /// The frame.
    pub(crate) frame: u32,
    /// The scene of the frame with the image's overrides.
    pub(crate) bundle: SceneBundle,
    /// How the film is cut into tiles.
    pub(crate) grid: TileGrid,
    /// Passes of each tile, in the order of the tiles.
    pub(crate) tile_passes: Vec<u32>,
}

/// Reads from `image` how it was made, and applies that to the scene, which is in the file `scene`.
pub(crate) fn recipe(bundle: SceneBundle, scene: &Path, image: &Path) -> Result<Recipe, Failure> {
    let picture = image_file::read(image)?;
    let Some(metadata) = picture.metadata() else {
        return Err(Failure::Usage(format!(
            "the image {} does not say how it was made: expected one that Clerestory rendered",
            image.display()
        )));
    };
    let failure = |source| Failure::scene(scene, source);
    let frame = metadata.frame;
    let bundle = bundle.frame(frame).map_err(failure)?;
    let mut description = bundle.description().clone();
    description.seed = metadata.seed;
    description.film = FilmDescription { width: picture.width(), height: picture.height() };
    description.sampling = SamplingDescription {
        samples_per_pass: metadata.sampling.samples_per_pass(),
        samples_per_block: metadata.sampling.samples_per_block(),
    };
    description.integrator = serde_json::from_value(metadata.integrator.clone()).map_err(|error| {
        Failure::Usage(format!("the image {} names an integrator that this build lacks: {error}", image.display()))
    })?;
    let bundle = bundle.with_description(description).map_err(failure)?;
    let found = bundle.scene_hash().to_string();
    if found != metadata.scene_hash && !was_version_1(&bundle, &metadata.scene_hash) {
        return Err(Failure::Usage(format!(
            "the scene {} is not the one of {}: with the image's settings it has the hash {found}, expected {}",
            scene.display(),
            image.display(),
            metadata.scene_hash
        )));
    }
    let grid = grid(image, bundle.description(), metadata, picture.layers())?;
    Ok(Recipe { frame, bundle, grid, tile_passes: metadata.tile_passes.clone() })
}

/// Whether a scene had this hash before its file said `"version": 2`.
fn was_version_1(bundle: &SceneBundle, hash: &str) -> bool {
    let old = SceneDescription { version: 1, ..bundle.description().clone() };
    bundle.clone().with_description(old).is_ok_and(|old| old.scene_hash().to_string() == hash)
}

/// How the film of an image was cut into tiles: the metadata may come from anyone. Earlier builds knew no light plane,
/// and no layer `caustic`.
fn grid(
    file: &Path,
    description: &SceneDescription,
    metadata: &ImageMetadata,
    layers: &ImageLayers,
) -> Result<TileGrid, Failure> {
    let grid = description.grid(metadata.tile_size.max(1)).with_caustic(layers.caustic.is_some());
    let found = [grid, grid.with_light_plane(false)]
        .into_iter()
        .find(|grid| metadata.tile_passes.len() == grid.len() as usize)
        .filter(|_| metadata.tile_size > 0);
    found.ok_or_else(|| {
        Failure::Usage(format!(
            "the image {} counts passes for {} of edge {}: expected {}",
            file.display(),
            counted(metadata.tile_passes.len() as u64, "tile", "tiles"),
            metadata.tile_size,
            counted(grid.len().into(), "tile", "tiles")
        ))
    })
}
