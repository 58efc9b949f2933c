//! The published search: along the curve from the straight line to the light, from triangle to triangle, to the first path
//! (Granizo-Hidalgo and Holzschuch 2024, section 3.4), with the printed equations corrected where they are wrong
//! (`docs/integrators.md`).
//!
//! In each triangle the curve enters by one crossing of an edge and leaves by the next along it. Where the defect of Snell's law
//! changes its sign between them, halving leads to the path; where it does not, the walk goes on behind the second. It finds one path
//! at most, none on other curves, and none where an even number of paths lies between two crossings.

use std::collections::BTreeSet;

use arrayvec::ArrayVec;
use glam::{DMat3, DVec2, DVec3, Vec3Swizzles};

use super::{
    curve::{Arc, MOST_ARCS, arcs_within, direction, quadratic_form, value},
    ends::Ends,
    facet::Facet,
    neighbours::Neighbours,
};

/// Triangles after which a walk ends; a curve that crosses as many of any mesh that can be rendered goes round in circles.
const MOST_TRIANGLES: usize = 1 << 16;

/// Halvings of the curve between two crossings.
const HALVINGS: usize = 50;

/// Parts of half an ellipse within the triangle that are looked at for a change of sign.
const PARTS: u32 = 32;

/// A corner's weight that is this small at a crossing is none.
const ON_EDGE: f64 = 1e-9;

/// Part of a triangle's edges by which the ends of the curve on two triangles may differ.
const JOINED: f64 = 1e-6;

/// Triangles around a corner among which the curve is looked for.
const MOST_AROUND: usize = 32;

/// The curve on a triangle.
#[derive(Clone)]
struct Crossed {
    triangle: u32,
    facet: Facet,
    arcs: ArrayVec<Arc, MOST_ARCS>,
}

/// An arc of the curve on a triangle, and which of its ends the walk leaves by.
struct Leaving {
    here: Crossed,
    arc: usize,
    end: usize,
}

/// The first path along the curve from a place on a triangle, given by the weights of its second and third corner: its triangle
/// and weights.
pub(super) fn first_path(
    start: (u32, DVec2),
    facet: impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
    ends: &Ends,
) -> Option<(u32, DVec2)> {
    let (triangle, at) = start;
    let first = facet(triangle);
    let found = |weights| (triangle, weights);
    let Some(here) = Crossed::new(triangle, first, ends) else {
        // Everything is coplanar: the place itself is the path, if anything here is.
        return first.polished(ends, at).map(found);
    };
    // The arc that the place is on comes first.
    let place = DVec3::new(1.0 - at.element_sum(), at.x, at.y);
    let mut arcs: ArrayVec<(f64, usize), MOST_ARCS> =
        (0..here.arcs.len()).map(|arc| (here.distance_to(arc, place), arc)).collect();
    arcs.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(weights) = arcs.iter().find_map(|&(_, arc)| here.path_on(arc, ends)) {
        return Some(found(weights));
    }
    let &(_, arc) = arcs.first()?;
    // First towards where less of the law is missing, then the other way.
    let [at_start, at_end] = [0.0, 1.0].map(|t| here.defect(arc, t, ends).map_or(f64::INFINITY, f64::abs));
    let order = if at_start <= at_end { [0, 1] } else { [1, 0] };
    order.into_iter().find_map(|end| along_curve(Leaving { here: here.clone(), arc, end }, &facet, neighbours, ends))
}

/// The first path along the curve behind a triangle.
fn along_curve(
    mut leaving: Leaving,
    facet: &impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
    ends: &Ends,
) -> Option<(u32, DVec2)> {
    let mut visited = BTreeSet::new();
    for _ in 0..MOST_TRIANGLES {
        visited.insert((leaving.here.triangle, leaving.arc));
        leaving = next(&leaving, &visited, facet, neighbours, ends)?;
        if let Some(weights) = leaving.here.path_on(leaving.arc, ends) {
            return Some((leaving.here.triangle, weights));
        }
    }
    None
}

/// The arc that the curve goes on with behind a crossing; `None` at the border of the mesh, and where a closed curve has been followed
/// back to its start.
fn next(
    leaving: &Leaving,
    visited: &BTreeSet<(u32, usize)>,
    facet: &impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
    ends: &Ends,
) -> Option<Leaving> {
    let Leaving { here, arc, end } = leaving;
    let weights = here.end(*arc, *end);
    let place = here.place(weights);
    let close = JOINED * here.facet.corners.map(|corner| (corner - place).length()).into_iter().fold(0.0, f64::max);
    let mut best: Option<(f64, Leaving)> = None;
    for triangle in behind(here, weights, facet, neighbours) {
        let Some(other) = Crossed::new(triangle, facet(triangle), ends) else { continue };
        let unseen = (0..other.arcs.len()).filter(|&arc| !visited.contains(&(triangle, arc)));
        let near = unseen
            .flat_map(|arc| [(arc, 0), (arc, 1)])
            .map(|(arc, end)| ((other.place(other.end(arc, end)) - place).length(), arc, end))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((distance, arc, end)) = near
            && distance <= close
            && best.as_ref().is_none_or(|(least, _)| distance < *least)
        {
            best = Some((distance, Leaving { here: other, arc, end: 1 - end }));
        }
    }
    best.map(|(_, leaving)| leaving)
}

/// The triangles that a crossing leads to: that across its edge, or at a corner all others around it.
fn behind(
    here: &Crossed,
    weights: DVec3,
    facet: &impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
) -> ArrayVec<u32, MOST_AROUND> {
    let mut triangles = ArrayVec::new();
    let is_none = [0, 1, 2].map(|corner: usize| weights[corner] < ON_EDGE);
    let Some(corner) = (0..3).find(|corner| is_none[(corner + 1) % 3] && is_none[(corner + 2) % 3]) else {
        let across = |corner: usize| neighbours.across(here.triangle, (corner + 1) % 3);
        triangles.extend((0..3).find(|&corner| is_none[corner]).and_then(across));
        return triangles;
    };
    let corner = here.facet.corners[corner];
    let (mut around, mut looked_at) = (ArrayVec::<u32, MOST_AROUND>::from_iter([here.triangle]), 0);
    while let Some(&triangle) = around.get(looked_at) {
        looked_at += 1;
        let corners = facet(triangle).corners;
        for edge in 0..3 {
            let touches = corners[edge] == corner || corners[(edge + 1) % 3] == corner;
            if let Some(next) = neighbours.across(triangle, edge).filter(|next| touches && !around.contains(next))
                && around.try_push(next).is_ok()
            {
                triangles.push(next);
            }
        }
    }
    triangles
}

impl Crossed {
    /// `None` where all places of the triangle are coplanar with both ends.
    fn new(triangle: u32, facet: Facet, ends: &Ends) -> Option<Self> {
        let columns = |corners: &[DVec3; 3]| DMat3::from_cols(corners[0], corners[1], corners[2]);
        let form = quadratic_form(&columns(&facet.corners), &columns(&facet.normals), ends)?;
        Some(Self { triangle, facet, arcs: arcs_within(&form) })
    }

    /// Weights of all corners at a place of an arc.
    fn weights(&self, arc: usize, t: f64) -> DVec3 {
        let weights = value(&self.arcs[arc], t);
        weights / weights.element_sum()
    }

    /// Weights of all corners at the first or second end of an arc.
    fn end(&self, arc: usize, end: usize) -> DVec3 {
        self.weights(arc, if end == 0 { 0.0 } else { 1.0 })
    }

    fn place(&self, weights: DVec3) -> DVec3 {
        self.facet.place(weights.yz())
    }

    /// About how far a place is from an arc, in weights, squared.
    fn distance_to(&self, arc: usize, place: DVec3) -> f64 {
        (0..=PARTS)
            .map(|part| (self.weights(arc, f64::from(part) / f64::from(PARTS)) - place).length_squared())
            .fold(f64::INFINITY, f64::min)
    }

    fn defect(&self, arc: usize, t: f64, ends: &Ends) -> Option<f64> {
        self.facet.defect(ends, self.weights(arc, t).yz(), direction(&self.arcs[arc], t))
    }

    /// The path on an arc, if the defect has two signs at its ends; on half an ellipse, at the ends of any of its parts.
    fn path_on(&self, arc: usize, ends: &Ends) -> Option<DVec2> {
        let crosses = [0, 1].iter().any(|&end| self.end(arc, end).min_element() < ON_EDGE);
        let parts = if crosses { 1 } else { PARTS };
        (0..parts).find_map(|part| {
            let [from, to] = [part, part + 1].map(|end| f64::from(end) / f64::from(parts));
            self.between(arc, from, to, ends)
        })
    }

    /// The path between two places of an arc where the defect has two signs.
    fn between(&self, arc: usize, from: f64, to: f64, ends: &Ends) -> Option<DVec2> {
        // Totally reflected light has no defect: the curve is broken there.
        let (first, last) = (self.defect(arc, from, ends)?, self.defect(arc, to, ends)?);
        if first * last > 0.0 {
            return None;
        }
        let (mut low, mut high) = (from, to);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            // As zero counts as positive at both ends, a place where it vanishes is on one side only.
            if (self.defect(arc, middle, ends)? >= 0.0) == (first >= 0.0) {
                low = middle;
            } else {
                high = middle;
            }
        }
        self.facet.polished(ends, self.weights(arc, low).yz())
    }
}
