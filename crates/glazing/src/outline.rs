//! Closed outlines of lines and arcs, counterclockwise.

use std::f64::consts::PI;

use glam::DVec2;

use crate::curve::Curve;
use crate::polygon;

/// Largest distance of an arc from its chords, metres.
pub(crate) const SAGITTA: f64 = 0.0002;

/// How an outline passes from one curve to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Corner {
    /// It turns left where the curves intersect.
    Convex,
    /// It turns right where the curves intersect.
    Reflex,
    /// It goes straight on. The vector is the unit direction of the joint from the centre of the circle, or of either
    /// of the circles.
    Tangent(DVec2),
}

/// A curve of an outline, and the corner at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Side {
    pub(crate) curve: Curve,
    pub(crate) corner: Corner,
}

impl Side {
    /// A curve that ends in a corner of less than 180 degrees.
    pub(crate) fn convex(curve: Curve) -> Self {
        Self { curve, corner: Corner::Convex }
    }
}

/// A closed outline. Parallel outlines have the same sides, so they are exact.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outline {
    sides: Vec<Side>,
    /// The end of each side.
    ends: Vec<DVec2>,
}

/// An arc of more than this is one that an inset has turned over, radians.
const LARGEST_SWEEP: f64 = 1.8 * PI;

/// Lines that turn by less than 20 degrees are chords of a curve: the cosine.
const SMOOTH: f64 = 0.94;

impl Outline {
    /// The outline along these sides; `None` where they do not close, or where a side would run backwards.
    pub(crate) fn new(sides: Vec<Side>) -> Option<Self> {
        let next = |index: usize| sides[(index + 1) % sides.len()].curve;
        let ends = (sides.iter().enumerate())
            .map(|(index, side)| corner_point(side.curve, next(index), side.corner))
            .collect::<Option<Vec<DVec2>>>()?;
        let outline = Self { sides, ends };
        let runs_forwards = (0..outline.sides.len()).all(|index| match outline.sides[index].curve {
            Curve::Line { direction, .. } => (outline.ends[index] - outline.start(index)).dot(direction) > 0.0,
            Curve::Circle { .. } => (1e-9..LARGEST_SWEEP).contains(&outline.sweep(index)),
        });
        runs_forwards.then_some(outline)
    }

    /// The outline of a disc.
    pub(crate) fn disc(centre: DVec2, radius: f64) -> Option<Self> {
        let half = |joint| Side { curve: Curve::disc(centre, radius), corner: Corner::Tangent(joint) };
        Self::new(vec![half(DVec2::X), half(DVec2::NEG_X)])
    }

    /// The outline with these corners, counterclockwise; `None` where neighbours lie in one place or on one line.
    pub(crate) fn around(corners: &[DVec2]) -> Option<Self> {
        if corners.len() < 3 {
            return None;
        }
        let corner = |index: usize| corners[index % corners.len()];
        let side = |index: usize| {
            let [from, to, next] = [corner(index), corner(index + 1), corner(index + 2)];
            let turns_left = (to - from).perp_dot(next - to) > 0.0;
            let corner = if turns_left { Corner::Convex } else { Corner::Reflex };
            Side { curve: Curve::line(from, to), corner }
        };
        Self::new((0..corners.len()).map(side).collect())
    }

    /// The sides.
    pub(crate) fn sides(&self) -> &[Side] {
        &self.sides
    }

    /// Where a side starts.
    pub(crate) fn start(&self, side: usize) -> DVec2 {
        self.ends[(side + self.ends.len() - 1) % self.ends.len()]
    }

    /// Where a side ends.
    pub(crate) fn end(&self, side: usize) -> DVec2 {
        self.ends[side]
    }

    /// The angle of an arc, radians; 0 for a line.
    pub(crate) fn sweep(&self, side: usize) -> f64 {
        self.sides[side].curve.sweep(self.start(side), self.ends[side])
    }

    /// The sides as lines and arcs: sides that are chords of a curve follow each other in one of them.
    pub(crate) fn runs(&self) -> Vec<Vec<usize>> {
        let count = self.sides.len();
        let is_chord = |index: usize| matches!(self.sides[index % count].curve, Curve::Line { .. });
        let goes_on = |index: usize| {
            let at = self.ends[index];
            let [tangent, next] = [index, (index + 1) % count].map(|side| self.sides[side].curve.tangent(at));
            is_chord(index) && is_chord(index + 1) && tangent.dot(next) > SMOOTH
        };
        let first = (0..count).find(|&index| !goes_on(index)).map_or(0, |last| last + 1);
        let mut runs: Vec<Vec<usize>> = Vec::new();
        let mut starts = true;
        for index in (first..first + count).map(|index| index % count) {
            match runs.last_mut() {
                Some(run) if !starts => run.push(index),
                _ => runs.push(vec![index]),
            }
            starts = !goes_on(index);
        }
        runs
    }

    /// A point of a run and the side that it is on, by the part of the run's length from its start.
    pub(crate) fn point_of_run(&self, run: &[usize], part: f64) -> (usize, DVec2) {
        let whole: f64 = run.iter().map(|&side| self.length(side)).sum();
        let mut left = part;
        let mut at = (0, DVec2::ZERO);
        for &side in run {
            let share = self.length(side) / whole;
            at = (side, self.point(side, (left / share).min(1.0)));
            if left <= share {
                break;
            }
            left -= share;
        }
        at
    }

    /// The length of a side, metres.
    pub(crate) fn length(&self, side: usize) -> f64 {
        match self.sides[side].curve {
            Curve::Line { .. } => self.start(side).distance(self.ends[side]),
            Curve::Circle { radius, .. } => radius * self.sweep(side),
        }
    }

    /// A point of a side, by the part of its length from its start.
    pub(crate) fn point(&self, side: usize, part: f64) -> DVec2 {
        let (from, to) = (self.start(side), self.ends[side]);
        match self.sides[side].curve {
            Curve::Line { .. } => from.lerp(to, part),
            Curve::Circle { centre, counterclockwise, .. } => {
                let angle = self.sweep(side) * if counterclockwise { part } else { -part };
                let (sine, cosine) = libm::sincos(angle);
                centre + (from - centre).rotate(DVec2::new(cosine, sine))
            }
        }
    }

    /// The outline at a distance inside, or outside where the distance is negative; `None` where nothing is left, or
    /// where sides vanish.
    pub(crate) fn inset(&self, distance: f64) -> Option<Self> {
        let sides = (self.sides.iter())
            .map(|side| Some(Side { curve: side.curve.inset(distance)?, corner: side.corner }))
            .collect::<Option<Vec<Side>>>()?;
        let inset = Self::new(sides)?;
        // A side that vanishes makes others cross, which brings corners nearer to the outline than the distance.
        let (outer, inner) = (self.polygon(), inset.polygon());
        let (outer, inner) = if distance < 0.0 { (inner, outer) } else { (outer, inner) };
        let keeps_distance = inner.iter().all(|&corner| {
            polygon::contains(&outer, corner)
                && polygon::distance_to_border(&outer, corner) >= distance.abs() - 2.0 * SAGITTA
        });
        (distance == 0.0 || keeps_distance).then_some(inset)
    }

    /// The corners of a polygon that follows the outline.
    pub(crate) fn polygon(&self) -> Vec<DVec2> {
        self.polygon_with(&self.segments(SAGITTA))
    }

    /// Into how many segments each side is cut.
    pub(crate) fn segments(&self, sagitta: f64) -> Vec<u32> {
        let count = |index: usize| match self.sides[index].curve {
            Curve::Line { .. } => 1,
            Curve::Circle { radius, .. } => {
                let step = 2.0 * libm::acos((1.0 - sagitta / radius).max(0.0));
                (self.sweep(index) / step).ceil().clamp(1.0, 4096.0) as u32
            }
        };
        (0..self.sides.len()).map(count).collect()
    }

    /// A polygon with these segments of each side. It starts with the start of the first side.
    pub(crate) fn polygon_with(&self, segments: &[u32]) -> Vec<DVec2> {
        let mut corners = Vec::new();
        for (side, &count) in segments.iter().enumerate() {
            corners.push(self.start(side));
            corners.extend((1..count).map(|index| self.point(side, f64::from(index) / f64::from(count))));
        }
        corners
    }
}

/// Where a curve ends that passes into another.
fn corner_point(curve: Curve, next: Curve, corner: Corner) -> Option<DVec2> {
    let turns_left = |at: DVec2| curve.tangent(at).perp_dot(next.tangent(at)) > 0.0;
    match corner {
        Corner::Tangent(joint) => match (curve, next) {
            (Curve::Circle { centre, radius, .. }, _) | (_, Curve::Circle { centre, radius, .. }) => {
                Some(centre + joint * radius)
            }
            _ => None,
        },
        Corner::Convex => curve.intersections(next)?.into_iter().find(|&at| turns_left(at)),
        Corner::Reflex => curve.intersections(next)?.into_iter().find(|&at| !turns_left(at)),
    }
}
