//! `sms`: specular manifold sampling (Zeltner et al. 2020), for the two faces of a pane.
//!
//! Seeds are uniform over the outline of each pane; manifold walks (`manifold`) lead from them to paths, whose light is
//! estimated from how often they are found (`trials`). Unless told otherwise, every pane of the scene is a caster, and all get
//! an estimate each, as in the authors' code.

use glam::DVec2;

use super::{
    Arrival, PanePath, ShadingPoint, SpecularMethod,
    manifold::ManifoldWalk,
    newton::Root,
    passage::{Found, Passage},
    trials::RandomSearch,
};
use crate::{
    counters::Counters,
    film::{SampleStream, TrialStream},
    optics::SourceSample,
    scene::{
        Scene,
        description::{ManifoldConstraint, ManifoldEstimator, PaneSelection},
    },
};

/// Specular manifold sampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sms {
    /// What a vertex has to obey.
    pub constraint: ManifoldConstraint,
    /// What is made of the paths that are found.
    pub estimator: ManifoldEstimator,
    /// Which panes are searched.
    pub selection: PaneSelection,
}

/// Manifold walks from chosen places, to look at what they converge to.
pub struct ManifoldSearch<'a> {
    passage: Passage<'a>,
    constraint: ManifoldConstraint,
}

impl<'a> ManifoldSearch<'a> {
    /// Walks from `point` to a point on a light through a pane, both indices into the scene; `None` when no path can exist.
    pub fn new(
        scene: &'a Scene,
        point: &'a ShadingPoint,
        light: u32,
        sample: &'a SourceSample,
        pane: u32,
        constraint: ManifoldConstraint,
    ) -> Option<Self> {
        Some(Self { passage: Passage::new(scene, point, light, sample, pane)?, constraint })
    }

    /// The path to which a walk leads that starts as the path of light through `place`, tangential coordinates on the near
    /// face in metres.
    pub fn walk_from(&self, place: DVec2, counters: &mut Counters) -> Option<Root> {
        ManifoldWalk::new(&self.passage, self.constraint).walk_from(place, counters)
    }
}

/// Walks from uniform seeds.
struct UniformSeeds<'a>(ManifoldWalk<'a>, &'a Passage<'a>);

impl RandomSearch for UniformSeeds<'_> {
    fn solve(&self, random: &mut TrialStream, counters: &mut Counters) -> Option<Root> {
        let outline = self.1.side.pane.outline();
        let place = DVec2::new(random.next_f64(), random.next_f64());
        self.0.walk_from(outline.min + (outline.max - outline.min) * place, counters)
    }

    fn same(&self, first: &Root, second: &Root) -> bool {
        self.0.same(first, second)
    }
}

impl SpecularMethod for Sms {
    fn gather(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let (centre, radius) = scene.pane_ball();
        let sample = scene.lights()[light as usize].sample_source(centre, radius, stream.next_2d());
        let Some(chosen) = self.selection.choose(scene, point, sample.source, stream, counters) else { return };
        for pane in chosen.panes {
            let mut trials = stream.trials();
            let Some(passage) = Passage::new(scene, point, light, &sample, pane as u32) else { continue };
            let search = UniformSeeds(ManifoldWalk::new(&passage, self.constraint), &passage);
            match self.estimator {
                ManifoldEstimator::Unbiased { max_trials } => {
                    let Some(root) = search.solve(&mut trials, counters) else { continue };
                    let Some(Found { arrival, .. }) = passage.found(&root, counters) else { continue };
                    let inverse = search.inverse_probability(&root, max_trials, &mut trials, counters);
                    let weight = arrival.weight * (inverse * chosen.inverse_probability);
                    arrive(Arrival { weight, ..arrival });
                }
                ManifoldEstimator::Biased { trials: runs } => {
                    for root in search.distinct(runs, &mut trials, counters) {
                        if let Some(Found { arrival, .. }) = passage.found(&root, counters) {
                            arrive(Arrival { weight: arrival.weight * chosen.inverse_probability, ..arrival });
                        }
                    }
                }
            }
        }
    }

    fn selects(&self, scene: &Scene, point: &ShadingPoint, path: &PanePath, counters: &mut Counters) -> bool {
        self.selection.may_choose(scene, point, path, counters)
    }
}
