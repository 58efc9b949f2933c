//! Where the glass of a pane meets something else.
//!
//! A ray knows what it is in by what it has crossed. In a pane that stands apart, it looks for nothing else. So
//! what lies in glass has to be known beforehand.
//!
//! The search halves the pane's outline. Bounds on both faces show that most parts hold nothing; in the others it looks
//! for one point that both share. So whatever is found is true. A contact smaller than [`RIM`] is not found. Once the
//! budget is spent, nor is one between reliefs that run parallel at a fraction of their own height.

use std::collections::VecDeque;

use glam::{DMat3, DVec2, DVec3};

use super::outline::{Outline, prism};
use super::{HeightField, Pane, Ray};
use crate::math::{Interval, Rect};

/// Panes and shapes may overlap by this much at their borders, metres: decimal numbers round, and a strip this narrow
/// carries no light that anybody sees. A shape that only stands on a face, with a corner or an edge, shares less than
/// this with it.
pub(crate) const RIM: f64 = 2e-6;

/// A face counts as thick as this, relative to the largest coordinate: positions along rays are not more exact.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Parts of one pane that are looked at for one shape.
const MOST_PARTS: u32 = 1 << 14;

/// Something that may meet glass, in world coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape<'a> {
    /// Another pane.
    Pane(&'a Pane),
    /// A flat convex polygon.
    Polygon(&'a [DVec3]),
    /// A ball; with radius 0, a point.
    Ball {
        /// Its centre.
        centre: DVec3,
        /// Its radius, metres.
        radius: f64,
    },
}

impl Shape<'_> {
    /// Corners of a box around it.
    pub(crate) fn bounds(&self) -> [DVec3; 2] {
        match *self {
            Self::Pane(pane) => pane.world_bounds(),
            Self::Polygon(corners) => {
                corners.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[min, max], corner| {
                    [min.min(*corner), max.max(*corner)]
                })
            }
            Self::Ball { centre, radius } => [centre - radius, centre + radius],
        }
    }

    /// Its extent along a unit vector.
    fn extent(&self, axis: DVec3) -> Interval {
        match *self {
            Self::Pane(pane) => {
                let local = pane.frame.vector_to_local(axis);
                let (across, depth) = (pane.outline.extent(local.truncate()), pane.depth() * Interval::point(local.z));
                across + depth + Interval::point(pane.frame.origin.dot(axis))
            }
            Self::Polygon(corners) => {
                corners.iter().map(|corner| Interval::point(corner.dot(axis))).fold(Interval::EMPTY, Interval::union)
            }
            Self::Ball { centre, radius } => Interval::new(centre.dot(axis) - radius, centre.dot(axis) + radius),
        }
    }
}

/// A point of the world that the glass of a pane and a shape share; `None` when they are apart.
///
/// Looks at no more parts of the pane than are left in `budget`.
pub(crate) fn contact(pane: &Pane, shape: &Shape<'_>, budget: &mut u32) -> Option<DVec3> {
    if !overlap(&pane.world_bounds(), &shape.bounds()) {
        return None;
    }
    if let Shape::Pane(other) = shape
        && are_side_by_side(pane, other)
    {
        return None;
    }
    let glass = Glass::new(pane, shape)?;
    let obstacle = Obstacle::new(pane, shape, &glass)?;
    let granted = (*budget).min(MOST_PARTS);
    let mut left = granted;
    let found = obstacle.search(&glass, &mut left);
    *budget -= granted - left;
    found.map(|point| pane.frame.point_to_world(point))
}

/// Whether two boxes, given by two corners each, have a point in common.
pub(crate) fn overlap(a: &[DVec3; 2], b: &[DVec3; 2]) -> bool {
    a[0].cmple(b[1]).all() && b[0].cmple(a[1]).all()
}

/// The box around no point.
pub(crate) const NOWHERE: [DVec3; 2] = [DVec3::INFINITY, DVec3::NEG_INFINITY];

/// The box around two boxes.
pub(crate) fn join(a: [DVec3; 2], b: [DVec3; 2]) -> [DVec3; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Whether an edge of one of two panes shows that they overlap by no more than [`RIM`]: as pieces do that were cut from
/// one sheet.
fn are_side_by_side(one: &Pane, other: &Pane) -> bool {
    let edges = |pane: &Pane| {
        let corners = pane.outline.corners();
        let sides = corners.iter().zip(corners.iter().cycle().skip(1)).map(|(from, to)| (*to - *from).perp());
        let axes = sides.map(|side| pane.frame.vector_to_world(side.normalize().extend(0.0)));
        axes.collect::<Vec<DVec3>>()
    };
    edges(one).into_iter().chain(edges(other)).any(|axis| {
        let (one, other) = (Shape::Pane(one).extent(axis), Shape::Pane(other).extent(axis));
        one.max - other.min <= RIM || other.max - one.min <= RIM
    })
}

/// The glass of a pane without its rim, with faces as thick as rounding errors, in the pane's frame.
struct Glass<'a> {
    pane: &'a Pane,
    outline: Outline,
    skin: f64,
}

impl<'a> Glass<'a> {
    /// `None` where the rim is all there is.
    fn new(pane: &'a Pane, shape: &Shape<'_>) -> Option<Self> {
        let [min, max] = pane.world_bounds();
        let mut largest = min.abs().max(max.abs()).max_element();
        if let Shape::Pane(other) = shape {
            let [min, max] = other.world_bounds();
            largest = largest.max(min.abs().max(max.abs()).max_element());
        }
        // A point has no rim: a camera at the very border of a pane sees its black edge.
        let rim = if matches!(shape, Shape::Ball { .. }) { 0.0 } else { RIM };
        Some(Self { pane, outline: pane.outline.without_rim(rim)?, skin: ROUNDING * largest })
    }

    /// Bounds of z over a part of the pane.
    fn depth_over(&self, part: &Rect) -> Interval {
        let (front, back) = (heights(&self.pane.front, part), heights(&self.pane.back, part));
        Interval::new(front.min - self.skin, self.pane.thickness + back.max + self.skin)
    }

    /// The z between which there is glass.
    fn depth_at(&self, at: DVec2) -> Interval {
        let (front, back) = (self.pane.front.height(at), self.pane.back.height(at));
        Interval::new(front - self.skin, self.pane.thickness + back + self.skin)
    }

    fn holds(&self, point: DVec3) -> bool {
        let depth = || self.depth_at(point.truncate());
        self.outline.contains(point.truncate()) && (depth().min..=depth().max).contains(&point.z)
    }
}

/// Bounds of the heights over a part of a face. Those of whole cells do not get narrower than a cell; Taylor's theorem
/// does.
fn heights(face: &HeightField, part: &Rect) -> Interval {
    let bounds = face.bounds(part);
    let middle = face.jet(part.centre());
    let half = 0.5 * (part.max - part.min);
    let [xx, xy, yy] = bounds.hessian.map(|derivative| derivative.magnitude());
    let bend = 0.5 * (xx * half.x * half.x + yy * half.y * half.y) + xy * half.x * half.y;
    let reach = middle.gradient.abs().dot(half) + bend;
    bounds.height.intersection(Interval::new(middle.height - reach, middle.height + reach))
}

/// What is known of the glass over a part of the outline.
enum Meeting {
    /// The obstacle is nowhere in it.
    Apart,
    /// Nothing.
    Unknown,
    /// The obstacle is here.
    At(DVec3),
}

/// A shape in the frame of the pane.
enum Obstacle<'a> {
    Pane(OtherPane<'a>),
    Polygon(Polygon),
    Ball { centre: DVec3, radius: f64 },
}

impl<'a> Obstacle<'a> {
    /// `None` where the rim of the other pane is all there is.
    fn new(pane: &Pane, shape: &Shape<'a>, glass: &Glass<'_>) -> Option<Self> {
        let frame = &pane.frame;
        Some(match *shape {
            Shape::Pane(other) => Self::Pane(OtherPane {
                glass: Glass { pane: other, outline: other.outline.without_rim(RIM)?, skin: glass.skin },
                origin: frame.point_to_local(other.frame.origin),
                axes: frame.axes.transpose() * other.frame.axes,
            }),
            Shape::Polygon(corners) => {
                let corners = corners.iter().map(|corner| frame.point_to_local(*corner)).collect();
                Self::Polygon(Polygon::new(corners, pane.thickness))
            }
            Shape::Ball { centre, radius } => {
                Self::Ball { centre: frame.point_to_local(centre), radius: (radius - RIM).max(0.0) }
            }
        })
    }

    /// Looks at large parts first, so that one which hides something small does not use up the budget.
    fn search(&self, glass: &Glass<'_>, budget: &mut u32) -> Option<DVec3> {
        let mut parts = VecDeque::from([self.footprint()]);
        while let Some(part) = parts.pop_front() {
            let part = glass.outline.narrowed(&part);
            if part.is_empty() {
                continue;
            }
            *budget = budget.checked_sub(1)?;
            match self.meets(glass, &part) {
                Meeting::At(point) => return Some(point),
                Meeting::Unknown if (part.max - part.min).max_element() > RIM => parts.extend(part.halves()),
                Meeting::Unknown | Meeting::Apart => {}
            }
        }
        None
    }

    /// A rectangle beyond which it does not reach.
    fn footprint(&self) -> Rect {
        let [min, max] = match self {
            Self::Pane(other) => {
                let depth = other.glass.pane.depth();
                let corners = prism(&other.glass.outline, depth).map(|corner| other.origin + other.axes * corner);
                let [min, max] = corners.fold(NOWHERE, |bounds, corner| join(bounds, [corner, corner]));
                [min - other.glass.skin, max + other.glass.skin]
            }
            Self::Polygon(polygon) => Shape::Polygon(&polygon.corners).bounds(),
            Self::Ball { centre, radius } => [*centre - *radius, *centre + *radius],
        };
        Rect::new(min.truncate(), max.truncate())
    }

    fn meets(&self, glass: &Glass<'_>, part: &Rect) -> Meeting {
        let depth = glass.depth_over(part);
        match self {
            Self::Pane(other) => other.meets(glass, part, depth),
            Self::Polygon(polygon) => polygon.meets(glass, part, depth),
            Self::Ball { centre, radius } => {
                let (min, max) = (part.min.extend(depth.min), part.max.extend(depth.max));
                if centre.distance(centre.clamp(min, max)) > *radius {
                    return Meeting::Apart;
                }
                let at = centre.truncate().clamp(part.min, part.max);
                let depth = glass.depth_at(at);
                let nearest = at.extend(centre.z.clamp(depth.min, depth.max));
                if centre.distance(nearest) <= *radius { Meeting::At(nearest) } else { Meeting::Unknown }
            }
        }
    }
}

/// A pane in the frame of another.
struct OtherPane<'a> {
    glass: Glass<'a>,
    origin: DVec3,
    /// Its axes.
    axes: DMat3,
}

impl OtherPane<'_> {
    fn meets(&self, glass: &Glass<'_>, part: &Rect, depth: Interval) -> Meeting {
        let column = Cuboid::new(part, depth);
        let centre = self.to_own(column.centre);
        let reach = DVec3::from_array([0, 1, 2].map(|axis| self.axes.col(axis).abs().dot(column.half)));
        let beneath = Rect::new((centre - reach).truncate(), (centre + reach).truncate());
        let beneath = self.glass.outline.narrowed(&beneath);
        if beneath.is_empty() {
            return Meeting::Apart;
        }
        let own = Cuboid::new(&beneath, self.glass.depth_over(&beneath));
        let own_centre = self.origin + self.axes * own.centre;
        if are_apart(own_centre - column.centre, column.half, own.half, &self.axes) {
            return Meeting::Apart;
        }
        let at = part.centre();
        let depth = glass.depth_at(at);
        let ends = [depth.min, depth.max].map(|z| self.to_own(at.extend(z)));
        self.on_segment(ends)
            .map_or(Meeting::Unknown, |t| Meeting::At(at.extend(depth.min + t * (depth.max - depth.min))))
    }

    fn to_own(&self, point: DVec3) -> DVec3 {
        self.axes.transpose() * (point - self.origin)
    }

    /// A place in the glass on the segment between two points in its own frame, from 0 to 1.
    fn on_segment(&self, [from, to]: [DVec3; 2]) -> Option<f64> {
        let way = to - from;
        let within = self.glass.outline.stretch(&Ray::new(from, way)).intersection(Interval::new(0.0, 1.0));
        if within.is_empty() {
            return None;
        }
        let middle = 0.5 * (within.min + within.max);
        // Where it is half way between the faces as they are at a place near by.
        let half_way = |near: f64| {
            let depth = self.glass.depth_at((from + way * near).truncate());
            let t = (0.5 * (depth.min + depth.max) - from.z) / way.z;
            if t.is_finite() { t.clamp(within.min, within.max) } else { middle }
        };
        let deep = half_way(middle);
        [within.min, within.max, middle, deep, half_way(deep)].into_iter().find(|t| {
            let point = from + way * *t;
            let depth = self.glass.depth_at(point.truncate());
            (depth.min..=depth.max).contains(&point.z)
        })
    }
}

/// A box along the axes of a frame.
struct Cuboid {
    centre: DVec3,
    half: DVec3,
}

impl Cuboid {
    fn new(part: &Rect, depth: Interval) -> Self {
        let (min, max) = (part.min.extend(depth.min), part.max.extend(depth.max));
        Self { centre: 0.5 * (min + max), half: 0.5 * (max - min) }
    }
}

/// Whether a plane separates two boxes: one along the axes of the frame, the other along `axes`, with its centre at
/// `offset` from that of the first (Gottschalk, Lin, Manocha 1996).
fn are_apart(offset: DVec3, half: DVec3, other_half: DVec3, axes: &DMat3) -> bool {
    let own = [DVec3::X, DVec3::Y, DVec3::Z];
    let others = [axes.x_axis, axes.y_axis, axes.z_axis];
    let edges = own.into_iter().flat_map(|a| others.map(|b| a.cross(b)));
    own.into_iter().chain(others).chain(edges).any(|axis| {
        // Edges that are all but parallel separate nothing that the faces do not.
        let reach = half.dot(axis.abs()) + (axes.transpose() * axis).abs().dot(other_half);
        axis.length_squared() > 1e-12 && offset.dot(axis).abs() > reach
    })
}

/// A convex polygon in the frame of the pane.
struct Polygon {
    corners: Vec<DVec3>,
    /// From a point that it shares with the glass, it must share what lies around it as well: these steps in its plane.
    around: [DVec3; 4],
    normal: DVec3,
}

impl Polygon {
    fn new(corners: Vec<DVec3>, thickness: f64) -> Self {
        let side = (corners[1] - corners[0]).normalize_or_zero();
        let normal = corners.iter().map(|corner| side.cross(*corner - corners[0])).fold(DVec3::ZERO, |best, normal| {
            if normal.length_squared() > best.length_squared() { normal } else { best }
        });
        let normal = normal.normalize_or_zero();
        let next = corners.iter().cycle().skip(1);
        let shortest = corners.iter().zip(next).map(|(a, b)| a.distance(*b)).fold(f64::INFINITY, f64::min);
        let step = RIM.min(0.1 * shortest).min(0.1 * thickness);
        let (x, y) = (side * step, normal.cross(side) * step);
        Self { around: [x, -x, y, -y], normal, corners }
    }

    fn meets(&self, glass: &Glass<'_>, part: &Rect, depth: Interval) -> Meeting {
        let within = self.clipped(part, depth);
        if within.len() < 3 || self.is_sliver(&within) {
            return Meeting::Apart;
        }
        let middle = within.iter().sum::<DVec3>() / within.len() as f64;
        let shared = |point: DVec3| glass.holds(point) && self.holds(point);
        let is_met = shared(middle) && self.around.iter().all(|step| shared(middle + *step));
        if is_met { Meeting::At(middle) } else { Meeting::Unknown }
    }

    /// Whether a point of its plane lies in it.
    fn holds(&self, point: DVec3) -> bool {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).all(|(a, b)| (*b - *a).cross(point - *a).dot(self.normal) >= 0.0)
    }

    /// Whether a part of it is too narrow for a point with what lies around it.
    fn is_sliver(&self, part: &[DVec3]) -> bool {
        is_narrow(part, self.normal, self.around[0].length())
    }

    /// The corners of what lies over a part of the pane and within a range of z.
    fn clipped(&self, part: &Rect, depth: Interval) -> Vec<DVec3> {
        let (min, max) = (part.min.extend(depth.min), part.max.extend(depth.max));
        let mut corners = self.corners.clone();
        for axis in 0..3 {
            corners = clip(&corners, |point| point[axis] - min[axis]);
            corners = clip(&corners, |point| max[axis] - point[axis]);
        }
        corners
    }
}

/// Whether a convex polygon with this unit normal has no room for a circle of this radius r: with room, its area is at
/// least r/2 times its circumference.
pub(super) fn is_narrow(corners: &[DVec3], normal: DVec3, radius: f64) -> bool {
    let next = corners.iter().cycle().skip(1);
    let circumference: f64 = corners.iter().zip(next).map(|(a, b)| a.distance(*b)).sum();
    let doubled = |pair: &[DVec3]| (pair[0] - corners[0]).cross(pair[1] - corners[0]).dot(normal);
    let area: f64 = corners.windows(2).map(|pair| 0.5 * doubled(pair)).sum();
    2.0 * area <= 0.5 * radius * circumference
}

/// The part of a polygon where `inside` is not negative (Sutherland and Hodgman 1974).
pub(super) fn clip(corners: &[DVec3], inside: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (index, &corner) in corners.iter().enumerate() {
        let before = corners[(index + corners.len() - 1) % corners.len()];
        let (was, is) = (inside(before), inside(corner));
        if (was < 0.0) != (is < 0.0) {
            kept.push(before + (corner - before) * (was / (was - is)));
        }
        if is >= 0.0 {
            kept.push(corner);
        }
    }
    kept
}

#[cfg(test)]
mod tests;
