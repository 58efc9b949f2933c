//! Starts in openings: light of suns and skies that comes straight through thin walls.
//!
//! A triangle of a thin wall is chosen, a place of it, evenly, and a direction of the light. Light is followed along
//! that line from outside the scene. It may go through several triangles, and have begun at each of them. So the
//! density of a line is the sum over all that the light goes through before anything else.

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use glam::DVec3;

use super::start::LOOKS;
use crate::geometry::{Hit, Ray};
use crate::light::{LightHit, Source};
use crate::scene::Scene;
use crate::scene::openings;
use crate::scene::visibility::StraightWay;

/// Light on a line through an opening.
pub(super) struct Beam {
    /// From outside the scene.
    pub(super) ray: Ray,
    /// What it meets behind all thin walls.
    pub(super) hit: Hit,
    /// The way to there.
    pub(super) way: StraightWay,
    /// Radiance over the density of the direction.
    pub(super) weight: DVec3,
    /// The density of the direction.
    pub(super) density: f64,
}

/// Light through a place of an opening; `None` where it does not get there.
pub(super) fn beam(
    scene: &Scene,
    light: u32,
    opening: u32,
    stream: &mut SampleStream,
    counters: &mut Counters,
) -> Option<Beam> {
    let (centre, radius) = scene.specular_ball();
    let source = &scene.lights()[light as usize];
    let sample = source.sample_source(centre, radius, source.random(stream));
    let place = openings::place(scene.accelerator().corners(opening), stream.next_2d());
    let Source::Direction(direction) = sample.source else { return None };
    let [min, max] = scene.accelerator().bounds()?;
    let outside = place + direction * (max - min).length();
    let ray = Ray::new(outside, -direction);
    let (hit, way) = scene.first_behind_walls(&ray, counters)?;
    if !way.walls.contains(&opening) {
        return None;
    }
    let weight = sample.weight * source.falloff(direction);
    Some(Beam { ray, hit, way, weight, density: source.source_density(centre, radius, sample.source) })
}

/// The density with which a light draws the direction of a ray that leads to it.
pub(super) fn direction_density(scene: &Scene, light: u32, to_light: &Ray, hit: &LightHit) -> f64 {
    let source = &scene.lights()[light as usize];
    let (centre, radius) = scene.specular_ball();
    let (met, _) = source.source_at(to_light, hit);
    source.source_density(centre, radius, met)
}

/// About the light that a light brings through an opening, W.
pub(super) fn brought(scene: &Scene, light: u32, opening: u32) -> f64 {
    let settings = SamplerSettings { seed: 2, samples_per_block: LOOKS };
    let counters = &mut Counters::default();
    let looks = (0..LOOKS).map(|look| {
        let mut stream = SampleStream::new(&settings, 0, [light, opening], look);
        beam(scene, light, opening, &mut stream, counters).map_or(0.0, |beam| {
            let light = beam.weight * beam.way.transmittance;
            light.element_sum() * openings::seen_area(scene.accelerator().corners(opening), beam.ray.direction)
        })
    });
    looks.sum::<f64>() / f64::from(3 * LOOKS)
}
