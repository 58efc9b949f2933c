//! `mnee`: manifold next event estimation (Hanika, Droske, Fascione 2015), for the two faces of a pane.
//!
//! One manifold walk (`manifold`) on half vectors starts from the straight line to the light and finds one path at most. It
//! is a function of the shading point and the point on the light, so its light counts with weight one. What it misses is
//! either left to chance, which is unbiased (a path that chance finds counts if the walk from its own ends does not lead to
//! it), or dropped.

use glam::DVec3;

use super::{
    Arrival, PanePath, ShadingPoint, SpecularMethod,
    manifold::ManifoldWalk,
    newton::Root,
    passage::{Found, Passage},
};
use crate::{
    counters::Counters,
    film::SampleStream,
    optics::SourceSample,
    scene::{
        Scene,
        description::{ManifoldConstraint, MissedPaths},
    },
};

/// Manifold next event estimation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mnee {
    /// What happens to the paths that the walk does not find.
    pub missed: MissedPaths,
}

/// A path that chance has found is the one to which the walk leads, if they cross the near face within this part of the
/// pane's thickness.
const SAME_PATH: f64 = 1e-3;

impl SpecularMethod for Mnee {
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
        let Some(pane) = scene.first_pane_towards(point, sample.source, counters) else { return };
        let Some(passage) = Passage::new(scene, point, light, &sample, pane) else { return };
        if let Some(root) = root(&passage, counters)
            && let Some(Found { arrival, .. }) = passage.found(&root, counters)
        {
            arrive(arrival);
        }
    }

    fn selects(&self, scene: &Scene, point: &ShadingPoint, path: &PanePath, counters: &mut Counters) -> bool {
        match self.missed {
            MissedPaths::Dropped => true,
            MissedPaths::LeftToChance => {
                let sample = SourceSample { source: path.source, normal: None, weight: DVec3::ZERO };
                let Some(passage) = Passage::new(scene, point, path.light, &sample, path.pane) else { return false };
                let Some(root) = root(&passage, counters) else { return false };
                let pane = passage.side.pane;
                let apart = root.path.vertices[0] - pane.frame.point_to_local(path.entry);
                apart.length() < SAME_PATH * pane.thickness
            }
        }
    }
}

/// The path to which the walk leads.
fn root(passage: &Passage<'_>, counters: &mut Counters) -> Option<Root> {
    ManifoldWalk::new(passage, ManifoldConstraint::HalfVector).walk_from_straight_line(counters)
}
