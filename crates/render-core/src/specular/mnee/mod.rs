//! `mnee`: manifold next event estimation (Hanika, Droske, Fascione 2015).
//!
//! One manifold walk (`manifold`) on half vectors starts from the straight line to the light. It finds one path at
//! most, over as many refractions as that line has surfaces. It is a function of the shading point and the point on the
//! light, so its light counts with weight one. Missed paths are either left to chance or dropped. Chance is unbiased: a
//! path that it finds counts if the walk from its own ends does not lead to it.

mod settings;

pub use settings::{MissedPaths, MneeSettings};

use crate::specular::constraint::ManifoldConstraint;
use crate::specular::manifold::WalkSteps;
use smallvec::SmallVec;

use super::caster::Caster;
use super::chain::Chain;
use super::coverage::Link;
use super::manifold::{ManifoldWalk, SolvedChain};
use super::scope::Scope;
use super::{Arrival, SpecularEvent, SpecularMethod, SpecularPath};
use crate::scene::ShadingPoint;
use crate::{light::Source, scene::Scene};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

/// Manifold next event estimation.
#[derive(Clone, Debug)]
pub struct Mnee {
    /// What happens to the paths that the walk does not find.
    pub missed: MissedPaths,
    /// Which paths are looked for.
    pub scope: Scope,
}

impl SpecularMethod for Mnee {
    fn chains(&self) -> Vec<Vec<SpecularEvent>> {
        self.scope.chains.clone()
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
        if let Some(sample) = self.scope.light_sample(scene, point, light, stream)
            && let Some(path) = self.path(scene, point, (sample.source, sample.triangle), events, counters)
            && let Some(arrival) = path.arrival(scene, point, light, &sample, counters)
        {
            arrive(arrival);
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, counters: &mut Counters) -> bool {
        if !self.scope.holds(scene, point, path) {
            return false;
        }
        match self.missed {
            MissedPaths::Dropped => true,
            MissedPaths::LeftToChance => {
                let events: SmallVec<[SpecularEvent; 2]> = path.links.iter().map(|link| link.event).collect();
                let found = self.path(scene, point, (path.source, path.triangle), &events, counters);
                found.is_some_and(|found| found.is_at(path.links[0].position))
            }
        }
    }
}

impl Mnee {
    /// The path to which the walk leads. The source may be on a triangle of the scene.
    fn path(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        (source, triangle): (Source, Option<u32>),
        events: &[SpecularEvent],
        counters: &mut Counters,
    ) -> Option<SolvedChain> {
        if events.contains(&SpecularEvent::Reflection) {
            return None;
        }
        let seed = Chain::along_straight_line(scene, point, (source, triangle), events.len(), counters)?;
        let first = seed.vertices.first()?;
        let link = Link {
            event: events[0],
            surface: first.surface,
            position: first.at.position,
            direction: (first.at.position - point.position).normalize(),
        };
        let caster = Caster::of(scene, &link).filter(|caster| self.scope.casters.contains(caster))?;
        let seen = caster.seen_from(scene, point)?;
        let (constraint, steps) = (ManifoldConstraint::HalfVector, WalkSteps::default());
        let walk = ManifoldWalk { scene, point, source, caster: seen, events, constraint, steps };
        walk.walk_from(seed, counters)
    }
}
