//! The settings of `fnee`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::SpecularMethod;
use super::super::cache::MethodCache;
use super::super::missing::{Contents, LightGroup, PathClass, THROUGH_ONE_PANE, cut_off, unowned_by_panes};
use super::super::selection::PaneSelection;
use super::super::settings::{DEFAULT_MAX_DEPTH, Method, MethodSettings, default_max_depth};
use super::Fnee;
use super::solver::FneeSolver;
use crate::scene::Scene;
use crate::settings::check::check_range;
use crate::settings::{Check, JsonPath, is_default};

/// Path tracing, with light through panes found by Fermat next event estimation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct FneeSettings {
    /// Largest number of vertices between camera and light, 1 to 1000.
    #[serde(default = "default_max_depth")]
    #[schemars(range(min = 1, max = 1000))]
    pub max_depth: u32,
    /// How stationary paths are searched for.
    #[serde(default)]
    pub solver: FneeSolver,
    /// Which panes are searched.
    #[serde(default)]
    pub selection: PaneSelection,
    /// Largest number of trials when an inverse probability is estimated, 1 to 1000000.
    #[serde(default = "default_max_trials")]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub max_trials: u32,
    /// Whether light that the outside of a pane reflects is searched for, too.
    #[serde(default, skip_serializing_if = "is_default")]
    pub reflected: bool,
}

fn default_max_trials() -> u32 {
    FneeSettings::USUAL.max_trials
}

impl FneeSettings {
    /// The settings of a scene that names none.
    pub(in super::super) const USUAL: Self = Self {
        max_depth: DEFAULT_MAX_DEPTH,
        solver: FneeSolver::Complete,
        selection: PaneSelection::All,
        max_trials: 1000,
        reflected: false,
    };
}

impl From<&FneeSettings> for Fnee {
    fn from(settings: &FneeSettings) -> Self {
        let FneeSettings { solver, selection, max_trials, reflected, .. } = *settings;
        Self { solver, selection, max_trials, reflected }
    }
}

impl MethodSettings for FneeSettings {
    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn check(&self, path: &JsonPath<'_>) -> Check {
        check_range(self.max_trials, 1, 1_000_000, &path.member("max_trials"))
    }

    fn unfound(&self, _: Contents) -> Vec<PathClass> {
        let cut_off = cut_off(self.max_trials);
        match self.solver {
            FneeSolver::Complete => {
                let text = format!("paths through a pane that the enumeration misses and a random seed {cut_off}");
                let through = PathClass::new(text, THROUGH_ONE_PANE);
                let text = format!("paths off the outside of a pane that a random seed {cut_off}");
                let off = self.reflected.then(|| PathClass::new(text, ".*DRL"));
                [through].into_iter().chain(off).collect()
            }
            FneeSolver::Published => {
                let (ways, paths) = if self.reflected {
                    ("through a pane or off its outside", ".*D(TT|R)L")
                } else {
                    ("through a pane", THROUGH_ONE_PANE)
                };
                let saddles = "along which the optical length is no minimum: the published solver finds almost none";
                vec![
                    PathClass::new(format!("paths {ways} {saddles}"), paths),
                    PathClass::new(format!("paths {ways} that a random seed {cut_off}"), paths),
                ]
            }
        }
    }

    fn unowned(&self, lights: &LightGroup, contents: Contents) -> Vec<PathClass> {
        unowned_by_panes(&lights.name, contents, self.selection, self.reflected)
    }

    fn build(&self, _: &Scene, _: &MethodCache) -> Option<Box<dyn SpecularMethod>> {
        Some(Box::new(Fnee::from(self)))
    }
}

impl Method for FneeSettings {
    const SUMMARY: &'static str = "Light through glass by Fermat next event estimation.";

    const PROBES: &'static [&'static str] =
        &[r#"{"fnee": {"reflected": true}}"#, r#"{"fnee": {"solver": "published", "max_trials": 20}}"#];

    fn adopting(other: &dyn MethodSettings) -> Self {
        Self { max_depth: other.max_depth(), ..Self::USUAL }
    }
}
