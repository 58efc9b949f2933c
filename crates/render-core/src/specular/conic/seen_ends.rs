//! The ends of a path, as the boxes and triangles of the hierarchy see them: eight at a time, in single precision, relative to the
//! middle of the mesh.

use glam::DVec3;

use super::ends::Ends;
use crate::lanes::{
    Instructions,
    singles::{SINGLES, Singles, Singles3},
};

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

/// The bits of those of eight that are not there.
pub(super) fn missing<T>(things: &[T]) -> u32 {
    ALL << things.len() & ALL
}

/// Both ends.
pub(super) struct SeenEnds<S> {
    pub(super) point: Singles3<S>,
    pub(super) light: Singles3<S>,
    pub(super) near: Singles<S>,
    pub(super) indices: [Singles<S>; 2],
    pub(super) side: Singles<S>,
    /// Whether the side matters.
    pub(super) has_side: bool,
    /// Whether the light is at a point.
    pub(super) is_near: bool,
    /// The axis along which the mesh is shortest.
    pub(super) short: usize,
    /// How far the ends can be from where they are, by their extent and by rounding.
    pub(super) grains: [Singles<S>; 2],
    /// How far by rounding alone; of a light at infinity, nothing.
    pub(super) roundings: [Singles<S>; 2],
}

impl<S: Instructions> SeenEnds<S> {
    /// The ends as seen from a mesh around `middle`, whose corners are within `radius` and whose shortest axis is `short`.
    #[inline(always)]
    pub(super) fn new(simd: S, ends: &Ends, middle: DVec3, radius: f64, short: usize) -> Self {
        let (point, light) = (ends.point - middle, ends.light - middle * ends.near);
        let rounding = |end: DVec3| GRAIN * (end.length() + radius);
        let of_light = if ends.near == 0.0 { GRAIN } else { rounding(light) };
        let of_point = Singles::splat(simd, rounding(point) as f32);
        let [inside, behind] = ends.indices;
        Self {
            point: Singles3::splat(simd, point),
            light: Singles3::splat(simd, light),
            near: Singles::splat(simd, ends.near as f32),
            indices: [Singles::splat(simd, inside as f32), Singles::splat(simd, behind as f32)],
            side: Singles::splat(simd, ends.side as f32),
            has_side: ends.side != 0.0,
            is_near: ends.near != 0.0,
            short,
            grains: [of_point, Singles::splat(simd, (of_light + ends.spread * (1.0 + GRAIN)) as f32)],
            roundings: [of_point, Singles::splat(simd, (of_light * ends.near) as f32)],
        }
    }
}

/// One of them, as seen from eight boxes or triangles.
pub(super) struct SeenEnd<S> {
    /// The direction to it from their middles.
    pub(super) direction: Singles3<S>,
    /// How fast its part of the half vector turns with the place.
    pub(super) speed: Singles<S>,
    /// What else that part may change by within the box or triangle.
    pub(super) bent: Singles<S>,
}

impl<S: Instructions> SeenEnd<S> {
    /// The end at infinity in a direction, which may be off by `grain`.
    #[inline(always)]
    pub(super) fn at_infinity(direction: Singles3<S>, index: Singles<S>, grain: Singles<S>) -> Self {
        Self { direction, speed: Singles::splat(index.simd(), 0.0), bent: index * grain }
    }

    /// The end at `offset` from middles around which places go as far as `reach`, and come as near as `nearest` to it; it may be off by
    /// `grain`.
    #[inline(always)]
    pub(super) fn new(
        offset: Singles3<S>,
        index: Singles<S>,
        nearest: Singles<S>,
        reach: Singles<S>,
        grain: Singles<S>,
    ) -> Self {
        let one = Singles::splat(index.simd(), 1.0);
        let inverse = one.over(offset.length());
        // Infinite around an end, which has no half vector at its middle and no bound.
        let closest = one.over(nearest);
        let turn = reach * closest;
        let strayed = grain * closest;
        Self {
            direction: offset * inverse,
            speed: index * inverse,
            // An end that strays by x of its distance turns by a chord of at most x (1 + x^2).
            bent: index
                * (Singles::splat(index.simd(), BENDING as f32) * turn * turn + strayed * (one + strayed * strayed)),
        }
    }
}

/// Largest second derivative of a unit vector, times the squared length of the vector, halved: |s (4 - 3 s^2)^(1/2)| / 2 at
/// the worst sine s^2 = 2/3 between vector and motion.
pub(super) const BENDING: f64 = 0.578;

/// How far a place in single precision can be from where it is, relative to the largest distance that it was computed from: twice the
/// rounding of each of three coordinates.
pub(super) const GRAIN: f64 = 4.0 * f32::EPSILON as f64;

/// Slack for rounding, relative: some units in the last place of single precision.
pub(super) const ROUNDING: f32 = 4e-6;
