//! The hierarchy of boxes that decides which primitives a ray is tested against.
//!
//! It is a compressed wide hierarchy from obvhs (Ylitie, Karras, Laine, *Efficient Incoherent Ray Traversal on GPUs
//! Through Compressed Wide BVHs*, HPG 2017). It computes in single precision. The tests of the primitives are in double
//! precision. So that it never loses a primitive that they would find:
//! - the scene is centred and scaled by a power of two to an extent of 2^14 to 2^15 units. Rays start where they enter
//!   it;
//! - boxes are padded by 1/8 unit. This is five times the rounding of the box test (a few units in the last place of
//!   2^15). It is a thousand times the 1e-4 units below which obvhs does not see the exit of a box;
//! - a hit at distance t cuts the search only behind t plus the padding.
//!
//! Each box is padded by another amount. Among boxes that are alike obvhs would find no pairs, and each would become a
//! level of its own.

use std::time::Duration;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray as HierarchyRay, RayHit};

use super::Ray;
use crate::math::Interval;
use crate::math::hash::mix;

/// Binary logarithm of the largest extent of the scene in units of the hierarchy.
const EXTENT_LOG2: i32 = 15;

/// Padding of boxes in units of the hierarchy.
const PADDING: f64 = 0.125;

/// Levels of the hierarchy that obvhs can walk; in a deeper one it would lose nodes silently.
pub(crate) const MOST_LEVELS: usize = 31;

/// A hierarchy over boxes; there is at least one.
#[derive(Clone, Debug)]
pub(crate) struct Hierarchy {
    tree: CwBvh,
    bounds: [DVec3; 2],
    centre: DVec3,
    scale: f64,
}

/// A ray on its way through a hierarchy.
struct Walk<'a> {
    tree: &'a CwBvh,
    ray: HierarchyRay,
    start: f64,
    scale: f64,
}

impl Hierarchy {
    /// The hierarchy over boxes, given by two corners each; `None` when there are none.
    pub(crate) fn over(boxes: impl ExactSizeIterator<Item = [DVec3; 2]> + Clone) -> Option<Self> {
        if boxes.len() == 0 {
            return None;
        }
        let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let bounds = boxes.clone().fold(nothing, |[min, max], [low, high]| [min.min(low), max.max(high)]);
        let extent = (bounds[1] - bounds[0]).max_element();
        let scale = if extent > 0.0 { libm::scalbn(1.0, EXTENT_LOG2 - 1 - libm::ilogb(extent)) } else { 1.0 };
        let centre = 0.5 * (bounds[0] + bounds[1]);
        let unit = |p: DVec3| (p - centre) * scale;
        let padded: Vec<_> = (0..)
            .zip(boxes)
            .map(|(index, [min, max])| {
                let (below, above) = (padding(2 * index), padding(2 * index + 1));
                Aabb::new(single(unit(min) - below), single(unit(max) + above))
            })
            .collect();
        let tree = build_cwbvh(&padded, BvhBuildParams::medium_build(), &mut Duration::default());
        Some(Self { tree, bounds, centre, scale })
    }

    /// Corners of the box around everything.
    pub(crate) fn bounds(&self) -> [DVec3; 2] {
        self.bounds
    }

    /// The numbers of the boxes in the order in which the leaves hold them.
    pub(crate) fn leaves(&self) -> &[u32] {
        &self.tree.primitive_indices
    }

    /// Number of levels; must not exceed [`MOST_LEVELS`].
    pub(crate) fn levels(&self) -> usize {
        let mut most = 0;
        let mut nodes = vec![(0, 1)];
        while let Some((node, level)) = nodes.pop() {
            most = most.max(level);
            let node = &self.tree.nodes[node as usize];
            let first = node.child_base_idx;
            nodes.extend((first..first + node.imask.count_ones()).map(|child| (child, level + 1)));
        }
        most
    }

    /// Hands to `test` the places, in the order of the leaves, of all boxes that may hold something within
    /// `max_distance` along the ray. Whenever `test` returns a distance, nothing farther away is looked for any more.
    pub(crate) fn visit(&self, ray: &Ray, max_distance: f64, mut test: impl FnMut(usize) -> Option<f64>) {
        let Some(walk) = self.enter(ray, max_distance) else { return };
        walk.tree.ray_traverse(walk.ray, &mut RayHit::none(), |_, leaf| {
            test(leaf).map_or(f32::INFINITY, |distance| walk.cut(distance))
        });
    }

    /// Whether `test` says yes to one of the places, in the order of the leaves, of the boxes that may hold something
    /// within `max_distance` along the ray.
    pub(crate) fn any(&self, ray: &Ray, max_distance: f64, mut test: impl FnMut(usize) -> bool) -> bool {
        let Some(walk) = self.enter(ray, max_distance) else { return false };
        !walk.tree.ray_traverse_miss(walk.ray, |_, leaf| if test(leaf) { 0.0 } else { f32::INFINITY })
    }

    /// The ray in units of the hierarchy, from where it enters the bounds; `None` when it misses them.
    fn enter(&self, ray: &Ray, max_distance: f64) -> Option<Walk<'_>> {
        let margin = PADDING / self.scale;
        let mut within = Interval::new(0.0, max_distance);
        for axis in 0..3 {
            let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
            let (low, high) = (self.bounds[0][axis] - margin - origin, self.bounds[1][axis] + margin - origin);
            if direction != 0.0 {
                let (a, b) = (low / direction, high / direction);
                within = within.intersection(Interval::new(a.min(b), a.max(b)));
            } else if low > 0.0 || high < 0.0 {
                return None;
            }
        }
        if within.is_empty() {
            return None;
        }
        let start = within.min;
        // Adding 0 turns -0 into 0, whose inverse obvhs would take for the wrong infinity.
        let direction = single(ray.direction) + Vec3A::ZERO;
        let origin = single((ray.at(start) - self.centre) * self.scale);
        let mut walk =
            Walk { tree: &self.tree, start, scale: self.scale, ray: HierarchyRay::new(origin, direction, 0.0, 0.0) };
        walk.ray.tmax = walk.cut(within.max);
        Some(walk)
    }
}

impl Walk<'_> {
    /// The end of the search for anything not farther than `distance`.
    fn cut(&self, distance: f64) -> f32 {
        (((distance - self.start) * self.scale).max(0.0) + PADDING) as f32
    }
}

/// One to two times the padding along each axis, by chance.
fn padding(number: u64) -> DVec3 {
    let bits = mix(number);
    let part = |shift: u32| (bits >> shift & 0xffff) as f64 / 65536.0;
    DVec3::new(part(0), part(16), part(32)) * PADDING + PADDING
}

fn single(v: DVec3) -> Vec3A {
    Vec3A::new(v.x as f32, v.y as f32, v.z as f32)
}
