//! Lights: one file for each kind, with its settings in the scene file, their checks, and how it emits.
//!
//! `registry` lists the kinds. Everything else sees a light through [`Emitter`] and never asks for its kind.

mod cap;
mod cone;
mod disk;
mod emitter;
#[cfg(test)]
mod example;
mod flat;
mod point;
mod receiver;
mod rectangle;
mod registry;
mod sampler;
mod sphere;
mod sun;
#[cfg(test)]
mod tests;
mod tree;

use std::ops::Deref;
use std::sync::Arc;

pub use cone::EmissionCone;
pub use disk::DiskLight;
pub use emitter::{Body, Emitter, LiSample, LightBounds, LightHit, Source, SourceSample};
pub use point::PointLight;
pub use receiver::{Receiver, Side};
pub use rectangle::RectangleLight;
pub use registry::LightDescription;
pub use sampler::{AskedLight, LightSampler, MOST_ASKED};
pub use sphere::SphereLight;
pub use sun::SunLight;

use crate::settings::{Check, JsonPath, Triple};

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

    /// Checks all settings but the name.
    ///
    /// # Errors
    ///
    /// The first setting that makes no sense, with its place, what stands there and what would be right.
    fn check(&self, path: &JsonPath<'_>) -> Check;

    /// The light, from settings that have been checked.
    fn build(&self) -> Arc<dyn Emitter>;
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
    pub fn new(description: &LightDescription) -> Self {
        Self { name: description.name().to_owned(), emitter: description.build() }
    }
}

impl Deref for Light {
    type Target = dyn Emitter;

    fn deref(&self) -> &Self::Target {
        &*self.emitter
    }
}
