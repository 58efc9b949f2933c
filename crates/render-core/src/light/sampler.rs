//! Which lights a point of a surface asks for light.
//!
//! Up to [`MOST_ASKED`] lights are all asked. Of more, a tree chooses one, and one of the suns is chosen by what it may
//! bring. The environment is always asked.

use arrayvec::ArrayVec;
use clerestory_film::SampleStream;
use glam::DVec3;

use super::tree::LightTree;
use super::{Light, LightBounds, Receiver};
use crate::geometry::Ray;

/// So many lights are all asked.
pub const MOST_ASKED: usize = 4;

/// A light that is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AskedLight {
    /// Its index in the scene.
    pub light: u32,
    /// The probability with which it is asked.
    pub probability: f64,
}

/// Chooses among the lights of a scene.
#[derive(Clone, Debug)]
pub struct LightSampler {
    count: u32,
    tree: LightTree,
    /// The first lights that are somewhere and no surfaces of the scene: all of them where all lights are asked.
    near: ArrayVec<u32, MOST_ASKED>,
    /// Lights at infinity that have a direction.
    suns: Vec<Sun>,
    /// The light that is all around.
    environment: Option<u32>,
}

/// A light at infinity that has a direction.
#[derive(Clone, Copy, Debug)]
struct Sun {
    light: u32,
    direction: DVec3,
    sin_radius: f64,
    power: f64,
}

impl Sun {
    /// A bound of what it may bring to a point, up to a factor.
    fn importance(&self, receiver: &Receiver) -> f64 {
        let Some(cosine) = receiver.side.cosine(self.direction) else { return self.power };
        // The nearest direction of the disc is its radius nearer to the normal.
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let cos_radius = (1.0 - self.sin_radius * self.sin_radius).max(0.0).sqrt();
        let nearest = if cosine >= cos_radius { 1.0 } else { cosine * cos_radius + sine * self.sin_radius };
        self.power * nearest.max(0.0)
    }
}

impl LightSampler {
    /// A choice among lights.
    pub fn new(lights: &[Light]) -> Self {
        let sun = |(light, emitter): (u32, &Light)| match emitter.bounds() {
            LightBounds::Cap { direction, sin_radius } => {
                Some(Sun { light, direction, sin_radius, power: emitter.power() })
            }
            LightBounds::Ball { .. } | LightBounds::Everywhere => None,
        };
        let numbered = || (0u32..).zip(lights);
        // Rays meet surfaces of the scene without this list.
        let is_near = |light: &Light| light.bounding_box().is_some() && light.triangles().is_none();
        let near = numbered().filter(|(_, light)| is_near(light));
        Self {
            count: lights.len() as u32,
            tree: LightTree::new(lights),
            near: near.map(|(index, _)| index).take(MOST_ASKED).collect(),
            suns: numbered().filter_map(sun).collect(),
            environment: numbered().find(|(_, light)| light.is_environment()).map(|(index, _)| index),
        }
    }

    fn asks_all(&self) -> bool {
        self.count as usize <= MOST_ASKED
    }

    /// The lights that a point asks for light. Where all lights are asked no random number is drawn.
    pub fn ask(&self, receiver: &Receiver, stream: &mut SampleStream) -> ArrayVec<AskedLight, MOST_ASKED> {
        if self.asks_all() {
            return (0..self.count).map(|light| AskedLight { light, probability: 1.0 }).collect();
        }
        let mut asked = ArrayVec::new();
        if !self.tree.is_empty() {
            let chosen = self.tree.choose(receiver, finely(stream));
            asked.extend(chosen.map(|chosen| AskedLight { light: chosen.light, probability: chosen.probability }));
        }
        match self.suns.as_slice() {
            [] => {}
            [sun] => asked.push(AskedLight { light: sun.light, probability: 1.0 }),
            suns => {
                let total: f64 = suns.iter().map(|sun| sun.importance(receiver)).sum();
                let mut target = finely(stream) * total;
                let chosen = suns.iter().find(|sun| {
                    let importance = sun.importance(receiver);
                    target -= importance;
                    target < 0.0 && importance > 0.0
                });
                // Rounding of the sum leaves the last one.
                let last = || suns.iter().rev().find(|sun| sun.importance(receiver) > 0.0);
                asked.extend(
                    chosen
                        .or_else(last)
                        .map(|sun| AskedLight { light: sun.light, probability: sun.importance(receiver) / total }),
                );
            }
        }
        asked.extend(self.environment.map(|light| AskedLight { light, probability: 1.0 }));
        asked
    }

    /// The probability with which [`Self::ask`] asks a light.
    pub fn probability(&self, light: u32, receiver: &Receiver) -> f64 {
        if self.asks_all() || self.environment == Some(light) {
            return 1.0;
        }
        let Ok(index) = self.suns.binary_search_by_key(&light, |sun| sun.light) else {
            return self.tree.probability(light, receiver);
        };
        if self.suns.len() == 1 {
            return 1.0;
        }
        let total: f64 = self.suns.iter().map(|sun| sun.importance(receiver)).sum();
        if total > 0.0 { self.suns[index].importance(receiver) / total } else { 0.0 }
    }

    /// The lights at infinity: suns in the order of the scene, then the environment.
    pub fn infinite(&self) -> impl Iterator<Item = u32> {
        self.suns.iter().map(|sun| sun.light).chain(self.environment)
    }

    /// The light that is all around.
    pub fn environment(&self) -> Option<u32> {
        self.environment
    }

    /// Visits the lights that a ray may meet before `end`, until one says that it is enough. None of them is at
    /// infinity or a surface of the scene. Answers whether one did.
    pub fn on_ray(&self, ray: &Ray, end: f64, visit: &mut dyn FnMut(u32) -> bool) -> bool {
        if self.asks_all() { self.near.iter().copied().any(visit) } else { self.tree.on_ray(ray, end, visit) }
    }
}

/// A number in [0, 1) with the places of a Sobol number, and random bits below: one number chooses at all levels of a
/// tree.
fn finely(stream: &mut SampleStream) -> f64 {
    let coarse = stream.next_1d();
    with_finer_places(coarse, stream)
}

/// The same of a number that has been drawn.
pub(crate) fn with_finer_places(coarse: f64, stream: &mut SampleStream) -> f64 {
    /// Places of a Sobol number.
    const SOBOL_STEP: f64 = 1.0 / (1u64 << 24) as f64;
    (coarse + stream.trials().next_f64() * SOBOL_STEP).min(1.0 - f64::EPSILON)
}
