//! Light through two panes, one close behind the other, for every method: a window with a protective pane outside.
//!
//! Methods look for light through one pane. This one stands before another method and owns the chain TTTT, for lights
//! that a ray can meet. Rays go into the deflection window of the first pane and on through whichever pane they meet
//! behind it (`second_panes`). The window is that of a light which is larger by as much as any second pane may bend
//! light. So a flat second pane, which bends none, costs nothing.
//!
//! Point lights cannot be met: their light through two panes is missing.

use std::sync::Arc;

use super::assumed_density::assumed_density;
use super::cache::MethodCache;
use super::effort::Effort;
use super::environment::Portals;
use super::light_view::LightView;
use super::second_panes::SecondPanes;
use super::{Arrival, SpecularEvent, SpecularMethod, SpecularPath, THROUGH_TWO_PANES};
use crate::geometry::SurfaceId;
use crate::scene::{Scene, ShadingPoint};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

/// A method, and the light through two panes.
struct WithSecondPanes {
    method: Box<dyn SpecularMethod>,
    chains: Vec<Vec<SpecularEvent>>,
    panes: Arc<SecondPanes>,
    /// The first panes, through which an environment is seen.
    portals: Option<Arc<FirstPortals>>,
}

/// The portals of first panes, apart from those of all panes in the cache.
#[derive(Debug)]
struct FirstPortals(Portals);

/// The method, which also finds light through two panes if any stands close behind another.
pub(crate) fn with_double_glazing(
    method: Box<dyn SpecularMethod>,
    scene: &Scene,
    cache: &MethodCache,
) -> Box<dyn SpecularMethod> {
    let chains = method.chains();
    let panes = cache.get_or_make(|| SecondPanes::new(scene));
    if panes.is_empty() || method.has_double_glazing() {
        return method;
    }
    let has_environment = scene.light_sampler().environment().is_some();
    let portals = has_environment.then(|| cache.get_or_make(|| FirstPortals(Portals::of(scene, panes.first_panes()))));
    Box::new(WithSecondPanes { method, chains, panes, portals })
}

impl WithSecondPanes {
    /// Whether a ray can meet a light.
    fn finds(scene: &Scene, light: u32) -> bool {
        !scene.lights()[light as usize].is_delta()
    }
}

impl SpecularMethod for WithSecondPanes {
    fn chains(&self) -> Vec<Vec<SpecularEvent>> {
        let own = [THROUGH_TWO_PANES.to_vec()].into_iter().filter(|chain| !self.chains.contains(chain));
        self.chains.iter().cloned().chain(own).collect()
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
        if events != THROUGH_TWO_PANES || !Self::finds(scene, light) {
            if self.chains.iter().any(|chain| chain == events) {
                self.method.sample_li(scene, point, light, events, stream, counters, arrive);
            }
            return;
        }
        if scene.light_sampler().environment() == Some(light) {
            if let Some(portals) = &self.portals {
                portals.0.sample_li(scene, point, light, Some(&self.panes), stream, counters, arrive);
            }
            return;
        }
        let random = stream.next_2d();
        let view = LightView::new(scene, point, light, &Effort::at(point), Some(&self.panes), counters);
        view.cast(random, counters, &mut |light_sample, _| arrive(light_sample.arrival));
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, counters: &mut Counters) -> bool {
        let events = path.links.iter().map(|link| link.event);
        if events.eq(THROUGH_TWO_PANES) && Self::finds(scene, path.light) {
            return self.panes.owns(scene, point, path);
        }
        self.method.owns(scene, point, path, counters)
    }

    fn density(
        &self,
        scene: &Scene,
        point: &ShadingPoint,
        path: &SpecularPath<'_>,
        counters: &mut Counters,
    ) -> Option<f64> {
        let events = path.links.iter().map(|link| link.event);
        if !events.eq(THROUGH_TWO_PANES) || !Self::finds(scene, path.light) {
            return self.method.density(scene, point, path, counters);
        }
        let first = path.links[0];
        let SurfaceId::Pane { index, face } = first.surface else { return None };
        if scene.light_sampler().environment() == Some(path.light) {
            let portals = self.portals.as_ref()?;
            return Some(portals.0.density(scene, point, path.light, (index, face), first.direction));
        }
        Some(assumed_density(scene, point, path.light, index, &Effort::at(point)))
    }
}
