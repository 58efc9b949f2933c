//! Lines and circles with a direction. The side to the left is inside.

use glam::DVec2;

/// A line or a circle that an outline follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Curve {
    /// A line through a point along a unit vector.
    Line { through: DVec2, direction: DVec2 },
    /// A circle. Counterclockwise, its disc is inside; clockwise, its disc is outside.
    Circle { centre: DVec2, radius: f64, counterclockwise: bool },
}

impl Curve {
    /// The line from one point to another.
    pub(crate) fn line(from: DVec2, to: DVec2) -> Self {
        Self::Line { through: from, direction: (to - from).normalize_or_zero() }
    }

    /// A circle whose disc is inside.
    pub(crate) fn disc(centre: DVec2, radius: f64) -> Self {
        Self::Circle { centre, radius, counterclockwise: true }
    }

    /// A circle whose disc is outside.
    pub(crate) fn hole(centre: DVec2, radius: f64) -> Self {
        Self::Circle { centre, radius, counterclockwise: false }
    }

    /// The curve moved by a vector.
    pub(crate) fn moved(self, by: DVec2) -> Self {
        match self {
            Self::Line { through, direction } => Self::Line { through: through + by, direction },
            Self::Circle { centre, radius, counterclockwise } => {
                Self::Circle { centre: centre + by, radius, counterclockwise }
            }
        }
    }

    /// The same curve the other way round.
    pub(crate) fn reversed(self) -> Self {
        match self {
            Self::Line { through, direction } => Self::Line { through, direction: -direction },
            Self::Circle { centre, radius, counterclockwise } => {
                Self::Circle { centre, radius, counterclockwise: !counterclockwise }
            }
        }
    }

    /// The parallel curve at a distance to the inside; `None` where a circle would vanish.
    pub(crate) fn inset(self, distance: f64) -> Option<Self> {
        match self {
            Self::Line { through, direction } => {
                Some(Self::Line { through: through + direction.perp() * distance, direction })
            }
            Self::Circle { centre, radius, counterclockwise } => {
                let radius = if counterclockwise { radius - distance } else { radius + distance };
                (radius > 0.0).then_some(Self::Circle { centre, radius, counterclockwise })
            }
        }
    }

    /// The direction of the curve at one of its points.
    pub(crate) fn tangent(self, at: DVec2) -> DVec2 {
        match self {
            Self::Line { direction, .. } => direction,
            Self::Circle { centre, counterclockwise, .. } => {
                let left = (at - centre).normalize_or_zero().perp();
                if counterclockwise { left } else { -left }
            }
        }
    }

    /// The angle around a circle from one of its points to another, along its direction, radians; 0 for a line.
    pub(crate) fn sweep(self, from: DVec2, to: DVec2) -> f64 {
        let Self::Circle { centre, counterclockwise, .. } = self else { return 0.0 };
        let (from, to) = (from - centre, to - centre);
        let angle = libm::atan2(from.perp_dot(to), from.dot(to));
        let angle = if counterclockwise { angle } else { -angle };
        if angle < 0.0 { angle + std::f64::consts::TAU } else { angle }
    }

    /// The points that two curves share: none, or two, which coincide where the curves touch.
    pub(crate) fn intersections(self, other: Self) -> Option<[DVec2; 2]> {
        match (self, other) {
            (Self::Line { through, direction }, Self::Line { through: point, direction: along }) => {
                let cross = direction.perp_dot(along);
                let place = through + direction * ((point - through).perp_dot(along) / cross);
                place.is_finite().then_some([place; 2])
            }
            (Self::Line { through, direction }, Self::Circle { centre, radius, .. })
            | (Self::Circle { centre, radius, .. }, Self::Line { through, direction }) => {
                let foot = through + direction * (centre - through).dot(direction);
                let square = radius * radius - centre.distance_squared(foot);
                let half = direction * square.sqrt();
                (square >= 0.0).then(|| [foot - half, foot + half])
            }
            (Self::Circle { centre, radius, .. }, Self::Circle { centre: other_centre, radius: other_radius, .. }) => {
                let between = other_centre - centre;
                let distance = between.length();
                let axis = between / distance;
                let along = 0.5 * (distance + (radius - other_radius) * (radius + other_radius) / distance);
                let square = radius * radius - along * along;
                let (foot, half) = (centre + axis * along, axis.perp() * square.sqrt());
                (square >= 0.0 && axis.is_finite()).then(|| [foot - half, foot + half])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intersections_lie_on_both_curves() {
        let curves = [
            Curve::line(DVec2::new(-1.0, 0.2), DVec2::new(2.0, 0.5)),
            Curve::disc(DVec2::new(0.3, 0.1), 1.1),
            Curve::hole(DVec2::new(-0.4, 0.6), 0.9),
            Curve::line(DVec2::new(0.5, -1.0), DVec2::new(0.1, 2.0)),
        ];
        let distance = |curve: Curve, at: DVec2| match curve {
            Curve::Line { through, direction } => direction.perp_dot(at - through).abs(),
            Curve::Circle { centre, radius, .. } => (centre.distance(at) - radius).abs(),
        };
        for first in curves {
            for second in curves.into_iter().filter(|second| *second != first) {
                for point in first.intersections(second).unwrap() {
                    assert!(distance(first, point).max(distance(second, point)) < 1e-12);
                }
            }
        }
    }

    #[test]
    fn parallel_curves_lie_inside() {
        let line = Curve::line(DVec2::ZERO, DVec2::X).inset(0.1).unwrap();
        assert_eq!(line, Curve::line(DVec2::new(0.0, 0.1), DVec2::new(1.0, 0.1)));
        assert_eq!(Curve::disc(DVec2::ZERO, 0.3).inset(0.1), Some(Curve::disc(DVec2::ZERO, 0.3 - 0.1)));
        assert_eq!(Curve::disc(DVec2::ZERO, 0.1).inset(0.1), None);
        assert_eq!(Curve::hole(DVec2::ZERO, 0.3).inset(0.1), Some(Curve::hole(DVec2::ZERO, 0.3 + 0.1)));
    }
}
