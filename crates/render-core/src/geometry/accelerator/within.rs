//! Rays among bodies that touch, overlap or hold each other. Such a ray may be in the glass of several panes at once.

use super::{Accelerator, Hit, Primitive, Query, Surface, to_local};
use crate::geometry::coverage::Parts;
use crate::geometry::{Ray, SurfaceId};
use clerestory_film::counters::Counters;

/// What a ray knows about where it starts.
#[derive(Clone, Copy, Debug)]
pub struct Within<'a> {
    /// The panes in whose glass it starts.
    pub panes: &'a [u32],
    /// The surfaces on which it starts: two where two bodies touch.
    pub origins: [SurfaceId; 2],
    /// The pane that it has left by the edge. Its outline is convex, so that the ray does not meet it again.
    pub left: Option<u32>,
}

impl Accelerator {
    /// The nearest triangle or boundary of a pane within `max_distance`.
    pub fn closest_hit_within(
        &self,
        ray: &Ray,
        max_distance: f64,
        within: &Within<'_>,
        counters: &mut Counters,
    ) -> Option<Hit> {
        counters.rays += 1;
        let [first, second] = within.origins.map(|origin| Query::new(ray, origin, Parts::Drawn));
        self.nearest(ray, max_distance, None, |primitive| match primitive {
            Primitive::Triangle { index, corners } => {
                let hit = self.hit_triangle(&first, *index, corners)?;
                if matches!(within.origins[1], SurfaceId::Triangle(_)) {
                    return self.hit_triangle(&second, *index, corners);
                }
                Some(hit)
            }
            Primitive::Pane { index } if Some(*index) == within.left => None,
            Primitive::Pane { index } => {
                let start = within.origins.iter().find_map(|origin| match origin {
                    SurfaceId::Pane { index: own, face } if own == index => Some(*face),
                    _ => None,
                });
                let pane = &self.panes[*index as usize];
                let local = to_local(pane, ray);
                let hit = if within.panes.contains(index) {
                    pane.intersect_inside(&local, start, counters)
                } else {
                    pane.intersect_outside(&local, max_distance, start, counters)
                }?;
                Some(Hit { distance: hit.distance, surface: Surface::Pane { index: *index, hit } })
            }
            Primitive::Sheet { .. } => None,
        })
    }

    /// Calls `found` with each triangle that a ray meets within `max_distance`, in no order, and with its distance.
    pub fn triangles_along(&self, ray: &Ray, max_distance: f64, found: &mut dyn FnMut(u32, f64)) {
        let Some(everything) = &self.everything else { return };
        let query = Query::new(ray, SurfaceId::Nothing, Parts::Drawn);
        let mut test = |primitive: &Primitive| {
            if let Primitive::Triangle { index, corners } = primitive
                && let Some(hit) = self.hit_triangle(&query, *index, corners)
                && hit.distance <= max_distance
            {
                found(*index, hit.distance);
            }
        };
        everything.hierarchy.any(ray, max_distance, |leaf| {
            match &everything.leaves[leaf] {
                Primitive::Sheet { index } => {
                    let (_, sheet) = &self.sheets[*index as usize];
                    sheet.hierarchy.any(ray, max_distance, |leaf| {
                        test(&sheet.leaves[leaf]);
                        false
                    });
                }
                primitive => test(primitive),
            }
            false
        });
    }
}
