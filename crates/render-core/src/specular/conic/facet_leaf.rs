//! Triangles that are looked at eight at a time, to see on which of them a path may be.
//!
//! On a triangle, place and normal are linear in the weights x of its corners, counted from the middle. So is the defect h x n (see
//! `facet_tree`), but for little that is bounded: `g + K x` with a matrix K of two columns. At a path it is not larger than that
//! bound, and Cramer's rule says how far outside each edge that can be.

use glam::DVec3;

use super::{
    facet::Facet,
    seen_ends::{ALL, BENDING, ByLane, ROUNDING, SeenEnd, SeenEnds, Vectors, missing, numbers, vectors},
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
        self.holding(simd, &self.middles(simd, ends))
    }

    /// The same, and which of these may focus the light more than `strongly` (see [`Facet::focus`]).
    #[inline(always)]
    pub(super) fn may_hold_and_focus<S: Instructions>(&self, simd: S, ends: &SeenEnds<S>, strongly: f64) -> [u32; 2] {
        let middles = self.middles(simd, ends);
        let holding = self.holding(simd, &middles);
        let focusing = if holding == 0 { 0 } else { holding & self.focusing(simd, ends, &middles, strongly) };
        [holding, focusing]
    }

    /// What light does at the middles.
    #[inline(always)]
    fn middles<S: Instructions>(&self, simd: S, ends: &SeenEnds<S>) -> Middles<S> {
        let (centre, normal) = (Singles3::new(simd, &self.centre), Singles3::new(simd, &self.normal));
        let reach = Singles::new(simd, &self.reach);
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
        let both = [&near_end, &far_end];
        let half_by = [self.half_by(simd, ends, 0, both), self.half_by(simd, ends, 1, both)];
        let by = [
            half_by[0].cross(normal) + half.cross(Singles3::new(simd, &self.turning[0])),
            half_by[1].cross(normal) + half.cross(Singles3::new(simd, &self.turning[1])),
        ];
        let determinant = normal.dot(by[0].cross(by[1]));
        Middles { near_end, far_end, normal, half, half_by, by, determinant }
    }

    #[inline(always)]
    fn holding<S: Instructions>(&self, simd: S, middles: &Middles<S>) -> u32 {
        let &Middles { ref near_end, ref far_end, normal, half, by: [first, second], determinant, .. } = middles;
        let (reach, away) = (Singles::new(simd, &self.reach), Singles::new(simd, &self.away));
        let normal_length = Singles::new(simd, &self.normal_length);
        let defect = half.cross(normal);
        let longest = normal_length + away;
        let (size, rounding) = (half.length(), Singles::splat(simd, ROUNDING));
        let rest = (near_end.speed + far_end.speed) * reach * away
            + (near_end.bent + far_end.bent) * longest
            + rounding * (size + Singles::splat(simd, 1.0)) * longest;
        // Where the linear part vanishes, as weights from the middle times the determinant, the sign turned; only what is across the
        // normal counts.
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

    /// What [`Facet::focus`] computes, with slack for rounding. Longer edges and normals that turn more than these do make bends larger
    /// and nothing else.
    #[inline(always)]
    fn focusing<S: Instructions>(&self, simd: S, ends: &SeenEnds<S>, middles: &Middles<S>, strongly: f64) -> u32 {
        let Middles { near_end, far_end, normal, half_by, by, determinant, .. } = middles;
        let normal_length = Singles::new(simd, &self.normal_length);
        // Two corners are at most so far apart, and so are normals.
        let twice = Singles::splat(simd, 2.01);
        let (edge, turn) = (Singles::new(simd, &self.reach) * twice, Singles::new(simd, &self.away) * twice);
        let [mut speed, mut bend] = bending(edge, near_end, ends.indices[0]);
        let mut grain = Singles::splat(simd, ROUNDING) + ends.roundings[0] * near_end.speed;
        if ends.is_near {
            let [far_speed, far_bend] = bending(edge, far_end, ends.indices[1]);
            (speed, bend) = (speed + far_speed, bend + far_bend);
            grain = grain + ends.roundings[1] * far_end.speed;
        }
        let bending = bend * (normal_length + turn) + speed * turn * Singles::splat(simd, 2.0);
        let most = (by[0].dot(by[0]) + by[1].dot(by[1])).sqrt() * normal_length;
        let plane = normal.dot(half_by[0].cross(half_by[1])).abs() * normal_length * normal_length;
        // More than twice the length of a column: the half vector is off by `grain` times both indices at the most, what it moves by and
        // normals by some `grain` of their own length. Of a determinant that makes at most 3, of the plane's at most 1, `grain` times the
        // squared length, and times that of the normal.
        let column = (near_end.speed + far_end.speed) * edge * normal_length * Singles::splat(simd, 5.0)
            + (ends.indices[0] + ends.indices[1]) * turn * Singles::splat(simd, 2.0);
        let strongly = Singles::splat(simd, strongly as f32);
        let off = grain * normal_length * column * column;
        let slack = off + off * strongly * Singles::splat(simd, 3.0);
        !(plane + slack).less_than((determinant.abs() - most * bending) * strongly) & ALL
    }

    /// The derivative of the half vector by a weight.
    #[inline(always)]
    fn half_by<S: Instructions>(
        &self,
        simd: S,
        ends: &SeenEnds<S>,
        weight: usize,
        [near_end, far_end]: [&SeenEnd<S>; 2],
    ) -> Singles3<S> {
        let edge = Singles3::new(simd, &self.edges[weight]);
        let moved = (near_end.direction * near_end.direction.dot(edge) - edge) * near_end.speed;
        if ends.is_near {
            moved + (far_end.direction * far_end.direction.dot(edge) - edge) * far_end.speed
        } else {
            moved
        }
    }
}

/// What light does at the middles of eight triangles.
struct Middles<S> {
    near_end: SeenEnd<S>,
    far_end: SeenEnd<S>,
    normal: Singles3<S>,
    /// The half vectors.
    half: Singles3<S>,
    /// Their derivatives by both weights.
    half_by: [Singles3<S>; 2],
    /// The derivatives of the defect by both weights.
    by: [Singles3<S>; 2],
    /// That of those across the normal, times the normal's length.
    determinant: Singles<S>,
}

/// How fast the part of the half vector towards an end turns within an edge's length, and twice how fast that changes.
#[inline(always)]
fn bending<S: Instructions>(edge: Singles<S>, end: &SeenEnd<S>, index: Singles<S>) -> [Singles<S>; 2] {
    // The distance is the index over the speed.
    let turn = edge.over((index.over(end.speed) - edge).positive_part());
    let speed = index * turn;
    [speed, speed * turn * Singles::splat(edge.simd(), 2.0 * BENDING as f32)]
}
