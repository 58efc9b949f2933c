//! Starts on a light itself, in proportion to the light that leaves there.

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};

use super::start::{On, Start};
use crate::geometry::{Ray, SurfaceId};
use crate::scene::Scene;

/// Rays of a light that are followed to find how much of it stays in the scene.
const RAYS: u32 = 64;

/// How far before a light its light subpaths begin, as a part of the largest coordinate there, or of a metre.
const CLEARANCE: f64 = 1e-8;

/// About the light of a light that stays in the scene, W; `None` where no light subpath begins on it.
pub(super) fn kept(scene: &Scene, light: u32) -> Option<f64> {
    let source = &scene.lights()[light as usize];
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

/// A start on a light, as if that had been chosen with certainty; `None` where its light meets nothing.
pub(super) fn start(scene: &Scene, light: u32, stream: &mut SampleStream, counters: &mut Counters) -> Option<Start> {
    let source = &scene.lights()[light as usize];
    let emission = source.emit(source.random(stream), stream.next_2d())?;
    // A surface on which the light lies is not met.
    let away = CLEARANCE * emission.ray.origin.abs().max_element().max(1.0);
    let ray = Ray::new(emission.ray.at(away), emission.ray.direction);
    let (hit, way) = scene.first_behind_walls(&ray, counters)?;
    Some(Start {
        light,
        on: On::Straight { hit, way, behind: 0.0 },
        ray,
        weight: emission.radiance / emission.density,
        density: emission.density,
    })
}
