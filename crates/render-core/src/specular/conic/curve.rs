//! The curve on a facet along which the shading point, the light and the normal are coplanar, and all paths on it.
//!
//! In the weights `b` of the corners it is the conic `b^T S b = 0` (Granizo-Hidalgo and Holzschuch 2024, equation 10). Its six
//! coefficients are those of a quadratic Bernstein polynomial over the triangle: where all have one sign there is no curve.
//! Through two of its points `p` and `q` it is a pair of rational arcs,
//!
//! ```text
//! b(t) = (1 - t)^2 p +- 2 t (1 - t) c + t^2 q,        c along (S p) x (S q), the pole of the line through both,
//! ```
//!
//! the parts of which that lie in the triangle are found from the signs of three quadratics. Along an arc, the squares of both
//! sides of Snell's law are polynomials of degree 12. Isolating their roots (`geometry::bernstein`) finds all paths.

use glam::{DMat3, DVec2, DVec3, Vec3Swizzles};

use super::{ends::Ends, facet::Facet};
use crate::geometry::bernstein::roots;

/// Coefficients smaller than this part of the terms that they are sums of are zero.
const NOTHING: f64 = 1e-13;

/// How far outside paths are looked for, in weights.
const GROWTH: f64 = 1e-7;

/// Values at corners that are smaller than this part of all others are zero where the curve is followed beyond the triangle.
const BESIDE_CORNER: f64 = 1e-12;

/// Where the conic is too close to a pair of crossing lines to be followed, the triangle is cut in four so many times.
const CUTS: u32 = 6;

/// Weights of corners, times a factor of either sign, as polynomials of the second degree in Bernstein form.
pub(super) type Arc = [DVec3; 3];

/// Most arcs of a conic within a triangle.
pub(super) const MOST_ARCS: usize = 14;

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
    let Some([p, q]) = two_points(&form) else { return };
    match arcs(&form, p, q) {
        Some(arcs) => {
            for arc in arcs {
                for piece in pieces(&arc) {
                    paths_on_arc(ends, &corners, &normals, part, &piece, found);
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
    let largest =
        [form.x_axis, form.y_axis, form.z_axis].iter().fold(0f64, |m, column| m.max(column.abs().max_element()));
    (largest > NOTHING * scale).then_some(form)
}

/// A triangle cut in four at the middles of its edges.
fn quarters(part: &DMat3) -> [DMat3; 4] {
    let [a, b, c] = [part.x_axis, part.y_axis, part.z_axis];
    let [ab, bc, ca] = [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)];
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]].map(|[a, b, c]| DMat3::from_cols(a, b, c))
}

/// Weights of the corners where the conic crosses edges, one of them zero (Granizo-Hidalgo and Holzschuch 2024, equations 22 to 24, with D and E, and C and D, in their places).
pub(super) fn crossings(form: &DMat3) -> arrayvec::ArrayVec<DVec3, 6> {
    let mut crossings = arrayvec::ArrayVec::new();
    for edge in 0..3 {
        let (a, b) = (DVec3::AXES[edge], DVec3::AXES[(edge + 1) % 3]);
        roots(&[a.dot(*form * a), a.dot(*form * b), b.dot(*form * b)], &mut |t| {
            let _ = crossings.try_push(a * (1.0 - t) + b * t);
        });
    }
    crossings
}

/// The parts of the conic within the triangle, each from one crossing of an edge to the next along it; of an ellipse within the
/// triangle, both halves. What is a hair beside a corner goes through it.
pub(super) fn arcs_within(form: &DMat3) -> arrayvec::ArrayVec<Arc, MOST_ARCS> {
    let largest = form.to_cols_array().into_iter().fold(0.0, |largest: f64, entry| largest.max(entry.abs()));
    let at_corners = DVec3::new(form.x_axis.x, form.y_axis.y, form.z_axis.z);
    let hair = DVec3::select(at_corners.abs().cmplt(DVec3::splat(BESIDE_CORNER * largest)), at_corners, DVec3::ZERO);
    let form = &(*form - DMat3::from_diagonal(hair));
    let met = crossings(form);
    // Where the conic is a pair of lines, or nearly, only two crossings of the same line span all its arcs.
    let pairs = (0..met.len()).flat_map(|first| (0..first).map(move |second| (first, second)));
    let crossed = pairs.map(|(first, second)| [met[first], met[second]]);
    let mut best = arrayvec::ArrayVec::new();
    let mut most = None;
    for [p, q] in two_points(form).into_iter().chain(crossed) {
        let arcs: arrayvec::ArrayVec<Arc, MOST_ARCS> =
            arcs(form, p, q).into_iter().flatten().flat_map(|arc| pieces(&arc)).collect();
        let ends = || arcs.iter().flat_map(|[from, _, to]| [from, to]).map(|end| *end / end.element_sum());
        let joined = met.iter().filter(|crossing| ends().any(|end| apart(end, **crossing) < CROSSING)).count();
        if most.is_none_or(|most| joined > most) {
            (best, most) = (arcs, Some(joined));
        }
        if joined == met.len() {
            break;
        }
    }
    best
}

/// Weights whose squared distance is less are the same crossing.
const CROSSING: f64 = 1e-12;

fn apart(a: DVec3, b: DVec3) -> f64 {
    (a - b).length_squared()
}

/// Two points of the conic, as far apart as is easily had; `None` when none of it lies in the triangle.
fn two_points(form: &DMat3) -> Option<[DVec3; 2]> {
    let crossings = crossings(form);
    if let Some(&first) = crossings.first() {
        let far = |from: DVec3| crossings.iter().copied().max_by(|&a, &b| apart(from, a).total_cmp(&apart(from, b)));
        let p = far(first)?;
        let q = far(p)?;
        if apart(p, q) > 1e-12 {
            return Some([p, q]);
        }
        // It enters and leaves at one place: the other end of a chord from there.
        return [DVec3::splat(1.0 / 3.0), DVec3::new(0.5, 0.3, 0.2)].into_iter().find_map(|through| {
            let direction = through - p;
            let across = direction.dot(*form * direction);
            let q = p - direction * (2.0 * p.dot(*form * direction) / across);
            (q.is_finite() && apart(p, q) > 1e-12).then_some([p, q])
        });
    }
    // An ellipse within the triangle has its centre there.
    let cofactors = form.inverse() * form.determinant();
    let centre = cofactors * DVec3::ONE;
    let centre = centre / centre.element_sum();
    if !(centre.is_finite() && centre.min_element() > 0.0) {
        return None;
    }
    let direction = DVec3::new(1.0, -1.0, 0.0);
    let squared = -centre.dot(*form * centre) / direction.dot(*form * direction);
    let reach = direction * squared.sqrt();
    (squared > 0.0).then_some([centre - reach, centre + reach])
}

/// The two arcs between two points of the conic; `None` where it is too close to a pair of crossing lines.
fn arcs(form: &DMat3, p: DVec3, q: DVec3) -> Option<arrayvec::ArrayVec<Arc, 2>> {
    let mut arcs = arrayvec::ArrayVec::new();
    let (towards_p, towards_q) = (*form * p, *form * q);
    let pole = towards_p.cross(towards_q);
    let chord = p.dot(towards_q);
    let size = towards_p.length() * towards_q.length();
    let within = pole.dot(*form * pole);
    let squared = -0.5 * chord / within;
    if chord.abs() <= NOTHING.sqrt() * towards_p.length() && pole.length() <= NOTHING.sqrt() * size {
        // Both on one line l of a pair, S = (l m^T + m l^T) / 2; the other one is m.
        arcs.push([p, 0.5 * (p + q), q]);
        let line = p.cross(q).normalize();
        let towards = *form * line;
        let other = 2.0 * towards - line * line.dot(towards);
        let met: arrayvec::ArrayVec<DVec3, 3> = (0..3)
            .filter_map(|edge| {
                let (a, b) = (DVec3::AXES[edge], DVec3::AXES[(edge + 1) % 3]);
                let (at_a, at_b) = (other.dot(a), other.dot(b));
                (at_a * at_b < 0.0).then(|| (a * at_b - b * at_a) / (at_b - at_a))
            })
            .collect();
        if let [p, q, ..] = met[..] {
            arcs.push([p, 0.5 * (p + q), q]);
        }
        return Some(arcs);
    }
    let middle = pole * squared.sqrt();
    if !(squared.is_finite() && squared >= 0.0 && middle.length() < 1e8) {
        return None;
    }
    arcs.push([p, middle, q]);
    arcs.push([p, -middle, q]);
    Some(arcs)
}

/// The pieces of an arc on which all weights have one sign: those within the triangle.
fn pieces(arc: &Arc) -> arrayvec::ArrayVec<Arc, 7> {
    let mut breaks = arrayvec::ArrayVec::<f64, 8>::new();
    breaks.extend([0.0, 1.0]);
    for weight in 0..3 {
        roots(&arc.map(|b| b[weight]), &mut |t| {
            let _ = breaks.try_push(t);
        });
    }
    breaks.sort_by(f64::total_cmp);
    let mut pieces = arrayvec::ArrayVec::new();
    for pair in breaks.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let middle = value(arc, 0.5 * (from + to));
        if to > from && (middle.min_element() > 0.0 || middle.max_element() < 0.0) {
            let blossom = |s: f64, t: f64| {
                arc[0] * ((1.0 - s) * (1.0 - t)) + arc[1] * (s * (1.0 - t) + t * (1.0 - s)) + arc[2] * (s * t)
            };
            pieces.push([blossom(from, from), blossom(from, to), blossom(to, to)]);
        }
    }
    pieces
}

/// The direction of an arc at one of its places, in weights of the second and third corner (equations 13 to 15, for a matrix that is
/// symmetric, and without a sign that changes where the curve crosses itself).
pub(super) fn direction(arc: &Arc, t: f64) -> DVec2 {
    let (place, moving) = (value(arc, t), (arc[1] - arc[0]) * (1.0 - t) + (arc[2] - arc[1]) * t);
    (moving * place.element_sum() - place * moving.element_sum()).yz()
}

/// The weights, times a factor, at a place of an arc.
pub(super) fn value(arc: &Arc, t: f64) -> DVec3 {
    arc[0] * ((1.0 - t) * (1.0 - t)) + arc[1] * (2.0 * t * (1.0 - t)) + arc[2] * (t * t)
}

/// Hands the weights of all paths on a piece of an arc to `found`. The arc's weights are those of the corners of `part`.
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
