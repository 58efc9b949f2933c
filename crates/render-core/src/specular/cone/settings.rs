//! The settings of `cone`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::SpecularMethod;
use super::super::cache::MethodCache;
use super::super::missing::{ANY, Contents, LightGroup, PathClass, unowned_by_panes};
use super::super::selection::PaneSelection;
use super::super::settings::{Method, MethodSettings, default_max_depth};
use super::Cone;
use crate::scene::Scene;
use crate::settings::{Check, JsonPath};

/// Path tracing, with light through panes found by sampling the cone from which the light can come.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct ConeSettings {
    /// Largest number of vertices between camera and light, 1 to 1000.
    #[serde(default = "default_max_depth")]
    #[schemars(range(min = 1, max = 1000))]
    pub max_depth: u32,
}

impl MethodSettings for ConeSettings {
    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn check(&self, _: &JsonPath<'_>) -> Check {
        Ok(())
    }

    fn unfound(&self, _: Contents) -> Vec<PathClass> {
        Vec::new()
    }

    fn unowned(&self, lights: &LightGroup, contents: Contents) -> Vec<PathClass> {
        if lights.can_be_met {
            unowned_by_panes(&lights.name, contents, PaneSelection::All, false)
        } else {
            vec![PathClass::new(lights.all(), ANY)]
        }
    }

    fn build(&self, _: &Scene, _: &MethodCache) -> Option<Box<dyn SpecularMethod>> {
        Some(Box::new(Cone))
    }
}

impl Method for ConeSettings {
    const SUMMARY: &'static str = "Light through glass by sampling the cone from which it can come.";

    const PROBES: &'static [&'static str] = &[r#"{"cone": {}}"#];

    fn adopting(other: &dyn MethodSettings) -> Self {
        Self { max_depth: other.max_depth() }
    }
}
