//! The settings of `auto`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::SpecularMethod;
use super::super::cache::MethodCache;
use super::super::missing::{Contents, LightGroup, PathClass, between_the_faces, other_than};
use super::super::settings::{LightSubpaths, Method, MethodSettings, default_max_depth};
use super::super::side::GRAZING_COSINE;
use super::super::sms::SmsSettings;
use super::choice::choose;
use super::{Auto, FNEE};
use crate::scene::Scene;
use crate::settings::{Check, JsonPath};

/// Path tracing, with each kind of light over glass, water and mirrors found by the method that is best for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct AutoSettings {
    /// Largest number of vertices between camera and light, 1 to 1000.
    #[serde(default = "default_max_depth")]
    #[schemars(range(min = 1, max = 1000))]
    pub max_depth: u32,
}

impl Default for AutoSettings {
    fn default() -> Self {
        Self { max_depth: default_max_depth() }
    }
}

impl MethodSettings for AutoSettings {
    fn max_depth(&self) -> u32 {
        self.max_depth
    }

    fn check(&self, _: &JsonPath<'_>) -> Check {
        Ok(())
    }

    fn light_subpaths(&self) -> LightSubpaths {
        LightSubpaths::Shared
    }

    fn unfound(&self, contents: Contents) -> Vec<PathClass> {
        let panes = (contents.panes > 0 && contents.has_points).then(|| FNEE.unfound(contents));
        let several = ["TT", "TTTT", "RTT", "TTT", "TTR"].map(str::to_owned).to_vec();
        let walks = SmsSettings { chains: several, ..SmsSettings::default() };
        let walks = (contents.meshes > 0 || contents.panes > 1).then(|| walks.unfound(contents));
        panes.into_iter().chain(walks).flatten().collect()
    }

    fn unowned(&self, lights: &LightGroup, contents: Contents) -> Vec<PathClass> {
        let of = &lights.name;
        let text = format!(
            "light of {of} over several panes, bodies of glass, water or mirrors in a row, or reflected within one of \
             them, where no chosen method looks for it"
        );
        // Of meshes, only closed ones are always searched for TT.
        let single: &[&str] = if contents.meshes > 0 { &["T", "R"] } else { &["T", "R", "TT"] };
        let single: Vec<String> = single.iter().map(|chain| (*chain).to_owned()).collect();
        let mut classes = vec![PathClass::new(text, other_than(&single))];
        if contents.panes > 0 {
            classes.push(between_the_faces(of, Some(libm::asin(GRAZING_COSINE).to_degrees())));
        }
        classes
    }

    fn chosen(&self, scene: &Scene) -> Vec<String> {
        let environment = scene.light_sampler().environment().filter(|_| !scene.panes().is_empty());
        let of_environment = environment.map(|light| {
            format!("sampling of the panes finds light of \"{}\" through panes", scene.lights()[light as usize].name)
        });
        choose(scene).iter().map(|choice| choice.describe(scene)).chain(of_environment).collect()
    }

    fn build(&self, scene: &Scene, cache: &MethodCache) -> Option<Box<dyn SpecularMethod>> {
        Some(Box::new(Auto::new(scene, cache)))
    }
}

impl Method for AutoSettings {
    const SUMMARY: &'static str = "Each kind of light over glass, water and mirrors by the method that is best for it.";

    const PROBES: &'static [&'static str] = &[r#"{"auto": {}}"#, include_str!("probe.json")];

    fn adopting(other: &dyn MethodSettings) -> Self {
        Self { max_depth: other.max_depth() }
    }
}
