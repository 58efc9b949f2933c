//! `auto`: each kind of light by the method that is best for it.
//!
//! `choice` says which method finds which light over which things. Here, they are made and asked. The paths of the
//! methods are disjoint by light, chain and first thing, so their light adds up. A path is owned when one of them owns
//! it ([`super::coverage`]).

mod choice;
mod settings;
mod through_panes;

pub use settings::AutoSettings;

use super::cache::MethodCache;
use super::conic::{Conic, ConicSearch};
use super::constraint::ManifoldConstraint;
use super::fnee::{Fnee, FneeSettings};
use super::manifold::WalkSteps;
use super::scope::{Scope, events};
use super::selection::PaneSelection;
use super::sms::{ManifoldEstimator, Sms};
use super::{Arrival, SpecularEvent, SpecularMethod, SpecularPath};
use crate::scene::Scene;
use crate::scene::ShadingPoint;
use choice::{Best, Choice, choose};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;
use through_panes::ThroughPanes;

/// The search through panes, and off them.
const FNEE: FneeSettings = FneeSettings { reflected: true, ..FneeSettings::USUAL };

/// Several methods, each for some of the light.
pub struct Auto {
    parts: Vec<Part>,
}

/// A method, and the light that it finds.
struct Part {
    method: Box<dyn SpecularMethod>,
    lights: Vec<bool>,
    chains: Vec<Vec<SpecularEvent>>,
}

impl Auto {
    /// The methods that are best for a scene.
    pub fn new(scene: &Scene, cache: &MethodCache) -> Self {
        Self { parts: choose(scene).iter().map(|choice| Part::new(scene, choice, cache)).collect() }
    }
}

impl Part {
    fn new(scene: &Scene, choice: &Choice, cache: &MethodCache) -> Self {
        let scope = || Scope::over(scene, &choice.chains, choice.casters.clone());
        let method: Box<dyn SpecularMethod> = match choice.method {
            Best::Rays => Box::new(ThroughPanes::new(&FNEE)),
            Best::Fnee => Box::new(Fnee::from(&FNEE)),
            Best::Conic => Box::new(Conic::new(scene, ConicSearch::default(), scope(), cache)),
            Best::Sms => Box::new(Sms {
                constraint: ManifoldConstraint::default(),
                steps: WalkSteps::default(),
                estimator: ManifoldEstimator::default(),
                selection: PaneSelection::default(),
                scope: scope(),
            }),
        };
        let chains = choice.chains.iter().map(|chain| events(chain)).collect();
        Self { method, lights: choice.lights.clone(), chains }
    }

    fn finds(&self, light: u32, events: impl Iterator<Item = SpecularEvent> + Clone) -> bool {
        self.lights[light as usize] && self.chains.iter().any(|chain| chain.iter().copied().eq(events.clone()))
    }
}

impl SpecularMethod for Auto {
    fn chains(&self) -> Vec<Vec<SpecularEvent>> {
        let mut chains: Vec<Vec<SpecularEvent>> = Vec::new();
        for chain in self.parts.iter().flat_map(|part| &part.chains) {
            if !chains.contains(chain) {
                chains.push(chain.clone());
            }
        }
        chains
    }

    /// Walks through two panes are for lights that cannot be met.
    fn has_double_glazing(&self) -> bool {
        false
    }

    fn sample_li(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        events: &[SpecularEvent],
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        for part in self.parts.iter().filter(|part| part.finds(light, events.iter().copied())) {
            part.method.sample_li(scene, point, light, events, stream, counters, arrive);
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, counters: &mut Counters) -> bool {
        let events = path.links.iter().map(|link| link.event);
        let mut parts = self.parts.iter().filter(|part| part.finds(path.light, events.clone()));
        parts.any(|part| part.method.owns(scene, point, path, counters))
    }

    fn density(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        path: &SpecularPath<'_>,
        counters: &mut Counters,
    ) -> Option<f64> {
        let events = path.links.iter().map(|link| link.event);
        let mut parts = self.parts.iter().filter(|part| part.finds(path.light, events.clone()));
        let owner = parts.find(|part| part.method.owns(scene, point, path, counters))?;
        owner.method.density(scene, point, path, counters)
    }
}
