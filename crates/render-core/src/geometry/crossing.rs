//! The first crossing of a ray with a height field.
//!
//! Along the ray, `g(t)` is the height above the surface, counted positive on the side on which the ray starts. The
//! caller knows that side, because it knows whether the ray is in the glass. So no distance decides anything. A ray
//! that starts on the surface needs no epsilon: its root at 0 is divided out.
//!
//! A stretch of the ray is settled by, in this order:
//! 1. bounds of the height over its footprint: the part of it outside these bounds is cut off;
//! 2. bounds of the slope over its footprint. They may prove that `g` rises (no crossing) or falls all the way (at most
//!    one, found by Halley's method in a bracket);
//! 3. within one cell, `g` is a polynomial of degree 6, whose Bernstein form yields its first change of sign;
//! 4. otherwise it is cut at the border of a cell nearest to its middle, and the front part goes first.
//!
//! Almost all rays end at 2 with the bounds over the whole surface.

use glam::{DVec2, DVec3, dvec2};

use super::{HeightField, JetBounds, Ray, SurfaceJet};
use crate::math::bernstein::first_descent;
use crate::math::{Interval, Rect};
use clerestory_film::counters::Counters;

/// A border of cells this close to the end of a stretch, in cells, is no reason to cut it. The polynomial of a cell
/// continued over so little differs from the surface by 1e-18 of its third differences, which is below rounding; and a
/// stretch that starts on the surface does not end where `g` is still only noise.
const BORDER_TOLERANCE: f64 = 1e-6;

/// Halley's method ends with a step of at most this many cells, over which the surface is its Taylor polynomial of
/// second order: to 1e-17 of its third differences in height, to 1e-11 in slope.
const STEP_TOLERANCE: f64 = 3e-6;

/// Most steps of Halley's method; bisection follows.
const MOST_HALLEY_STEPS: usize = 24;

/// A side of a height field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// Where z is larger than the surface's.
    Above,
    /// Where z is smaller than the surface's.
    Below,
}

/// Where the ray starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// Off the surface, or on it by chance.
    Free,
    /// On the surface by construction, leaving it to the given side.
    OnSurface,
}

/// Where a ray goes through a height field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crossing {
    /// Distance along the ray.
    pub(crate) distance: f64,
    /// The point, on the surface to the last digits.
    pub(crate) point: DVec3,
    /// Gradient of the height there.
    pub(crate) gradient: DVec2,
}

impl HeightField {
    /// The first point within `range` at which `ray`, on the given side of the surface `z = base + h(x, y)` to begin
    /// with, changes to the other side. With [`Start::OnSurface`] the range must start at 0. `bounds` hold wherever the
    /// ray is within the range.
    #[expect(clippy::too_many_arguments, reason = "the ray, the surface, and what is known of both")]
    pub(crate) fn first_crossing(
        &self,
        bounds: &JetBounds,
        base: f64,
        ray: &Ray,
        range: Interval,
        side: Side,
        start: Start,
        counters: &mut Counters,
    ) -> Option<Crossing> {
        if range.is_empty() {
            return None;
        }
        let sign = match side {
            Side::Above => 1.0,
            Side::Below => -1.0,
        };
        let origin = ray.origin - DVec3::new(0.0, 0.0, base);
        let mut path = Path { field: self, origin, direction: ray.direction, sign };
        let trend = path.trend(bounds.gradient);
        let on_surface = start == Start::OnSurface;
        if on_surface && matches!(trend, Trend::Away) {
            return None;
        }
        let whole = Stretch { from: range.min, to: range.max, on_surface, crossed: false };
        let stretch = path.clipped(&whole, bounds.height)?;
        // Measured from where it may first meet the surface, the ray keeps all its digits for the short way that is
        // left.
        let shift = stretch.from;
        path.origin += path.direction * shift;
        let stretch = Stretch { from: 0.0, to: stretch.to - shift, ..stretch };
        let found = match trend {
            Trend::Away => None,
            Trend::Towards => path.only_crossing(&stretch, counters),
            Trend::Unknown => {
                if on_surface {
                    counters.height_evaluations += 1;
                    path.origin.z = self.height(path.origin.truncate());
                }
                path.search(stretch, counters)
            }
        }?;
        Some(Crossing { distance: found.distance + shift, point: found.point + DVec3::new(0.0, 0.0, base), ..found })
    }
}

/// A stretch of the ray that has no crossing before it.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    from: f64,
    to: f64,
    /// It begins on the surface, which is no crossing.
    on_surface: bool,
    /// Its end is known to lie on the other side.
    crossed: bool,
}

/// What is known of the way in which `g` changes over a stretch.
enum Trend {
    Away,
    Towards,
    Unknown,
}

/// The ray over a surface of base 0.
struct Path<'a> {
    field: &'a HeightField,
    origin: DVec3,
    direction: DVec3,
    /// 1 when the ray starts above the surface, -1 when below.
    sign: f64,
}

impl Path<'_> {
    fn at(&self, t: f64) -> DVec2 {
        self.origin.truncate() + self.direction.truncate() * t
    }

    fn z(&self, t: f64) -> f64 {
        self.origin.z + self.direction.z * t
    }

    fn search(&self, mut stretch: Stretch, counters: &mut Counters) -> Option<Crossing> {
        loop {
            let (p, q) = (self.at(stretch.from), self.at(stretch.to));
            let footprint = Rect::new(p.min(q), p.max(q));
            let length = stretch.to - stretch.from;
            let bounds = self.field.bounds(&footprint);
            stretch = self.clipped(&stretch, bounds.height)?;
            match self.trend(bounds.gradient) {
                Trend::Away => return None,
                Trend::Towards => return self.only_crossing(&stretch, counters),
                Trend::Unknown => {}
            }
            let Some(border) = self.border_near_middle(&stretch) else {
                return self.crossing_in_cell(&stretch, counters);
            };
            if stretch.to - stretch.from > 0.5 * length {
                let front = Stretch { to: border, crossed: false, ..stretch };
                let rear = Stretch { from: border, on_surface: false, ..stretch };
                return self.search(front, counters).or_else(|| self.search(rear, counters));
            }
        }
    }

    /// The part of a stretch in which the ray's z lies within the surface's; `None` if there is none.
    fn clipped(&self, stretch: &Stretch, heights: Interval) -> Option<Stretch> {
        let (z0, z1) = (self.z(stretch.from), self.z(stretch.to));
        let slack = 4.0 * f64::EPSILON * (self.origin.z.abs() + heights.magnitude());
        let (low, high) = (heights.min - slack, heights.max + slack);
        if z0.max(z1) < low || z0.min(z1) > high {
            return None;
        }
        if self.direction.z == 0.0 {
            return Some(*stretch);
        }
        let (a, b) = ((low - self.origin.z) / self.direction.z, (high - self.origin.z) / self.direction.z);
        let (enter, leave) = (a.min(b), a.max(b));
        let mut clipped = *stretch;
        if !stretch.on_surface {
            clipped.from = clipped.from.max(enter);
        }
        if leave < clipped.to {
            clipped.to = leave;
            clipped.crossed = self.sign * self.direction.z < 0.0;
        }
        (clipped.from <= clipped.to).then_some(clipped)
    }

    /// How `g` changes where the surface has the given slopes.
    fn trend(&self, slopes: [Interval; 2]) -> Trend {
        let d = self.direction;
        let term = |slope: Interval, d: f64| {
            let (a, b) = (slope.min * d, slope.max * d);
            (a.min(b), a.max(b))
        };
        let (x, y) = (term(slopes[0], d.x), term(slopes[1], d.y));
        let (low, high) = (d.z - (x.1 + y.1), d.z - (x.0 + y.0));
        let slack = 4.0 * f64::EPSILON * (1.0 + x.0.abs() + x.1.abs() + y.0.abs() + y.1.abs());
        let (rises, falls) = (low > slack, high < -slack);
        let (away, towards) = if self.sign > 0.0 { (rises, falls) } else { (falls, rises) };
        match (away, towards) {
            (true, _) => Trend::Away,
            (_, true) => Trend::Towards,
            _ => Trend::Unknown,
        }
    }

    /// The crossing of a stretch on which `g` falls.
    fn only_crossing(&self, stretch: &Stretch, counters: &mut Counters) -> Option<Crossing> {
        if stretch.on_surface {
            // The ray claims to leave to the side that it heads away from: it crosses where it stands.
            return Some(self.crossing_at(0.0, counters));
        }
        if !stretch.crossed {
            counters.height_evaluations += 1;
            if self.sign * (self.z(stretch.to) - self.field.height(self.at(stretch.to))) >= 0.0 {
                return None;
            }
        }
        let d = self.direction.truncate();
        let lateral = (d * self.field.density()).abs().max_element();
        let (mut low, mut high) = (stretch.from, stretch.to);
        let mut t = 0.5 * (low + high);
        for steps in 0.. {
            counters.height_evaluations += 1;
            let SurfaceJet { height, gradient, hessian: [xx, xy, yy] } = self.field.jet(self.at(t));
            let g = self.sign * (self.z(t) - height);
            if g >= 0.0 {
                low = t;
            } else {
                high = t;
            }
            let along = gradient.dot(d);
            let turn = dvec2(xx * d.x + xy * d.y, xy * d.x + yy * d.y);
            let curvature = turn.dot(d);
            let rate = self.sign * (self.direction.z - along);
            let halley = t - g * rate / (rate * rate + 0.5 * self.sign * g * curvature);
            let trusted = steps < MOST_HALLEY_STEPS && (halley == t || (halley > low && halley < high));
            let next = if trusted { halley } else { 0.5 * (low + high) };
            let step = next - t;
            let settled = if trusted { step.abs() * lateral <= STEP_TOLERANCE } else { next <= low || next >= high };
            if settled {
                let height = height + step * (along + 0.5 * step * curvature);
                return Some(Crossing {
                    distance: next,
                    point: self.at(next).extend(height),
                    gradient: gradient + turn * step,
                });
            }
            t = next;
        }
        None
    }

    fn crossing_at(&self, t: f64, counters: &mut Counters) -> Crossing {
        counters.height_evaluations += 1;
        let (height, gradient) = self.field.slope(self.at(t));
        Crossing { distance: t, point: self.at(t).extend(height), gradient }
    }

    /// Where the stretch goes over the border of a cell, as near as possible to its middle; `None` within one cell.
    fn border_near_middle(&self, stretch: &Stretch) -> Option<f64> {
        let origin = self.field.cell_coordinates(self.origin.truncate());
        let rate = self.direction.truncate() * self.field.density();
        let middle = 0.5 * (stretch.from + stretch.to);
        let on_axis = |origin: f64, rate: f64| {
            let (a, b) = (origin + rate * stretch.from, origin + rate * stretch.to);
            let border = (origin + rate * middle).round();
            let inside = border > a.min(b) + BORDER_TOLERANCE && border < a.max(b) - BORDER_TOLERANCE;
            inside.then(|| (border - origin) / rate)
        };
        match (on_axis(origin.x, rate.x), on_axis(origin.y, rate.y)) {
            (Some(x), Some(y)) => Some(if (x - middle).abs() <= (y - middle).abs() { x } else { y }),
            (x, y) => x.or(y),
        }
    }

    /// The first crossing on a stretch within one cell.
    fn crossing_in_cell(&self, stretch: &Stretch, counters: &mut Counters) -> Option<Crossing> {
        counters.height_evaluations += 1;
        let from = self.field.cell_coordinates(self.at(stretch.from));
        let to = self.field.cell_coordinates(self.at(stretch.to));
        let length = stretch.to - stretch.from;
        let s = if stretch.on_surface {
            first_descent(&self.bernstein_from_surface(from, to, length))
        } else {
            first_descent(&self.bernstein(stretch, from, to))
        }?;
        Some(self.crossing_at(stretch.from + s * length, counters))
    }

    /// Bernstein coefficients of `g` over a stretch within one cell.
    fn bernstein(&self, stretch: &Stretch, from: DVec2, to: DVec2) -> [f64; 7] {
        let heights = diagonal::<4, 4, 7>(&self.field.bernstein(from, to));
        let (z0, z1) = (self.z(stretch.from), self.z(stretch.to));
        std::array::from_fn(|k| {
            let s = k as f64 / 6.0;
            self.sign * (z0 * (1.0 - s) + z1 * s - heights[k])
        })
    }

    /// Bernstein coefficients of `g(s) / s` over a stretch within one cell that starts on the surface. They come from
    /// the derivative of `g`, so that they are exact to rounding also on the shortest stretch.
    fn bernstein_from_surface(&self, from: DVec2, to: DVec2, length: f64) -> [f64; 6] {
        let (along_x, along_y) = self.field.bernstein_slopes(from, to);
        let (x, y) = (diagonal::<3, 4, 6>(&along_x), diagonal::<4, 3, 6>(&along_y));
        let step = self.direction.truncate() * self.field.density() * length;
        let mut sum = 0.0;
        std::array::from_fn(|k| {
            sum += self.sign * (self.direction.z * length - (x[k] * step.x + y[k] * step.y));
            sum / (k + 1) as f64
        })
    }
}

/// Bernstein coefficients along the diagonal of a tensor-product patch of degree `COLUMNS - 1` by `ROWS - 1`.
fn diagonal<const COLUMNS: usize, const ROWS: usize, const N: usize>(patch: &[[f64; COLUMNS]; ROWS]) -> [f64; N] {
    debug_assert_eq!(N, COLUMNS + ROWS - 1);
    let mut sum = [0.0; N];
    for (j, row) in patch.iter().enumerate() {
        for (i, value) in row.iter().enumerate() {
            sum[i + j] += value * (binomial(COLUMNS - 1, i) * binomial(ROWS - 1, j)) / binomial(N - 1, i + j);
        }
    }
    sum
}

/// Binomial coefficients up to row 6.
fn binomial(n: usize, k: usize) -> f64 {
    (0..k).map(|i| (n - i) as f64 / (i + 1) as f64).product()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::{Glass, fixed_seed};
    use proptest::prelude::*;

    const SIZE: DVec2 = dvec2(0.5, 0.4);
    const AMPLITUDE: f64 = 0.003;
    const SAMPLES: usize = 100_000;

    fn signed_height(field: &HeightField, ray: &Ray, side: Side, t: f64) -> f64 {
        let p = ray.at(t);
        let above = p.z - field.height(p.truncate());
        if side == Side::Above { above } else { -above }
    }

    /// Compares the crossing with the signs of the height at many points of the range.
    fn check(field: &HeightField, ray: &Ray, end: f64, side: Side, start: Start) -> Result<(), TestCaseError> {
        let range = Interval::new(0.0, end);
        let found = field.first_crossing(field.all_bounds(), 0.0, ray, range, side, start, &mut Counters::default());
        // Rounding of the ray's points, which are at most 1 m away.
        let noise = 1e-15;
        let step = end / SAMPLES as f64;
        let until = found.map_or(end, |crossing| crossing.distance);
        for i in 1..SAMPLES {
            let t = i as f64 * step;
            if t >= until {
                break;
            }
            let height = signed_height(field, ray, side, t);
            prop_assert!(height > -noise, "missed a crossing before {} of {:?}: {:?}", t, ray, found);
        }
        if let Some(crossing) = found {
            prop_assert!((0.0..=end * (1.0 + 1e-15)).contains(&crossing.distance));
            prop_assert!((crossing.point - ray.at(crossing.distance)).length() < noise, "{:?} of {:?}", crossing, ray);
            let (height, gradient) = field.slope(crossing.point.truncate());
            prop_assert!((crossing.point.z - height).abs() < noise);
            prop_assert!((crossing.gradient - gradient).length() < 1e-9);
            let beyond = (1..=1000).map(|i| crossing.distance + step * f64::from(i) / 1000.0);
            let lowest = beyond.map(|t| signed_height(field, ray, side, t)).fold(f64::INFINITY, f64::min);
            prop_assert!(lowest < noise, "false crossing {:?} of {:?}: {}", crossing, ray, lowest);
        }
        Ok(())
    }

    fn glass() -> impl Strategy<Value = HeightField> {
        (prop::sample::select(Glass::ALL.to_vec()), 0.0..1.0f64)
            .prop_map(|(glass, variant)| glass.face(SIZE, AMPLITUDE, variant))
    }

    /// Unit vectors at all angles to the plane, down to 1e-4 rad, some of them along an axis.
    fn direction() -> impl Strategy<Value = DVec3> {
        let diagonal = (0..8).prop_map(|i| f64::from(i) * 0.25 * std::f64::consts::PI);
        let azimuth = prop_oneof![4 => 0.0..std::f64::consts::TAU, 1 => diagonal];
        let elevation = prop_oneof![4 => (-4.0..0.2f64).prop_map(|e| libm::pow(10.0, e)), 1 => Just(0.0)];
        (azimuth, elevation, prop::bool::ANY).prop_map(|(azimuth, elevation, up)| {
            let elevation = if up { elevation } else { -elevation };
            let across = libm::cos(elevation);
            DVec3::new(across * libm::cos(azimuth), across * libm::sin(azimuth), libm::sin(elevation)).normalize()
        })
    }

    /// Points over the outline: anywhere, on a border of cells, on the border of the outline, in a corner.
    fn place() -> impl Strategy<Value = DVec2> {
        let coordinate = || {
            prop_oneof![
                6 => -0.5..0.5f64,
                1 => (0..48).prop_map(|i| (f64::from(i) + 0.5) / 48.0 - 0.5),
                1 => Just(-0.5),
                1 => Just(0.5),
            ]
        };
        (coordinate(), coordinate()).prop_map(|(x, y)| dvec2(x, y) * SIZE)
    }

    proptest! {
        #![proptest_config(fixed_seed(300))]

        #[test]
        fn crossings_of_rays_near_the_surface_are_those_of_dense_sampling(
            field in glass(), place in place(), direction in direction(), height in -1.2..1.2f64,
        ) {
            let ray = Ray::new(place.extend(AMPLITUDE * height), direction);
            let side = if ray.origin.z > field.height(place) { Side::Above } else { Side::Below };
            check(&field, &ray, 0.5, side, Start::Free)?;
        }

        #[test]
        fn crossings_of_rays_from_afar_are_those_of_dense_sampling(
            field in glass(), place in place(), direction in direction(),
        ) {
            prop_assume!(direction.z.abs() > 1e-3);
            let distance = 0.5;
            let ray = Ray::new(place.extend(0.0) - direction * distance, direction);
            let side = if direction.z < 0.0 { Side::Above } else { Side::Below };
            prop_assume!(signed_height(&field, &ray, side, 0.0) > 0.0);
            check(&field, &ray, 1.0, side, Start::Free)?;
        }

        #[test]
        fn a_ray_that_leaves_the_surface_meets_it_again_where_dense_sampling_says(
            field in glass(), place in place(), azimuth in 0.0..std::f64::consts::TAU, grazing in -4.0..0.0f64,
            above in prop::bool::ANY,
        ) {
            let (height, gradient) = field.slope(place);
            let along = DVec3::new(libm::cos(azimuth), libm::sin(azimuth), 0.0);
            let tangent = along + DVec3::new(0.0, 0.0, gradient.dot(along.truncate()));
            let normal = DVec3::new(-gradient.x, -gradient.y, 1.0).normalize();
            let outwards = if above { normal } else { -normal };
            let direction = (tangent.normalize() + outwards * libm::pow(10.0, grazing)).normalize();
            let ray = Ray::new(place.extend(height), direction);
            check(&field, &ray, 0.5, if above { Side::Above } else { Side::Below }, Start::OnSurface)?;
        }

        #[test]
        fn a_scaled_scene_has_the_same_crossings_to_the_last_bit(
            glass in prop::sample::select(Glass::ALL.to_vec()), place in place(), direction in direction(),
            height in -1.2..1.2f64, power in prop::sample::select(vec![-12, -10, 10, 12]),
        ) {
            let scale = libm::scalbn(1.0, power);
            let origin = place.extend(AMPLITUDE * height);
            let cross = |scale: f64| {
                let field = glass.face(SIZE * scale, AMPLITUDE * scale, 0.4);
                let ray = Ray::new(origin * scale, direction);
                let range = Interval::new(0.0, scale);
                let mut counters = Counters::default();
                let side = if ray.origin.z > field.height(ray.origin.truncate()) { Side::Above } else { Side::Below };
                (field.first_crossing(field.all_bounds(), 0.0, &ray, range, side, Start::Free, &mut counters), counters)
            };
            let (original, counters) = cross(1.0);
            let scaled = original.map(|c| Crossing { distance: c.distance * scale, point: c.point * scale, ..c });
            prop_assert_eq!(cross(scale), (scaled, counters));
        }
    }

    #[test]
    fn a_perpendicular_ray_costs_one_evaluation() {
        let field = Glass::Crown.face(SIZE, AMPLITUDE, 0.4);
        let mut counters = Counters::default();
        let ray = Ray::new(DVec3::new(0.03, 0.04, 2.0), DVec3::NEG_Z);
        let range = Interval::new(0.0, f64::INFINITY);
        let bounds = field.all_bounds();
        let crossing = field.first_crossing(bounds, 0.0, &ray, range, Side::Above, Start::Free, &mut counters).unwrap();
        assert!((crossing.point.z - field.height(dvec2(0.03, 0.04))).abs() < 1e-17);
        assert_eq!(counters.height_evaluations, 1);
    }
}
