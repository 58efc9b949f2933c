//! The light that a vertex gathers: straight from the lights, and over the chains that a specular method looks for.

use glam::DVec3;

use super::caustic::{Gathered, Mirrors};
use super::lobe::{Lobe, sides};
use super::{PathSample, PathTracer, Walk};
use crate::document::PathEvent;
use crate::geometry::{MOST_PASSED, Ray, Surface, SurfaceId};
use crate::light::{AskedLight, LightHit, Receiver};
use crate::scene::ShadingPoint;
use crate::specular::SpecularEvent;
use clerestory_film::SampleStream;
use clerestory_film::counters::Counters;

/// What a path does that goes straight through walls to a light: the last so many are those through one less.
const BEHIND_WALLS: [PathEvent; MOST_PASSED + 1] = {
    let mut events = [PathEvent::Transmission; MOST_PASSED + 1];
    events[MOST_PASSED] = PathEvent::Light;
    events
};

impl PathSample {
    /// Adds light that the path has met.
    pub(super) fn add(&mut self, light: DVec3, is_caustic: bool) {
        self.radiance += light;
        if is_caustic {
            self.caustic += light;
        }
    }
}

impl PathTracer<'_> {
    /// Adds the light that a vertex scatters into the path: straight from the lights, and over chains of specular
    /// vertices that the specular method owns.
    #[expect(clippy::too_many_arguments, reason = "a vertex and the three places to which it reports")]
    pub(super) fn add_scattered(
        &self,
        walk: &Walk,
        point: &ShadingPoint,
        lobe: &Lobe<'_>,
        carried: DVec3,
        sample: &mut PathSample,
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) {
        if self.scene.has_straight_meshes() || self.accepts(walk.filter, &[PathEvent::Light]) {
            sample.radiance += carried * self.direct_light(walk, point, lobe, stream, counters);
        }
        // Methods know air on this side alone.
        let chains = if walk.around.is_air() && walk.asks_methods { &self.chains[..] } else { &[] };
        for chain in chains {
            let fits = walk.depth as usize + chain.events.len() <= self.max_depth as usize;
            if fits && self.accepts(walk.filter, &chain.with_light) {
                for side in sides(*point, lobe.bsdf.gathers_behind()) {
                    let found = self.specular_light(&side, lobe, &chain.events, stream, counters);
                    sample.radiance += carried * found.all;
                    sample.caustic += carried * found.caustic;
                }
            }
        }
    }

    /// Light straight from the lights, over the scale of the BSDF.
    fn direct_light(
        &self,
        walk: &Walk,
        point: &ShadingPoint,
        lobe: &Lobe<'_>,
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) -> DVec3 {
        let mut sum = DVec3::ZERO;
        let asked = self.scene.light_sampler().ask(&lobe.receiver, stream);
        for AskedLight { light: index, probability } in asked {
            let Some(sample) = self.scene.sample_li(index, &lobe.receiver, stream) else { continue };
            let value = lobe.eval(sample.direction);
            if value == DVec3::ZERO {
                continue;
            }
            let ray = Ray::new(point.position, sample.direction);
            let around = lobe.around(sample.direction);
            let way = if around.is_empty() {
                self.scene.straight_way(&ray, sample.distance, point.surface, index, counters)
            } else {
                self.straight_way_among_bodies(&ray, sample.distance, point.surface, around, index, counters)
            };
            let Some(way) = way.filter(|way| self.fits(walk, way.walls.len())) else { continue };
            let (found, by_chance) = match sample.pdf {
                Some(pdf) => (pdf * probability, lobe.pdf(sample.direction)),
                // As if the point had an area that is drawn with certainty.
                None => (sample.distance * sample.distance * probability, 0.0),
            };
            let by_light = lobe.by_light(sample.direction);
            let hit = LightHit { distance: sample.distance, radiance: DVec3::ZERO, triangle: None };
            let cosine = lobe.cosine(sample.direction);
            let by_light = self.straight_by_light(index, &way.walls, (&ray, &hit), cosine, by_light);
            let balance = found / (found + by_chance + by_light);
            let kept = lobe.kept(sample.direction, sample.distance);
            sum += way.transmittance * kept * sample.weight * (value * balance) / probability;
        }
        sum
    }

    /// Light by the paths over a chain of specular vertices that the specular method owns, over the scale of the BSDF.
    fn specular_light(
        &self,
        point: &ShadingPoint,
        lobe: &Lobe<'_>,
        events: &[SpecularEvent],
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) -> Gathered {
        let mut sum = Gathered::default();
        let Some(method) = self.method else { return sum };
        let receiver = Receiver::anywhere(point.position);
        for AskedLight { light, probability } in self.scene.light_sampler().ask(&receiver, stream) {
            method.sample_li(self.scene, point, light, events, stream, counters, &mut |arrival| {
                let share = self.share_of_method(&arrival, light, probability, lobe);
                let light = arrival.weight * lobe.eval(arrival.direction) * (share / probability);
                sum.add(light, self.is_over_glass(point, arrival.direction, events));
            });
        }
        sum
    }

    /// Whether a path that goes straight through so many walls to a light is rendered.
    fn fits(&self, walk: &Walk, walls: usize) -> bool {
        walk.depth as usize + walls <= self.max_depth as usize
            && self.accepts(walk.filter, &BEHIND_WALLS[MOST_PASSED - walls..])
    }

    /// Whether a path that a method has found from a point in a direction, over a chain, goes over glass or water.
    fn is_over_glass(&self, point: &ShadingPoint, direction: DVec3, events: &[SpecularEvent]) -> bool {
        // No mirror of metal transmits light, and methods do not search thin walls.
        if events.contains(&SpecularEvent::Transmission) {
            return true;
        }
        match self.mirrors {
            Mirrors::Glass => true,
            Mirrors::Metal => false,
            Mirrors::Both => self.is_mirrored_by_glass(point, direction, events.len()),
        }
    }

    /// Whether one of the mirrors is of glass or water that a ray meets one after the other.
    fn is_mirrored_by_glass(&self, point: &ShadingPoint, direction: DVec3, mirrors: usize) -> bool {
        // These rays are no work of the method.
        let counters = &mut Counters::default();
        let (mut ray, mut origin) = (Ray::new(point.position, direction), point.surface);
        for _ in 0..mirrors {
            let hit = self.scene.accelerator().closest_hit(&ray, f64::INFINITY, origin, counters);
            let Some(hit) = hit else { return false };
            let Surface::Triangle { index, barycentric } = hit.surface else { return true };
            if self.scene.bsdf(index).interior().is_some() {
                return true;
            }
            let at = self.scene.surface_point(index, barycentric);
            let Some(mirrored) = self.scene.delta_bsdf(index).and_then(|bsdf| bsdf.reflect(ray.direction, &at)) else {
                return false;
            };
            (ray, origin) = (Ray::new(ray.at(hit.distance), mirrored.direction), SurfaceId::Triangle(index));
        }
        false
    }
}
