//! Where light subpaths begin: on the first face of a pane that a light meets, or on a light itself.
//!
//! At a pane, a light and a face are chosen together, by what the light brings there. Then the point of the light is
//! drawn as the light draws it, and the place of the face evenly over the pane's outline. Light keeps its etendue on
//! the way through glass and air. So the density of such a start is that of the path at the first surface behind:
//!
//! ```text
//! cos dA dw (at the surface) = |m . s| dp ds (at the face)
//! ```
//!
//! Here w is the direction at the surface, and s that towards the light. The place p of the face is in the pane's
//! plane, and m is its unnormalised normal. On a light itself, it is the area and the cosine there.

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use glam::{DVec2, DVec3};

use crate::geometry::{Face, Ray, SurfaceId};
use crate::light::{Light, LightHit, Source, SourceSample};
use crate::scene::Scene;

/// Points of a light and a face at which it is looked what the light brings.
const LOOKS: u32 = 8;

/// Rays of a light that are followed to find how much of it stays in the scene.
const RAYS: u32 = 64;

/// How far before a light its light subpaths begin, as a part of the largest coordinate there, or of a metre.
const CLEARANCE: f64 = 1e-8;

/// The part of all starts on faces, and on lights, that is spread over them alike, whatever the looks have found.
const EVENLY: f64 = 0.1;

/// The faces of a pane, as they are numbered.
const FACES: [Face; 2] = [Face::Front, Face::Back];

/// The starts of a scene's light subpaths.
#[derive(Debug)]
pub(in crate::integrator) struct Starts {
    /// For each light: each face of each pane, and the light itself.
    probabilities: Vec<f64>,
    /// Their sums, up to each.
    sums: Vec<f64>,
    /// Of all panes.
    faces: usize,
}

/// The start of a light subpath.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct Start {
    /// Index of the light.
    pub(in crate::integrator) light: u32,
    /// Where it begins; `None` on the light itself.
    pub(in crate::integrator) on: Option<PlaceOnFace>,
    /// Along which light comes from there: from the face, or from the light.
    pub(in crate::integrator) ray: Ray,
    /// Radiance over density, times the cosine there.
    pub(in crate::integrator) weight: DVec3,
    /// Density of the place and the direction, over that cosine.
    pub(in crate::integrator) density: f64,
}

/// A place of a face to which light comes.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct PlaceOnFace {
    /// Index of the pane.
    pub(in crate::integrator) pane: u32,
    /// Its face.
    pub(in crate::integrator) face: Face,
    /// The place, in the pane's frame.
    pub(in crate::integrator) point: DVec3,
    /// Gradient of the face there.
    pub(in crate::integrator) gradient: DVec2,
    /// The point of the light.
    pub(in crate::integrator) sample: SourceSample,
    /// How far that is.
    pub(in crate::integrator) distance: f64,
}

impl Starts {
    /// The starts of a scene; `None` where there are none.
    pub(in crate::integrator) fn new(scene: &Scene) -> Option<Self> {
        let faces = FACES.len() * scene.panes().len();
        let slots = faces + 1;
        let mut brought = vec![0.0; slots * scene.lights().len()];
        let mut even = vec![0.0; brought.len()];
        for (light, source) in (0u32..).zip(scene.lights()) {
            let of_light = light as usize * slots;
            for pane in (0..scene.panes().len() as u32).filter(|pane| !scene.media().is_immersed(*pane)) {
                for (number, face) in FACES.into_iter().enumerate() {
                    let place = of_light + FACES.len() * pane as usize + number;
                    even[place] = scene.panes()[pane as usize].outline.area();
                    brought[place] = brought_to(scene, light, (pane, face));
                }
            }
            let kept = kept(scene, light, source);
            even[of_light + faces] = f64::from(kept.is_some());
            brought[of_light + faces] = kept.unwrap_or(0.0);
        }
        let is_light = |place: usize| place % slots == faces;
        let total = |parts: &[f64], lights: bool| {
            let of_kind = parts.iter().enumerate().filter(|(place, _)| is_light(*place) == lights);
            of_kind.map(|(_, part)| part).sum::<f64>()
        };
        let totals = [false, true].map(|lights| [total(&brought, lights), total(&even, lights)]);
        let kinds = totals.iter().filter(|[brought, _]| *brought > 0.0).count();
        let probability = |place: usize| {
            let [all_brought, all_even] = totals[usize::from(is_light(place))];
            if all_brought == 0.0 {
                return 0.0;
            }
            let part = (1.0 - EVENLY) * brought[place] / all_brought + EVENLY * even[place] / all_even;
            part / kinds as f64
        };
        let probabilities: Vec<f64> = (0..brought.len()).map(probability).collect();
        let mut sum = 0.0;
        let sums = probabilities.iter().map(|part| {
            sum += part;
            sum
        });
        let starts = Self { sums: sums.collect(), probabilities, faces };
        (kinds > 0).then_some(starts)
    }

    /// Draws a start; `None` where nothing comes from there.
    pub(in crate::integrator) fn sample(
        &self,
        scene: &Scene,
        stream: &mut SampleStream,
        counters: &mut Counters,
    ) -> Option<Start> {
        let chosen = stream.next_1d() * self.sums.last()?;
        let place = self.sums.partition_point(|sum| *sum <= chosen).min(self.sums.len() - 1);
        let slots = self.faces + 1;
        let (light, slot) = ((place / slots) as u32, place % slots);
        let start = if slot == self.faces {
            let source = &scene.lights()[light as usize];
            let emission = source.emit(source.random(stream), stream.next_2d())?;
            let weight = emission.radiance / emission.density;
            // A surface on which the light lies is not met.
            let away = CLEARANCE * emission.ray.origin.abs().max_element().max(1.0);
            let ray = Ray::new(emission.ray.at(away), emission.ray.direction);
            Start { light, on: None, ray, weight, density: emission.density }
        } else {
            let start = on_face(scene, light, ((slot / FACES.len()) as u32, FACES[slot % FACES.len()]), stream)?;
            if start.is_blocked(scene, counters) {
                return None;
            }
            start
        };
        let probability = self.probabilities[place];
        Some(Start { weight: start.weight / probability, density: start.density * probability, ..start })
    }

    /// The density with which a path to a light begins, over the cosine where it does: the ray leads to the light from
    /// the specular surface next to it, or, if there is none, from a surface that scatters light. 0 where no light
    /// subpath begins.
    pub(in crate::integrator) fn density(
        &self,
        scene: &Scene,
        light: u32,
        surface: Option<SurfaceId>,
        to_light: &Ray,
        hit: &LightHit,
    ) -> f64 {
        let source = &scene.lights()[light as usize];
        let of_light = light as usize * (self.faces + 1);
        let Some(surface) = surface else {
            return self.probabilities[of_light + self.faces] * source.emission_density(to_light);
        };
        let SurfaceId::Pane { index, face } = surface else { return 0.0 };
        let probability = self.probabilities[of_light + FACES.len() * index as usize + usize::from(face == FACES[1])];
        if probability == 0.0 {
            return 0.0;
        }
        let pane = &scene.panes()[index as usize];
        let at = pane.frame.point_to_local(to_light.origin).truncate();
        let (_, gradient) = pane.surface(face).slope(at);
        let local = pane.frame.vector_to_local(to_light.direction);
        let Some(cosine) = facing(face, gradient, local) else { return 0.0 };
        let (met, light_cosine) = source.source_at(to_light, hit);
        let (centre, radius) = scene.specular_ball();
        let spread = match met {
            Source::Direction(_) => 1.0,
            Source::Point(_) => light_cosine / (hit.distance * hit.distance),
        };
        probability * source.source_density(centre, radius, met) / (spread * pane.outline.area() * cosine)
    }
}

impl Start {
    /// Whether anything stands between the face and the light.
    fn is_blocked(&self, scene: &Scene, counters: &mut Counters) -> bool {
        self.on.is_some_and(|PlaceOnFace { pane, face, sample, distance, .. }| {
            let surface = SurfaceId::Pane { index: pane, face };
            let to_light = Ray::new(self.ray.origin, -self.ray.direction);
            scene.blocked_from_light(&to_light, distance, surface, self.light, &sample, counters)
        })
    }
}

/// About the light that a light brings to a face of a pane, W.
fn brought_to(scene: &Scene, light: u32, (pane, face): (u32, Face)) -> f64 {
    let settings = SamplerSettings { seed: 0, samples_per_block: LOOKS };
    let counters = &mut Counters::default();
    let tint = scene.panes()[pane as usize].tint();
    let number = FACES.len() as u32 * pane + u32::from(face == FACES[1]);
    let looks = (0..LOOKS).map(|look| {
        let mut stream = SampleStream::new(&settings, 0, [light, number], look);
        let start = on_face(scene, light, (pane, face), &mut stream);
        let seen = start.filter(|start| !start.is_blocked(scene, counters));
        seen.map_or(0.0, |start| (start.weight * tint).element_sum())
    });
    looks.sum::<f64>() / f64::from(3 * LOOKS)
}

/// About the light of a light that stays in the scene, W; `None` where no light subpath begins on it.
fn kept(scene: &Scene, light: u32, source: &Light) -> Option<f64> {
    // Within a body, light subpaths would not know what absorbs light.
    if !scene.bodies_near(&source.bounding_box()?).is_empty() {
        return None;
    }
    let settings = SamplerSettings { seed: 1, samples_per_block: RAYS };
    let counters = &mut Counters::default();
    let mut sum = 0.0;
    for number in 0..RAYS {
        let mut stream = SampleStream::new(&settings, 0, [light, 0], number);
        let emission = source.emit(stream.next_2d(), stream.next_2d())?;
        let hit = scene.accelerator().closest_hit(&emission.ray, f64::INFINITY, SurfaceId::Nothing, counters);
        if hit.is_some() {
            sum += emission.radiance.element_sum() / emission.density;
        }
    }
    Some(sum / f64::from(3 * RAYS))
}

/// A place of a face and a point of a light, as if they had been chosen with certainty; `None` where the light is
/// behind the face.
fn on_face(scene: &Scene, light: u32, (pane, face): (u32, Face), stream: &mut SampleStream) -> Option<Start> {
    let (centre, radius) = scene.specular_ball();
    let source = &scene.lights()[light as usize];
    let sample = source.sample_source(centre, radius, source.random(stream));
    let geometry = &scene.panes()[pane as usize];
    let place = geometry.outline.sample(stream.next_2d());
    let (height, gradient) = geometry.surface(face).slope(place);
    let point = place.extend(geometry.base_height(face) + height);
    let origin = geometry.frame.point_to_world(point);
    let (direction, distance, spread) = match sample.source {
        Source::Direction(direction) => (direction, f64::INFINITY, 1.0),
        Source::Point(position) => {
            let offset = position - origin;
            let distance = offset.length();
            let direction = offset / distance;
            (direction, distance, sample.cosine(direction) / (distance * distance))
        }
    };
    let cosine = facing(face, gradient, geometry.frame.vector_to_local(direction)).filter(|_| spread > 0.0)?;
    let passed = spread * geometry.outline.area() * cosine;
    let falloff = source.falloff(direction);
    if falloff == 0.0 {
        return None;
    }
    Some(Start {
        light,
        on: Some(PlaceOnFace { pane, face, point, gradient, sample, distance }),
        ray: Ray::new(origin, -direction),
        weight: sample.weight * passed * falloff,
        density: source.source_density(centre, radius, sample.source) / passed,
    })
}

/// The cosine between the direction of a light and a face's unnormalised normal, times the length of that; `None` where
/// the light is behind the face or its plane. All in the pane's frame.
fn facing(face: Face, gradient: DVec2, to_light: DVec3) -> Option<f64> {
    let outwards = if face == Face::Front { -1.0 } else { 1.0 };
    let cosine = DVec3::new(-gradient.x, -gradient.y, 1.0).dot(to_light) * outwards;
    (cosine > 0.0 && to_light.z * outwards > 0.0).then_some(cosine)
}
