//! The settings of `conic`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::SpecularMethod;
use super::super::cache::MethodCache;
use super::super::missing::{ANY, Contents, LightGroup, PathClass, other_than, over, unmarked};
use super::super::scope::{Scope, ScopeSettings, check_chains};
use super::super::settings::{Method, MethodSettings, default_max_depth};
use super::Conic;
use crate::scene::Scene;
use crate::settings::{Check, JsonPath};

/// Path tracing, with all light over one interface, a specular mesh, found on the curves along which surface, light and
/// normal are coplanar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct ConicSettings {
    /// Largest number of vertices between camera and light, 1 to 1000.
    #[serde(default = "default_max_depth")]
    #[schemars(range(min = 1, max = 1000))]
    pub max_depth: u32,
    /// Which paths are found.
    #[serde(default)]
    pub search: ConicSearch,
    /// What happens between a surface and a light: `T`, refraction, or `R`, reflection, or both in turn.
    #[serde(default = "through_one_interface")]
    #[schemars(length(min = 1, max = 2), inner(regex(pattern = "^[RT]$")))]
    pub chains: Vec<String>,
    /// Names of the specular meshes on which it happens; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub casters: Option<Vec<String>>,
    /// Names of the meshes on which the light is gathered; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receivers: Option<Vec<String>>,
}

/// One refraction.
pub(crate) fn through_one_interface() -> Vec<String> {
    vec!["T".to_owned()]
}

/// Which paths over a mesh `conic` finds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ConicSearch {
    /// All, with rays to where a surface focuses a light that has an extent.
    #[default]
    Complete,
    /// All, without these rays.
    WithoutRays,
    /// The first along the curve from the straight line to the light (Granizo-Hidalgo and Holzschuch 2024).
    Published,
}

impl MethodSettings for ConicSettings {
    fn scope(&self) -> Option<ScopeSettings<'_>> {
        let (casters, receivers) = (self.casters.as_deref(), self.receivers.as_deref());
        Some(ScopeSettings { chains: &self.chains, casters, receivers, only_meshes: true })
    }

    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_chains(&self.chains, "RT", 1, path)
    }

    fn unfound(&self, _: Contents) -> Vec<PathClass> {
        match self.search {
            ConicSearch::Complete | ConicSearch::WithoutRays => Vec::new(),
            ConicSearch::Published => vec![PathClass::new(
                "paths over a specular mesh but for the first that a walk from the straight line to the light meets",
                over(&self.chains),
            )],
        }
    }

    fn unowned(&self, lights: &LightGroup, contents: Contents) -> Vec<PathClass> {
        let chains = self.chains.join(", ");
        let text = format!("{}, but for that over one specular mesh ({chains}; chains)", lights.all());
        let paths = if contents.panes > 0 { ANY.to_owned() } else { other_than(&self.chains) };
        let mut classes = vec![PathClass::new(text, paths)];
        classes.extend(unmarked(&lights.name, self.casters.as_deref(), self.receivers.as_deref()));
        classes
    }

    fn build(&self, scene: &Scene, cache: &MethodCache) -> Option<Box<dyn SpecularMethod>> {
        let scope = Scope::new(scene, &self.chains, self.casters.as_deref(), self.receivers.as_deref());
        Some(Box::new(Conic::new(scene, self.search, scope.over_meshes(), cache)))
    }
}

impl Method for ConicSettings {
    const SUMMARY: &'static str = "All light over one specular mesh, such as the surface of water.";

    const PROBES: &'static [&'static str] = &[
        r#"{"conic": {"casters": ["water"], "chains": ["T", "R"]}}"#,
        r#"{"conic": {"casters": ["water"], "search": "published"}}"#,
    ];

    fn adopting(other: &dyn MethodSettings) -> Self {
        let scope = other.scope();
        let single = |scope: ScopeSettings<'_>| {
            let chains: Vec<String> = scope.chains.iter().filter(|chain| chain.len() == 1).cloned().collect();
            (!chains.is_empty()).then_some(chains)
        };
        Self {
            max_depth: other.max_depth(),
            search: ConicSearch::default(),
            chains: scope.and_then(single).unwrap_or_else(through_one_interface),
            casters: scope.and_then(|scope| scope.casters.map(<[String]>::to_vec)),
            receivers: scope.and_then(|scope| scope.receivers.map(<[String]>::to_vec)),
        }
    }
}
