//! Triangles that are looked at eight at a time, to see on which of them a path may be.
//!
//! On a triangle, place and normal are linear in the weights x of its corners, counted from the middle. So is the
//! defect h x n (see `facet_tree`), but for little that is bounded: `g + K x` with a matrix K of two columns. At a path
//! it is not larger than that bound. Cramer's rule says how far outside each edge that can be. It uses the two
//! coordinates of the defect across the axis along which normals are longest.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::{
    facet::Facet,
    seen_ends::{
        ALL, BENDING, ByLane, ROUNDING, SeenEnd, SeenEnds, Vectors, in_order, missing, numbers, steepest_axis, vectors,
    },
};
use crate::math::simd::Instructions;
use crate::math::simd::singles::{SINGLES, Singles, Singles2, Singles3, prefetch};

/// At most eight triangles, in single precision relative to the middle of the mesh.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
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
    /// The bits of those that are not there.
    missing: u32,
    /// The axis whose coordinate comes last in all vectors.
    axis: u32,
    /// Their numbers.
    pub(super) triangles: [u32; SINGLES],
    /// Nothing, to the end of the last cache line.
    rest: [u32; 14],
}

impl FacetLeaf {
    /// Triangles with their numbers, at most eight.
    pub(super) fn over(facets: &[(u32, Facet)], middle: DVec3) -> Self {
        let mean = |corners: &[DVec3; 3]| corners.iter().sum::<DVec3>() / 3.0;
        let farthest = |corners: &[DVec3; 3]| {
            let mean = mean(corners);
            corners.iter().fold(0.0, |most, corner| f64::max(most, (*corner - mean).length()))
        };
        let axis = steepest_axis(facets.iter().map(|(_, facet)| mean(&facet.normals)));
        let by_facet = |vector: &dyn Fn(&Facet) -> DVec3| vectors(facets, |(_, facet)| in_order(vector(facet), axis));
        Self {
            centre: by_facet(&|facet| mean(&facet.corners) - middle),
            edges: [1, 2].map(|k| by_facet(&|facet| facet.corners[k] - facet.corners[0])),
            normal: by_facet(&|facet| mean(&facet.normals)),
            turning: [1, 2].map(|k| by_facet(&|facet| facet.normals[k] - facet.normals[0])),
            reach: numbers(facets, |(_, facet)| farthest(&facet.corners)),
            normal_length: numbers(facets, |(_, facet)| mean(&facet.normals).length()),
            away: numbers(facets, |(_, facet)| farthest(&facet.normals)),
            triangles: std::array::from_fn(|lane| facets.get(lane).map_or(0, |(triangle, _)| *triangle)),
            missing: missing(facets),
            axis: axis as u32,
            rest: [0; 14],
        }
    }

    /// Tells the processor that it will be looked at soon.
    #[inline(always)]
    pub(super) fn prefetch(&self) {
        // Two arrays share a cache line.
        let Self { centre, edges: [second, third], normal, turning: [with_second, with_third], .. } = self;
        for numbers in [
            &centre[0],
            &centre[2],
            &second[1],
            &third[0],
            &third[2],
            &normal[1],
            &with_second[0],
            &with_second[2],
            &with_third[1],
        ] {
            prefetch(numbers);
        }
        prefetch(&self.reach);
        prefetch(&self.away);
        prefetch(&self.triangles[SINGLES - 1]);
    }

    /// On which triangles a path may be, as the bits of a number.
    #[inline(always)]
    pub(super) fn may_hold<S: Instructions, const NEAR: bool>(&self, simd: S, ends: &SeenEnds<S, NEAR>) -> u32 {
        let [to_point, to_light] = ends.offsets(Singles3::new(simd, &self.centre), self.axis);
        let point = self.point(simd, ends, to_point);
        self.holding(simd, &self.middles(simd, ends, &point, to_light))
    }

    /// On which triangles a path may be to one point of a whole light, `drawn`, and which of those that may hold a path
    /// to any of its points may focus it more than `strongly` (see [`Facet::focus`]).
    #[inline(always)]
    pub(super) fn may_hold_and_focus<S: Instructions, const NEAR: bool>(
        &self,
        simd: S,
        whole: &SeenEnds<S, NEAR>,
        drawn: &SeenEnds<S, NEAR>,
        strongly: f64,
    ) -> [u32; 2] {
        let centre = Singles3::new(simd, &self.centre);
        let [to_point, to_whole] = whole.offsets(centre, self.axis);
        let point = self.point(simd, whole, to_point);
        let middles = self.middles(simd, whole, &point, to_whole);
        let holding = self.holding(simd, &middles);
        if holding == 0 {
            return [0, 0];
        }
        let [_, to_drawn] = drawn.offsets(centre, self.axis);
        let holding_drawn = self.holding(simd, &self.middles(simd, drawn, &point, to_drawn));
        [holding & holding_drawn, holding & self.focusing(simd, whole, &middles, strongly)]
    }

    /// The shading point at offsets from the middles.
    #[inline(always)]
    fn point<S: Instructions, const NEAR: bool>(
        &self,
        simd: S,
        ends: &SeenEnds<S, NEAR>,
        to_point: Singles3<S>,
    ) -> EndFromMiddles<S> {
        let end = ends.seen_point(to_point, self.closest(simd, to_point), Singles::new(simd, &self.reach));
        self.with_derivatives(simd, end)
    }

    /// An end with how its part of the half vector changes with the weights.
    #[inline(always)]
    fn with_derivatives<S: Instructions>(&self, simd: S, end: SeenEnd<S>) -> EndFromMiddles<S> {
        let [second, third] = &self.edges;
        let half_by = [end.moved(Singles3::new(simd, second)), end.moved(Singles3::new(simd, third))];
        EndFromMiddles { end, half_by }
    }

    /// What light does at the middles.
    #[inline(always)]
    fn middles<S: Instructions, const NEAR: bool>(
        &self,
        simd: S,
        ends: &SeenEnds<S, NEAR>,
        point: &EndFromMiddles<S>,
        to_light: Singles3<S>,
    ) -> Middles<S> {
        let normal = Singles3::new(simd, &self.normal);
        let EndFromMiddles { end: SeenEnd { half, speed, bent, .. }, half_by } = *point;
        let (mut half, mut half_by, mut whole_speed, mut bent) = (half, half_by, speed, bent);
        let mut far_speed = None;
        if NEAR {
            let light = ends.seen_light(to_light, self.closest(simd, to_light), Singles::new(simd, &self.reach));
            let light = self.with_derivatives(simd, light);
            half_by = [half_by[0] + light.half_by[0], half_by[1] + light.half_by[1]];
            (half, bent, whole_speed) = (half + light.end.half, bent + light.end.bent, speed + light.end.speed);
            far_speed = Some(light.end.speed);
        } else {
            (half, bent) = (half + to_light, bent + ends.bent_at_infinity());
        }
        let [with_second, with_third] = &self.turning;
        let by = [
            half_by[0].cross_xy(normal) + half.cross_xy(Singles3::new(simd, with_second)),
            half_by[1].cross_xy(normal) + half.cross_xy(Singles3::new(simd, with_third)),
        ];
        Middles { speeds: [Some(speed), far_speed], speed: whole_speed, bent, normal, half, half_by, by }
    }

    /// One over how near places on triangles can be to the end at an offset from their middles.
    #[inline(always)]
    fn closest<S: Instructions>(&self, simd: S, offset: Singles3<S>) -> Singles<S> {
        Singles::splat(simd, 1.0).over((offset.length() - Singles::new(simd, &self.reach)).positive_part())
    }

    #[inline(always)]
    fn holding<S: Instructions>(&self, simd: S, middles: &Middles<S>) -> u32 {
        let &Middles { speed, bent, normal, half, by: [first, second], .. } = middles;
        let (reach, away) = (Singles::new(simd, &self.reach), Singles::new(simd, &self.away));
        let normal_length = Singles::new(simd, &self.normal_length);
        let defect = half.cross_xy(normal);
        let determinant = first.determinant(second);
        let longest = normal_length + away;
        let (size, rounding) = (half.length(), Singles::splat(simd, ROUNDING));
        let rest = speed * reach * away + bent * longest + rounding * (size + Singles::splat(simd, 1.0)) * longest;
        // Where the linear part vanishes, as weights from the middle times the determinant, the sign turned.
        let weights = [defect.determinant(second), first.determinant(defect)];
        // Outside an edge, all times the squared determinant: the middle is a third of the way to the opposite corner.
        // What the rest makes of a weight is at most what the other column makes of it.
        let third = determinant * determinant * Singles::splat(simd, 1.0 / 3.0);
        let scale = determinant.abs();
        let slack = rest * scale;
        let lengths = [first.length(), second.length()];
        let cancelled = rounding * scale * (size * normal_length + lengths[0]) * (lengths[0] + lengths[1]);
        let sum = Singles::splat(simd, 0.0) - (weights[0] + weights[1]) * determinant;
        let beyond = (slack * lengths[1]).less_than(weights[0] * determinant - third)
            | (slack * lengths[0]).less_than(weights[1] * determinant - third)
            | (slack * (second - first).length() + cancelled).less_than(sum - third);
        !(beyond | self.missing) & ALL
    }

    /// What [`Facet::focus`] computes, with slack for rounding. Longer edges and normals that turn more than these do
    /// make bends larger and nothing else.
    #[inline(always)]
    fn focusing<S: Instructions, const NEAR: bool>(
        &self,
        simd: S,
        ends: &SeenEnds<S, NEAR>,
        middles: &Middles<S>,
        strongly: f64,
    ) -> u32 {
        let &Middles { speeds, normal, half, half_by, .. } = middles;
        let normal_length = Singles::new(simd, &self.normal_length);
        let [with_second, with_third] = &self.turning;
        let by = [
            half_by[0].cross(normal) + half.cross(Singles3::new(simd, with_second)),
            half_by[1].cross(normal) + half.cross(Singles3::new(simd, with_third)),
        ];
        let determinant = normal.dot(by[0].cross(by[1]));
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
        // More than twice the length of a column: the half vector is off by `grain` times both indices at the most,
        // what it moves by and normals by some `grain` of their own length. Of a determinant that makes at most 3, of
        // the plane's at most 1, `grain` times the squared length, and times that of the normal.
        let column = middles.speed * edge * normal_length * Singles::splat(simd, 5.0)
            + (ends.indices[0] + ends.indices[1]) * turn * Singles::splat(simd, 2.0);
        let strongly = Singles::splat(simd, strongly as f32);
        let off = grain * normal_length * column * column;
        let slack = off + off * strongly * Singles::splat(simd, 3.0);
        !(plane + slack).less_than((determinant.abs() - most * bending) * strongly) & ALL
    }
}

/// An end of a path, as seen from the middles of eight triangles.
struct EndFromMiddles<S> {
    end: SeenEnd<S>,
    /// The derivatives of its part of the half vector by both weights.
    half_by: [Singles3<S>; 2],
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
    /// The derivatives of the defect by both weights: the coordinates across the axis.
    by: [Singles2<S>; 2],
}

/// How fast the part of the half vector towards an end turns within an edge's length, and twice how fast that changes.
#[inline(always)]
fn bending<S: Instructions>(edge: Singles<S>, speed: Singles<S>, index: Singles<S>) -> [Singles<S>; 2] {
    // The distance is the index over the speed.
    let turn = edge.over((index.over(speed) - edge).positive_part());
    let speed = index * turn;
    [speed, speed * turn * Singles::splat(edge.simd(), 2.0 * BENDING as f32)]
}
