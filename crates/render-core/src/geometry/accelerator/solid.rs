//! The scene without what is only partly there, for searches that trace many rays to find one path.
//!
//! What is left out is asked for once for each path that is found ([`Accelerator::is_veiled`]).

use super::{Accelerator, Hit, Query, precedes};
use crate::geometry::coverage::Parts;
use crate::geometry::{Face, Ray, SurfaceId};
use clerestory_film::counters::Counters;

/// The part of the way to a place on which something may stand in the way. The place itself, and the triangle beside an
/// edge on which it lies, are behind.
const BEFORE: f64 = 1.0 - 1e-9;

/// What all rays meet: panes, and triangles where they are not partly there.
#[derive(Clone, Copy, Debug)]
pub struct Solid<'a>(&'a Accelerator);

impl Accelerator {
    /// Without surfaces that are only partly there.
    pub fn solid(&self) -> Solid<'_> {
        Solid(self)
    }

    /// Whether a surface that is only partly there stands in the way to a place `distance` along a ray.
    pub fn is_veiled(&self, ray: &Ray, distance: f64, ray_origin: SurfaceId, counters: &mut Counters) -> bool {
        if self.coverage.is_none() {
            return false;
        }
        counters.rays += 1;
        let end = distance * BEFORE;
        let query = Query::new(ray, ray_origin, Parts::Veils);
        self.any(&query, end, SurfaceId::Nothing, None, counters, |hit| hit.distance <= end)
    }
}

impl Solid<'_> {
    /// [`Accelerator::closest_hit`].
    pub fn closest_hit(
        &self,
        ray: &Ray,
        max_distance: f64,
        ray_origin: SurfaceId,
        counters: &mut Counters,
    ) -> Option<Hit> {
        self.0.closest(&Query::new(ray, ray_origin, Parts::Solid), max_distance, counters)
    }

    /// What [`Self::closest_hit`] finds, when that is the given pane. Asking for one pane alone is quicker, above all
    /// where the ray misses it: then nothing else is looked at.
    pub fn closest_hit_on_pane(
        &self,
        pane: u32,
        ray: &Ray,
        max_distance: f64,
        ray_origin: SurfaceId,
        counters: &mut Counters,
    ) -> Option<Hit> {
        counters.rays += 1;
        let hit = self.0.hit_pane(ray, max_distance, pane, ray_origin, counters)?;
        let query = Query::new(ray, ray_origin, Parts::Solid);
        let before = |other: &Hit| precedes(other, &hit);
        let blocked = hit.distance > max_distance
            || self.0.any(&query, hit.distance, SurfaceId::Nothing, Some(pane), counters, before);
        (!blocked).then_some(hit)
    }

    /// [`Accelerator::closest_hit_inside`].
    pub fn closest_hit_inside(
        &self,
        pane: u32,
        ray: &Ray,
        start_face: Option<Face>,
        counters: &mut Counters,
    ) -> Option<Hit> {
        self.0.closest_inside(pane, &Query::new(ray, SurfaceId::Nothing, Parts::Solid), start_face, counters)
    }

    /// Whether anything stands within `max_distance` in the way of a ray through the air.
    pub fn occluded(&self, ray: &Ray, max_distance: f64, ray_origin: SurfaceId, counters: &mut Counters) -> bool {
        self.0.occluded_to(&Query::new(ray, ray_origin, Parts::Solid), max_distance, None, counters)
    }

    /// Whether anything stands in the way to a place on a triangle, `distance` along a ray through the air.
    pub fn occluded_before(
        &self,
        ray: &Ray,
        distance: f64,
        ray_origin: SurfaceId,
        triangle: u32,
        counters: &mut Counters,
    ) -> bool {
        counters.rays += 1;
        let end = distance * BEFORE;
        let query = Query::new(ray, ray_origin, Parts::Solid);
        self.0.any(&query, end, SurfaceId::Triangle(triangle), None, counters, |hit| hit.distance <= end)
    }
}
