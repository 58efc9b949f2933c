//! The published search: along the curve from the straight line to the light, from triangle to triangle, to the first path
//! (Granizo-Hidalgo and Holzschuch 2024, section 3.4), with the printed equations corrected where they are wrong
//! (`docs/integrators.md`).
//!
//! In each triangle the curve enters by one crossing of an edge and leaves by another. Where the defect of Snell's law changes
//! its sign between them, halving leads to the path; where it does not, the walk goes on behind the second. It finds one path at
//! most, none on other curves, and none where an even number of paths lies between two crossings.

use std::collections::BTreeSet;

use arrayvec::ArrayVec;
use glam::{DMat3, DVec2, DVec3};

use super::{
    curve::{quadratic_form, quarters},
    ends::Ends,
    facet::Facet,
    neighbours::Neighbours,
};
use crate::geometry::bernstein::roots;

/// Triangles after which a walk ends; a curve that crosses as many of any mesh that can be rendered goes round in circles.
const MOST_TRIANGLES: usize = 1 << 16;

/// Halvings of the curve between two crossings.
const HALVINGS: usize = 50;

/// Times that a triangle is cut in four to find an ellipse within it.
const CUTS: u32 = 5;

/// Where the curve crosses an edge, counted from that between the first two corners.
#[derive(Clone, Copy)]
struct Crossing {
    edge: usize,
    /// Weights of all three corners.
    weights: DVec3,
}

/// The first path along the curve from a place on a triangle, given by the weights of its second and third corner: its triangle
/// and weights.
pub(super) fn first_path(
    start: (u32, DVec2),
    facet: impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
    ends: &Ends,
) -> Option<(u32, DVec2)> {
    let (triangle, _) = start;
    let first = facet(triangle);
    let Some(form) = form_on(&first, ends) else {
        // Everything is coplanar: the place itself is the path, if anything here is.
        return first.polished(ends, start.1).map(|weights| (triangle, weights));
    };
    let met = crossings(&form);
    let defects: ArrayVec<(Crossing, f64), 6> =
        met.iter().filter_map(|crossing| Some((*crossing, first.defect(ends, &form, crossing.weights)?))).collect();
    if met.is_empty() {
        return ellipse(&first, ends, &form, &DMat3::IDENTITY, CUTS).map(|weights| (triangle, weights));
    }
    for (a, b) in [(0, 1), (2, 3), (1, 2), (3, 0), (4, 5)] {
        if let (Some(a), Some(b)) = (defects.get(a), defects.get(b))
            && let Some(weights) = between(&first, ends, &form, a, b)
        {
            return Some((triangle, weights));
        }
    }
    // First towards where less of the law is missing, then the other way.
    let mut starts: ArrayVec<(Crossing, f64), 6> = defects;
    starts.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    starts.iter().find_map(|(leaves, _)| along_curve(triangle, *leaves, &facet, neighbours, ends))
}

/// The first path along the curve that leaves a triangle by a crossing.
fn along_curve(
    mut triangle: u32,
    mut leaves: Crossing,
    facet: &impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
    ends: &Ends,
) -> Option<(u32, DVec2)> {
    let mut visited = BTreeSet::from([triangle]);
    for _ in 0..MOST_TRIANGLES {
        let place = place_of(&facet(triangle), leaves.weights);
        triangle = neighbours.across(triangle, leaves.edge)?;
        let here = facet(triangle);
        let form = form_on(&here, ends)?;
        let mut met = crossings(&form);
        let distance = |crossing: &Crossing| (place_of(&here, crossing.weights) - place).length_squared();
        let entry = (0..met.len()).min_by(|&a, &b| distance(&met[a]).total_cmp(&distance(&met[b])))?;
        let enters = met.remove(entry);
        let unseen = |crossing: &&Crossing| {
            neighbours.across(triangle, crossing.edge).is_none_or(|next| !visited.contains(&next))
        };
        leaves = *met.iter().find(unseen)?;
        // Totally reflected light has no defect: the curve is broken there.
        let defects =
            [enters, leaves].map(|crossing| here.defect(ends, &form, crossing.weights).map(|f| (crossing, f)));
        if let [Some(from), Some(to)] = defects
            && let Some(weights) = between(&here, ends, &form, &from, &to)
        {
            return Some((triangle, weights));
        }
        visited.insert(triangle);
    }
    None
}

fn form_on(facet: &Facet, ends: &Ends) -> Option<DMat3> {
    let columns = |corners: &[DVec3; 3]| DMat3::from_cols(corners[0], corners[1], corners[2]);
    quadratic_form(&columns(&facet.corners), &columns(&facet.normals), ends)
}

fn place_of(facet: &Facet, weights: DVec3) -> DVec3 {
    facet.place(DVec2::new(weights.y, weights.z))
}

/// Where the conic crosses the edges (equations 22 to 24, with D and E, and C and D, in their places).
fn crossings(form: &DMat3) -> ArrayVec<Crossing, 6> {
    let corners = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut crossings = ArrayVec::new();
    for edge in 0..3 {
        let (a, b) = (corners[edge], corners[(edge + 1) % 3]);
        roots(&[a.dot(*form * a), a.dot(*form * b), b.dot(*form * b)], &mut |t| {
            let _ = crossings.try_push(Crossing { edge, weights: a * (1.0 - t) + b * t });
        });
    }
    crossings
}

/// The path between two places of the curve where the defect has two signs.
fn between(facet: &Facet, ends: &Ends, form: &DMat3, from: &(Crossing, f64), to: &(Crossing, f64)) -> Option<DVec2> {
    if from.1 * to.1 > 0.0 {
        return None;
    }
    let (mut low, mut high) = (from.0.weights, to.0.weights);
    for _ in 0..HALVINGS {
        let middle = onto_conic(form, 0.5 * (low + high))?;
        // As zero counts as positive at both ends, a place where it vanishes is on one side only.
        if (facet.defect(ends, form, middle)? >= 0.0) == (from.1 >= 0.0) {
            low = middle;
        } else {
            high = middle;
        }
    }
    facet.polished(ends, DVec2::new(low.y, low.z))
}

/// The nearest place of the conic along its gradient.
fn onto_conic(form: &DMat3, place: DVec3) -> Option<DVec3> {
    let gradient = *form * place;
    let along = gradient - gradient.element_sum() / 3.0;
    let (a, b, c) = (along.dot(*form * along), place.dot(*form * along), place.dot(*form * place));
    // a s^2 + 2 b s + c = 0, the smaller root.
    let root = (b * b - a * c).max(0.0).sqrt();
    let step = -c / (b + root.copysign(b));
    if c == 0.0 { Some(place) } else { Some(place + along * step).filter(|place| place.is_finite()) }
}

/// The path on an ellipse within a triangle, whose parts are looked at until one shows a change of sign.
fn ellipse(facet: &Facet, ends: &Ends, form: &DMat3, part: &DMat3, cuts: u32) -> Option<DVec2> {
    let within = part.transpose() * *form * *part;
    let met = crossings(&within);
    let defects: ArrayVec<(Crossing, f64), 6> = met
        .iter()
        .filter_map(|crossing| {
            let crossing = Crossing { weights: *part * crossing.weights, ..*crossing };
            Some((crossing, facet.defect(ends, form, crossing.weights)?))
        })
        .collect();
    if let [a, b, ..] = defects[..]
        && let Some(weights) = between(facet, ends, form, &a, &b)
    {
        return Some(weights);
    }
    if cuts == 0 {
        return None;
    }
    quarters(part).iter().find_map(|part| ellipse(facet, ends, form, part, cuts - 1))
}
