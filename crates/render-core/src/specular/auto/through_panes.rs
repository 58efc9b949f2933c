//! Light through panes, of lights that can be met.
//!
//! Where a certificate says that no point of a light is on a fold, it is found by paths to points of the light. Such a
//! search has no noise but that of the points. One Newton solve is enough where one path is all. Elsewhere, rays
//! through the panes find it: near folds and behind fine ripples, a search would have much noise, and rays have little.

use super::super::assumed_density::assumed_density;
use super::super::certificate::Certificate;
use super::super::effort::Effort;
use super::super::fnee::{Fnee, FneeSettings, SampledLight};
use super::super::light_view::{LightView, SearchedWindow};
use super::super::newton::{Root, SearchRegion, solve_complete};
use super::super::passage::{Found, Passage};
use super::super::window::Window;
use super::super::{Arrival, SampledPath, SpecularEvent, SpecularMethod, SpecularPath, THROUGH_PANE, coverage};
use crate::scene::{Scene, ShadingPoint};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

/// Rays, and a search beside them.
pub(super) struct ThroughPanes {
    search: Fnee,
}

impl ThroughPanes {
    /// With a search of these settings.
    pub(super) fn new(search: &FneeSettings) -> Self {
        Self { search: Fnee::from(search) }
    }
}

/// With what weights assume, whichever way it was found.
fn assuming(arrival: Arrival, density: f64) -> Arrival {
    Arrival { path: arrival.path.map(|path| SampledPath { density, ..path }), ..arrival }
}

/// The path that a certificate says is the only one, if it does and Newton's method finds it.
fn only_root(
    passage: &Passage<'_>,
    window: &Window<'_>,
    certificate: &Certificate,
    counters: &mut Counters,
) -> Option<Root> {
    let Certificate::OnePath(region_of_one) = certificate else { return None };
    let side = window.side();
    let region = SearchRegion::around(&window.entry(), side.pane.thickness);
    let seed = passage.connection.thin_seed(window.rect().centre(), counters)?;
    let root = solve_complete(&passage.connection, seed, &region, counters)?;
    // A stationary path may be a reflection, of which the certificate says nothing.
    let is_held = root.path.crosses(side.sign) && region_of_one.contains(window.place_of(root.path.vertices[0]));
    is_held.then_some(root)
}

impl SpecularMethod for ThroughPanes {
    fn chains(&self) -> Vec<Vec<SpecularEvent>> {
        vec![THROUGH_PANE.to_vec()]
    }

    fn sample_li(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        light: u32,
        _: &[SpecularEvent],
        stream: &mut SampleStream,
        counters: &mut Counters,
        arrive: &mut dyn FnMut(Arrival),
    ) {
        let (centre, radius) = scene.specular_ball();
        let source = &scene.lights()[light as usize];
        // A window has rays or a search, and so both may have the same numbers.
        let random = source.random(stream);
        let sample = source.sample_source(centre, radius, random);
        let view = LightView::new(scene, point, light, &Effort::beside_search(point), None, counters);
        view.cast(random, counters, &mut |light_sample, _| arrive(light_sample.arrival));
        for SearchedWindow { pane, window, certificate } in view.searched() {
            let Some(passage) = Passage::new(scene, point, light, &sample, *pane) else { continue };
            if let Some(root) = only_root(&passage, window, certificate, counters) {
                if let Some(Found { arrival, .. }) = passage.found(&root, counters) {
                    arrive(assuming(arrival, view.assumed(*pane)));
                }
                continue;
            }
            // There may be several, or it has not converged.
            let random = stream.next_2d();
            let mut trials = stream.trials();
            let sampled = SampledLight { index: light, sample: &sample, view: None };
            self.search.connect(scene, point, &sampled, *pane, random, &mut trials, counters, &mut |arrival| {
                arrive(assuming(arrival, view.assumed(*pane)));
            });
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, _: &mut Counters) -> bool {
        coverage::through_one_pane(scene, point, path).is_some()
    }

    fn density(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, _: &mut Counters) -> Option<f64> {
        let pane = coverage::through_one_pane(scene, point, path)?;
        Some(assumed_density(scene, point, path.light, pane, &Effort::beside_search(point)))
    }
}
