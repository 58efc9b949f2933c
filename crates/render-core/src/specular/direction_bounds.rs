//! Interval arithmetic of directions and tangents: bounds on what refraction does to a box of them.
//!
//! A *direction* is the tangential part of a unit vector, a *tangent* that part divided by the cosine to the pane's
//! axis.

use glam::DVec3;

use super::side::GRAZING_COSINE;
use crate::math::Interval;

/// Two intervals: a box of tangential vectors.
pub(super) type Box2 = [Interval; 2];

/// `t / sqrt(1 + |t|^2)` over a box, in each component.
pub(super) fn directions_of_tangents(tangents: &Box2) -> Box2 {
    std::array::from_fn(|axis| {
        let other = squared(tangents[1 - axis]);
        // Rises with its own component; the other component pulls it towards zero.
        let value = |own: f64, other_squared: f64| own / (1.0 + own * own + other_squared).sqrt();
        let [own_min, own_max] = [tangents[axis].min, tangents[axis].max];
        Interval::new(
            value(own_min, if own_min < 0.0 { other.min } else { other.max }),
            value(own_max, if own_max > 0.0 { other.min } else { other.max }),
        )
    })
}

/// `t / sqrt(1 - |t|^2)` over a box, in each component, for directions that do not graze the pane.
pub(super) fn tangents_of_directions(directions: &Box2) -> Box2 {
    std::array::from_fn(|axis| {
        let other = squared(directions[1 - axis]);
        let value = |own: f64, other_squared: f64| {
            own / (1.0 - own * own - other_squared).max(GRAZING_COSINE * GRAZING_COSINE).sqrt()
        };
        let [own_min, own_max] = [directions[axis].min, directions[axis].max];
        Interval::new(
            value(own_min, if own_min < 0.0 { other.max } else { other.min }),
            value(own_max, if own_max > 0.0 { other.max } else { other.min }),
        )
    })
}

/// Bounds on `(Q(t + d) - Q(t)) = B d` for `Q(t) = t / sqrt(1 - |t|^2)`, with t and t + d in `hull`: the entries 11,
/// 12 = 21 and 22 of the symmetric matrix B, by the mean value theorem.
pub(super) fn bend(hull: &Box2) -> [Interval; 3] {
    let squares = hull.map(squared);
    let cos_squared = Interval::new(
        (1.0 - squares[0].max - squares[1].max).max(GRAZING_COSINE * GRAZING_COSINE),
        (1.0 - squares[0].min - squares[1].min).max(GRAZING_COSINE * GRAZING_COSINE),
    );
    let inverse_cube = Interval::new(
        1.0 / (cos_squared.max * cos_squared.max.sqrt()),
        1.0 / (cos_squared.min * cos_squared.min.sqrt()),
    );
    let own = |axis: usize| {
        let other = squares[1 - axis];
        inverse_cube * Interval::new((1.0 - other.max).max(0.0), (1.0 - other.min).max(0.0))
    };
    [own(0), inverse_cube * (hull[0] * hull[1]), own(1)]
}

/// Directions have components between -1 and 1.
pub(super) fn clamped(directions: &Box2) -> Box2 {
    directions.map(|direction| Interval::new(direction.min.clamp(-1.0, 1.0), direction.max.clamp(-1.0, 1.0)))
}

/// Bounds on `g = (sqrt(n^2 - 1 + c^2) - c) / |m|` where c is the cosine, in air, to a normal of the given slopes.
pub(super) fn refraction_strength(index: f64, directions: &Box2, slopes: &Box2) -> Interval {
    let squares = directions.map(squared);
    let sin_squared = Interval::new(squares[0].min + squares[1].min, (squares[0].max + squares[1].max).min(1.0));
    let slope_squared =
        Interval::new(squared(slopes[0]).min + squared(slopes[1]).min, squared(slopes[0]).max + squared(slopes[1]).max);
    let tilt = (sin_squared.max * slope_squared.max).sqrt();
    let cosine = Interval::new(
        (((1.0 - sin_squared.max).max(0.0).sqrt() - tilt) / (1.0 + slope_squared.max).sqrt()).max(0.0),
        ((1.0 - sin_squared.min).max(0.0).sqrt() + tilt).min(1.0),
    );
    // Falls with c.
    let strength = |cosine: f64| (index * index - 1.0 + cosine * cosine).sqrt() - cosine;
    Interval::new(
        strength(cosine.max) / (1.0 + slope_squared.max).sqrt(),
        strength(cosine.min) / (1.0 + slope_squared.min).sqrt(),
    )
}

/// The same for any direction and slope.
pub(super) fn refraction_strength_widest(index: f64) -> Interval {
    Interval::new(0.0, (index * index - 1.0).sqrt())
}

/// Bounds on the components of the directions of a cap.
pub(super) fn cap_bounds(axis: DVec3, sin_radius: f64) -> [Interval; 3] {
    let cos_radius = (1.0 - sin_radius * sin_radius).max(0.0).sqrt();
    axis.to_array().map(|component| {
        // cos(phi -+ r) for the angle phi between the axis and the coordinate axis.
        let sine = (1.0 - component * component).max(0.0).sqrt();
        let max = if component >= cos_radius { 1.0 } else { component * cos_radius + sine * sin_radius };
        let min = if component <= -cos_radius { -1.0 } else { component * cos_radius - sine * sin_radius };
        Interval::new(min, max)
    })
}

fn squared(interval: Interval) -> Interval {
    let (a, b) = (interval.min * interval.min, interval.max * interval.max);
    let contains_zero = interval.min <= 0.0 && interval.max >= 0.0;
    Interval::new(if contains_zero { 0.0 } else { a.min(b) }, a.max(b))
}
