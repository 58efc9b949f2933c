//! Which lights a point of a surface asks for light.
//!
//! Up to [`MOST_ASKED`] lights are all asked. Of more, a tree chooses one, and one of the suns is chosen by its power.

use arrayvec::ArrayVec;
use clerestory_film::SampleStream;
use glam::DVec3;

use super::tree::{Asking, LightTree};
use super::{Light, LightBounds};
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
    /// The lights at infinity, each with the sum of powers up to it.
    suns: Vec<(u32, f64)>,
}

impl LightSampler {
    /// A choice among lights.
    pub fn new(lights: &[Light]) -> Self {
        let is_sun = |light: &Light| matches!(light.bounds(), LightBounds::Cap { .. });
        let suns = (0u32..).zip(lights).filter(|(_, light)| is_sun(light)).scan(0.0, |sum, (index, light)| {
            *sum += light.power();
            Some((index, *sum))
        });
        Self { count: lights.len() as u32, suns: suns.collect(), tree: LightTree::new(lights) }
    }

    fn asks_all(&self) -> bool {
        self.count as usize <= MOST_ASKED
    }

    /// The lights that a point asks for light. `normal` is that of the surface for light that comes straight, and `None`
    /// for light that is bent on its way. Where all lights are asked no random number is drawn.
    pub fn ask(
        &self,
        position: DVec3,
        normal: Option<DVec3>,
        stream: &mut SampleStream,
    ) -> ArrayVec<AskedLight, MOST_ASKED> {
        if self.asks_all() {
            return (0..self.count).map(|light| AskedLight { light, probability: 1.0 }).collect();
        }
        let mut asked = ArrayVec::new();
        if !self.tree.is_empty() {
            let chosen = self.tree.choose(&Asking { position, normal }, stream.next_1d());
            asked.extend(chosen.map(|(light, probability)| AskedLight { light, probability }));
        }
        if let Some((_, total)) = self.suns.last() {
            let target = stream.next_1d() * total;
            let index = self.suns.partition_point(|(_, sum)| *sum <= target);
            if let Some((light, _)) = self.suns.get(index) {
                asked.push(AskedLight { light: *light, probability: self.share_of_sun(index) });
            }
        }
        asked
    }

    /// The probability with which [`Self::ask`] asks a light.
    pub fn probability(&self, light: u32, position: DVec3, normal: Option<DVec3>) -> f64 {
        if self.asks_all() {
            return 1.0;
        }
        match self.suns.binary_search_by_key(&light, |(sun, _)| *sun) {
            Ok(index) => self.share_of_sun(index),
            Err(_) => self.tree.probability(light, &Asking { position, normal }),
        }
    }

    fn share_of_sun(&self, index: usize) -> f64 {
        let before = index.checked_sub(1).map_or(0.0, |before| self.suns[before].1);
        let total = self.suns.last().map_or(0.0, |(_, total)| *total);
        if total > 0.0 { (self.suns[index].1 - before) / total } else { 0.0 }
    }

    /// The lights at infinity, in the order of the scene.
    pub fn suns(&self) -> impl Iterator<Item = u32> {
        self.suns.iter().map(|(sun, _)| *sun)
    }

    /// Visits the lights that a ray may meet before `end`, until one says that it is enough. Answers whether one did.
    pub fn on_ray(&self, ray: &Ray, end: f64, visit: &mut dyn FnMut(u32) -> bool) -> bool {
        if self.asks_all() { (0..self.count).any(visit) } else { self.tree.on_ray(ray, end, visit) }
    }
}
