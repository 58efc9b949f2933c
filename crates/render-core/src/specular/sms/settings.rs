//! The settings of `sms`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::SpecularMethod;
use super::super::cache::MethodCache;
use super::super::constraint::ManifoldConstraint;
use super::super::manifold::WalkSteps;
use super::super::missing::{
    Contents, LightGroup, PathClass, between_the_faces, cut_off, over, over_other, unmarked, unselected,
};
use super::super::scope::{MOST_SPECULAR_VERTICES, Scope, ScopeSettings, check_chains, through_panes};
use super::super::selection::PaneSelection;
use super::super::settings::{Method, MethodSettings, default_max_depth};
use super::Sms;
use crate::scene::Scene;
use crate::settings::check::check_range;
use crate::settings::{Check, JsonPath};

/// Path tracing, with light by way of panes and specular meshes found by specular manifold sampling.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct SmsSettings {
    /// Largest number of vertices between camera and light, 1 to 1000.
    #[serde(default = "default_max_depth")]
    #[schemars(range(min = 1, max = 1000))]
    pub max_depth: u32,
    /// What a vertex on a face has to obey.
    #[serde(default)]
    pub constraint: ManifoldConstraint,
    /// Where walks go that leave a pane.
    #[serde(default)]
    pub steps: WalkSteps,
    /// What is made of the paths that are found.
    #[serde(default)]
    pub estimator: ManifoldEstimator,
    /// Which panes (or specular meshes) are searched.
    #[serde(default)]
    pub selection: PaneSelection,
    /// Which chains of specular vertices between a surface and a light are looked for: each a word of 1 to 16 letters R
    /// (reflection) and T (transmission), from the surface to the light.
    #[serde(default = "through_panes")]
    #[schemars(length(min = 1, max = 16), inner(regex(pattern = "^[RT]{1,16}$")))]
    pub chains: Vec<String>,
    /// Names of the panes and specular meshes on which chains begin; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub casters: Option<Vec<String>>,
    /// Names of the meshes on which their light is gathered; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receivers: Option<Vec<String>>,
}

/// What specular manifold sampling makes of the paths that it finds (Zeltner et al. 2020, section 4.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ManifoldEstimator {
    /// One path, weighted by an unbiased estimate of one over the probability with which a seed leads to it.
    Unbiased {
        /// Largest number of trials of that estimate, 1 to 10000000.
        #[serde(default = "default_manifold_trials")]
        #[schemars(range(min = 1, max = 10_000_000))]
        max_trials: u32,
    },
    /// All distinct paths that a fixed number of seeds finds: too dark where they find few.
    Biased {
        /// Number of seeds, 1 to 10000.
        #[schemars(range(min = 1, max = 10_000))]
        trials: u32,
    },
}

impl Default for SmsSettings {
    fn default() -> Self {
        Self {
            max_depth: default_max_depth(),
            constraint: ManifoldConstraint::default(),
            steps: WalkSteps::default(),
            estimator: ManifoldEstimator::default(),
            selection: PaneSelection::default(),
            chains: through_panes(),
            casters: None,
            receivers: None,
        }
    }
}

impl Default for ManifoldEstimator {
    fn default() -> Self {
        Self::Unbiased { max_trials: default_manifold_trials() }
    }
}

/// As in the scenes of the authors of specular manifold sampling.
fn default_manifold_trials() -> u32 {
    10_000_000
}

impl MethodSettings for SmsSettings {
    fn scope(&self) -> Option<ScopeSettings<'_>> {
        let (casters, receivers) = (self.casters.as_deref(), self.receivers.as_deref());
        Some(ScopeSettings { chains: &self.chains, casters, receivers, only_meshes: false })
    }

    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_chains(&self.chains, "RT", MOST_SPECULAR_VERTICES, path)?;
        let path = path.member("estimator");
        match self.estimator {
            ManifoldEstimator::Unbiased { max_trials } => {
                check_range(max_trials, 1, 10_000_000, &path.member("unbiased").member("max_trials"))
            }
            ManifoldEstimator::Biased { trials } => {
                check_range(trials, 1, 10_000, &path.member("biased").member("trials"))
            }
        }
    }

    fn unfound(&self, _: Contents) -> Vec<PathClass> {
        let chains = self.chains.join(" or ");
        let text = match self.estimator {
            ManifoldEstimator::Unbiased { max_trials } => {
                format!("paths over {chains} (chains) that a random seed {}", cut_off(max_trials))
            }
            ManifoldEstimator::Biased { trials } => format!(
                "the part (1 - p)^{trials} of the light of each path over {chains} (chains), p being the probability \
                 with which a random seed finds it (trials)"
            ),
        };
        vec![PathClass::new(text, over(&self.chains))]
    }

    fn unowned(&self, lights: &LightGroup, contents: Contents) -> Vec<PathClass> {
        let of = &lights.name;
        let mut classes = vec![over_other(of, &self.chains)];
        classes.extend((contents.panes > 0).then(|| between_the_faces(of, None)));
        classes.extend(unmarked(of, self.casters.as_deref(), self.receivers.as_deref()));
        classes.extend(unselected(of, self.selection));
        classes
    }

    fn build(&self, scene: &Scene, _: &MethodCache) -> Option<Box<dyn SpecularMethod>> {
        let Self { constraint, steps, estimator, selection, .. } = *self;
        let scope = Scope::new(scene, &self.chains, self.casters.as_deref(), self.receivers.as_deref());
        Some(Box::new(Sms { constraint, steps, estimator, selection, scope }))
    }
}

impl Method for SmsSettings {
    const SUMMARY: &'static str = "Light through glass by specular manifold sampling.";

    const PROBES: &'static [&'static str] = &[
        r#"{"sms": {"estimator": {"unbiased": {"max_trials": 20}}}}"#,
        r#"{"sms": {"constraint": "half_vector", "estimator": {"biased": {"trials": 4}}}}"#,
        r#"{"sms": {"chains": ["T"], "casters": ["water"], "estimator": {"biased": {"trials": 4}}}}"#,
        r#"{"sms": {"steps": "published", "selection": "random", "estimator": {"biased": {"trials": 4}}}}"#,
    ];

    fn adopting(other: &dyn MethodSettings) -> Self {
        let scope = other.scope();
        Self {
            max_depth: other.max_depth(),
            chains: scope.map_or_else(through_panes, |scope| scope.chains.to_vec()),
            casters: scope.and_then(|scope| scope.casters.map(<[String]>::to_vec)),
            receivers: scope.and_then(|scope| scope.receivers.map(<[String]>::to_vec)),
            ..Self::default()
        }
    }
}
