//! `sms`: specular manifold sampling (Zeltner et al. 2020).
//!
//! Seeds are uniform over each caster, a pane or a specular mesh. Manifold walks (`manifold`) lead from them to paths.
//! Their light is estimated from how often they are found (`trials`). Every caster gets an estimate of its own, as in
//! the authors' code, unless the selection of panes says otherwise. A path belongs to the caster that it meets first.

mod settings;

pub use settings::{ManifoldEstimator, SmsSettings};

use crate::specular::constraint::ManifoldConstraint;
use crate::specular::manifold::WalkSteps;
use crate::specular::selection::PaneSelection;
use glam::DVec3;

use super::caster::Caster;
use super::manifold::{ManifoldWalk, SolvedChain};
use super::scope::Scope;
use super::selection::Choice;
use super::trials::RandomSearch;
use super::{Arrival, SpecularEvent, SpecularMethod, SpecularPath, THROUGH_PANE};
use crate::scene::ShadingPoint;
use crate::{light::Source, scene::Scene};
use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, TrialStream};

/// Specular manifold sampling.
#[derive(Clone, Debug)]
pub struct Sms {
    /// What a vertex has to obey.
    pub constraint: ManifoldConstraint,
    /// Where walks go that leave a pane.
    pub steps: WalkSteps,
    /// What is made of the paths that are found.
    pub estimator: ManifoldEstimator,
    /// Which casters are searched.
    pub selection: PaneSelection,
    /// Which paths are looked for.
    pub scope: Scope,
}

/// Manifold walks through a pane from chosen places, to look at what they converge to.
pub struct ManifoldSearch<'a>(ManifoldWalk<'a>);

impl<'a> ManifoldSearch<'a> {
    /// Walks from `point` to a source through a pane, an index into the scene; `None` when no path can exist.
    pub fn new(
        scene: &'a Scene,
        point: &'a ShadingPoint,
        source: Source,
        pane: u32,
        constraint: ManifoldConstraint,
        steps: WalkSteps,
    ) -> Option<Self> {
        let caster = Caster::Pane(pane).seen_from(scene, point)?;
        Some(Self(ManifoldWalk { scene, point, source, caster, events: &THROUGH_PANE, constraint, steps }))
    }

    /// Where the path to which a walk leads enters the pane. The walk starts as the path of light in the direction of
    /// `target`.
    pub fn walk_towards(&self, target: DVec3, counters: &mut Counters) -> Option<DVec3> {
        self.0.walk_towards(target, counters).map(|path| path.first_vertex())
    }
}

/// Walks from uniform seeds.
struct UniformSeeds<'a>(ManifoldWalk<'a>);

impl RandomSearch for UniformSeeds<'_> {
    type Path = SolvedChain;

    fn solve(&self, random: &mut TrialStream, counters: &mut Counters) -> Option<SolvedChain> {
        let target = self.0.caster.sample(self.0.scene, random, counters)?;
        self.0.walk_towards(target, counters)
    }

    fn same(&self, first: &SolvedChain, second: &SolvedChain) -> bool {
        first.same(second)
    }
}

impl SpecularMethod for Sms {
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
        let Some(sample) = self.scope.light_sample(scene, point, light, stream) else { return };
        let casters = &self.scope.casters;
        let choice = self.selection.choose(scene, point, &sample, casters.len(), stream, counters);
        let (chosen, inverse_selection) = match &choice {
            Choice::All => (&casters[..], 1.0),
            Choice::One(caster) if casters.contains(caster) => (std::slice::from_ref(caster), 1.0),
            Choice::AtRandom(index) => (&casters[*index..=*index], casters.len() as f64),
            Choice::One(_) | Choice::None => return,
        };
        for caster in chosen {
            let mut trials = stream.trials();
            let Some(caster) = caster.seen_from(scene, point) else { continue };
            let (source, constraint, steps) = (sample.source, self.constraint, self.steps);
            let search = UniformSeeds(ManifoldWalk { scene, point, source, caster, events, constraint, steps });
            match self.estimator {
                ManifoldEstimator::Unbiased { max_trials } => {
                    let Some(path) = search.solve(&mut trials, counters) else { continue };
                    let Some(arrival) = path.arrival(scene, point, light, &sample, counters) else { continue };
                    let inverse = search.inverse_probability(&path, max_trials, &mut trials, counters);
                    arrive(Arrival { weight: arrival.weight * (inverse * inverse_selection), ..arrival });
                }
                ManifoldEstimator::Biased { trials: runs } => {
                    for path in search.distinct(runs, &mut trials, counters) {
                        if let Some(arrival) = path.arrival(scene, point, light, &sample, counters) {
                            arrive(Arrival { weight: arrival.weight * inverse_selection, ..arrival });
                        }
                    }
                }
            }
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, counters: &mut Counters) -> bool {
        let caster = path.links.first().and_then(|first| Caster::of(scene, first));
        self.scope.holds(scene, point, path)
            && caster.is_some_and(|caster| self.selection.may_choose(scene, point, path, caster, counters))
    }
}
