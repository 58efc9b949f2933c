//! The settings of `mnee`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::SpecularMethod;
use super::super::cache::MethodCache;
use super::super::missing::{ANY, Contents, LightGroup, PathClass, over, over_other, unmarked};
use super::super::scope::{MOST_SPECULAR_VERTICES, Scope, ScopeSettings, check_chains, through_panes};
use super::super::settings::{Method, MethodSettings, default_max_depth};
use super::Mnee;
use crate::scene::Scene;
use crate::settings::{Check, JsonPath};

/// Path tracing, with one path through what refracts on the straight line to a light found by a manifold walk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct MneeSettings {
    /// Largest number of vertices between camera and light, 1 to 1000.
    #[serde(default = "default_max_depth")]
    #[schemars(range(min = 1, max = 1000))]
    pub max_depth: u32,
    /// What happens to the paths that the walk does not find.
    #[serde(default)]
    pub missed: MissedPaths,
    /// Which chains of specular vertices between a surface and a light are looked for: each a word of 1 to 16 letters T
    /// (transmission).
    #[serde(default = "through_panes")]
    #[schemars(length(min = 1, max = 16), inner(regex(pattern = "^T{1,16}$")))]
    pub chains: Vec<String>,
    /// Names of the panes and specular meshes on which chains begin; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub casters: Option<Vec<String>>,
    /// Names of the meshes on which their light is gathered; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receivers: Option<Vec<String>>,
}

/// What manifold next event estimation does about the paths through a pane that its walk does not find.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MissedPaths {
    /// They count when chance finds them: unbiased, but for point lights, which chance never meets.
    #[default]
    LeftToChance,
    /// They are dropped: dark where there is more than one path, and without the noise of rare finds.
    Dropped,
}

impl MethodSettings for MneeSettings {
    fn scope(&self) -> Option<ScopeSettings<'_>> {
        let (casters, receivers) = (self.casters.as_deref(), self.receivers.as_deref());
        Some(ScopeSettings { chains: &self.chains, casters, receivers, only_meshes: false })
    }

    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_chains(&self.chains, "T", MOST_SPECULAR_VERTICES, path)
    }

    fn unfound(&self, _: Contents) -> Vec<PathClass> {
        match self.missed {
            MissedPaths::LeftToChance => Vec::new(),
            MissedPaths::Dropped => vec![PathClass::new(
                "paths through a pane but for the one that a walk from the straight line to the light finds",
                over(&self.chains),
            )],
        }
    }

    fn unowned(&self, lights: &LightGroup, _: Contents) -> Vec<PathClass> {
        let of = &lights.name;
        let is_named_already = lights.can_be_met && self.missed == MissedPaths::Dropped;
        let first = if is_named_already {
            over_other(of, &self.chains)
        } else {
            let found = self.chains.join(" or ");
            let by = "that a walk from the straight line to the light finds";
            PathClass::new(format!("{}, but for the one path over {found} {by}", lights.all()), ANY)
        };
        let mut classes = vec![first];
        classes.extend(unmarked(of, self.casters.as_deref(), self.receivers.as_deref()));
        classes
    }

    fn build(&self, scene: &Scene, _: &MethodCache) -> Option<Box<dyn SpecularMethod>> {
        let scope = Scope::new(scene, &self.chains, self.casters.as_deref(), self.receivers.as_deref());
        Some(Box::new(Mnee { missed: self.missed, scope }))
    }
}

impl Method for MneeSettings {
    const SUMMARY: &'static str = "Light through glass by one manifold walk from the straight line to the light.";

    const PROBES: &'static [&'static str] =
        &[r#"{"mnee": {}}"#, r#"{"mnee": {"chains": ["T"], "casters": ["water"]}}"#];

    fn adopting(other: &dyn MethodSettings) -> Self {
        let scope = other.scope();
        Self {
            max_depth: other.max_depth(),
            missed: MissedPaths::default(),
            chains: scope.map_or_else(through_panes, |scope| scope.chains.to_vec()),
            casters: scope.and_then(|scope| scope.casters.map(<[String]>::to_vec)),
            receivers: scope.and_then(|scope| scope.receivers.map(<[String]>::to_vec)),
        }
    }
}
