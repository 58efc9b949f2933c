//! The ends of a path for boxes and triangles of the hierarchy: eight at a time, in single precision, relative to the
//! mesh's middle.
//!
//! Nodes and leaves have their coordinates in cyclic order with that axis last along which their normals are longest.
//! The misfit h x n is across n. So its other two coordinates suffice where n is not across that axis. Where it is, one
//! of them says less.

use glam::DVec3;

use super::ends::Ends;
use crate::math::simd::Instructions;
use crate::math::simd::singles::{SINGLES, Singles, Singles2, Singles3};

/// A number for each of eight boxes or triangles.
pub(super) type ByLane = [f32; SINGLES];

/// A vector for each: the three coordinates.
pub(super) type Vectors = [ByLane; 3];

/// The bits of all eight.
pub(super) const ALL: u32 = (1 << SINGLES) - 1;

/// A number of each of at most eight things.
pub(super) fn numbers<T>(things: &[T], number: impl Fn(&T) -> f64) -> ByLane {
    std::array::from_fn(|lane| things.get(lane).map_or(0.0, &number) as f32)
}

/// A vector of each of at most eight things.
pub(super) fn vectors<T>(things: &[T], vector: impl Fn(&T) -> DVec3) -> Vectors {
    [0, 1, 2].map(|axis| numbers(things, |thing| vector(thing)[axis]))
}

/// The axis along which some normals are longest.
pub(super) fn steepest_axis(normals: impl Iterator<Item = DVec3>) -> usize {
    let squares = normals.fold(DVec3::ZERO, |sum, normal| sum + normal * normal);
    (0..3).fold(0, |longest, axis| if squares[axis] > squares[longest] { axis } else { longest })
}

/// The coordinates of a vector in cyclic order, that along `axis` last.
pub(super) fn in_order(vector: DVec3, axis: usize) -> DVec3 {
    DVec3::new(vector[(axis + 1) % 3], vector[(axis + 2) % 3], vector[axis])
}

/// The bits of those of eight that are not there.
pub(super) fn missing<T>(things: &[T]) -> u32 {
    ALL << things.len() & ALL
}

/// Both ends. `NEAR` lights are at points, the others at infinity.
pub(super) struct SeenEnds<S, const NEAR: bool> {
    point: Cyclic,
    /// Of one at infinity the direction, times the index there.
    light: Cyclic,
    simd: S,
    pub(super) indices: [Singles<S>; 2],
    /// One over their squares.
    inverse_squares: [Singles<S>; 2],
    pub(super) side: Singles<S>,
    /// Whether the side matters.
    pub(super) has_side: bool,
    /// How far the ends can be from where they are, by their extent and by rounding.
    pub(super) grains: [Singles<S>; 2],
    /// How far by rounding alone; of a light at infinity, nothing.
    pub(super) roundings: [Singles<S>; 2],
}

impl<S: Instructions, const NEAR: bool> SeenEnds<S, NEAR> {
    /// The ends as seen from a mesh around `middle`, whose corners are within `radius`.
    #[inline(always)]
    pub(super) fn new(simd: S, ends: &Ends, middle: DVec3, radius: f64) -> Self {
        let (point, light) = (ends.point - middle, ends.light - middle * ends.near);
        let rounding = |end: DVec3| GRAIN * (end.length() + radius);
        let of_light = if NEAR { rounding(light) } else { GRAIN };
        let of_point = Singles::splat(simd, rounding(point) as f32);
        let [inside, behind] = ends.indices;
        Self {
            point: Cyclic::new(point),
            light: Cyclic::new(if NEAR { light } else { light * behind }),
            simd,
            indices: [Singles::splat(simd, inside as f32), Singles::splat(simd, behind as f32)],
            inverse_squares: [
                Singles::splat(simd, (1.0 / (inside * inside)) as f32),
                Singles::splat(simd, (1.0 / (behind * behind)) as f32),
            ],
            side: Singles::splat(simd, ends.side as f32),
            has_side: ends.side != 0.0,
            grains: [of_point, Singles::splat(simd, (of_light + ends.spread * (1.0 + GRAIN)) as f32)],
            roundings: [of_point, Singles::splat(simd, (of_light * ends.near) as f32)],
        }
    }
}

impl<S: Instructions, const NEAR: bool> SeenEnds<S, NEAR> {
    /// The vectors from middles, whose coordinates along `axis` come last, to both ends; towards a light at infinity,
    /// its part of the half vector.
    #[inline(always)]
    pub(super) fn offsets(&self, middles: Singles3<S>, axis: u32) -> [Singles3<S>; 2] {
        let (point, light) = (self.point.in_order(self.simd, axis), self.light.in_order(self.simd, axis));
        [point - middles, if NEAR { light - middles } else { light }]
    }

    /// The shading point at an offset from middles around which places go as far as `reach`, and come as near to it as
    /// one over `closest`.
    #[inline(always)]
    pub(super) fn seen_point(&self, offset: Singles3<S>, closest: Singles<S>, reach: Singles<S>) -> SeenEnd<S> {
        self.seen(0, offset, closest, reach)
    }

    /// The same for a light at a point.
    #[inline(always)]
    pub(super) fn seen_light(&self, offset: Singles3<S>, closest: Singles<S>, reach: Singles<S>) -> SeenEnd<S> {
        self.seen(1, offset, closest, reach)
    }

    #[inline(always)]
    fn seen(&self, end: usize, offset: Singles3<S>, closest: Singles<S>, reach: Singles<S>) -> SeenEnd<S> {
        let (index, grain) = (self.indices[end], self.grains[end]);
        let one = Singles::splat(index.simd(), 1.0);
        let speed = index.over(offset.length());
        // Infinite around an end, which has no half vector at its middle and no bound.
        let turn = reach * closest;
        let strayed = grain * closest;
        // An end that strays by x of its distance turns by a chord of at most x (1 + x^2).
        let chord = strayed * strayed.times_plus(strayed, one);
        let bending = Singles::splat(index.simd(), BENDING as f32);
        let bent = index * (bending * turn).times_plus(turn, chord);
        SeenEnd { half: offset * speed, speed, lengthening: speed * self.inverse_squares[end], bent }
    }

    /// What the part of the half vector towards a light at infinity may change by.
    #[inline(always)]
    pub(super) fn bent_at_infinity(&self) -> Singles<S> {
        self.indices[1] * self.grains[1]
    }
}

/// A vector whose coordinates can be taken in cyclic order from any of them on.
struct Cyclic([f32; 5]);

impl Cyclic {
    #[inline(always)]
    fn new(vector: DVec3) -> Self {
        let [x, y, z] = [vector.x as f32, vector.y as f32, vector.z as f32];
        Self([x, y, z, x, y])
    }

    /// Eight times the vector, the coordinate along `axis` last.
    #[inline(always)]
    fn in_order<S: Instructions>(&self, simd: S, axis: u32) -> Singles3<S> {
        let axis = axis as usize % 3;
        let Self(coordinates) = self;
        Singles3 {
            x: Singles::splat(simd, coordinates[axis + 1]),
            y: Singles::splat(simd, coordinates[axis + 2]),
            z: Singles::splat(simd, coordinates[axis]),
        }
    }
}

/// One of them, as seen from eight boxes or triangles.
pub(super) struct SeenEnd<S> {
    /// Its part of the half vector: the unit direction to it from their middles, times the index there.
    pub(super) half: Singles3<S>,
    /// How fast that part turns with the place: the index over the distance.
    pub(super) speed: Singles<S>,
    /// As the place moves by d, that part moves by `half (half . d)` times this, less d times `speed`.
    pub(super) lengthening: Singles<S>,
    /// What else that part may change by within the box or triangle.
    pub(super) bent: Singles<S>,
}

impl<S: Instructions> SeenEnd<S> {
    /// The derivatives of a defect by the place along each axis, and what the half vector's change along itself adds to
    /// them.
    #[inline(always)]
    pub(super) fn lengthened(&self, [x, y, z]: [Singles2<S>; 3], normal: Singles3<S>) -> [Singles2<S>; 3] {
        let across = self.half.cross_xy(normal) * self.lengthening;
        [across.times_plus(self.half.x, x), across.times_plus(self.half.y, y), across.times_plus(self.half.z, z)]
    }

    /// How its part of the half vector changes as the place moves along an edge.
    #[inline(always)]
    pub(super) fn moved(&self, edge: Singles3<S>) -> Singles3<S> {
        let along = self.half.dot(edge) * self.lengthening;
        self.half * along - edge * self.speed
    }
}

/// Largest second derivative of a unit vector, times the squared length of the vector, halved: |s (4 - 3 s^2)^(1/2)| /
/// 2 at the worst sine s^2 = 2/3 between vector and motion.
pub(super) const BENDING: f64 = 0.578;

/// How far a place in single precision can be from where it is, relative to the largest distance that it was computed
/// from: twice the rounding of each of three coordinates.
pub(super) const GRAIN: f64 = 4.0 * f32::EPSILON as f64;

/// Slack for rounding, relative: some units in the last place of single precision.
pub(super) const ROUNDING: f32 = 4e-6;
