//! The deflection window: where, on a pane, light can come through from a light to a shading point.
//!
//! Along a path O, X1, X2, S through two faces, Snell's law adds to the tangential direction only multiples of the two
//! slopes. With a the unit direction at O, w the unit direction at S, n the relative index and m the face's
//! unnormalised normal,
//!
//! ```text
//! w_t - a_t = -g1 grad h1 + g2 grad h2,    g = (sqrt(n^2 - 1 + c^2) - c) / |m|,    c = cosine in air at that face
//! ```
//!
//! so bounds on the slopes bound the deflection, and bounds on the deflection bound where the path can cross the pane.
//! Interval arithmetic (`deflection`) turns this into a rectangle that holds every path, and the rectangle into better
//! bounds on the slopes. A few rounds contract it. The same arithmetic contracts any part of the window further. The
//! rectangle is a true bound (no path that [`super::coverage`] owns lies outside), which makes sampling inside it
//! unbiased.

use glam::{DVec2, DVec3};

use super::{
    deflection::{DeflectionBounds, Detail, Ends, MirroredSource, Part, mirrored},
    direction_bounds::cap_bounds,
    side::{GRAZING_COSINE, PaneSide},
};
use crate::geometry::{SeenOutline, ShapeBounds};
use crate::math::simd::{Instructions, LaneRects, Mask};
use crate::math::{Interval, Rect};
use crate::scene::looks::Looks;

/// The places from which light may come, in the pane's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SourceBounds {
    /// A ball: a point light, a sample on a light, or a whole light.
    Ball {
        /// Its centre.
        centre: DVec3,
        /// Its radius.
        radius: f64,
    },
    /// A cap of directions: the sun or a sample of it.
    Cap {
        /// Unit vector towards its middle.
        direction: DVec3,
        /// Sine of its angular radius (at most 90 degrees).
        sin_radius: f64,
    },
}

/// Each round reads the slopes in the window of the round before; the fourth changes next to nothing.
const ROUNDS: usize = 3;

/// A round that leaves more than this part of the window's area is the last.
const CONTRACTED: f64 = 0.8;

/// Rectangles are grown by this part of the window's size and of the distance from the shading point, against the
/// rounding of the interval arithmetic.
const ROUNDING_MARGINS: [f64; 2] = [1e-9, 1e-13];

/// Bounds, in the plane of the undisplaced near face, on where the line from a shading point along the first segment of
/// any owned path to a source crosses that plane.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    origin: DVec3,
    outline: SeenOutline<'a>,
    rect: Rect,
    deflection: DeflectionBounds<'a>,
    spread: DVec2,
    margin: f64,
}

impl<'a> Window<'a> {
    /// The window of the point `origin` and a source, all in the pane's frame; `None` when no owned path exists.
    pub fn new(side: &PaneSide<'a>, origin: DVec3, source: &SourceBounds) -> Option<Self> {
        let (ends, outline) = ends(side, origin, source)?;
        let mut rect = outline.narrowed(outline.rect());
        let mut last = None;
        for round in 0..ROUNDS {
            Looks::count(|looks| looks.windows += 1);
            // Most points see no light through most panes: the first round, which finds that, reads no pyramid.
            let detail = if round == 0 { Detail::WholeFace } else { Detail::Region };
            let (deflection, part) = DeflectionBounds::new(side, &ends, &rect, detail)?;
            let [of_size, of_distance] = ROUNDING_MARGINS;
            let margin = (part.rect.max - part.rect.min).max_element() * of_size
                + ends.near * of_distance * deflection.tangent_rounding();
            // Behind flat glass the window is a point, which the next round would lose by rounding.
            let grown = outline.narrowed(&part.rect.grown(margin));
            if grown.is_empty() {
                return None;
            }
            let settled = grown.area() > CONTRACTED * rect.area();
            rect = grown;
            last = Some((deflection, part.spread, margin));
            if settled {
                break;
            }
        }
        let (deflection, spread, margin) = last?;
        Some(Self { origin, outline, rect, deflection, spread, margin })
    }

    /// The whole window.
    pub fn rect(&self) -> &Rect {
        &self.rect
    }

    /// The shading point, in the pane's frame.
    pub(super) fn origin(&self) -> DVec3 {
        self.origin
    }

    /// How far an end point may be off because the slopes vary over the window: [`Part::spread`], or more.
    pub(super) fn spread(&self) -> DVec2 {
        self.spread
    }

    /// What of a part of the window can matter; `None` when nothing can.
    #[inline(always)]
    pub(super) fn part(&self, part: &Rect) -> Option<Part> {
        let Part { rect, spread } = self.deflection.part(part)?;
        let rect = self.outline.narrowed(&rect.grown(self.margin).intersection(part));
        (!rect.is_empty()).then_some(Part { rect, spread })
    }

    /// What of the near plane the lead does not cover, whatever the height of the relief.
    pub(super) fn outline(&self) -> &SeenOutline<'a> {
        &self.outline
    }

    /// As [`Self::part`], for four parts with the shapes of both faces there; and for which of them anything can.
    #[inline(always)]
    pub(super) fn shaped_parts<S: Instructions>(
        &self,
        parts: LaneRects<S>,
        shapes: &[ShapeBounds<S>; 2],
    ) -> (LaneRects<S>, Mask<S>) {
        let left = self.deflection.shaped_parts(parts, shapes);
        (parts.intersection(left.grown(self.margin)), left.is_empty().not())
    }

    /// Where light from the window goes through the near face.
    pub fn entry(&self) -> Rect {
        self.deflection.entry(&self.rect)
    }

    /// The pane from the side of the shading point.
    pub fn side(&self) -> &PaneSide<'a> {
        self.deflection.side()
    }

    /// Where the line from the shading point to `vertex` crosses the near plane.
    #[inline(always)]
    pub(super) fn place_of(&self, vertex: DVec3) -> DVec2 {
        let offset = vertex - self.origin;
        self.origin.truncate() + offset.truncate() * ((self.side().near_base() - self.origin.z) / offset.z)
    }

    /// The map from the window to the source.
    #[inline(always)]
    pub(super) fn deflection(&self) -> &DeflectionBounds<'a> {
        &self.deflection
    }
}

/// A near face, as a shading point sees it.
pub(super) struct SeenFace<'a> {
    /// What it covers of the plane of the undisplaced face, whatever the height of the relief.
    pub(super) outline: SeenOutline<'a>,
    /// Height of that plane above the shading point, towards the light.
    pub(super) near: f64,
    /// Heights of the face above that plane.
    heights: Interval,
}

/// The near face as the point `origin` of the pane's frame sees it; `None` where it is not in front.
pub(super) fn seen_face<'a>(side: &PaneSide<'a>, origin: DVec3) -> Option<SeenFace<'a>> {
    let sign = side.sign;
    let near = side.near_base() * sign - origin.z * sign;
    let heights = mirrored(side.pane.bounds(side.near), sign).height;
    if !(near + heights.min > 0.0 && near > 0.0) {
        return None;
    }
    // A point of the face at the height h is seen, from O, in the plane of the face at O + (X - O) near/(near + h).
    let scale = Interval::new(near / (near + heights.max), near / (near + heights.min));
    let outline = SeenOutline::new(&side.pane.outline, origin.truncate(), scale);
    Some(SeenFace { outline, near, heights })
}

/// The ends of the path as seen from the pane, and everything between the shading point's view of the outline and the
/// plane of the near face.
fn ends<'a>(side: &PaneSide<'a>, origin: DVec3, source: &SourceBounds) -> Option<(Ends, SeenOutline<'a>)> {
    let sign = side.sign;
    let SeenFace { outline, near, heights } = seen_face(side, origin)?;
    let source = match *source {
        SourceBounds::Ball { centre, radius } => {
            let offset = centre - origin;
            if offset.z * sign + radius <= near + heights.min {
                return None;
            }
            let around = |middle: f64| Interval::new(middle - radius, middle + radius);
            MirroredSource::Offset([around(offset.x), around(offset.y), around(offset.z * sign)])
        }
        SourceBounds::Cap { direction, sin_radius } => {
            let [x, y, z] = cap_bounds(direction, sin_radius);
            let towards_light = if sign > 0.0 { z.max } else { -z.min };
            if towards_light < GRAZING_COSINE {
                return None;
            }
            MirroredSource::Direction([x, y])
        }
    };
    Some((Ends { origin: origin.truncate(), near, source }, outline))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Ray, testing::Glass},
        specular::{
            coverage,
            testing::{between, pair, pane, random},
        },
    };
    use clerestory_film::counters::Counters;

    /// Traces random rays through panes; whatever light they come from, the window must hold them.
    #[track_caller]
    fn check(glass: Glass, amplitude: f64) -> f64 {
        let pane = pane(glass, amplitude);
        let mut random = random(1);
        let mut counters = Counters::default();
        let (mut traced, mut area) = (0, 0.0);
        for case in 0..4000 {
            let distance = between(&mut random, 0.01, 1.0).powi(2) * 8.0;
            let sign = if case % 2 == 0 { 1.0 } else { -1.0 };
            let lateral = (pair(&mut random) - 0.5) * between(&mut random, 0.1, 6.0) * distance.max(0.2);
            let origin = lateral.extend(if sign > 0.0 { -distance } else { 0.003 + distance });
            let Some(side) = PaneSide::facing(&pane, origin) else { continue };
            let target = ((pair(&mut random) - 0.5) * pane.size()).extend(side.near_base());
            let direction = (target - origin).normalize();
            let Some(through) = side.transmit(&Ray::new(origin, direction), &mut counters) else { continue };
            if !coverage::steep(&side, [direction, through.inner_direction, through.direction]) {
                continue;
            }
            traced += 1;
            let light = through.exit + through.direction * between(&mut random, 0.005, 7.0).powi(2);
            let offset = DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) - 0.5;
            let tilted = (through.direction + offset * 0.1).normalize();
            for source in [
                SourceBounds::Cap { direction: through.direction, sin_radius: 0.0 },
                SourceBounds::Cap {
                    direction: tilted,
                    sin_radius: tilted.cross(through.direction).length() * (1.0 + 1e-12),
                },
                SourceBounds::Ball { centre: light, radius: 0.0 },
                SourceBounds::Ball { centre: light + offset, radius: offset.length() * (1.0 + 1e-12) },
            ] {
                let window = Window::new(&side, origin, &source)
                    .unwrap_or_else(|| panic!("case {case}: no window for {source:?} from {origin}"));
                let place = target.truncate();
                let mut part = *window.rect();
                for depth in 0..20 {
                    assert!(
                        part.contains(place),
                        "case {case}, depth {depth}: {place} outside {part:?} for {source:?} from {origin}"
                    );
                    let kept = window.part(&part);
                    let Part { rect, .. } =
                        kept.unwrap_or_else(|| panic!("case {case}, depth {depth}: nothing left of {part:?}"));
                    let [low, high] = rect.halves();
                    part = if low.contains(place) { low } else { high };
                }
                if matches!(source, SourceBounds::Ball { radius: 0.0, .. }) && direction.z.abs() > 0.5 {
                    area += window.rect().area() / pane.outline.area();
                }
            }
        }
        assert!(traced > 1000, "only {traced} rays came through");
        area / f64::from(traced)
    }

    #[test]
    fn the_window_holds_every_path_through_gentle_glass_and_is_small() {
        assert!(check(Glass::Crown, 0.05e-3) < 0.2);
        assert!(check(Glass::Bumpy, 0.02e-3) < 0.2);
    }

    #[test]
    fn the_window_holds_every_path_through_rough_glass() {
        check(Glass::Crown, 0.6e-3);
        check(Glass::Bumpy, 0.6e-3);
        check(Glass::Steep, 0.8e-3);
    }

    #[test]
    fn a_flat_pane_has_one_point_for_a_point_light() {
        let pane = pane(Glass::Flat, 0.0);
        let origin = DVec3::new(0.02, 0.03, -1.0);
        let side = PaneSide::facing(&pane, origin).unwrap();
        let source = SourceBounds::Ball { centre: DVec3::new(-0.1, 0.1, 2.0), radius: 0.0 };
        let window = Window::new(&side, origin, &source).unwrap();
        assert!((window.rect().max - window.rect().min).max_element() < 1e-6);
    }

    #[test]
    fn a_flat_pane_loses_no_path_to_a_source_without_extent() {
        let pane = pane(Glass::Flat, 0.0);
        let mut random = random(4);
        for case in 0..20_000 {
            let near = between(&mut random, 0.01, 10.0);
            let origin = (pair(&mut random) * 4.0 - 2.0).extend(-near);
            let through = ((pair(&mut random) - 0.5) * pane.size() * 0.99).extend(0.0);
            let direction = (through - origin).normalize();
            let side = PaneSide::facing(&pane, origin).unwrap();
            let Some(path) = side.transmit(&Ray::new(origin, direction), &mut Counters::default()) else { continue };
            if !coverage::steep(&side, [direction, path.inner_direction, path.direction]) {
                continue;
            }
            let light = path.exit + direction * between(&mut random, 0.01, 1000.0);
            for source in
                [SourceBounds::Cap { direction, sin_radius: 0.0 }, SourceBounds::Ball { centre: light, radius: 0.0 }]
            {
                let window = Window::new(&side, origin, &source)
                    .unwrap_or_else(|| panic!("case {case}: no window for {source:?} from {origin}"));
                let rect = window.rect();
                assert!(rect.contains(through.truncate()), "case {case}: {through} outside {rect:?} from {origin}");
            }
        }
    }

    #[test]
    fn no_window_where_the_light_is_hidden_by_the_frame() {
        let pane = pane(Glass::Crown, 0.05e-3);
        let origin = DVec3::new(0.0, 0.0, -1.0);
        let side = PaneSide::facing(&pane, origin).unwrap();
        let beside = SourceBounds::Ball { centre: DVec3::new(2.0, 0.0, 1.0), radius: 0.0 };
        assert!(Window::new(&side, origin, &beside).is_none());
        let behind = SourceBounds::Ball { centre: DVec3::new(0.0, 0.0, -2.0), radius: 0.1 };
        assert!(Window::new(&side, origin, &behind).is_none());
        let setting = SourceBounds::Cap { direction: DVec3::new(0.6, 0.0, -0.8), sin_radius: 0.01 };
        assert!(Window::new(&side, origin, &setting).is_none());
    }
}
