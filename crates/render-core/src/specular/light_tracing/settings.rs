//! The settings of `light`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::SpecularMethod;
use super::super::cache::MethodCache;
use super::super::missing::{ANY, Contents, LightGroup, PathClass};
use super::super::settings::{LightSubpaths, Method, MethodSettings, default_max_depth};
use crate::scene::Scene;
use crate::settings::check::check_range;
use crate::settings::{Check, JsonPath};

/// Most light subpaths for each camera sample.
const MOST_SUBPATHS: u32 = 256;

/// Light tracing: light subpaths begin on panes, in openings and on lamps, and leave splats where the camera sees their
/// vertices. They bring all light that they can; the rest is found by path tracing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct LightTracingSettings {
    /// Largest number of vertices between camera and light, 1 to 1000.
    #[serde(default = "default_max_depth")]
    #[schemars(range(min = 1, max = 1000))]
    pub max_depth: u32,
    /// Light subpaths for each camera sample, 1 to 256.
    #[serde(default = "default_subpaths")]
    #[schemars(range(min = 1, max = 256))]
    pub subpaths: u32,
}

/// A camera sample finds what little is left; most of the time goes into light subpaths.
fn default_subpaths() -> u32 {
    16
}

impl MethodSettings for LightTracingSettings {
    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_range(self.subpaths, 1, MOST_SUBPATHS, &path.member("subpaths"))
    }

    fn unfound(&self, _: Contents) -> Vec<PathClass> {
        Vec::new()
    }

    fn unowned(&self, lights: &LightGroup, contents: Contents) -> Vec<PathClass> {
        if lights.can_be_met {
            return vec![PathClass::new(lights.all(), ANY)];
        }
        let of = &lights.name;
        let seen =
            format!("light of {of} over specular vertices to a surface that the camera sees through or off others");
        let mut classes = vec![PathClass::new(seen, "[RT]+.*D[RT]+L")];
        if contents.meshes > 0 {
            let text = format!("light of {of} over bodies of glass, water or mirrors to a surface");
            classes.push(PathClass::new(text, ANY));
        }
        classes
    }

    fn finds_environment(&self) -> bool {
        false
    }

    fn light_subpaths(&self) -> LightSubpaths {
        LightSubpaths::Alone(self.subpaths)
    }

    fn build(&self, _: &Scene, _: &MethodCache) -> Option<Box<dyn SpecularMethod>> {
        None
    }
}

impl Method for LightTracingSettings {
    const SUMMARY: &'static str = "Forward light tracing, with path tracing for the rest.";

    const PROBES: &'static [&'static str] = &[r#"{"light": {}}"#];

    fn adopting(other: &dyn MethodSettings) -> Self {
        Self { max_depth: other.max_depth(), subpaths: default_subpaths() }
    }
}
