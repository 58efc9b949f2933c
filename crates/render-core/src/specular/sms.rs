//! `sms`: specular manifold sampling (Zeltner et al. 2020).
//!
//! Seeds are uniform over each caster, a pane or a smooth mesh; manifold walks (`manifold`) lead from them to paths, whose
//! light is estimated from how often they are found (`trials`). Every caster gets an estimate of its own, as in the authors'
//! code; a path belongs to the caster that it meets first.

use super::{
    Arrival, ShadingPoint, SpecularEvent, SpecularMethod, SpecularPath,
    manifold::{ManifoldWalk, SolvedChain},
    scope::Scope,
    trials::RandomSearch,
};
use crate::{
    counters::Counters,
    film::{SampleStream, TrialStream},
    scene::{
        Scene,
        description::{ManifoldConstraint, ManifoldEstimator},
    },
};

/// Specular manifold sampling.
#[derive(Clone, Debug)]
pub struct Sms {
    /// What a vertex has to obey.
    pub constraint: ManifoldConstraint,
    /// What is made of the paths that are found.
    pub estimator: ManifoldEstimator,
    /// Which paths are looked for.
    pub scope: Scope,
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

    fn gather(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        events: &[SpecularEvent],
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let (centre, radius) = scene.specular_ball();
        let sample = scene.lights()[light as usize].sample_source(centre, radius, stream.next_2d());
        if !self.scope.receives(scene, point) {
            return;
        }
        for caster in &self.scope.casters {
            let mut trials = stream.trials();
            let Some(caster) = caster.seen_from(scene, point) else { continue };
            let (source, constraint) = (sample.source, self.constraint);
            let search = UniformSeeds(ManifoldWalk { scene, point, source, caster, events, constraint });
            match self.estimator {
                ManifoldEstimator::Unbiased { max_trials } => {
                    let Some(path) = search.solve(&mut trials, counters) else { continue };
                    let Some(arrival) = path.arrival(scene, point, light, &sample, counters) else { continue };
                    let inverse = search.inverse_probability(&path, max_trials, &mut trials, counters);
                    arrive(Arrival { weight: arrival.weight * inverse, ..arrival });
                }
                ManifoldEstimator::Biased { trials: runs } => {
                    for path in search.distinct(runs, &mut trials, counters) {
                        if let Some(arrival) = path.arrival(scene, point, light, &sample, counters) {
                            arrive(arrival);
                        }
                    }
                }
            }
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, _: &mut Counters) -> bool {
        self.scope.holds(scene, point, path)
    }
}
