//! References: the same scene rendered with many samples, kept in the folder of the experiment.

use std::fs;
use std::path::{Path, PathBuf};

use clerestory_film::{DecodeBudget, FrameImage, ImageLayers};
use clerestory_render_core::document::SamplingDescription;
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::scene::Asset;
use serde::Serialize;

use crate::error::ExperimentError;
use crate::measure;
use crate::scenes::changed;
use crate::session::Session;
use crate::snapshot::Snapshot;
use crate::variant::{Variant, file_name};

/// Seed of references; those of the variants count from 1.
const SEED: u64 = 0;

/// Fewest blocks of a reference: their spread is its standard error.
const LEAST_BLOCKS: u32 = 16;

/// Most samples of a block.
const MOST_SAMPLES_PER_BLOCK: u32 = 256;

/// Samples of a pass, at the most.
const MOST_SAMPLES_PER_PASS: u32 = 16;

/// Memory that a reference may take when it is decoded: 16384 x 16384 pixels of RGB.
const BUDGET: DecodeBudget = DecodeBudget { pixel_bytes: 16384 * 16384 * 3 * 4 };

/// What the variants of a scene are measured against.
pub(crate) struct Reference {
    pub(crate) image: FrameImage,
    /// Its mean and standard error as a file.
    pub(crate) asset: Asset,
    pub(crate) record: ReferenceRecord,
}

/// What a report says of a reference.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ReferenceRecord {
    /// The scene.
    scene: String,
    /// Its file in the folder of the experiment.
    pub(crate) file: String,
    /// The integrator that made it.
    integrator: String,
    samples_per_pixel: u32,
    /// Mean of its numbers, W/(m2 sr).
    pub(crate) mean: f64,
    /// Mean square of the standard error of its numbers, which is subtracted from the error of a variant. Absent with
    /// fewer than two blocks of samples.
    pub(crate) noise: Option<f64>,
    /// Hash of the scene that was rendered.
    scene_hash: String,
}

/// The reference of a scene: from the folder if it has been rendered before.
pub(crate) fn reference(session: &mut Session, name: &str, bundle: &SceneBundle) -> Result<Reference, ExperimentError> {
    let samples = session.settings.reference_samples;
    let method = method(bundle.description());
    let integrator = method.integrator(&bundle.description().integrator);
    let changed = changed(bundle, integrator, SEED, sampling(samples));
    let bundle = changed.map_err(|source| ExperimentError::scene(name.as_ref(), source))?;
    let scene_hash = bundle.scene_hash().to_string();
    let file = format!("reference-{}-{samples}spp-{:.16}.exr", file_name(name), scene_hash);
    let image = match kept(session, &file, &bundle) {
        Some(image) => {
            session.end(&format!("Reference of {name}: {file} is here already"));
            image
        }
        None => {
            session.begin(format!("reference of {name}, {samples} samples a pixel"));
            let Snapshot { image, wall_seconds, .. } = measure::samples(session, &bundle, samples)?;
            let bytes = image.encode().map_err(|error| ExperimentError::BadImage(error.into()))?;
            session.host.write(&session.folder.join(&file), &bytes)?;
            session.end(&format!("Reference of {name}: {samples} samples a pixel in {wall_seconds:.1} s"));
            image
        }
    };
    let numbers = image.layers().mean.as_flattened();
    let mean = numbers.iter().map(|number| f64::from(*number)).sum::<f64>() / numbers.len() as f64;
    let record = ReferenceRecord {
        scene: name.to_owned(),
        file,
        integrator: method.name,
        samples_per_pixel: samples,
        mean,
        noise: noise(&image),
        scene_hash,
    };
    let asset = Asset::new(bare(&image)?.encode().map_err(|error| ExperimentError::BadImage(error.into()))?);
    Ok(Reference { image, asset, record })
}

/// The least noisy method without bias: `cone`, or `fnee` with a point light, which `cone` never meets. Both know panes
/// only.
///
/// Without panes, light comes by way of specular meshes. Over one surface, `conic` finds all of it. Over several, `sms`
/// is the only method whose probability to find a path does not shrink with the light. `mnee` and `path` leave paths to
/// chance, which meets a small light too rarely, and their standard error does not show that.
fn method(scene: &SceneDescription) -> Variant {
    let over_one_surface =
        scene.integrator.scope().is_some_and(|scope| scope.chains.iter().all(|chain| chain.len() == 1));
    if scene.panes.is_empty() {
        if over_one_surface { Variant::conic() } else { Variant::sms() }
    } else if scene.lights.iter().any(|light| light.is_delta()) {
        Variant::fnee()
    } else {
        Variant::cone()
    }
}

/// The layers of an image that errors are measured against.
fn bare(image: &FrameImage) -> Result<FrameImage, ExperimentError> {
    let ImageLayers { mean, standard_error, .. } = image.layers().clone();
    let layers = ImageLayers { mean, standard_error, ..ImageLayers::default() };
    FrameImage::new(image.width(), image.height(), layers, None).map_err(ExperimentError::BadImage)
}

/// The mean square of an image's standard error.
pub(crate) fn noise(image: &FrameImage) -> Option<f64> {
    let errors = image.layers().standard_error.as_ref()?.as_flattened();
    let squares: f64 = errors.iter().map(|&error| f64::from(error) * f64::from(error)).sum();
    Some(squares / errors.len() as f64)
}

/// An image of the same scene that the same build has rendered before. An image of another build may have a fault. A
/// damaged file counts as absent.
fn kept(session: &Session, file: &str, bundle: &SceneBundle) -> Option<FrameImage> {
    let path: PathBuf = session.folder.join(file);
    if !path.is_file() {
        return None;
    }
    let image = match read(&path) {
        Ok(image) => image,
        Err(failure) => {
            session.note(&format!("{failure}: it is rendered again"));
            return None;
        }
    };
    let film = bundle.description().film;
    let is_whole = (image.width(), image.height()) == (film.width, film.height);
    let is_same = image.metadata().is_some_and(|metadata| {
        metadata.scene_hash == bundle.scene_hash().to_string() && metadata.build == session.build
    });
    (is_whole && is_same).then_some(image)
}

fn read(file: &Path) -> Result<FrameImage, ExperimentError> {
    let bytes = fs::read(file).map_err(|source| ExperimentError::Read { file: file.to_owned(), source })?;
    FrameImage::decode(&bytes, BUDGET).map_err(|source| ExperimentError::Image { file: file.to_owned(), source })
}

/// The longest blocks that are enough for a standard error.
fn sampling(samples: u32) -> SamplingDescription {
    let longest = (samples / LEAST_BLOCKS).clamp(1, MOST_SAMPLES_PER_BLOCK);
    // The largest power of two that is no longer.
    let samples_per_block = 1 << longest.ilog2();
    SamplingDescription { samples_per_pass: samples_per_block.min(MOST_SAMPLES_PER_PASS), samples_per_block }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::{FOUR_PANES, FOUR_PANES_POINT, POOL};

    #[test]
    fn references_are_made_by_methods_that_find_all_light_of_the_scene() {
        for (file, expected) in [(FOUR_PANES, "cone"), (FOUR_PANES_POINT, "fnee"), (POOL, "conic")] {
            assert_eq!(method(file.bundle([8, 8]).unwrap().description()).name, expected);
        }
    }

    #[test]
    fn references_have_blocks_enough_for_a_standard_error() {
        for (samples, pass, block) in [(1, 1, 1), (20, 1, 1), (32, 2, 2), (1000, 16, 32), (4096, 16, 256)] {
            let expected = SamplingDescription { samples_per_pass: pass, samples_per_block: block };
            assert_eq!(sampling(samples), expected, "{samples}");
        }
    }
}
