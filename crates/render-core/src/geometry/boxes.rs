//! Which boxes overlap another box, found through a hierarchy.
//!
//! The hierarchy is in single precision, about the middle of all boxes, and its boxes are wider by more than that
//! rounds. What it finds is compared again in double precision.

use std::time::Duration;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use super::contact::{NOWHERE, join, overlap};

/// Boxes are wider by this part of the largest coordinate.
const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// Boxes, each given by its smallest and its largest corner.
pub(crate) struct BoxIndex {
    boxes: Vec<[DVec3; 2]>,
    middle: DVec3,
    margin: f64,
    tree: Bvh2,
}

impl BoxIndex {
    /// An index of boxes.
    pub(crate) fn over(boxes: Vec<[DVec3; 2]>) -> Self {
        let around = boxes.iter().copied().fold(NOWHERE, join);
        let middle = if boxes.is_empty() { DVec3::ZERO } else { 0.5 * (around[0] + around[1]) };
        let margin = if boxes.is_empty() { 0.0 } else { ROUNDING * (around[1] - middle).max_element() };
        let single: Vec<Aabb> = boxes.iter().map(|corners| padded(corners, middle, margin)).collect();
        let tree = build_bvh2(&single, BvhBuildParams::fast_build(), &mut Duration::default());
        Self { boxes, middle, margin, tree }
    }

    /// Hands the numbers of all boxes that overlap one to `found`, in no particular order, until that says no.
    pub(crate) fn overlapping(&self, corners: &[DVec3; 2], mut found: impl FnMut(u32) -> bool) {
        if self.boxes.is_empty() {
            return;
        }
        self.tree.aabb_traverse(padded(corners, self.middle, self.margin), |tree, node| {
            let node = &tree.nodes[node as usize];
            let (first, count) = (node.first_index as usize, node.prim_count as usize);
            tree.primitive_indices[first..first + count]
                .iter()
                .all(|&index| !overlap(corners, &self.boxes[index as usize]) || found(index))
        });
    }
}

fn padded([min, max]: &[DVec3; 2], middle: DVec3, margin: f64) -> Aabb {
    let single = |corner: DVec3| Vec3A::new(corner.x as f32, corner.y as f32, corner.z as f32);
    Aabb::new(single(*min - middle - margin), single(*max - middle + margin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_that_overlap_are_found_far_from_the_origin_too() {
        for offset in [DVec3::ZERO, DVec3::new(1e6, -2e6, 3e5)] {
            let corner = |index: u32| {
                let part = |factor: f64| libm::sin(f64::from(index) * factor) * 3.0;
                offset + DVec3::new(part(12.9), part(78.2), part(37.7))
            };
            let boxes: Vec<[DVec3; 2]> =
                (0..500).map(|index| [corner(index), corner(index) + 0.02 * f64::from(index % 17)]).collect();
            let index = BoxIndex::over(boxes.clone());
            let mut pairs = 0;
            for one in &boxes {
                let mut found = Vec::new();
                index.overlapping(one, |other| {
                    found.push(other);
                    true
                });
                found.sort_unstable();
                let expected: Vec<u32> =
                    (0..).zip(&boxes).filter(|(_, other)| overlap(one, other)).map(|(number, _)| number).collect();
                assert_eq!(found, expected);
                pairs += found.len();
            }
            assert!(pairs > 600, "{pairs} pairs");
        }
        BoxIndex::over(Vec::new()).overlapping(&[DVec3::ZERO; 2], |_| panic!("there is no box"));
    }
}
