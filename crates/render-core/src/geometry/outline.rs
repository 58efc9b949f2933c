//! Outlines of panes: convex polygons.
//!
//! A polygon is the smallest rectangle around it, less what its other edges cut off. So a rectangular pane is one
//! without such cuts, and bounds that hold for the rectangle hold for the polygon.

use glam::{DVec2, DVec3};
use smallvec::SmallVec;
use thiserror::Error;

use super::Ray;
use super::half_plane::{HalfPlane, ROUNDING, Shape, area, clipped, cut, narrowed, sample, within};
use crate::math::simd::{Instructions, LaneRects, Lanes, Mask};
use crate::math::{Interval, Rect};

/// Most corners of an outline.
pub const MOST_CORNERS: usize = 64;

/// The smallest area of an outline, as a part of that of the square over its longest side.
const NARROWEST: f64 = 1e-6;

/// The convex outline of a pane, in the pane's frame, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    bounds: Rect,
    cuts: Box<[HalfPlane]>,
    corners: Box<[DVec2]>,
    area: f64,
}

/// Why corners are no outline.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum OutlineError {
    /// There are too few or too many.
    #[error("{0} corners: an outline has 3 to 64")]
    Count(usize),
    /// A coordinate is infinite or not a number.
    #[error("corner {index} at {}, {}: coordinates must be finite", at.x, at.y)]
    NotFinite {
        /// Number of the corner, from 0.
        index: usize,
        /// The corner.
        at: DVec2,
    },
    /// The outline turns to the right, crosses itself or stands still.
    #[error(
        "corner {index} at {}, {}: the outline must turn to the left at each corner (counterclockwise and convex), \
         once around", at.x, at.y
    )]
    NotConvex {
        /// Number of the corner, from 0.
        index: usize,
        /// The corner.
        at: DVec2,
    },
    /// It has next to no area.
    #[error("an outline of {0} square metres: it must be wider")]
    Narrow(f64),
}

impl Outline {
    /// A rectangle with an area.
    pub fn rectangle(rect: Rect) -> Self {
        let Rect { min, max } = rect;
        let corners = [min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)];
        Self { bounds: rect, cuts: Box::default(), corners: corners.into(), area: rect.area() }
    }

    /// The rectangle of this size around the origin.
    pub fn centred(size: DVec2) -> Self {
        Self::rectangle(Rect::new(-0.5 * size, 0.5 * size))
    }

    /// A convex polygon, given by its corners, counterclockwise.
    ///
    /// # Errors
    /// [`OutlineError`] when the corners are too few or too many, or make no convex polygon with an area.
    pub fn polygon(corners: Vec<DVec2>) -> Result<Self, OutlineError> {
        if !(3..=MOST_CORNERS).contains(&corners.len()) {
            return Err(OutlineError::Count(corners.len()));
        }
        if let Some(index) = corners.iter().position(|corner| !corner.is_finite()) {
            return Err(OutlineError::NotFinite { index, at: corners[index] });
        }
        let count = corners.len();
        let side = |index: usize| corners[(index + 1) % count] - corners[index % count];
        let mut quarters = 0;
        for (index, &at) in corners.iter().enumerate() {
            let (before, after) = (side(index + count - 1), side(index));
            if before.perp_dot(after) <= 0.0 {
                return Err(OutlineError::NotConvex { index, at });
            }
            // A polygon goes around once if its sides point downwards in one run.
            quarters += usize::from(points_down(after) && !points_down(before));
        }
        if quarters != 1 {
            return Err(OutlineError::NotConvex { index: 0, at: corners[0] });
        }
        let (min, max) = corners
            .iter()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(min, max), corner| (min.min(*corner), max.max(*corner)));
        let area = area(&corners);
        let longest = (max - min).max_element();
        if area <= NARROWEST * longest * longest {
            return Err(OutlineError::Narrow(area));
        }
        let is_on_bounds = |a: DVec2, b: DVec2| {
            (a.x == b.x && (a.x == min.x || a.x == max.x)) || (a.y == b.y && (a.y == min.y || a.y == max.y))
        };
        let cuts = (0..count)
            .filter(|index| !is_on_bounds(corners[*index], corners[(index + 1) % count]))
            .map(|index| {
                let inwards = side(index).perp().normalize();
                // The line through the outer one of both ends, so that no corner is cut off by rounding.
                let offset = inwards.dot(corners[index]).min(inwards.dot(corners[(index + 1) % count]));
                HalfPlane { inwards, offset }
            })
            .collect();
        Ok(Self { bounds: Rect::new(min, max), cuts, corners: corners.into(), area })
    }

    /// The smallest rectangle around it.
    #[inline(always)]
    pub fn bounds(&self) -> &Rect {
        &self.bounds
    }

    /// Its edges that are not sides of that rectangle.
    #[inline(always)]
    pub fn cuts(&self) -> &[HalfPlane] {
        &self.cuts
    }

    /// Its corners, counterclockwise.
    pub fn corners(&self) -> &[DVec2] {
        &self.corners
    }

    /// Its area in square metres.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Whether a place lies inside or on the border.
    #[inline(always)]
    pub fn contains(&self, place: DVec2) -> bool {
        self.bounds.contains(place) && self.cuts.iter().all(|cut| cut.distance(place) >= 0.0)
    }

    /// A rectangle around what both have in common; empty when that is nothing. It may be larger than needed.
    #[inline]
    pub fn narrowed(&self, rect: &Rect) -> Rect {
        narrowed(self.cuts.iter().copied(), rect.intersection(&self.bounds))
    }

    /// The corners of what it has of a convex polygon, in the order of that; none where it has nothing.
    pub fn clipped(&self, corners: &[DVec2]) -> SmallVec<[DVec2; 8]> {
        cut(SmallVec::from_slice(corners), self.cuts.iter().copied())
    }

    /// Which of four rectangles are beside it, as far as a line along one of its edges shows.
    #[inline(always)]
    pub(crate) fn is_beside<S: Instructions>(&self, rects: LaneRects<S>) -> Mask<S> {
        let simd = rects.min.x.simd();
        let mut beside = rects.is_beside(LaneRects::new(simd, &[self.bounds; 4]));
        for HalfPlane { inwards, offset } in &self.cuts {
            let x = if inwards.x > 0.0 { rects.max.x } else { rects.min.x };
            let y = if inwards.y > 0.0 { rects.max.y } else { rects.min.y };
            beside = beside.or((x * inwards.x + y * inwards.y).less_than(Lanes::splat(simd, *offset)));
        }
        beside
    }

    /// The stretch of a whole line on which it is over the outline; empty when it never is.
    #[inline]
    pub fn stretch(&self, ray: &Ray) -> Interval {
        let mut stretch = Interval::new(f64::NEG_INFINITY, f64::INFINITY);
        let (origin, direction) = (ray.origin.truncate(), ray.direction.truncate());
        for axis in 0..2 {
            let (low, high) = (self.bounds.min[axis] - origin[axis], self.bounds.max[axis] - origin[axis]);
            if direction[axis] != 0.0 {
                let (a, b) = (low / direction[axis], high / direction[axis]);
                stretch = stretch.intersection(Interval::new(a.min(b), a.max(b)));
            } else if low > 0.0 || high < 0.0 {
                return Interval::EMPTY;
            }
        }
        for cut in &self.cuts {
            let (inside, rate) = (cut.distance(origin), cut.inwards.dot(direction));
            if rate > 0.0 {
                stretch.min = stretch.min.max(-inside / rate);
            } else if rate < 0.0 {
                stretch.max = stretch.max.min(-inside / rate);
            } else if inside < 0.0 {
                return Interval::EMPTY;
            }
        }
        stretch
    }

    /// A place inside for a pair of numbers in [0, 1): uniform over the area.
    pub fn sample(&self, random: DVec2) -> DVec2 {
        if self.cuts.is_empty() {
            return within(&self.bounds, random);
        }
        sample(&self.corners, self.area, random)
    }

    /// The same of what a rectangle has of it; `None` where that is nothing.
    pub fn sample_within(&self, rect: &Rect, random: DVec2) -> Option<DVec2> {
        Some(Shape::new(*rect, self.cuts.iter().copied())?.sample(random))
    }

    /// The place nearest to one given that is at least `margin` inside of all edges, or the middle where the outline is
    /// narrower than that.
    pub fn nearest(&self, place: DVec2, margin: f64) -> DVec2 {
        let middle = self.middle();
        let slack = DVec2::splat(margin).min(0.25 * (self.bounds.max - self.bounds.min));
        let mut nearest = place.clamp(self.bounds.min + slack, self.bounds.max - slack);
        // Onto one edge after the other; where two meet at a sharp corner, a few rounds come near it.
        for _ in 0..4 {
            let mut moved = false;
            for cut in &self.cuts {
                let wanted = margin.min(0.5 * cut.distance(middle));
                let short = wanted - cut.distance(nearest);
                if short > 0.0 {
                    nearest += cut.inwards * short;
                    moved = true;
                }
            }
            if !moved {
                return nearest;
            }
        }
        if self.contains(nearest) { nearest } else { middle }
    }

    /// The mean of its corners.
    pub fn middle(&self) -> DVec2 {
        self.corners.iter().sum::<DVec2>() / self.corners.len() as f64
    }

    /// Its interior without a rim of this width; `None` where nothing is left. A negative width adds a rim.
    pub(crate) fn without_rim(&self, rim: f64) -> Option<Self> {
        let bounds = self.bounds.grown(-rim);
        let cuts: Box<[HalfPlane]> =
            self.cuts.iter().map(|cut| HalfPlane { offset: cut.offset + rim, ..*cut }).collect();
        let corners = clipped(&bounds, cuts.iter().copied());
        (corners.len() > 2).then(|| Self { bounds, cuts, area: area(&corners), corners: corners.to_vec().into() })
    }

    /// The outline in a direction of its plane: the largest product of a place with it.
    pub(crate) fn extent(&self, direction: DVec2) -> Interval {
        let products = self.corners.iter().map(|corner| Interval::point(corner.dot(direction)));
        products.fold(Interval::EMPTY, Interval::union)
    }
}

/// Whether a vector points into the lower half plane; every direction and its opposite differ in this.
fn points_down(side: DVec2) -> bool {
    side.y < 0.0 || (side.y == 0.0 && side.x < 0.0)
}

/// An outline from a point: what its relief, at any of some heights, covers of the plane of the undisplaced face.
///
/// A place `p` of the outline at the height `h` is seen, from `O`, in that plane at `O + (p - O) s` with
/// `s = near/(near + h)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenOutline<'a> {
    outline: &'a Outline,
    origin: DVec2,
    scale: Interval,
    rect: Rect,
}

impl<'a> SeenOutline<'a> {
    /// The outline from a point over `origin`, scaled about it by any number of an interval of positive ones.
    pub(crate) fn new(outline: &'a Outline, origin: DVec2, scale: Interval) -> Self {
        let seen = |min: f64, max: f64, centre: f64| {
            scale * Interval::new(min - centre, max - centre) + Interval::point(centre)
        };
        let Rect { min, max } = *outline.bounds();
        let (x, y) = (seen(min.x, max.x, origin.x), seen(min.y, max.y, origin.y));
        Self { outline, origin, scale, rect: Rect::new(DVec2::new(x.min, y.min), DVec2::new(x.max, y.max)) }
    }

    /// The rectangle around it.
    pub(crate) fn rect(&self) -> &Rect {
        &self.rect
    }

    fn cuts(&self) -> impl Iterator<Item = HalfPlane> + Clone + 'a {
        let Self { outline, origin, scale, .. } = *self;
        outline.cuts().iter().map(move |cut| {
            let beyond = -cut.distance(origin);
            let offset = (scale.min * beyond).min(scale.max * beyond);
            let slack = ROUNDING * (offset.abs() + origin.abs().max_element());
            HalfPlane { inwards: cut.inwards, offset: cut.inwards.dot(origin) + offset - slack }
        })
    }

    /// A rectangle around what of a rectangle may be seen of it; empty when nothing may.
    #[inline]
    pub(crate) fn narrowed(&self, rect: &Rect) -> Rect {
        if self.outline.cuts().is_empty() { *rect } else { narrowed(self.cuts(), *rect) }
    }

    /// What of a rectangle may be seen of it; `None` where that is nothing.
    pub(crate) fn shape(&self, rect: &Rect) -> Option<Shape> {
        Shape::new(*rect, self.cuts())
    }

    /// The outline, widened until it holds all that may be seen of it.
    pub(crate) fn widened(&self) -> Widened<'a> {
        let Rect { min, max } = *self.outline.bounds();
        let middle = self.outline.middle();
        // How far a place may be moved, and the shortest way out.
        let reach = (min - self.origin).abs().max((max - self.origin).abs()).length();
        let moved = reach * (self.scale.max - 1.0).abs().max((self.scale.min - 1.0).abs());
        let sides = (middle - min).min(max - middle).min_element();
        let inside = self.outline.cuts().iter().map(|cut| cut.distance(middle)).fold(sides, f64::min);
        Widened { outline: self.outline, middle, by: (1.0 + moved / inside) * (1.0 + ROUNDING) }
    }

    /// Whether all places of a rectangle may be seen of it.
    pub(crate) fn holds(&self, rect: &Rect) -> bool {
        let Rect { min, max } = *rect;
        [min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)].iter().all(|corner| self.contains(*corner))
    }

    /// Whether a place may be seen of it.
    pub(crate) fn contains(&self, place: DVec2) -> bool {
        self.rect.contains(place) && self.cuts().all(|cut| cut.distance(place) >= 0.0)
    }
}

/// An outline that is scaled about its middle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Widened<'a> {
    outline: &'a Outline,
    middle: DVec2,
    by: f64,
}

impl Widened<'_> {
    /// Its area in square metres.
    pub(crate) fn area(&self) -> f64 {
        self.outline.area() * self.by * self.by
    }

    /// Whether a place is in it.
    pub(crate) fn contains(&self, place: DVec2) -> bool {
        self.outline.contains(self.middle + (place - self.middle) / self.by)
    }

    /// A place in it for a pair of numbers in [0, 1): uniform over the area.
    pub(crate) fn sample(&self, random: DVec2) -> DVec2 {
        self.middle + (self.outline.sample(random) - self.middle) * self.by
    }
}

/// The corners of the outline between two heights, in the frame of the pane.
pub(crate) fn prism<'a>(outline: &'a Outline, depth: Interval) -> impl Iterator<Item = DVec3> + 'a {
    outline.corners().iter().flat_map(move |corner| [corner.extend(depth.min), corner.extend(depth.max)])
}

#[cfg(test)]
mod tests {
    use glam::dvec2;
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::testing::fixed_seed;

    /// A convex polygon: corners of a circle or an ellipse at rising angles.
    fn any_outline() -> impl Strategy<Value = Outline> {
        let angles = prop::collection::vec(0.05..1.0f64, 3..12);
        (angles, 0.05..2.0f64, 0.05..2.0f64, -3.0..3.0f64, -3.0..3.0f64).prop_filter_map(
            "it has an area",
            |(steps, a, b, x, y)| {
                let whole: f64 = steps.iter().sum();
                let mut turned = 0.0;
                let corner = |step: &f64| {
                    turned += step / whole * std::f64::consts::TAU;
                    dvec2(x + a * libm::cos(turned), y + b * libm::sin(turned))
                };
                Outline::polygon(steps.iter().map(corner).collect()).ok()
            },
        )
    }

    /// Whether a place is to the left of all sides.
    fn is_inside(outline: &Outline, place: DVec2, slack: f64) -> bool {
        let corners = outline.corners();
        let mut sides = corners.iter().zip(corners.iter().cycle().skip(1));
        sides.all(|(from, to)| (*to - *from).perp_dot(place - *from) >= -slack * (*to - *from).length())
    }

    proptest! {
        #![proptest_config(fixed_seed(300))]

        #[test]
        fn an_outline_is_its_polygon(
            outline in any_outline(), places in prop::collection::vec((-5.0..5.0f64, -5.0..5.0f64), 40),
            min in (-5.0..5.0f64, -5.0..5.0f64), size in (0.01..2.0f64, 0.01..2.0f64),
        ) {
            let rect = Rect::new(DVec2::from(min), DVec2::from(min) + DVec2::from(size));
            let narrowed = outline.narrowed(&rect);
            let shape = Shape::new(rect.intersection(outline.bounds()), outline.cuts().iter().copied());
            for place in places.into_iter().map(DVec2::from) {
                let place = outline.middle() + (place - outline.middle()) * 0.3;
                prop_assert!(!outline.contains(place) || is_inside(&outline, place, 1e-12));
                prop_assert!(outline.contains(place) || !is_inside(&outline, place, -1e-12));
                if rect.contains(place) && outline.contains(place) {
                    prop_assert!(narrowed.contains(place) && shape.is_some());
                }
                // A line through the place is over the outline where its points are.
                let ray = Ray::new(place.extend(1.0), DVec3::new(0.6, -0.3, 0.7));
                let stretch = outline.stretch(&ray);
                for step in -40..40 {
                    let t = f64::from(step) * 0.1;
                    let at = ray.at(t).truncate();
                    let is_over = stretch.min <= t && t <= stretch.max;
                    prop_assert!(is_over || !is_inside(&outline, at, -1e-12));
                    prop_assert!(!is_over || is_inside(&outline, at, 1e-12));
                }
                let nearest = outline.nearest(place, 0.0);
                prop_assert!(is_inside(&outline, nearest, 1e-9), "{nearest} for {place}");
                prop_assert!(!outline.contains(place) || nearest == place);
            }
        }

        #[test]
        fn places_are_drawn_evenly(outline in any_outline(), split in 0.1..0.9f64) {
            let Rect { min, max } = *outline.bounds();
            let low = Rect::new(min, dvec2(min.x + split * (max.x - min.x), max.y));
            let shape = Shape::new(low, outline.cuts().iter().copied());
            let (mut inside, count) = (0, 100);
            for index in 0..count * count {
                let random = dvec2(f64::from(index % count) + 0.5, f64::from(index / count) + 0.5) / f64::from(count);
                let place = outline.sample(random);
                prop_assert!(is_inside(&outline, place, 1e-12));
                inside += u32::from(low.contains(place));
                if let Some(shape) = &shape {
                    let place = shape.sample(random);
                    prop_assert!(is_inside(&outline, place, 1e-12) && low.grown(1e-12).contains(place));
                }
            }
            let part = shape.map_or(0.0, |shape| shape.area()) / outline.area();
            prop_assert!((f64::from(inside) / f64::from(count * count) - part).abs() < 0.03, "{inside} {part}");
        }

        #[test]
        fn what_is_seen_of_an_outline_holds_each_place_at_each_height(
            outline in any_outline(), origin in (-3.0..3.0f64, -3.0..3.0f64), random in (0.0..1.0f64, 0.0..1.0f64),
            scale in 0.9..1.1f64,
        ) {
            let origin = DVec2::from(origin);
            let seen = SeenOutline::new(&outline, origin, Interval::new(0.9, 1.1));
            let place = origin + (outline.sample(DVec2::from(random)) - origin) * scale;
            prop_assert!(seen.contains(place) && seen.narrowed(seen.rect()).contains(place));
            let widened = seen.widened();
            let back = outline.middle() + (place - outline.middle()) / widened.by;
            prop_assert!(outline.contains(back));
            let drawn = outline.middle() + (widened.sample(DVec2::from(random)) - outline.middle()) / widened.by;
            prop_assert!(is_inside(&outline, drawn, 1e-12));
            let shape = seen.shape(seen.rect()).unwrap();
            prop_assert!(widened.area() >= 0.999 * shape.area().min(outline.area()));
            let area = shape.area();
            prop_assert!(area >= 0.81 * outline.area());
        }
    }

    #[test]
    fn corners_that_make_no_convex_polygon_are_refused() {
        let polygon =
            |corners: &[[f64; 2]]| Outline::polygon(corners.iter().map(|corner| DVec2::from(*corner)).collect());
        assert_eq!(polygon(&[[0.0, 0.0], [1.0, 0.0]]), Err(OutlineError::Count(2)));
        let clockwise = polygon(&[[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
        assert!(matches!(clockwise, Err(OutlineError::NotConvex { index: 0, .. })));
        let dented = polygon(&[[0.0, 0.0], [1.0, 0.0], [0.5, 0.2], [0.5, 1.0]]);
        assert!(matches!(dented, Err(OutlineError::NotConvex { index: 2, .. })), "{dented:?}");
        let star: Vec<[f64; 2]> = (0..5)
            .map(|point| f64::from(point) * 0.8 * std::f64::consts::PI)
            .map(|angle| [libm::cos(angle), libm::sin(angle)])
            .collect();
        assert!(matches!(polygon(&star), Err(OutlineError::NotConvex { .. })));
        assert!(matches!(polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1e-7]]), Err(OutlineError::Narrow(_))));
        let lost = polygon(&[[0.0, 0.0], [f64::NAN, 0.0], [1.0, 1.0]]);
        assert!(matches!(lost, Err(OutlineError::NotFinite { index: 1, .. })));
    }

    #[test]
    fn a_rectangle_has_no_cuts() {
        let corners = vec![dvec2(-1.0, -2.0), dvec2(3.0, -2.0), dvec2(3.0, 2.0), dvec2(-1.0, 2.0)];
        let rect = Rect::new(corners[0], corners[2]);
        assert_eq!(Outline::polygon(corners).unwrap(), Outline::rectangle(rect));
        assert_eq!(Outline::centred(dvec2(1.0, 2.0)).cuts().len(), 0);
    }
}
