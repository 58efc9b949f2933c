//! The curve on a facet along which the shading point, the light and the normal are coplanar, and all paths on it.
//!
//! In the weights `b` of the corners it is the conic `b^T S b = 0` (Granizo-Hidalgo and Holzschuch 2024, equation 10).
//! Its six coefficients are those of a quadratic Bernstein polynomial over the triangle: where all have one sign there
//! is no curve. Between two of its points `p` and `q` it is one of two rational arcs,
//!
//! ```text
//! b(t) = (1 - t)^2 p +- 2 t (1 - t) c + t^2 q,        c along (S p) x (S q), the pole of the line through both.
//! ```
//!
//! Those between crossings of edges on which no weight is negative are the curve's parts in the triangle. Along an arc,
//! the squares of both sides of Snell's law are polynomials of degree 12. Isolating their roots (`geometry::bernstein`)
//! finds all paths.

use arrayvec::ArrayVec;
use glam::{DMat3, DVec2, DVec3};

use super::{ends::Ends, facet::Facet};
use crate::math::bernstein::roots;

/// Coefficients smaller than this part of the terms that they are sums of are zero.
const NOTHING: f64 = 1e-13;

/// How far outside paths are looked for, in weights.
const GROWTH: f64 = 1e-7;

/// Values at corners that are smaller than this part of all others are zero where the curve is followed beyond the
/// triangle.
const BESIDE_CORNER: f64 = 1e-12;

/// How often a triangle is cut in four where the conic is too close to a pair of crossing lines to be followed.
const CUTS: u32 = 6;

/// Weights of corners, times a factor of either sign, as polynomials of the second degree in Bernstein form.
pub(super) type Arc = [DVec3; 3];

/// Most arcs of a conic within a triangle: from each of six crossings two, along lines that cross there.
pub(super) const MOST_ARCS: usize = 12;

/// Weights that differ by less are the same crossing.
const SAME: f64 = 1e-9;

/// What rounding may make of the weights on an arc.
const ROUNDING: f64 = 1e-12;

/// How sharply an arc may turn: the weights of its middle point. One that turns more sharply is a pair of lines.
const SHARPEST: f64 = 1e5;

/// An arc is most of an ellipse where the sum of its weights half way is less than this.
const LARGE_PART: f64 = 0.2;

/// A conic is a line between two of its points where what it is half way is less than this part of the largest entry
/// times the square of their distance.
const STRAIGHT: f64 = 1e-8;

/// Hands the weights of all paths on a facet to `found`; some more than once, and some just outside.
pub(super) fn all_paths(facet: &Facet, ends: &Ends, found: &mut impl FnMut(DVec2)) {
    // A path on an edge or a corner is well within the grown triangle, for each of the triangles that meet there.
    let grown = DMat3::IDENTITY * (1.0 + 3.0 * GROWTH) - DMat3::from_cols_array(&[GROWTH; 9]);
    paths_within(facet, ends, &grown, CUTS, found);
    // Where light goes straight on, the path is a double root, which rounding may take away.
    if let Some(straight) = straight_through(facet, ends) {
        found(straight);
    }
}

/// Where the line through both ends crosses the triangle.
pub(super) fn straight_through(facet: &Facet, ends: &Ends) -> Option<DVec2> {
    let [a, b, c] = facet.corners;
    let weights = DMat3::from_cols(b - a, c - a, ends.across()).inverse() * (ends.point - a);
    let weights = weights.truncate();
    (weights.min_element() > -GROWTH && weights.element_sum() < 1.0 + GROWTH).then_some(weights)
}

/// As [`all_paths`], within the triangle whose corners have the weights `part` (columns).
fn paths_within(facet: &Facet, ends: &Ends, part: &DMat3, cuts: u32, found: &mut impl FnMut(DVec2)) {
    let corners = DMat3::from_cols_array_2d(&facet.corners.map(|corner| corner.to_array())) * *part;
    let normals = DMat3::from_cols_array_2d(&facet.normals.map(|normal| normal.to_array())) * *part;
    // Where everything is coplanar, there is no curve to follow, and Newton's method is left.
    let mut from_the_middle = || {
        let middle = *part * DVec3::splat(1.0 / 3.0);
        found(DVec2::new(middle.y, middle.z));
    };
    let Some(form) = quadratic_form(&corners, &normals, ends) else { return from_the_middle() };
    let signs = [form.x_axis.x, form.y_axis.y, form.z_axis.z, form.x_axis.y, form.x_axis.z, form.y_axis.z];
    if signs.iter().all(|&value| value > 0.0) || signs.iter().all(|&value| value < 0.0) {
        return;
    }
    match arcs_within(&form) {
        Some(arcs) => {
            let mut search = |arc: &Arc| paths_on_arc(ends, &corners, &normals, part, arc, found);
            for arc in &arcs {
                match in_two(&form, arc) {
                    Some(parts) => parts.iter().for_each(&mut search),
                    None => search(arc),
                }
            }
        }
        None if cuts == 0 => from_the_middle(),
        None => {
            quarters(part).iter().for_each(|part| paths_within(facet, ends, part, cuts - 1, found));
        }
    }
}

/// The matrix S; `None` when it vanishes, so that all places are coplanar with both ends.
pub(super) fn quadratic_form(corners: &DMat3, normals: &DMat3, ends: &Ends) -> Option<DMat3> {
    let across = ends.across();
    let from_point = [corners.x_axis, corners.y_axis, corners.z_axis].map(|corner| corner - ends.point);
    let turned = from_point.map(|offset| across.cross(offset));
    let normals = [normals.x_axis, normals.y_axis, normals.z_axis];
    let entry = |i: usize, j: usize| 0.5 * (normals[i].dot(turned[j]) + normals[j].dot(turned[i]));
    let form = DMat3::from_cols(
        DVec3::new(entry(0, 0), entry(0, 1), entry(0, 2)),
        DVec3::new(entry(0, 1), entry(1, 1), entry(1, 2)),
        DVec3::new(entry(0, 2), entry(1, 2), entry(2, 2)),
    );
    let longest = from_point.iter().fold(0f64, |longest, offset| longest.max(offset.length_squared())).sqrt();
    let scale = across.length() * longest * normals[0].length();
    (largest_entry(&form) > NOTHING * scale).then_some(form)
}

fn largest_entry(form: &DMat3) -> f64 {
    [form.x_axis, form.y_axis, form.z_axis].iter().fold(0.0, |largest, column| column.abs().max_element().max(largest))
}

/// A triangle cut in four at the middles of its edges.
fn quarters(part: &DMat3) -> [DMat3; 4] {
    let [a, b, c] = [part.x_axis, part.y_axis, part.z_axis];
    let [ab, bc, ca] = [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)];
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]].map(|[a, b, c]| DMat3::from_cols(a, b, c))
}

/// Weights of the corners where the conic crosses edges, one of them zero (Granizo-Hidalgo and Holzschuch 2024,
/// equation 22 with E for D, 23 with D for C, and 24).
pub(super) fn crossings(form: &DMat3) -> ArrayVec<DVec3, 6> {
    let mut crossings = ArrayVec::new();
    for edge in 0..3 {
        let (a, b) = (DVec3::AXES[edge], DVec3::AXES[(edge + 1) % 3]);
        roots(&[a.dot(*form * a), a.dot(*form * b), b.dot(*form * b)], &mut |t| {
            let _ = crossings.try_push(a * (1.0 - t) + b * t);
        });
    }
    crossings
}

/// The parts of the conic within the triangle, each from one crossing of an edge to the next along it; of an ellipse
/// within the triangle, both halves. What is a hair beside a corner goes through it. `None` where the conic is too
/// close to a pair of lines to be told from one, and not close enough to be followed as one.
pub(super) fn arcs_within(form: &DMat3) -> Option<ArrayVec<Arc, MOST_ARCS>> {
    let largest = largest_entry(form);
    let at_corners = DVec3::new(form.x_axis.x, form.y_axis.y, form.z_axis.z);
    let hair = DVec3::select(at_corners.abs().cmplt(DVec3::splat(BESIDE_CORNER * largest)), at_corners, DVec3::ZERO);
    let form = &(*form - DMat3::from_diagonal(hair));
    let mut met = ArrayVec::<DVec3, 6>::new();
    for crossing in crossings(form) {
        if met.iter().all(|known| apart(*known, crossing) > SAME) {
            met.push(crossing);
        }
    }
    if met.len() < 2 {
        let Some([p, q]) = two_points(form, met.first()) else { return Some(ArrayVec::new()) };
        // An ellipse that touches an edge may go beyond it by what crossings differ by.
        let is_inside = p.min(q).min_element() >= -SAME;
        return Some(curved(form, p, q)?.into_iter().filter(|arc| is_inside || is_within(arc)).collect());
    }
    let pairs = || (0..met.len()).flat_map(|second| (0..second).map(move |first| [first, second]));
    let mut arcs = ArrayVec::new();
    let mut is_end = [false; 6];
    let mut keep = |pair: [usize; 2], arc: Arc| {
        if is_within(&arc) && arcs.try_push(arc).is_ok() {
            pair.iter().for_each(|&end| is_end[end] = true);
        }
    };
    for [first, second] in pairs() {
        let halves = curved(form, met[first], met[second]);
        halves.into_iter().flatten().for_each(|arc| keep([first, second], arc));
    }
    let is_lonely = |end: usize, is_end: &[bool; 6]| end < met.len() && !is_end[end];
    if (0..6).any(|end| is_lonely(end, &is_end)) {
        for [first, second] in pairs() {
            if let Some(arc) = straight(form, met[first], met[second])
                && arcs.try_push(arc).is_ok()
            {
                (is_end[first], is_end[second]) = (true, true);
            }
        }
    }
    // The curve may touch a corner from outside, but an edge only where it has a double root there.
    let is_lost = |end: usize| is_lonely(end, &is_end) && met[end].max_element() < 1.0 - SAME;
    (!(0..6).any(is_lost)).then_some(arcs)
}

fn apart(a: DVec3, b: DVec3) -> f64 {
    (a - b).abs().max_element()
}

/// An arc that is most of an ellipse, in two: from its ends, which are close together, to the opposite point. By itself
/// its weights all but vanish half way, and its polynomials with them. `None` for other arcs.
fn in_two(form: &DMat3, arc: &Arc) -> Option<ArrayVec<Arc, 4>> {
    let [p, _, q] = *arc;
    if value(arc, 0.5).element_sum() > LARGE_PART {
        return None;
    }
    let opposite = centre(form)? * 2.0 - p;
    let halves = [curved(form, p, opposite)?, curved(form, opposite, q)?];
    Some(halves.into_iter().flatten().filter(is_within).collect())
}

/// The centre of an ellipse; `None` where the conic is too close to a parabola or to a single place.
fn centre(form: &DMat3) -> Option<DVec3> {
    let cofactors = form.inverse() * form.determinant();
    let centre = cofactors * DVec3::ONE;
    Some(centre / centre.element_sum()).filter(|centre| centre.is_finite())
}

/// Two points of a conic that crosses edges at one place at the most, as far apart as is easily had; `None` when there
/// are none.
fn two_points(form: &DMat3, crossing: Option<&DVec3>) -> Option<[DVec3; 2]> {
    if let Some(&p) = crossing {
        // It enters and leaves at one place: the other end of a chord from there.
        return [DVec3::splat(1.0 / 3.0), DVec3::new(0.5, 0.3, 0.2)].into_iter().find_map(|through| {
            let direction = through - p;
            let across = direction.dot(*form * direction);
            let q = p - direction * (2.0 * p.dot(*form * direction) / across);
            (q.is_finite() && apart(p, q) > SAME).then_some([p, q])
        });
    }
    // An ellipse within the triangle has its centre there.
    let centre = centre(form).filter(|centre| centre.min_element() > 0.0)?;
    let direction = DVec3::new(1.0, -1.0, 0.0);
    let squared = -centre.dot(*form * centre) / direction.dot(*form * direction);
    let reach = direction * squared.sqrt();
    // Beside the triangle there are other conics around that place.
    let [p, q] = [centre - reach, centre + reach];
    (squared > 0.0 && p.min(q).min_element() >= -SAME).then_some([p, q])
}

/// The two arcs between two points of the conic; `None` where it is too close to a pair of lines.
fn curved(form: &DMat3, p: DVec3, q: DVec3) -> Option<[Arc; 2]> {
    let pole = (*form * p).cross(*form * q);
    let squared = -0.5 * p.dot(*form * q) / pole.dot(*form * pole);
    let middle = pole * squared.sqrt();
    let is_followed = squared.is_finite() && squared >= 0.0 && middle.length() < SHARPEST;
    is_followed.then_some([[p, middle, q], [p, -middle, q]])
}

/// The straight arc between two points of the conic, if it is a pair of lines of which one goes through both.
fn straight(form: &DMat3, p: DVec3, q: DVec3) -> Option<Arc> {
    // Half way, the form is half of what it is between both.
    let limit = STRAIGHT * largest_entry(form) * (p - q).length_squared();
    (p.dot(*form * q).abs() < limit).then_some([p, 0.5 * (p + q), q])
}

/// Whether no weight of an arc is negative, but for rounding.
fn is_within(arc: &Arc) -> bool {
    let [p, middle, q] = arc;
    // The pole of a short chord is known the less the shorter it is.
    let slack = ROUNDING * (1.0 + middle.abs().max_element()) + 8.0 * f64::EPSILON / apart(*p, *q);
    let least = -(p.max(DVec3::ZERO) * q.max(DVec3::ZERO)).map(f64::sqrt) - slack;
    p.min(*q).min_element() >= -slack && middle.cmpge(least).all()
}

/// The weights, times a factor, at a place of an arc.
pub(super) fn value(arc: &Arc, t: f64) -> DVec3 {
    arc[0] * ((1.0 - t) * (1.0 - t)) + arc[1] * (2.0 * t * (1.0 - t)) + arc[2] * (t * t)
}

/// Hands the weights of all paths on a piece of an arc to `found`. The arc's weights are those of the corners of
/// `part`.
fn paths_on_arc(ends: &Ends, corners: &DMat3, normals: &DMat3, part: &DMat3, arc: &Arc, found: &mut impl FnMut(DVec2)) {
    let to_light = DMat3::from_cols(
        ends.offset_to_light(corners.x_axis),
        ends.offset_to_light(corners.y_axis),
        ends.offset_to_light(corners.z_axis),
    );
    let from_point =
        DMat3::from_cols(corners.x_axis - ends.point, corners.y_axis - ends.point, corners.z_axis - ends.point);
    // Coefficients times their binomials, so that products are sums of products.
    let scaled = [arc[0], arc[1] * 2.0, arc[2]];
    let components = |map: &DMat3| {
        let columns = scaled.map(|b| *map * b);
        [0, 1, 2].map(|axis| columns.map(|column| column[axis]))
    };
    let [from_point, to_light, normal] = [&from_point, &to_light, normals].map(components);
    let squared = |v: &[[f64; 3]; 3]| {
        let mut sum = [0.0; 5];
        v.iter().for_each(|component| add_product(component, component, 1.0, &mut sum));
        sum
    };
    let cross_squared = |v: &[[f64; 3]; 3]| {
        let mut sum = [0.0; 9];
        for (a, b) in [(1, 2), (2, 0), (0, 1)] {
            let mut component = [0.0; 5];
            add_product(&normal[a], &v[b], 1.0, &mut component);
            add_product(&normal[b], &v[a], -1.0, &mut component);
            add_product(&component, &component, 1.0, &mut sum);
        }
        sum
    };
    let mut law = [0.0; 13];
    let [index_point, index_light] = ends.indices.map(|index| index * index);
    add_product(&cross_squared(&from_point), &squared(&to_light), index_point, &mut law);
    add_product(&cross_squared(&to_light), &squared(&from_point), -index_light, &mut law);
    for (coefficient, binomial) in law.iter_mut().zip(BINOMIALS) {
        *coefficient /= binomial;
    }
    roots(&law, &mut |t| {
        let b = value(arc, t);
        let weights = *part * (b / b.element_sum());
        found(DVec2::new(weights.y, weights.z));
    });
}

/// Of 12.
const BINOMIALS: [f64; 13] = [1.0, 12.0, 66.0, 220.0, 495.0, 792.0, 924.0, 792.0, 495.0, 220.0, 66.0, 12.0, 1.0];

fn add_product(a: &[f64], b: &[f64], factor: f64, sum: &mut [f64]) {
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            sum[i + j] += factor * x * y;
        }
    }
}
