//! Which paths the manifold methods look for: over which chains of specular vertices, beginning on which casters, from
//! which receivers. What is not named is marked by what it is: panes and specular meshes cast, everything else
//! receives.

use super::caster::{Caster, casters};
use super::{SpecularEvent, SpecularPath};
use crate::scene::ShadingPoint;
use crate::settings::check::Quoted;
use crate::settings::{Check, JsonPath, SceneError};
use crate::{geometry::SurfaceId, light::SourceSample, scene::Scene};
use clerestory_film::SampleStream;

/// The paths that a manifold method looks for.
#[derive(Clone, Debug)]
pub struct Scope {
    /// The chains, each as what happens from the shading point to the light.
    pub(super) chains: Vec<Vec<SpecularEvent>>,
    /// The first things that they meet.
    pub(super) casters: Vec<Caster>,
    /// For each mesh, whether light is gathered on it.
    receivers: Vec<bool>,
}

impl Scope {
    /// The paths over `chains` (strings of R for reflection and T for transmission, from the surface to the light) that
    /// begin on the named panes and meshes, all by default, and end on the named meshes, all by default.
    pub fn new(
        scene: &Scene,
        chains: &[String],
        casters_named: Option<&[String]>,
        receivers: Option<&[String]>,
    ) -> Self {
        let is_named = |names: Option<&[String]>, name: &str| names.is_none_or(|names| names.iter().any(|n| n == name));
        let name = |caster: &Caster| match *caster {
            Caster::Pane(index) => scene.panes()[index as usize].name.as_str(),
            Caster::Mesh(index) => scene.meshes()[index as usize].name(),
        };
        Self {
            chains: chains.iter().map(|chain| events(chain)).collect(),
            casters: casters(scene).filter(|caster| is_named(casters_named, name(caster))).collect(),
            receivers: scene.meshes().iter().map(|mesh| is_named(receivers, mesh.name())).collect(),
        }
    }

    /// The paths over `chains` that begin on these things, to all meshes.
    pub(super) fn over(scene: &Scene, chains: &[&str], casters: Vec<Caster>) -> Self {
        let chains = chains.iter().map(|chain| events(chain)).collect();
        Self { chains, casters, receivers: vec![true; scene.meshes().len()] }
    }

    /// The same paths, but for those that begin on panes.
    #[must_use]
    pub fn over_meshes(mut self) -> Self {
        self.casters.retain(|caster| matches!(caster, Caster::Mesh(_)));
        self
    }

    /// The point of `light` (an index into the scene) to which paths from `point` are looked for; `None` where no light
    /// is gathered.
    pub(super) fn light_sample(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        stream: &mut SampleStream,
    ) -> Option<SourceSample> {
        let (centre, radius) = scene.specular_ball();
        let source = &scene.lights()[light as usize];
        let sample = source.sample_source(centre, radius, source.random(stream));
        self.receives(scene, point).then_some(sample)
    }

    /// Whether light is gathered at a point.
    fn receives(&self, scene: &Scene, point: &ShadingPoint) -> bool {
        match point.surface {
            SurfaceId::Triangle(triangle) => self.receivers[scene.mesh_of(triangle) as usize],
            _ => true,
        }
    }

    /// Whether a path is one of them.
    pub(super) fn holds(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>) -> bool {
        let is_chain = |chain: &Vec<SpecularEvent>| chain.iter().copied().eq(path.links.iter().map(|link| link.event));
        let Some(first) = path.links.first() else { return false };
        let begins = Caster::of(scene, first)
            .is_some_and(|caster| self.casters.contains(&caster) && caster.owns(scene, point, first));
        begins && self.chains.iter().any(is_chain) && self.receives(scene, point)
    }
}

/// A chain from its letters.
pub(super) fn events(chain: &str) -> Vec<SpecularEvent> {
    let event = |letter| if letter == 'R' { SpecularEvent::Reflection } else { SpecularEvent::Transmission };
    chain.chars().map(event).collect()
}

/// Most specular vertices between a surface and a light that a method looks for.
pub const MOST_SPECULAR_VERTICES: usize = 16;

/// The settings of a scope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScopeSettings<'a> {
    /// Words of R (reflection) and T (transmission), from the surface to the light.
    pub chains: &'a [String],
    /// Names of the panes and specular meshes on which chains begin; all by default.
    pub casters: Option<&'a [String]>,
    /// Names of the meshes on which light is gathered; all by default.
    pub receivers: Option<&'a [String]>,
    /// Whether chains begin on meshes only.
    pub only_meshes: bool,
}

/// In through one face of a pane, and out through the other.
pub(super) fn through_panes() -> Vec<String> {
    vec!["TT".to_owned()]
}

/// Checks the words of chains.
pub(super) fn check_chains(chains: &[String], letters: &str, longest: usize, path: &JsonPath<'_>) -> Check {
    let path = path.member("chains");
    if chains.is_empty() || chains.len() > MOST_SPECULAR_VERTICES {
        return Err(SceneError::value(&path, format_args!("{} words", chains.len()), "1 to 16 words"));
    }
    for (index, chain) in chains.iter().enumerate() {
        let length = chain.chars().count();
        let fits = (1..=longest).contains(&length) && chain.chars().all(|sign| letters.contains(sign));
        if !fits || chains[..index].contains(chain) {
            let letters: Vec<String> = letters.chars().map(String::from).collect();
            let length = if longest == 1 { "one letter of".to_owned() } else { format!("1 to {longest} letters") };
            let expected = format!("another word than those before, of {length} {}", letters.join(" and "));
            return Err(SceneError::value(&path.element(index), Quoted(chain), expected));
        }
    }
    Ok(())
}
