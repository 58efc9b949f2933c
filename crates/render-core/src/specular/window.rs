//! The deflection window: where, on a pane, light can come through from a light to a shading point.
//!
//! Along a path O, X1, X2, S through two faces, Snell's law adds to the tangential direction only multiples of the two
//! slopes. With a the unit direction at O, w the unit direction at S, n the relative index and m the face's unnormalised
//! normal,
//!
//! ```text
//! w_t - a_t = -g1 grad h1 + g2 grad h2,    g = (sqrt(n^2 - 1 + c^2) - c) / |m|,    c = cosine in air at that face
//! ```
//!
//! so bounds on the slopes bound the deflection, and bounds on the deflection bound where the path can cross the pane.
//! Interval arithmetic turns this into a rectangle that holds every path, and the rectangle into better bounds on the
//! slopes: a few rounds contract it to the neighbourhood that matters. The rectangle is a true bound (no path that
//! [`super::coverage`] owns lies outside), which makes sampling inside it unbiased.

use glam::{DVec2, DVec3};

use super::side::{GRAZING_COSINE, PaneSide};
use crate::geometry::{HeightField, Interval, Rect};

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

/// Grown by this part of its size against the rounding of the interval arithmetic.
const ROUNDING_MARGIN: f64 = 1e-9;

/// Bounds, in the plane of the undisplaced near face, on where the line from `origin` along the first segment of any
/// owned path crosses that plane. `None` when no owned path exists.
pub fn deflection_window(side: &PaneSide<'_>, origin: DVec3, source: &SourceBounds) -> Option<Rect> {
    let geometry = SideGeometry::new(side, origin)?;
    let mut window = geometry.outline_seen;
    for round in 0..ROUNDS {
        // Most points see no light through most panes: the first round, which finds that, reads no pyramid.
        let detail = if round == 0 { Detail::WholeFace } else { Detail::Region };
        window = window.intersection(&geometry.contract(&window, source, detail)?);
        if window.is_empty() {
            return None;
        }
    }
    let margin = (window.max - window.min).max_element() * ROUNDING_MARGIN;
    Some(window.grown(margin))
}

/// The pane mirrored, if need be, so that light travels towards +z.
struct SideGeometry<'a> {
    side: PaneSide<'a>,
    /// The shading point, mirrored.
    origin: DVec3,
    /// Height of the undisplaced near face above the shading point.
    near: f64,
    /// Everything between the shading point's view of the outline and the plane of the near face.
    outline_seen: Rect,
}

/// For what part of a face bounds are read.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Detail {
    WholeFace,
    Region,
}

/// Heights and slopes of a face, mirrored if need be.
struct FaceBounds {
    heights: Interval,
    slopes: Box2,
}

impl FaceBounds {
    fn new(surface: &HeightField, region: &Rect, detail: Detail, sign: f64) -> Self {
        let (heights, slopes) = match detail {
            Detail::WholeFace => (surface.all_heights(), surface.all_slopes()),
            Detail::Region => (surface.height_bounds(region), surface.slope_bounds(region)),
        };
        Self { heights: mirrored(heights, sign), slopes: slopes.map(|slope| mirrored(slope, sign)) }
    }
}

/// Two intervals: a box of tangential vectors.
type Box2 = [Interval; 2];

impl<'a> SideGeometry<'a> {
    fn new(side: &PaneSide<'a>, origin: DVec3) -> Option<Self> {
        let origin = DVec3::new(origin.x, origin.y, origin.z * side.sign);
        let near = side.near_base() * side.sign - origin.z;
        let outline = side.pane.outline();
        let heights = mirrored(side.near_surface().all_heights(), side.sign);
        // A point of the face at the height h is seen, from O, in the plane of the face at O + (X - O) near/(near + h).
        let scale = Interval::new(near / (near + heights.max), near / (near + heights.min));
        let seen = |min: f64, max: f64, centre: f64| {
            scale * Interval::new(min - centre, max - centre) + Interval::point(centre)
        };
        let x = seen(outline.min.x, outline.max.x, origin.x);
        let y = seen(outline.min.y, outline.max.y, origin.y);
        if !(near + heights.min > 0.0 && near > 0.0) {
            return None;
        }
        Some(Self {
            side: *side,
            origin,
            near,
            outline_seen: Rect::new(DVec2::new(x.min, y.min), DVec2::new(x.max, y.max)),
        })
    }

    /// A window that holds every owned path that crosses the near plane inside `window`.
    fn contract(&self, window: &Rect, source: &SourceBounds, detail: Detail) -> Option<Rect> {
        let pane = self.side.pane;
        let sign = self.side.sign;
        let index = pane.index_of_refraction;
        let tangents: Box2 = [
            Interval::new(window.min.x - self.origin.x, window.max.x - self.origin.x),
            Interval::new(window.min.y - self.origin.y, window.max.y - self.origin.y),
        ]
        .map(|offset| Interval::new(offset.min / self.near, offset.max / self.near));
        let directions = directions_of_tangents(&tangents);

        let (near_surface, far_surface) = (self.side.near_surface(), self.side.far_surface());
        let entry = shifted(window, &tangents, mirrored(near_surface.all_heights(), sign));
        let entry = entry.intersection(&pane.outline());
        if entry.is_empty() {
            return None;
        }
        let FaceBounds { heights: near_heights, slopes: near_slopes } =
            FaceBounds::new(near_surface, &entry, detail, sign);
        let near_strength = refraction_strength(index, &directions, &near_slopes);
        // n b_t = a_t - g1 grad h1
        let inner: Box2 = std::array::from_fn(|axis| {
            let momentum = directions[axis] - near_strength * near_slopes[axis];
            Interval::new(momentum.min / index, momentum.max / index)
        });
        let inner_tangents = tangents_of_directions(&inner, GRAZING_COSINE);

        let gap = self.gap(near_heights, mirrored(far_surface.all_heights(), sign));
        let exit = shifted(&entry, &inner_tangents, gap).intersection(&pane.outline());
        if exit.is_empty() {
            return None;
        }
        let FaceBounds { heights: far_heights, slopes: far_slopes } = FaceBounds::new(far_surface, &exit, detail, sign);
        // The far face's cosine in air is that of w, which the deflection itself bounds: the widest strength is safe.
        let widest = refraction_strength_widest(index);
        let loose: Box2 = std::array::from_fn(|axis| {
            directions[axis] - near_strength * near_slopes[axis] + widest * far_slopes[axis]
        });
        let far_strength = refraction_strength(index, &clamped(&loose), &far_slopes);
        let deflection: Box2 =
            std::array::from_fn(|axis| far_strength * far_slopes[axis] - near_strength * near_slopes[axis]);

        let tangents = match *source {
            SourceBounds::Cap { direction, sin_radius } => {
                let cap = cap_bounds(DVec3::new(direction.x, direction.y, direction.z * sign), sin_radius);
                let first: Box2 =
                    std::array::from_fn(|axis| (cap[axis] - deflection[axis]).intersection(directions[axis]));
                if first.iter().any(Interval::is_empty) {
                    return None;
                }
                tangents_of_directions(&first, GRAZING_COSINE)
            }
            SourceBounds::Ball { centre, radius } => {
                let gap = self.gap(near_heights, far_heights);
                let exit_height = Interval::point(self.near) + near_heights + gap;
                let rise = centre.z * sign - self.origin.z;
                // Height of the source above the exit, along the way of the light.
                let above = (Interval::new(rise - radius, rise + radius) - exit_height)
                    .intersection(Interval::new(0.0, f64::INFINITY));
                if above.is_empty() {
                    return None;
                }
                // q - p for the tangents p at O and q at S, by the mean value theorem on t -> t / sqrt(1 - t^2).
                let last: Box2 = std::array::from_fn(|axis| directions[axis] + deflection[axis]);
                let hull = clamped(&std::array::from_fn(|axis| directions[axis].union(last[axis])));
                let bend = tangent_difference(&hull, &deflection);
                // S_t - O_t = near' p + gap r + above q = (near' + above) p + gap r + above (q - p)
                let path = Interval::point(self.near) + near_heights + above;
                std::array::from_fn(|axis| {
                    let offset = [centre.x - self.origin.x, centre.y - self.origin.y][axis];
                    let numerator = Interval::new(offset - radius, offset + radius)
                        - gap * inner_tangents[axis]
                        - above * bend[axis];
                    quotient(numerator, path).intersection(tangents[axis])
                })
            }
        };
        if tangents.iter().any(Interval::is_empty) {
            return None;
        }
        let cross = |axis: usize, centre: f64| {
            Interval::new(centre + self.near * tangents[axis].min, centre + self.near * tangents[axis].max)
        };
        let (x, y) = (cross(0, self.origin.x), cross(1, self.origin.y));
        Some(Rect::new(DVec2::new(x.min, y.min), DVec2::new(x.max, y.max)))
    }

    /// Bounds on the thickness of the glass along z.
    fn gap(&self, near_heights: Interval, far_heights: Interval) -> Interval {
        let gap = Interval::point(self.side.pane.thickness) + far_heights - near_heights;
        Interval::new(gap.min.max(0.0), gap.max)
    }
}

/// An interval of z values or slopes as seen when z is mirrored for a negative sign.
fn mirrored(interval: Interval, sign: f64) -> Interval {
    if sign > 0.0 { interval } else { -interval }
}

/// `rect` moved along the tangents by any of the given rises.
fn shifted(rect: &Rect, tangents: &Box2, rise: Interval) -> Rect {
    let x = Interval::new(rect.min.x, rect.max.x) + rise * tangents[0];
    let y = Interval::new(rect.min.y, rect.max.y) + rise * tangents[1];
    Rect::new(DVec2::new(x.min, y.min), DVec2::new(x.max, y.max))
}

/// `t / sqrt(1 + |t|^2)` over a box, in each component.
fn directions_of_tangents(tangents: &Box2) -> Box2 {
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

/// `t / sqrt(1 - |t|^2)` over a box, in each component, for directions whose z is at least `cos_min`.
fn tangents_of_directions(directions: &Box2, cos_min: f64) -> Box2 {
    std::array::from_fn(|axis| {
        let other = squared(directions[1 - axis]);
        let value =
            |own: f64, other_squared: f64| own / (1.0 - own * own - other_squared).max(cos_min * cos_min).sqrt();
        let [own_min, own_max] = [directions[axis].min, directions[axis].max];
        Interval::new(
            value(own_min, if own_min < 0.0 { other.max } else { other.min }),
            value(own_max, if own_max > 0.0 { other.max } else { other.min }),
        )
    })
}

/// Bounds on `Q(t + d) - Q(t)` for `Q(t) = t / sqrt(1 - |t|^2)`, with t and t + d in `hull` and d in `difference`.
fn tangent_difference(hull: &Box2, difference: &Box2) -> Box2 {
    let squares = hull.map(squared);
    let cos_squared = Interval::new(
        (1.0 - squares[0].max - squares[1].max).max(GRAZING_COSINE * GRAZING_COSINE),
        (1.0 - squares[0].min - squares[1].min).max(GRAZING_COSINE * GRAZING_COSINE),
    );
    let inverse_cube = Interval::new(
        1.0 / (cos_squared.max * cos_squared.max.sqrt()),
        1.0 / (cos_squared.min * cos_squared.min.sqrt()),
    );
    std::array::from_fn(|axis| {
        let other = squares[1 - axis];
        let own = inverse_cube * Interval::new((1.0 - other.max).max(0.0), (1.0 - other.min).max(0.0));
        let mixed = inverse_cube * (hull[0] * hull[1]);
        own * difference[axis] + mixed * difference[1 - axis]
    })
}

fn squared(interval: Interval) -> Interval {
    let (a, b) = (interval.min * interval.min, interval.max * interval.max);
    let contains_zero = interval.min <= 0.0 && interval.max >= 0.0;
    Interval::new(if contains_zero { 0.0 } else { a.min(b) }, a.max(b))
}

/// Directions have components between -1 and 1.
fn clamped(directions: &Box2) -> Box2 {
    directions.map(|direction| Interval::new(direction.min.clamp(-1.0, 1.0), direction.max.clamp(-1.0, 1.0)))
}

/// `numerator / denominator` for a denominator that is never negative.
fn quotient(numerator: Interval, denominator: Interval) -> Interval {
    let inverse = Interval::new(1.0 / denominator.max, 1.0 / denominator.min.max(f64::MIN_POSITIVE));
    numerator * inverse
}

/// Bounds on `g = (sqrt(n^2 - 1 + c^2) - c) / |m|` where c is the cosine, in air, to a normal of the given slopes.
fn refraction_strength(index: f64, directions: &Box2, slopes: &Box2) -> Interval {
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
fn refraction_strength_widest(index: f64) -> Interval {
    Interval::new(0.0, (index * index - 1.0).sqrt())
}

/// Bounds on the x and y components of the directions of a cap.
fn cap_bounds(axis: DVec3, sin_radius: f64) -> Box2 {
    let cos_radius = (1.0 - sin_radius * sin_radius).max(0.0).sqrt();
    [axis.x, axis.y].map(|component| {
        // cos(phi -+ r) for the angle phi between the axis and the coordinate axis.
        let sine = (1.0 - component * component).max(0.0).sqrt();
        let max = if component >= cos_radius { 1.0 } else { component * cos_radius + sine * sin_radius };
        let min = if component <= -cos_radius { -1.0 } else { component * cos_radius - sine * sin_radius };
        Interval::new(min, max)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        counters::Counters,
        geometry::{Ray, testing::Glass},
        specular::{
            coverage,
            testing::{between, pair, pane, random},
        },
    };

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
            let target = ((pair(&mut random) - 0.5) * pane.size).extend(side.near_base());
            let direction = (target - origin).normalize();
            let Some(through) = side.transmit(&Ray::new(origin, direction), &mut counters) else { continue };
            if !coverage::owns(&side, [direction, through.inner_direction, through.direction]) {
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
                let window = deflection_window(&side, origin, &source)
                    .unwrap_or_else(|| panic!("case {case}: no window for {source:?} from {origin}"));
                assert!(
                    window.contains(target.truncate()),
                    "case {case}: {target} outside {window:?} for {source:?} from {origin}"
                );
                if matches!(source, SourceBounds::Ball { radius: 0.0, .. }) && direction.z.abs() > 0.5 {
                    area += window.area() / pane.outline().area();
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
        let window = deflection_window(&side, origin, &source).unwrap();
        assert!((window.max - window.min).max_element() < 1e-6);
    }

    #[test]
    fn no_window_where_the_light_is_hidden_by_the_frame() {
        let pane = pane(Glass::Crown, 0.05e-3);
        let origin = DVec3::new(0.0, 0.0, -1.0);
        let side = PaneSide::facing(&pane, origin).unwrap();
        let beside = SourceBounds::Ball { centre: DVec3::new(2.0, 0.0, 1.0), radius: 0.0 };
        assert_eq!(deflection_window(&side, origin, &beside), None);
        let behind = SourceBounds::Ball { centre: DVec3::new(0.0, 0.0, -2.0), radius: 0.1 };
        assert_eq!(deflection_window(&side, origin, &behind), None);
    }
}
