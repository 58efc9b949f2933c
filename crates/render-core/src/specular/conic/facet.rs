//! A triangle with interpolated normals: where on it light goes from one end to another.
//!
//! Places are given by the weights of the three corners, which sum to one. A path obeys the law of refraction if the
//! generalised half vector `h = n_P w_P + n_L w_L` is along the normal (Walter et al. 2007). Here `w_P` and `w_L` are
//! the unit directions to the shading point and to the light, and `n_P`, `n_L` the indices there. Both indices are one
//! for a mirror. The three components of `h x n` vanish together.

use glam::{DVec2, DVec3};

use super::{ends::Ends, seen_ends::BENDING};
use crate::bsdf::fresnel::{reflect, refract};

/// A triangle with normals at its corners.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facet {
    /// The corners, metres.
    pub(crate) corners: [DVec3; 3],
    /// The normals at the corners. What is interpolated linearly is normalised afterwards.
    pub(crate) normals: [DVec3; 3],
}

/// Most steps of Newton's method from a place that is a path but for rounding.
const STEPS: usize = 8;

/// Newton's method ends with a step of this part of the triangle.
pub(super) const TOLERANCE: f64 = 1e-12;

/// Sine of the largest angle between half vector and normal at a path.
const STATIONARY: f64 = 1e-9;

/// What rounding makes of coordinates, and of sums of a few of them, as a part of them.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// As [`STATIONARY`], where one end is so close that rounding matters. What is closer still is on the surface.
const COARSEST: f64 = 1e-6;

/// Places so far outside are within: they lie on the edge that two triangles share, and belong to both.
pub(super) const ON_EDGE: f64 = 1e-9;

impl Facet {
    /// Its area, along its normal.
    pub(super) fn area(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a)
    }

    /// How many times as bright light of a small light may be behind it as behind a plane one.
    pub(super) fn focus(&self, ends: &Ends) -> f64 {
        const MIDDLE: DVec2 = DVec2::splat(1.0 / 3.0);
        let misfit = self.misfit(ends, MIDDLE);
        let least = misfit.determinant().abs() - misfit.most() * self.bending(ends, MIDDLE, 1.0);
        if least > 0.0 { misfit.determinant_of_plane().abs() / least } else { f64::INFINITY }
    }

    /// The place with these weights of the second and third corner.
    pub(super) fn place(&self, weights: DVec2) -> DVec3 {
        blend(&self.corners, weights)
    }

    /// The normal there, not of unit length.
    pub(super) fn normal(&self, weights: DVec2) -> DVec3 {
        blend(&self.normals, weights)
    }

    /// A bound of the second derivatives of the misfit by the weights, as far as `extent` from a place.
    pub(super) fn bending(&self, ends: &Ends, weights: DVec2, extent: f64) -> f64 {
        let longer = |[a, b, c]: [DVec3; 3]| (b - a).length_squared().max((c - a).length_squared()).sqrt();
        let (edge, turn) = (longer(self.corners), longer(self.normals));
        let place = self.place(weights);
        let (mut speed, mut bend) = (0.0, 0.0);
        let offsets = [(ends.point - place, 1.0), (ends.offset_to_light(place), ends.near)];
        for ((offset, near), index) in offsets.into_iter().zip(ends.indices) {
            if near == 0.0 {
                continue;
            }
            let least = offset.length() - near * edge * extent;
            let moved = if least > 0.0 { near * edge / least } else { f64::INFINITY };
            speed += index * moved;
            bend += index * 2.0 * BENDING * moved * moved;
        }
        bend * (self.normal(weights).length() + extent * turn) + 2.0 * speed * turn
    }

    /// By how much the ray from the shading point through a place misses the light: the cross product of its direction
    /// behind the interface and that to the light (equation 19). `None` where light is totally reflected.
    pub(super) fn missed(&self, ends: &Ends, weights: DVec2) -> Option<DVec3> {
        let (place, normal) = (self.place(weights), self.normal(weights).normalize());
        let direction = (place - ends.point).normalize();
        let behind = if ends.is_mirrored() {
            reflect(direction, normal)
        } else {
            refract(direction, normal, ends.indices[0], ends.indices[1])?.direction
        };
        Some(behind.cross(ends.offset_to_light(place).normalize()))
    }

    /// The sine of the angle by which the ray through a place of the curve misses the light, within the plane of
    /// incidence. Its sign is that of a turn about the normal of that plane, which is across the straight line from the
    /// shading point to the light; it changes where a path is, and where the curve crosses that line. Equation 20 takes
    /// the sign from the curve's tangent, which is of no use wherever the curve runs along the plane of incidence, on
    /// all of a flat surface. `None` where light is totally reflected.
    pub(super) fn defect(&self, ends: &Ends, weights: DVec2) -> Option<f64> {
        let across = ends.across().cross(self.place(weights) - ends.point);
        Some(across.normalize_or_zero().dot(self.missed(ends, weights)?))
    }

    /// The path next to a place that is one but for rounding, as weights; `None` when there is none in the triangle.
    pub(super) fn polished(&self, ends: &Ends, start: DVec2) -> Option<DVec2> {
        self.stationary(ends, start, TOLERANCE)
            .filter(|weights| is_within(*weights) && self.takes_sides(ends, *weights))
    }

    /// Where Newton's method from a place leads on the triangle's plane, if that is a path; `tolerance` is the step
    /// with which it ends.
    pub(super) fn stationary(&self, ends: &Ends, start: DVec2, tolerance: f64) -> Option<DVec2> {
        let mut weights = start;
        for _ in 0..STEPS {
            let step = self.misfit(ends, weights).step();
            if !step.is_finite() {
                return None;
            }
            weights -= step;
            if step.abs().max_element() < tolerance {
                break;
            }
        }
        let (place, normal) = (self.place(weights), self.normal(weights).normalize());
        let offsets = [ends.point - place, ends.offset_to_light(place)];
        let lengths = offsets.map(DVec3::length);
        let half = offsets[0] * (ends.indices[0] / lengths[0]) + offsets[1] * (ends.indices[1] / lengths[1]);
        // Directions to what is close are known no better than places are.
        let nearest = if ends.near > 0.0 { lengths[0].min(lengths[1]) } else { lengths[0] };
        let grain = ROUNDING * place.abs().max_element() / nearest;
        (half.cross(normal).length() < STATIONARY.max(grain.min(COARSEST))).then_some(weights)
    }

    /// Whether the ends are on the right sides of the tangent plane.
    pub(super) fn takes_sides(&self, ends: &Ends, weights: DVec2) -> bool {
        let (place, normal) = (self.place(weights), self.normal(weights));
        ends.take_sides(normal.dot(ends.point - place), normal.dot(ends.offset_to_light(place)))
    }

    /// How far from a path a place is.
    pub(super) fn misfit(&self, ends: &Ends, weights: DVec2) -> Misfit {
        let (place, normal) = (self.place(weights), self.normal(weights));
        let mut half = DVec3::ZERO;
        let mut half_by = [DVec3::ZERO; 2];
        let edges = [self.corners[1] - self.corners[0], self.corners[2] - self.corners[0]];
        let offsets = [(ends.point - place, 1.0), (ends.offset_to_light(place), ends.near)];
        for ((offset, near), index) in offsets.into_iter().zip(ends.indices) {
            let inverse = 1.0 / offset.length();
            let direction = offset * inverse;
            half += direction * index;
            if near == 0.0 {
                continue;
            }
            for (by, edge) in half_by.iter_mut().zip(edges) {
                *by += (direction * direction.dot(edge) - edge) * (near * index * inverse);
            }
        }
        let by = [0, 1].map(|k| half_by[k].cross(normal) + half.cross(self.normals[k + 1] - self.normals[0]));
        Misfit { normal, value: half.cross(normal), by, half_by }
    }
}

/// `h x n` at a place, which vanishes at a path, and its derivatives by the weights of the second and third corner.
/// What of them is along n does not matter.
pub(super) struct Misfit {
    normal: DVec3,
    value: DVec3,
    by: [DVec3; 2],
    /// The derivatives of h.
    half_by: [DVec3; 2],
}

impl Misfit {
    /// The determinant of the derivatives across the normal, times the normal's length.
    pub(super) fn determinant(&self) -> f64 {
        self.normal.dot(self.by[0].cross(self.by[1]))
    }

    /// That on a plane with the same normal.
    pub(super) fn determinant_of_plane(&self) -> f64 {
        self.normal.dot(self.half_by[0].cross(self.half_by[1])) * self.normal.length_squared()
    }

    /// A bound of the larger singular value of the derivatives, times the normal's length.
    pub(super) fn most(&self) -> f64 {
        let squares = self.by[0].length_squared() + self.by[1].length_squared();
        (squares * self.normal.length_squared()).sqrt()
    }

    /// What Newton's method takes from the weights.
    pub(super) fn step(&self) -> DVec2 {
        let along = |a: DVec3, b: DVec3| self.normal.dot(a.cross(b));
        DVec2::new(along(self.value, self.by[1]), along(self.by[0], self.value)) / self.determinant()
    }
}

/// Whether a place is on the triangle.
pub(super) fn is_within(weights: DVec2) -> bool {
    weights.min_element() >= -ON_EDGE && weights.element_sum() <= 1.0 + ON_EDGE
}

fn blend(corners: &[DVec3; 3], weights: DVec2) -> DVec3 {
    corners[0] * (1.0 - weights.x - weights.y) + corners[1] * weights.x + corners[2] * weights.y
}
