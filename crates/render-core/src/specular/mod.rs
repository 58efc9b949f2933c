//! How light reaches a shading point over glass, water and mirrors: one question, and one folder for each method that
//! answers it.
//!
//! The path tracer asks [`SpecularMethod::sample_li`]: which light arrives at this point, from this light, over
//! specular surfaces? [`cone`] samples directions and sees whether they reach the light; [`fnee`] solves for the paths
//! that do. Both look for them in the same window ([`window`]). [`sms`] and [`mnee`] walk to them, through panes and
//! over specular meshes, and [`conic`] finds all over one mesh. [`auto`] chooses among them. The light of an
//! environment is found in one way beside all methods (`environment`). Which paths a method owns, and the path tracer
//! therefore leaves to it, is a function of the path ([`coverage`]).

mod assumed_density;
pub mod auto;
mod block_tridiagonal;
mod bounded;
pub mod cache;
mod caster;
mod certificate;
mod chain;
pub mod cone;
pub mod conic;
pub mod constraint;
pub mod coverage;
#[cfg(test)]
mod cutting_tests;
mod deflection;
mod direction_bounds;
pub(crate) mod double_glazing;
mod effort;
pub mod enumeration;
pub(crate) mod environment;
pub mod fermat;
pub mod fnee;
pub mod light_tracing;
mod light_view;
pub mod manifold;
pub mod missing;
pub mod mnee;
pub mod newton;
mod passage;
pub mod path;
#[cfg(test)]
mod polarisation_tests;
pub mod registry;
#[cfg(test)]
mod rotated_sheet_tests;
pub mod scope;
mod second_panes;
pub mod selection;
pub mod settings;
pub mod side;
pub mod sms;
#[cfg(test)]
pub(crate) mod testing;
mod traced_path;
mod trials;
mod warp;
mod widest;
pub mod window;

use glam::DVec3;

use crate::geometry::{Ray, SurfaceId};
use crate::light::LightHit;
use crate::scene::{Scene, ShadingPoint};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

pub use crate::bsdf::SpecularEvent;
pub use coverage::{Link, SpecularPath};

/// Light that arrives at a shading point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Unit direction towards the light's last vertex.
    pub direction: DVec3,
    /// Estimate of radiance times solid angle [W/m2]; the cosine at the shading point is not included.
    pub weight: DVec3,
    /// Its path, where the method can tell how densely it finds such; `None` where the path is the method's alone.
    pub path: Option<SampledPath>,
}

/// The last part of a path that a method has found, and how densely it finds such.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledPath {
    /// About the expected number of times that the method finds it, for each unit of solid angle at the shading point:
    /// what [`SpecularMethod::density`] answers.
    pub density: f64,
    /// The specular surface next to the light.
    pub surface: SurfaceId,
    /// The ray from there to the light.
    pub exit: Ray,
    /// Where it meets the light.
    pub hit: LightHit,
    /// The fraction of the light that the faces let through or mirror, without what the glass absorbs.
    pub transmitted: f64,
}

/// In through one face of a pane, and out through the other.
pub const THROUGH_PANE: [SpecularEvent; 2] = [SpecularEvent::Transmission; 2];

/// In and out of one pane, and in and out of another.
pub const THROUGH_TWO_PANES: [SpecularEvent; 4] = [SpecularEvent::Transmission; 4];

/// A method that finds the light that arrives by way of specular surfaces.
pub trait SpecularMethod: Send + Sync {
    /// The chains that the method looks for, each as what happens from the shading point to the light.
    fn chains(&self) -> Vec<Vec<SpecularEvent>>;

    /// Whether it is asked for light that can be met and comes through two panes close behind each other, rather than
    /// the way that every other method shares (`double_glazing`).
    fn has_double_glazing(&self) -> bool {
        self.chains().iter().any(|chain| *chain == THROUGH_TWO_PANES)
    }

    /// Estimates the light of `light` (an index into the scene) that arrives at `point` by the paths over the chain
    /// `events` that the method owns, and hands each piece to `arrive`. The expectation of the sum over all pieces is
    /// the light that arrives.
    #[expect(clippy::too_many_arguments, reason = "one estimate depends on all of them, and none belong together")]
    fn sample_li(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        events: &[SpecularEvent],
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    );

    /// Whether the method looks for this path to `point`: a function of these alone, so that the path tracer can own
    /// exactly the paths that the method does not look for.
    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, counters: &mut Counters) -> bool;

    /// About the expected number of times that the method finds a path which it owns, for each unit of solid angle at
    /// `point`: [`SampledPath::density`], to rounding. It is positive only if the method may find the path. `None`
    /// where it cannot tell, and no other technique may find the path.
    fn density(
        &self,
        _scene: &Scene,
        _point: &ShadingPoint,
        _path: &SpecularPath<'_>,
        _counters: &mut Counters,
    ) -> Option<f64> {
        None
    }
}
