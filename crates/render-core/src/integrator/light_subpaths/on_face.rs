//! Starts on the first face of a pane that a light meets.
//!
//! The point of the light is drawn as the light draws it, and the place of the face evenly over the pane's outline.
//! Light keeps its etendue on the way through glass and air. So the density of such a start is that of the path at the
//! first surface behind:
//!
//! ```text
//! cos dA dw (at the surface) = |m . s| dp ds (at the face)
//! ```
//!
//! Here w is the direction at the surface, and s that towards the light. The place p of the face is in the pane's
//! plane, and m is its unnormalised normal.

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use glam::{DVec2, DVec3};

use super::start::{LOOKS, On, PlaceOnFace, Start};
use crate::geometry::{Face, Ray, SurfaceId};
use crate::light::{LightHit, Source};
use crate::scene::Scene;

/// The faces of a pane, as they are numbered.
pub(super) const FACES: [Face; 2] = [Face::Front, Face::Back];

/// About the light that a light brings to a face of a pane, W.
pub(super) fn brought(scene: &Scene, light: u32, (pane, face): (u32, Face)) -> f64 {
    let settings = SamplerSettings { seed: 0, samples_per_block: LOOKS };
    let counters = &mut Counters::default();
    let tint = scene.panes()[pane as usize].tint();
    let number = FACES.len() as u32 * pane + u32::from(face == FACES[1]);
    let looks = (0..LOOKS).map(|look| {
        let mut stream = SampleStream::new(&settings, 0, [light, number], look);
        let start = start(scene, light, (pane, face), &mut stream, counters);
        start.map_or(0.0, |start| (start.weight * tint).element_sum())
    });
    looks.sum::<f64>() / f64::from(3 * LOOKS)
}

/// A start on a face, as if light and face had been chosen with certainty; `None` where the light does not reach it.
pub(super) fn start(
    scene: &Scene,
    light: u32,
    (pane, face): (u32, Face),
    stream: &mut SampleStream,
    counters: &mut Counters,
) -> Option<Start> {
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
    let to_light = Ray::new(origin, direction);
    if scene.blocked_from_light(&to_light, distance, SurfaceId::Pane { index: pane, face }, light, &sample, counters) {
        return None;
    }
    Some(Start {
        light,
        on: On::Face(PlaceOnFace { pane, face, point, gradient, sample }),
        ray: Ray::new(origin, -direction),
        weight: sample.weight * passed * falloff,
        density: source.source_density(centre, radius, sample.source) / passed,
    })
}

/// [`Start::density`] of a path on which light meets a face from a light, against the ray.
pub(super) fn density(
    scene: &Scene,
    light: u32,
    (pane, face): (u32, Face),
    to_light: &Ray,
    hit: &LightHit,
) -> Option<f64> {
    let pane = &scene.panes()[pane as usize];
    let at = pane.frame.point_to_local(to_light.origin).truncate();
    let (_, gradient) = pane.surface(face).slope(at);
    let cosine = facing(face, gradient, pane.frame.vector_to_local(to_light.direction))?;
    let source = &scene.lights()[light as usize];
    let (met, light_cosine) = source.source_at(to_light, hit);
    let (centre, radius) = scene.specular_ball();
    let spread = match met {
        Source::Direction(_) => 1.0,
        Source::Point(_) => light_cosine / (hit.distance * hit.distance),
    };
    Some(source.source_density(centre, radius, met) / (spread * pane.outline.area() * cosine))
}

/// The cosine between the direction of a light and a face's unnormalised normal, times the length of that; `None` where
/// the light is behind the face or its plane. All in the pane's frame.
fn facing(face: Face, gradient: DVec2, to_light: DVec3) -> Option<f64> {
    let outwards = if face == Face::Front { -1.0 } else { 1.0 };
    let cosine = DVec3::new(-gradient.x, -gradient.y, 1.0).dot(to_light) * outwards;
    (cosine > 0.0 && to_light.z * outwards > 0.0).then_some(cosine)
}
