//! The settings of `path`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::SpecularMethod;
use super::super::cache::MethodCache;
use super::super::missing::{ANY, Contents, LightGroup, PathClass};
use super::super::settings::{Method, MethodSettings, default_max_depth};
use crate::scene::Scene;
use crate::settings::{Check, JsonPath};

/// Path tracing alone: light through glass is found by chance, light of point lights through glass not at all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct PathSettings {
    /// Largest number of vertices between camera and light, 1 to 1000.
    #[serde(default = "default_max_depth")]
    #[schemars(range(min = 1, max = 1000))]
    pub max_depth: u32,
}

impl MethodSettings for PathSettings {
    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn check(&self, _: &JsonPath<'_>) -> Check {
        Ok(())
    }

    fn unfound(&self, _: Contents) -> Vec<PathClass> {
        Vec::new()
    }

    fn unowned(&self, lights: &LightGroup, _: Contents) -> Vec<PathClass> {
        vec![PathClass::new(lights.all(), ANY)]
    }

    fn finds_environment(&self) -> bool {
        false
    }

    fn build(&self, _: &Scene, _: &MethodCache) -> Option<Box<dyn SpecularMethod>> {
        None
    }
}

impl Method for PathSettings {
    const SUMMARY: &'static str = "Path tracing alone.";

    const PROBES: &'static [&'static str] = &[r#"{"path": {}}"#];

    fn adopting(other: &dyn MethodSettings) -> Self {
        Self { max_depth: other.max_depth() }
    }
}
