//! What lies between two points of a scene: triangles, panes and lights.

use glam::DVec3;

use super::Scene;
use crate::geometry::{Face, Ray, Surface, SurfaceId};
use crate::light::Source;
use crate::scene::ShadingPoint;
use clerestory_film::counters::Counters;

/// Things on one ray whose distances differ by less than this part are in the same place.
pub(crate) const SAME_PLACE: f64 = 1e-9;

impl Scene {
    /// Whether anything blocks the ray before `max_distance`, apart from the pane and the light that are named. A light
    /// that lies on a surface is in front of it.
    pub fn blocked(
        &self,
        ray: &Ray,
        max_distance: f64,
        ray_origin: SurfaceId,
        ignored_pane: Option<u32>,
        target_light: Option<u32>,
        counters: &mut Counters,
    ) -> bool {
        let clear = if target_light.is_some() { max_distance * (1.0 - SAME_PLACE) } else { max_distance };
        self.blocked_by_light(ray, max_distance, target_light)
            || self.accelerator().occluded(ray, clear, ray_origin, ignored_pane, counters)
    }

    /// Whether a light stands on the ray before `max_distance`, apart from the one that is named.
    pub fn blocked_by_light(&self, ray: &Ray, max_distance: f64, target_light: Option<u32>) -> bool {
        self.light_sampler().on_ray(ray, max_distance, &mut |index| {
            let hit = || self.lights()[index as usize].intersect(ray);
            Some(index) != target_light
                && hit().is_some_and(|hit| hit.distance < max_distance && hit.distance.is_finite())
        })
    }

    /// Whether anything but the pane blocks the way from `point` to `entry` on its near face, or stands in the glass
    /// between `entry` and `exit`.
    pub fn blocked_through_pane(
        &self,
        point: &ShadingPoint,
        entry: DVec3,
        pane: u32,
        near: Face,
        exit: &DVec3,
        counters: &mut Counters,
    ) -> bool {
        let (first, first_length) = segment(point.position, entry);
        let (inner, inner_length) = segment(entry, *exit);
        self.blocked(&first, first_length, point.surface, Some(pane), None, counters)
            || self.blocked(
                &inner,
                inner_length,
                SurfaceId::Pane { index: pane, face: near },
                Some(pane),
                None,
                counters,
            )
    }

    /// The pane that the straight line from `point` to `source` meets before anything else.
    pub fn first_pane_towards(&self, point: &ShadingPoint, source: Source, counters: &mut Counters) -> Option<u32> {
        let (ray, distance) = straight(point.position, source);
        let hit = self.accelerator().closest_hit(&ray, distance, point.surface, counters)?;
        match hit.surface {
            Surface::Pane { index, .. } => Some(index),
            Surface::Triangle { .. } => None,
        }
    }

    /// Whether anything blocks the straight line from `point` to `source`.
    pub fn is_blocked_towards(&self, point: &ShadingPoint, source: Source, counters: &mut Counters) -> bool {
        let (ray, distance) = straight(point.position, source);
        self.accelerator().occluded(&ray, distance, point.surface, None, counters)
    }
}

fn segment(from: DVec3, to: DVec3) -> (Ray, f64) {
    let offset = to - from;
    let length = offset.length();
    (Ray::new(from, offset / length), length)
}

/// The straight line from a point to a source, and its length.
pub(crate) fn straight(from: DVec3, source: Source) -> (Ray, f64) {
    match source {
        Source::Point(position) => segment(from, position),
        Source::Direction(direction) => (Ray::new(from, direction), f64::INFINITY),
    }
}
