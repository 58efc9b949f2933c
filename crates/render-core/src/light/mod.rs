//! Lights: one file for each kind, with its settings in the scene file, their checks, and how it emits.
//!
//! `registry` lists the kinds. Everything else sees a light through [`Emitter`] and never asks for its kind.

mod assets;
mod cap;
mod cone;
#[cfg(test)]
mod density_tests;
mod disk;
mod emitter;
mod environment;
mod environment_map;
mod environment_sky;
#[cfg(test)]
mod example;
mod flat;
mod mesh;
mod point;
mod receiver;
mod rectangle;
mod registry;
mod sampler;
mod sphere;
mod sphere_density;
mod spot;
mod sun;
#[cfg(test)]
mod tests;
mod tree;

use std::ops::Deref;
use std::sync::Arc;

pub use assets::LightAssets;
pub(crate) use assets::{ShiningPicture, ShiningSurface};
pub use cone::EmissionCone;
pub use disk::DiskLight;
pub use emitter::{Body, Emission, Emitter, LiSample, LightBounds, LightHit, Source, SourceSample};
pub use environment::{EnvironmentLight, EnvironmentRadiance};
pub use environment_map::{EnvironmentMap, EnvironmentMaps};
pub use environment_sky::{SkyModel, SkySettings};
pub use mesh::MeshLight;
pub use point::PointLight;
pub use receiver::{Receiver, Side};
pub use rectangle::RectangleLight;
pub use registry::LightDescription;
pub(crate) use sampler::with_finer_places;
pub use sampler::{AskedLight, LightSampler, MOST_ASKED};
pub use sphere::SphereLight;
pub use spot::SpotLight;
pub use sun::SunLight;
pub(crate) use tree::{Chosen, Cluster, LightTree};

use clerestory_film::SampleStream;
use glam::DVec2;

use crate::exchange::LightModel;
use crate::settings::{Check, JsonPath, Triple};
use crate::texture::{Bitmaps, TextureUse};

/// A light is seldom met where its solid angle is below this, steradians. An image of some thousand samples then shows
/// it as single bright pixels.
pub(crate) const SELDOM_MET: f64 = std::f64::consts::PI / 1000.0;

/// The settings of a light in the scene file.
pub trait LightSettings {
    /// Its name.
    fn name(&self) -> &str;

    /// The member that says where it is; `None` for a light that is nowhere.
    fn place(&self) -> Option<&'static str>;

    /// Direction from the scene towards a distant light; `None` for all others.
    fn direction(&self) -> Option<Triple> {
        None
    }

    /// The same, to be changed.
    fn direction_mut(&mut self) -> Option<&mut Triple> {
        None
    }

    /// Whether the light is a point ([`Emitter::is_delta`]).
    fn is_delta(&self) -> bool {
        false
    }

    /// Whether the light is all around ([`Emitter::is_environment`]).
    fn is_environment(&self) -> bool {
        false
    }

    /// The picture of radiance that it names, with its place below the settings.
    fn picture(&self) -> Option<(String, &str)> {
        None
    }

    /// Name of the mesh of the scene that is the light ([`Emitter::triangles`]).
    fn mesh(&self) -> Option<&str> {
        None
    }

    /// The picture over that mesh, with its place below the settings.
    fn texture(&self) -> Option<TextureUse<'_>> {
        None
    }

    /// Checks all settings but the name.
    ///
    /// # Errors
    ///
    /// The first setting that makes no sense, with its place, what stands there and what would be right.
    fn check(&self, path: &JsonPath<'_>) -> Check;

    /// What it is for other programs; `None` if no model describes it.
    fn model(&self, _bitmaps: &Bitmaps<'_>) -> Option<LightModel> {
        None
    }

    /// The light, from settings that have been checked.
    fn build(&self, assets: &LightAssets) -> Arc<dyn Emitter>;
}

/// A light of the scene.
#[derive(Clone, Debug)]
pub struct Light {
    /// Its name in the scene file.
    pub name: String,
    emitter: Arc<dyn Emitter>,
}

impl Light {
    /// The light of settings that have been checked.
    pub fn new(description: &LightDescription, assets: &LightAssets) -> Self {
        Self { name: description.name().to_owned(), emitter: description.build(assets) }
    }

    /// Two numbers in [0, 1) by which a point of it may be drawn. Where the first chooses among many triangles, it has
    /// more places than others.
    pub(crate) fn random(&self, stream: &mut SampleStream) -> DVec2 {
        let random = stream.next_2d();
        if self.triangles().is_none() { random } else { DVec2::new(with_finer_places(random.x, stream), random.y) }
    }
}

impl Deref for Light {
    type Target = dyn Emitter;

    fn deref(&self) -> &Self::Target {
        &*self.emitter
    }
}
