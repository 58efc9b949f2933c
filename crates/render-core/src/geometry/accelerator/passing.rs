//! Rays that go straight through some triangles: thin walls.

use arrayvec::ArrayVec;

use super::{Accelerator, Hit, Primitive, Query, Surface};
use crate::geometry::coverage::Parts;
use crate::geometry::{Ray, SurfaceId};
use clerestory_film::counters::Counters;

/// Most triangles that a ray goes straight through.
pub const MOST_PASSED: usize = 64;

/// Triangles that a ray goes straight through.
pub type Passed = ArrayVec<PassedTriangle, MOST_PASSED>;

/// A triangle that a ray goes straight through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassedTriangle {
    /// Its number in the scene.
    pub index: u32,
    /// Weights of its second and third corner.
    pub barycentric: [f64; 2],
    /// Distance along the ray in metres.
    pub distance: f64,
}

impl Accelerator {
    /// The nearest hit of a ray through the air that goes straight through the triangles of which `passes` says so. It
    /// is one ray, so what is there of veils is what [`Accelerator::passed`] finds.
    pub fn closest_hit_past(
        &self,
        ray: &Ray,
        ray_origin: SurfaceId,
        passes: &dyn Fn(u32) -> bool,
        counters: &mut Counters,
    ) -> Option<Hit> {
        counters.rays += 1;
        let query = Query::new(ray, ray_origin, Parts::Drawn);
        self.nearest(ray, f64::INFINITY, self.left_behind(ray_origin, ray), |primitive| match primitive {
            Primitive::Triangle { index, .. } if passes(*index) => None,
            Primitive::Triangle { index, corners } => self.hit_triangle(&query, *index, corners),
            Primitive::Pane { index } => self.hit_pane(ray, f64::INFINITY, *index, ray_origin, counters),
            Primitive::Sheet { .. } => None,
        })
    }

    /// The triangles that a ray through the air goes straight through within `max_distance`, nearest first. `passes`
    /// says of which triangles light passes. `None` where anything else stands in the way, or more than
    /// [`MOST_PASSED`].
    pub fn passed(
        &self,
        ray: &Ray,
        max_distance: f64,
        ray_origin: SurfaceId,
        passes: &dyn Fn(u32) -> bool,
        counters: &mut Counters,
    ) -> Option<Passed> {
        counters.rays += 1;
        let mut all = Passed::new();
        let query = Query::new(ray, ray_origin, Parts::Drawn);
        let blocked = self.any(&query, max_distance, SurfaceId::Nothing, None, counters, |hit| {
            if hit.distance > max_distance {
                return false;
            }
            let Surface::Triangle { index, barycentric } = hit.surface else { return true };
            !passes(index) || all.try_push(PassedTriangle { index, barycentric, distance: hit.distance }).is_err()
        });
        if blocked {
            return None;
        }
        all.sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.index.cmp(&b.index)));
        let mut last: Option<PassedTriangle> = None;
        all.retain(|next| {
            let corners = self.corners(next.index);
            let is_left = last.is_some_and(|last| self.is_beside(last.index, corners, next.distance - last.distance));
            if !is_left {
                last = Some(*next);
            }
            !is_left
        });
        Some(all)
    }
}
