//! What the settings of all methods have in common.

use super::SpecularMethod;
use super::cache::MethodCache;
use super::missing::{Contents, LightGroup, PathClass};
use super::scope::ScopeSettings;
use crate::scene::Scene;
use crate::settings::{Check, JsonPath};

/// What a method wants of light subpaths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightSubpaths {
    /// Nothing.
    None,
    /// They share paths with other techniques. How many there are for each camera sample a pilot tells.
    Shared,
    /// The light plane has this number for each camera sample, and what it finds is left to it alone.
    Alone(u32),
}

/// The settings of an integrator in the scene file, which is path tracing with a specular method.
pub trait MethodSettings {
    /// The chains that it looks for, where they can be chosen.
    fn scope(&self) -> Option<ScopeSettings<'_>> {
        None
    }

    /// Largest number of vertices between camera and light.
    fn max_depth(&self) -> u32;

    /// Checks all settings but `max_depth` and names of other parts of the scene.
    ///
    /// # Errors
    ///
    /// The first setting that makes no sense, with its place, what stands there and what would be right.
    fn check(&self, path: &JsonPath<'_>) -> Check;

    /// The paths, whatever light they come from, that the path tracer leaves to the method and that it misses.
    fn unfound(&self, contents: Contents) -> Vec<PathClass>;

    /// The paths from a group of lights that the method does not look for.
    fn unowned(&self, lights: &LightGroup, contents: Contents) -> Vec<PathClass>;

    /// Whether light of an environment that comes through one pane is looked for. All that an environment sends over
    /// other specular surfaces is left to chance.
    fn finds_environment(&self) -> bool {
        true
    }

    /// What it wants of light subpaths.
    fn light_subpaths(&self) -> LightSubpaths {
        LightSubpaths::None
    }

    /// Where it chooses among methods: what it chooses, in words.
    fn chosen(&self, _: &Scene) -> Vec<String> {
        Vec::new()
    }

    /// The method for a scene; `None` for path tracing alone. What it looks things up in it may keep.
    fn build(&self, scene: &Scene, cache: &MethodCache) -> Option<Box<dyn SpecularMethod>>;
}

/// What the registry needs of a method.
pub trait Method: MethodSettings + Sized {
    /// A line for people who choose a method.
    const SUMMARY: &'static str;

    /// What is rendered to probe the method, as JSON: settings for the scene of the probe, or a scene of its own. There
    /// is one for each form of the method that has code of its own. New ones are appended, because running jobs are
    /// pinned to the digests of those that are there.
    const PROBES: &'static [&'static str];

    /// The usual settings, with what describes the scene rather than the method taken from another.
    fn adopting(other: &dyn MethodSettings) -> Self;
}

/// Largest number of vertices between camera and light, unless the scene says otherwise.
pub(super) const DEFAULT_MAX_DEPTH: u32 = 16;

pub(super) fn default_max_depth() -> u32 {
    DEFAULT_MAX_DEPTH
}
