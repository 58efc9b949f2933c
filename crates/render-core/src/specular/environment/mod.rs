//! Light of an environment, for every method: what comes through one pane is found by sampling the panes (`portals`).
//!
//! An environment has no point to connect to, and is seen in every pane. So no method looks for it itself. This one
//! stands before another method and owns the environment's light over exactly two transmissions through one pane
//! ([`coverage::through_one_pane`]). All other light of the environment over specular surfaces is left to chance.

mod portals;

use std::sync::Arc;

pub(super) use self::portals::Portals;
use super::cache::MethodCache;
use super::{Arrival, SpecularEvent, SpecularMethod, SpecularPath, THROUGH_PANE, coverage};
use crate::geometry::SurfaceId;
use crate::scene::{Scene, ShadingPoint};
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

/// A method for all lights but the environment, and the panes through which that is seen.
struct WithEnvironment {
    method: Box<dyn SpecularMethod>,
    /// The chains that the method looks for.
    chains: Vec<Vec<SpecularEvent>>,
    portals: Arc<Portals>,
}

/// The method, which also finds the light of the scene's environment if there is one.
pub(crate) fn with_environment(
    method: Box<dyn SpecularMethod>,
    scene: &Scene,
    cache: &MethodCache,
) -> Box<dyn SpecularMethod> {
    if scene.light_sampler().environment().is_none() {
        return method;
    }
    let portals = cache.get_or_make(|| Portals::new(scene));
    Box::new(WithEnvironment { chains: method.chains(), method, portals })
}

impl SpecularMethod for WithEnvironment {
    fn chains(&self) -> Vec<Vec<SpecularEvent>> {
        let through_pane = [THROUGH_PANE.to_vec()].into_iter().filter(|chain| !self.chains.contains(chain));
        self.chains.iter().cloned().chain(through_pane).collect()
    }

    fn has_double_glazing(&self) -> bool {
        self.method.has_double_glazing()
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
        if scene.light_sampler().environment() != Some(light) {
            if self.chains.iter().any(|chain| chain == events) {
                self.method.sample_li(scene, point, light, events, stream, counters, arrive);
            }
        } else if events == THROUGH_PANE {
            self.portals.sample_li(scene, point, light, None, stream, counters, arrive);
        }
    }

    fn owns(&self, scene: &Scene, point: &ShadingPoint, path: &SpecularPath<'_>, counters: &mut Counters) -> bool {
        if scene.light_sampler().environment() == Some(path.light) {
            return coverage::through_one_pane(scene, point, path).is_some();
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
        if scene.light_sampler().environment() != Some(path.light) {
            return self.method.density(scene, point, path, counters);
        }
        let first = path.links[0];
        let SurfaceId::Pane { index, face } = first.surface else { return None };
        Some(self.portals.density(scene, point, path.light, (index, face), first.direction))
    }
}
