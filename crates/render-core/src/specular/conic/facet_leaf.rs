//! Triangles that are looked at eight at a time, to see on which of them a path may be.
//!
//! On a triangle, place and normal are linear in the weights x of its corners, counted from the middle. So is the defect h x n (see
//! `facet_tree`), but for little that is bounded: `g + K x` with a matrix K of two columns. At a path it is not larger than that
//! bound, and Cramer's rule says how far outside each edge that can be.

use glam::DVec3;

use super::{
    facet::Facet,
    seen_ends::{ALL, ByLane, ROUNDING, SeenEnd, SeenEnds, Vectors, missing, numbers, vectors},
};
use crate::lanes::{
    Instructions,
    singles::{SINGLES, Singles, Singles3},
};

/// At most eight triangles, in single precision relative to the middle of the mesh.
#[derive(Clone, Debug)]
pub(super) struct FacetLeaf {
    /// Their middles.
    centre: Vectors,
    /// From their first corners to the second and third.
    edges: [Vectors; 2],
    /// The normals in the middles.
    normal: Vectors,
    /// From the normals at their first corners to those at the second and third.
    turning: [Vectors; 2],
    /// How far places are from the middle at the most.
    reach: ByLane,
    /// Length of the normals in the middles.
    normal_length: ByLane,
    /// How far normals are from those at the most.
    away: ByLane,
    /// Their numbers.
    pub(super) triangles: [u32; SINGLES],
    /// The bits of those that are not there.
    missing: u32,
}

impl FacetLeaf {
    /// Triangles with their numbers, at most eight.
    pub(super) fn over(facets: &[(u32, Facet)], middle: DVec3) -> Self {
        let mean = |corners: &[DVec3; 3]| corners.iter().sum::<DVec3>() / 3.0;
        let farthest = |corners: &[DVec3; 3]| {
            let mean = mean(corners);
            corners.iter().fold(0.0, |most, corner| f64::max(most, (*corner - mean).length()))
        };
        Self {
            centre: vectors(facets, |(_, facet)| mean(&facet.corners) - middle),
            edges: [1, 2].map(|k| vectors(facets, |(_, facet)| facet.corners[k] - facet.corners[0])),
            normal: vectors(facets, |(_, facet)| mean(&facet.normals)),
            turning: [1, 2].map(|k| vectors(facets, |(_, facet)| facet.normals[k] - facet.normals[0])),
            reach: numbers(facets, |(_, facet)| farthest(&facet.corners)),
            normal_length: numbers(facets, |(_, facet)| mean(&facet.normals).length()),
            away: numbers(facets, |(_, facet)| farthest(&facet.normals)),
            triangles: std::array::from_fn(|lane| facets.get(lane).map_or(0, |(triangle, _)| *triangle)),
            missing: missing(facets),
        }
    }

    /// On which triangles a path may be, as the bits of a number.
    #[inline(always)]
    pub(super) fn may_hold<S: Instructions>(&self, simd: S, ends: &SeenEnds<S>) -> u32 {
        let (centre, normal) = (Singles3::new(simd, &self.centre), Singles3::new(simd, &self.normal));
        let (reach, away) = (Singles::new(simd, &self.reach), Singles::new(simd, &self.away));
        let normal_length = Singles::new(simd, &self.normal_length);
        let (to_point, to_light) = (ends.point - centre, ends.light - centre * ends.near);
        let nearest = (to_point.length() - reach).positive_part();
        let near_end = SeenEnd::new(to_point, ends.indices[0], nearest, reach, ends.grains[0]);
        let far_end = if ends.is_near {
            let nearest = (to_light.length() - reach).positive_part();
            SeenEnd::new(to_light, ends.indices[1], nearest, reach, ends.grains[1])
        } else {
            SeenEnd::at_infinity(to_light, ends.indices[1], ends.grains[1])
        };
        let half = near_end.direction.times_plus(ends.indices[0], far_end.direction * ends.indices[1]);
        let first = self.column(simd, ends, 0, [&near_end, &far_end], normal, half);
        let second = self.column(simd, ends, 1, [&near_end, &far_end], normal, half);
        let defect = half.cross(normal);
        let longest = normal_length + away;
        let (size, rounding) = (half.length(), Singles::splat(simd, ROUNDING));
        let rest = (near_end.speed + far_end.speed) * reach * away
            + (near_end.bent + far_end.bent) * longest
            + rounding * (size + Singles::splat(simd, 1.0)) * longest;
        // Where the linear part vanishes, as weights from the middle times the determinant, the sign turned; only what is across the
        // normal counts.
        let determinant = normal.dot(first.cross(second));
        let weights = [normal.dot(defect.cross(second)), normal.dot(first.cross(defect))];
        // Outside an edge, all times the squared determinant: the middle is a third of the way to the opposite corner. What the rest makes
        // of a weight is at most what the other column makes of it.
        let third = determinant * determinant * Singles::splat(simd, 1.0 / 3.0);
        let scale = normal_length * determinant.abs();
        let slack = rest * scale;
        let lengths = [first.length(), second.length()];
        let cancelled = rounding * scale * (size * normal_length + lengths[0]) * (lengths[0] + lengths[1]);
        let sum = Singles::splat(simd, 0.0) - (weights[0] + weights[1]) * determinant;
        let beyond = (slack * lengths[1]).less_than(weights[0] * determinant - third)
            | (slack * lengths[0]).less_than(weights[1] * determinant - third)
            | (slack * (second - first).length() + cancelled).less_than(sum - third);
        !(beyond | self.missing) & ALL
    }

    /// The derivative of the defect by a weight.
    #[inline(always)]
    fn column<S: Instructions>(
        &self,
        simd: S,
        ends: &SeenEnds<S>,
        weight: usize,
        [near_end, far_end]: [&SeenEnd<S>; 2],
        normal: Singles3<S>,
        half: Singles3<S>,
    ) -> Singles3<S> {
        let edge = Singles3::new(simd, &self.edges[weight]);
        let mut moved = (near_end.direction * near_end.direction.dot(edge) - edge) * near_end.speed;
        if ends.is_near {
            moved = moved + (far_end.direction * far_end.direction.dot(edge) - edge) * far_end.speed;
        }
        moved.cross(normal) + half.cross(Singles3::new(simd, &self.turning[weight]))
    }
}
