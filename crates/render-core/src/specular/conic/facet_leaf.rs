//! Triangles that are looked at eight at a time, to see on which of them a path may be.
//!
//! On a triangle, place and normal are linear in the weights x of its corners, counted from the middle. So is the defect h x n (see
//! `facet_tree`), but for little that is bounded: `g + K x` with a matrix K of two columns. At a path it is not larger than that
//! bound, and Cramer's rule says how far outside each edge that can be.

use glam::DVec3;

use super::{
    facet::Facet,
    seen_ends::{ALL, BENDING, ByLane, ROUNDING, SeenEnds, Vectors, missing, numbers, vectors},
};
use crate::lanes::{
    Instructions,
    singles::{SINGLES, Singles, Singles3, prefetch},
};

/// At most eight triangles, in single precision relative to the middle of the mesh.
#[derive(Clone, Debug)]
#[repr(align(64))]
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

    /// Tells the processor that it will be looked at soon.
    #[inline(always)]
    pub(super) fn prefetch(&self) {
        let Self { centre, edges, normal, turning, reach, normal_length, away, .. } = self;
        [centre, &edges[0], &edges[1], normal, &turning[0], &turning[1]].into_iter().flatten().for_each(prefetch);
        [reach, normal_length, away].into_iter().for_each(prefetch);
    }

    /// On which triangles a path may be, as the bits of a number.
    #[inline(always)]
    pub(super) fn may_hold<S: Instructions, const NEAR: bool>(&self, simd: S, ends: &SeenEnds<S, NEAR>) -> u32 {
        self.holding(simd, &self.middles(simd, ends))
    }

    /// The same, and which of these may focus the light more than `strongly` (see [`Facet::focus`]).
    #[inline(always)]
    pub(super) fn may_hold_and_focus<S: Instructions, const NEAR: bool>(
        &self,
        simd: S,
        ends: &SeenEnds<S, NEAR>,
        strongly: f64,
    ) -> [u32; 2] {
        let middles = self.middles(simd, ends);
        let holding = self.holding(simd, &middles);
        let focusing = if holding == 0 { 0 } else { holding & self.focusing(simd, ends, &middles, strongly) };
        [holding, focusing]
    }

    /// What light does at the middles.
    #[inline(always)]
    fn middles<S: Instructions, const NEAR: bool>(&self, simd: S, ends: &SeenEnds<S, NEAR>) -> Middles<S> {
        let (centre, normal) = (Singles3::new(simd, &self.centre), Singles3::new(simd, &self.normal));
        let reach = Singles::new(simd, &self.reach);
        let [to_point, to_light] = ends.offsets(centre);
        let near_end = ends.seen_point(to_point, self.closest(simd, to_point), reach);
        let edges = [Singles3::new(simd, &self.edges[0]), Singles3::new(simd, &self.edges[1])];
        let mut half_by = [near_end.moved(edges[0]), near_end.moved(edges[1])];
        let (mut half, mut speed, mut bent) = (near_end.half, near_end.speed, near_end.bent);
        let mut far_speed = None;
        if NEAR {
            let far_end = ends.seen_light(to_light, self.closest(simd, to_light), reach);
            half_by = [half_by[0] + far_end.moved(edges[0]), half_by[1] + far_end.moved(edges[1])];
            (half, speed, bent) = (half + far_end.half, speed + far_end.speed, bent + far_end.bent);
            far_speed = Some(far_end.speed);
        } else {
            (half, bent) = (half + to_light, bent + ends.bent_at_infinity());
        }
        let by = [
            half_by[0].cross(normal) + half.cross(Singles3::new(simd, &self.turning[0])),
            half_by[1].cross(normal) + half.cross(Singles3::new(simd, &self.turning[1])),
        ];
        let determinant = normal.dot(by[0].cross(by[1]));
        let speeds = [Some(near_end.speed), far_speed];
        Middles { speeds, speed, bent, normal, half, half_by, by, determinant }
    }

    /// One over how near places on triangles can be to the end at an offset from their middles.
    #[inline(always)]
    fn closest<S: Instructions>(&self, simd: S, offset: Singles3<S>) -> Singles<S> {
        Singles::splat(simd, 1.0).over((offset.length() - Singles::new(simd, &self.reach)).positive_part())
    }

    #[inline(always)]
    fn holding<S: Instructions>(&self, simd: S, middles: &Middles<S>) -> u32 {
        let &Middles { speed, bent, normal, half, by: [first, second], determinant, .. } = middles;
        let (reach, away) = (Singles::new(simd, &self.reach), Singles::new(simd, &self.away));
        let normal_length = Singles::new(simd, &self.normal_length);
        let defect = half.cross(normal);
        let longest = normal_length + away;
        let (size, rounding) = (half.length(), Singles::splat(simd, ROUNDING));
        let rest = speed * reach * away + bent * longest + rounding * (size + Singles::splat(simd, 1.0)) * longest;
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
    fn focusing<S: Instructions, const NEAR: bool>(
        &self,
        simd: S,
        ends: &SeenEnds<S, NEAR>,
        middles: &Middles<S>,
        strongly: f64,
    ) -> u32 {
        let &Middles { speeds, normal, half_by, by, determinant, .. } = middles;
        let normal_length = Singles::new(simd, &self.normal_length);
        // Two corners are at most so far apart, and so are normals.
        let twice = Singles::splat(simd, 2.01);
        let (edge, turn) = (Singles::new(simd, &self.reach) * twice, Singles::new(simd, &self.away) * twice);
        let zero = Singles::splat(simd, 0.0);
        let (mut speed, mut bend, mut grain) = (zero, zero, Singles::splat(simd, ROUNDING));
        for (end, end_speed) in speeds.into_iter().enumerate() {
            let Some(end_speed) = end_speed else { continue };
            let [end_turns, end_bends] = bending(edge, end_speed, ends.indices[end]);
            (speed, bend) = (speed + end_turns, bend + end_bends);
            grain = grain + ends.roundings[end] * end_speed;
        }
        let bending = bend * (normal_length + turn) + speed * turn * Singles::splat(simd, 2.0);
        let most = (by[0].dot(by[0]) + by[1].dot(by[1])).sqrt() * normal_length;
        let plane = normal.dot(half_by[0].cross(half_by[1])).abs() * normal_length * normal_length;
        // More than twice the length of a column: the half vector is off by `grain` times both indices at the most, what it moves by and
        // normals by some `grain` of their own length. Of a determinant that makes at most 3, of the plane's at most 1, `grain` times the
        // squared length, and times that of the normal.
        let column = middles.speed * edge * normal_length * Singles::splat(simd, 5.0)
            + (ends.indices[0] + ends.indices[1]) * turn * Singles::splat(simd, 2.0);
        let strongly = Singles::splat(simd, strongly as f32);
        let off = grain * normal_length * column * column;
        let slack = off + off * strongly * Singles::splat(simd, 3.0);
        !(plane + slack).less_than((determinant.abs() - most * bending) * strongly) & ALL
    }
}

/// What light does at the middles of eight triangles.
struct Middles<S> {
    /// How fast the parts of the half vector turn with the place, towards the point and towards a light that is at one.
    speeds: [Option<Singles<S>>; 2],
    /// Their sum.
    speed: Singles<S>,
    /// What else the half vector may change by within a triangle.
    bent: Singles<S>,
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
fn bending<S: Instructions>(edge: Singles<S>, speed: Singles<S>, index: Singles<S>) -> [Singles<S>; 2] {
    // The distance is the index over the speed.
    let turn = edge.over((index.over(speed) - edge).positive_part());
    let speed = index * turn;
    [speed, speed * turn * Singles::splat(edge.simd(), 2.0 * BENDING as f32)]
}
