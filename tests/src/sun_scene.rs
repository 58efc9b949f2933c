//! A scene with its sun at another angular radius, and references of it rendered by `cone`.

use std::path::{Path, PathBuf};

use clerestory_render_core::document::{SamplingDescription, SceneBundle};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::integrator::RenderError;
use clerestory_render_core::light::LightDescription;
use clerestory_render_core::light::SunLight;
use clerestory_render_core::scene::SceneError;

use crate::{
    reference::{Image, Reference},
    rendering::Rendering,
};

/// What is changed of a scene that has a sun.
#[derive(Clone, Copy, Debug)]
pub struct SunScene<'a> {
    /// Angular radius of the sun, degrees. Its irradiance stays the same.
    pub angular_radius: f64,
    /// Name of the integrator.
    pub integrator: &'a str,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Light path expression that the light is restricted to.
    pub path_filter: Option<&'a str>,
}

/// Samples with a scramble of their own.
const SAMPLES_PER_BLOCK: u32 = 256;

/// Independent batches of a reference, for its halves and its standard error.
const BATCHES: u32 = 16;

impl SunScene<'_> {
    /// The changed scene, with passes of one sample.
    ///
    /// # Errors
    ///
    /// When a change is not valid, or the scene cannot be built.
    pub fn build(&self, bundle: &SceneBundle) -> Result<PreparedScene, SceneError> {
        PreparedScene::build(&self.bundle(bundle)?)
    }

    /// The changed scene, not yet built.
    ///
    /// # Errors
    ///
    /// When a change is not valid.
    pub fn bundle(&self, bundle: &SceneBundle) -> Result<SceneBundle, SceneError> {
        let mut description = bundle
            .description()
            .clone()
            .with_integrator_named(self.integrator)?
            .with_seed(self.seed)
            .with_size(self.size[0], self.size[1])?;
        description.sampling = SamplingDescription { samples_per_pass: 1, samples_per_block: SAMPLES_PER_BLOCK };
        if let Some(filter) = self.path_filter {
            description.path_filter = Some(filter.to_owned());
        }
        for light in &mut description.lights {
            if let LightDescription::Sun(SunLight { angular_radius, radiance, .. }) = light {
                let ratio = libm::sin(angular_radius.to_radians()) / libm::sin(self.angular_radius.to_radians());
                *radiance = radiance.map(|channel| channel * ratio * ratio);
                *angular_radius = self.angular_radius;
            }
        }
        bundle.clone().with_description(description)
    }
}

/// Where the reference for an angular radius is stored.
pub fn reference_file(folder: &Path, angular_radius: f64) -> PathBuf {
    folder.join(format!("reference-{angular_radius}.exr"))
}

/// A reference of at least `samples` samples in each pixel, in batches of whole blocks, whose scrambles are
/// independent.
///
/// # Errors
///
/// When a sample is not finite.
pub fn render_reference(scene: &PreparedScene, samples: u32, progress: impl Fn(f64)) -> Result<Reference, RenderError> {
    let per_batch = samples.div_ceil(SAMPLES_PER_BLOCK * BATCHES).max(1) * SAMPLES_PER_BLOCK;
    let mut rendering = Rendering::new(scene);
    let mut before = rendering.image();
    let mut batches = Vec::new();
    for batch in 1..=BATCHES {
        let first = rendering.samples();
        while rendering.samples() < batch * per_batch {
            rendering.render_pass()?;
            progress(f64::from(rendering.samples()) / f64::from(BATCHES * per_batch));
        }
        let sum = rendering.image().scaled(f64::from(rendering.samples()));
        let count = f64::from(rendering.samples() - first);
        let pixels = sum.pixels.iter().zip(&before.pixels).map(|(&now, &then)| (now - then) / count).collect();
        batches.push(Image { pixels, ..sum.clone() });
        before = sum;
    }
    Ok(Reference::from_batches(&batches))
}
