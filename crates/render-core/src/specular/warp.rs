//! Points of a square, spread evenly, moved onto patches of a plane by their weights.
//!
//! The patches are halved again and again by where they are, and the square with them, in proportion to the weights.
//! This is hierarchical warping (Clarberg et al. 2005, "Wavelet Importance Sampling", section 4.2). Neighbours in the
//! square stay neighbours on the plane. So points that are spread evenly stay so, however the plane is cut.

use glam::DVec2;
use smallvec::SmallVec;

/// Patches for which no memory is allocated.
const USUAL_PATCHES: usize = 32;

/// A patch of the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weighted {
    /// Its number.
    pub(super) index: u32,
    /// Its middle.
    pub(super) at: DVec2,
    /// Its part of the square's points: positive.
    pub(super) weight: f64,
}

/// The map from the unit square to patches.
#[derive(Clone, Debug)]
pub(super) struct Warp {
    patches: SmallVec<[Weighted; USUAL_PATCHES]>,
    /// The halving of all, that of its first half and what is in it, and that of its second half and what is in it.
    splits: SmallVec<[Split; USUAL_PATCHES]>,
    total: f64,
}

/// How patches are halved.
#[derive(Clone, Copy, Debug)]
struct Split {
    axis: usize,
    /// Patches in the first half.
    first: usize,
    /// Its part of the weight.
    part: f64,
}

impl Warp {
    /// The map to some patches.
    pub(super) fn new(patches: impl Iterator<Item = Weighted>) -> Self {
        let mut warp = Self { patches: patches.collect(), splits: SmallVec::new(), total: 0.0 };
        warp.total = halve(&mut warp.patches, &mut warp.splits);
        warp
    }

    /// The weight of all patches.
    pub(super) fn total(&self) -> f64 {
        self.total
    }

    /// The number of the patch to which a point of the square goes, and a point of the square for its place within;
    /// `None` where there are no patches.
    pub(super) fn patch(&self, mut point: DVec2) -> Option<(u32, DVec2)> {
        let (mut patches, mut splits) = (&self.patches[..], &self.splits[..]);
        while let [split, below @ ..] = splits {
            let at = point[split.axis];
            let is_first = at < split.part;
            point[split.axis] = if is_first { at / split.part } else { (at - split.part) / (1.0 - split.part) };
            let (first_patches, second_patches) = patches.split_at(split.first);
            let (first_splits, second_splits) = below.split_at(split.first - 1);
            (patches, splits) = if is_first { (first_patches, first_splits) } else { (second_patches, second_splits) };
        }
        patches.first().map(|patch| (patch.index, point.clamp(DVec2::ZERO, DVec2::splat(BELOW_ONE))))
    }
}

/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// Sorts patches, adds how they are halved, and returns their weight.
fn halve(patches: &mut [Weighted], splits: &mut SmallVec<[Split; USUAL_PATCHES]>) -> f64 {
    if let [] | [_] = patches {
        return patches.iter().map(|patch| patch.weight).sum();
    }
    let (mut min, mut max, mut moment, mut total) = (DVec2::INFINITY, DVec2::NEG_INFINITY, DVec2::ZERO, 0.0);
    for Weighted { at, weight, .. } in &*patches {
        min = min.min(*at);
        max = max.max(*at);
        moment += *at * *weight;
        total += weight;
    }
    let axis = (max - min).max_position();
    let middle = moment[axis] / total;
    let mut first = 0;
    for index in 0..patches.len() {
        if patches[index].at[axis] < middle {
            patches.swap(first, index);
            first += 1;
        }
    }
    // Middles that are the same, or all but that.
    if first == 0 || first == patches.len() {
        first = patches.len() / 2;
    }
    let split = splits.len();
    splits.push(Split { axis, first, part: 0.5 });
    let (low, high) = patches.split_at_mut(first);
    let low = halve(low, splits);
    let sum = low + halve(high, splits);
    splits[split].part = low / sum;
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specular::light_view::GOLDEN_RATIO;
    use crate::specular::testing::{pair, random};

    /// Cells of a grid in rows, each cut into `cuts` slices.
    fn slices(cuts: u32) -> Vec<Weighted> {
        let slice = |index: u32| {
            let (cell, slice) = (index / cuts, index % cuts);
            let (x, y) = (cell % 4, cell / 4);
            let at = DVec2::new(f64::from(x) + (f64::from(slice) + 0.5) / f64::from(cuts), f64::from(y));
            Weighted { index, at, weight: 1.0 / f64::from(cuts) }
        };
        (0..16 * cuts).map(slice).collect()
    }

    #[test]
    fn points_fall_on_patches_by_weight_and_evenly_within_them() {
        let mut random = random(31);
        let patches: Vec<Weighted> = (0..23)
            .map(|index| Weighted { index, at: pair(&mut random), weight: 0.05 + random.next_f64().powi(4) })
            .collect();
        let warp = Warp::new(patches.iter().copied());
        let total: f64 = patches.iter().map(|patch| patch.weight).sum();
        assert!((warp.total() - total).abs() < 1e-12 * total);
        let count = 1_000_000;
        let mut found = vec![(0.0, DVec2::ZERO); patches.len()];
        for index in 0..count {
            let point = DVec2::new(f64::from(index) / f64::from(count), (f64::from(index) * GOLDEN_RATIO).fract());
            let (patch, within) = warp.patch(point).unwrap();
            let (points, mean) = &mut found[patch as usize];
            *points += 1.0;
            *mean += within;
        }
        for (patch, (points, sum)) in patches.iter().zip(found) {
            let part = points / f64::from(count);
            assert!((part / (patch.weight / total) - 1.0).abs() < 0.05, "patch {}: {part}", patch.index);
            let mean = sum / points;
            assert!((mean - 0.5).abs().max_element() < 0.02, "patch {}: {mean}", patch.index);
        }
    }

    #[test]
    fn even_points_stay_even_however_the_patches_are_cut() {
        for cuts in [1, 3, 10] {
            let patches = slices(cuts);
            let warp = Warp::new(patches.iter().copied());
            let mut cells = [0; 16];
            for index in 0..16 {
                let point = (DVec2::new(f64::from(index % 4), f64::from(index / 4)) + 0.5) / 4.0;
                let (patch, _) = warp.patch(point).unwrap();
                cells[(patch / cuts) as usize] += 1;
            }
            assert_eq!(cells, [1; 16], "cells cut into {cuts}");
        }
    }

    #[test]
    fn patches_in_one_place_are_told_apart_and_none_have_no_points() {
        let patch = |index| Weighted { index, at: DVec2::ONE, weight: 1.0 };
        let warp = Warp::new((0..5).map(patch));
        let found: std::collections::BTreeSet<u32> = (0..100)
            .filter_map(|step| warp.patch(DVec2::splat(f64::from(step) / 100.0)))
            .map(|(patch, _)| patch)
            .collect();
        assert_eq!(found.len(), 5);
        assert!(Warp::new(std::iter::empty()).patch(DVec2::ZERO).is_none());
    }
}
