//! The published search (Granizo-Hidalgo and Holzschuch 2024, section 3.4). It follows the curve from the straight line
//! to the light, from triangle to triangle, to the first path. Wrong printed equations are corrected
//! (`docs/integrators.md`).
//!
//! In each triangle the curve enters by one crossing of an edge and leaves by the next along it. If the defect of
//! Snell's law changes its sign between them, bisection leads to the path. If not, the walk continues behind the
//! second. It finds one path at most, and none on other curves. It finds none if an even number of paths lies between
//! two crossings. It ends at a triangle whose places are all coplanar with both ends, or whose curve is too close to a
//! pair of lines.

use std::collections::BTreeSet;

use arrayvec::ArrayVec;
use glam::{DMat3, DVec2, DVec3, Vec3Swizzles};
use smallvec::SmallVec;

use super::{
    curve::{Arc, MOST_ARCS, arcs_within, quadratic_form, value},
    ends::Ends,
    facet::Facet,
    neighbours::Neighbours,
};

/// Halvings of the curve between two crossings.
const HALVINGS: usize = 50;

/// Parts of an arc that are looked at for a change of sign where it is half an ellipse within the triangle, and for the
/// place closest to another.
const PARTS: u32 = 32;

/// Steps that close in on that place, each to two thirds.
const CLOSING: usize = 60;

/// How far beside the straight line's place, as a part of the arc, the defect is looked at: there it has no sign.
const BESIDE: f64 = 1e-6;

/// Sine of the angle by which light that arrives misses it.
const ARRIVES: f64 = 1e-9;

/// A corner's weight that is this small at a crossing is none.
const ON_EDGE: f64 = 1e-9;

/// Part of a triangle's edges by which the ends of the curve on two triangles may differ.
const JOINED: f64 = 1e-6;

/// Triangles at a crossing that are remembered without allocating memory.
const USUAL: usize = 8;

/// The curve on a triangle.
#[derive(Clone)]
struct Crossed {
    triangle: u32,
    facet: Facet,
    arcs: ArrayVec<Arc, MOST_ARCS>,
}

/// An arc of the curve on a triangle, and by which of its ends the walk leaves.
struct Exit {
    here: Crossed,
    arc: usize,
    end: usize,
}

/// The first path along the curve from where the straight line to the light meets a triangle, given by the weights of
/// its second and third corner: the path's triangle and weights.
pub(super) fn first_path(
    start: (u32, DVec2),
    facet: impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
    ends: &Ends,
) -> Option<(u32, DVec2)> {
    let (triangle, at) = start;
    let first = facet(triangle);
    let found = |weights| (triangle, weights);
    let straight_on = first.missed(ends, at).is_some_and(|missed| missed.length() < ARRIVES);
    let here = Crossed::new(triangle, first, ends).filter(|_| !straight_on);
    let Some(here) = here else {
        // Light goes straight on, or everything is coplanar: the place itself is the path, if anything here is.
        return first.polished(ends, at).map(found);
    };
    let place = DVec3::new(1.0 - at.element_sum(), at.x, at.y);
    let closest = (0..here.arcs.len()).map(|arc| (here.closest(arc, place), arc));
    let ((_, start), begin) = closest.min_by(|a, b| a.0.0.total_cmp(&b.0.0))?;
    // The defect has two signs on the two sides of the straight line.
    let sides = [(start - BESIDE, 0.0), (start + BESIDE, 1.0)].map(|(from, to)| here.between(begin, from, to, ends));
    let elsewhere = || (0..here.arcs.len()).filter(|&arc| arc != begin).find_map(|arc| here.path_on(arc, ends));
    if let Some(weights) = sides.into_iter().flatten().next().or_else(elsewhere) {
        return Some(found(weights));
    }
    // First towards where less of the law is missing, then the other way.
    let [at_start, at_end] = [0.0, 1.0].map(|t| here.defect(begin, t, ends).map_or(f64::INFINITY, f64::abs));
    let order = if at_start <= at_end { [0, 1] } else { [1, 0] };
    order
        .into_iter()
        .find_map(|end| along_curve(Exit { here: here.clone(), arc: begin, end }, &facet, neighbours, ends))
}

/// The first path along the curve behind a triangle.
fn along_curve(
    mut exit: Exit,
    facet: &impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
    ends: &Ends,
) -> Option<(u32, DVec2)> {
    // No arc is followed twice, so that the walk ends.
    let mut visited = BTreeSet::new();
    loop {
        visited.insert((exit.here.triangle, exit.arc));
        exit = next(&exit, &visited, facet, neighbours, ends)?;
        if let Some(weights) = exit.here.path_on(exit.arc, ends) {
            return Some((exit.here.triangle, weights));
        }
    }
}

/// The arc that the curve goes on with behind a crossing; `None` at the border of the mesh, and where a closed curve
/// has been followed back to its start.
fn next(
    exit: &Exit,
    visited: &BTreeSet<(u32, usize)>,
    facet: &impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
    ends: &Ends,
) -> Option<Exit> {
    let Exit { here, arc, end } = exit;
    let weights = here.end(*arc, *end);
    let place = here.place(weights);
    let close = JOINED * here.facet.corners.map(|corner| (corner - place).length()).into_iter().fold(0.0, f64::max);
    let mut best: Option<(f64, Exit)> = None;
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
            best = Some((distance, Exit { here: other, arc, end: 1 - end }));
        }
    }
    best.map(|(_, exit)| exit)
}

/// The triangles that a crossing leads to: that across its edge, or at a corner all others around it.
fn behind(
    here: &Crossed,
    weights: DVec3,
    facet: &impl Fn(u32) -> Facet,
    neighbours: &Neighbours,
) -> SmallVec<[u32; USUAL]> {
    let is_none = [0, 1, 2].map(|corner: usize| weights[corner] < ON_EDGE);
    let Some(corner) = (0..3).find(|corner| is_none[(corner + 1) % 3] && is_none[(corner + 2) % 3]) else {
        let across = |corner: usize| neighbours.across(here.triangle, (corner + 1) % 3);
        return (0..3).find(|&corner| is_none[corner]).and_then(across).into_iter().collect();
    };
    let corner = here.facet.corners[corner];
    let mut around: SmallVec<[u32; USUAL]> = SmallVec::from_slice(&[here.triangle]);
    let mut looked_at = 0;
    while let Some(&triangle) = around.get(looked_at) {
        looked_at += 1;
        let corners = facet(triangle).corners;
        for edge in 0..3 {
            let touches = corners[edge] == corner || corners[(edge + 1) % 3] == corner;
            let next = neighbours.across(triangle, edge).filter(|next| touches && !around.contains(next));
            around.extend(next);
        }
    }
    around.remove(0);
    around
}

impl Crossed {
    /// `None` where all places of the triangle are coplanar with both ends.
    fn new(triangle: u32, facet: Facet, ends: &Ends) -> Option<Self> {
        let columns = |corners: &[DVec3; 3]| DMat3::from_cols(corners[0], corners[1], corners[2]);
        let form = quadratic_form(&columns(&facet.corners), &columns(&facet.normals), ends)?;
        Some(Self { triangle, facet, arcs: arcs_within(&form).unwrap_or_default() })
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

    /// The place of an arc that is closest to another: the distance between their weights, squared, and how far along
    /// the arc it is.
    fn closest(&self, arc: usize, place: DVec3) -> (f64, f64) {
        let distance = |t: f64| (self.weights(arc, t) - place).length_squared();
        let part = |number: u32| f64::from(number) / f64::from(PARTS);
        let parts = (0..=PARTS).map(part);
        let middle = parts.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(0.0);
        let (mut low, mut high) = ((middle - part(1)).max(0.0), (middle + part(1)).min(1.0));
        for _ in 0..CLOSING {
            let third = (high - low) / 3.0;
            if distance(low + third) <= distance(high - third) { high -= third } else { low += third }
        }
        let t = 0.5 * (low + high);
        (distance(t), t)
    }

    fn defect(&self, arc: usize, t: f64, ends: &Ends) -> Option<f64> {
        self.facet.defect(ends, self.weights(arc, t).yz())
    }

    /// The path on an arc, if the defect has two signs at its ends; on half an ellipse, at the ends of any of its
    /// parts.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        light::Source,
        specular::{
            conic::{certified::Problem, curve::straight_through, degenerate::any_facet, testing::WATER},
            testing::{between, random},
        },
    };

    /// Where an arc may be cut so that the defect has a sign all along each piece but for paths: at the straight line's
    /// place.
    fn pieces(here: &Crossed, arc: usize, straight: Option<DVec2>) -> Vec<(f64, f64)> {
        let close = straight.map(|at| here.closest(arc, DVec3::new(1.0 - at.element_sum(), at.x, at.y)));
        match close {
            Some((distance, t)) if distance < 1e-16 => vec![(0.0, t - BESIDE), (t + BESIDE, 1.0)],
            _ => vec![(0.0, 1.0)],
        }
    }

    #[test]
    fn an_arc_holds_an_odd_number_of_paths_where_the_defect_has_two_signs_at_its_ends() {
        let mut random = random(51);
        let (mut odd, mut even, mut several, mut ellipses, mut crossed) = (0, 0, 0, 0, 0);
        for _ in 0..50_000 {
            let facet = any_facet(&mut random, 0.8);
            let mut end = |height: f64| {
                DVec3::new(
                    between(&mut random, -1.0, 1.0),
                    between(&mut random, -1.0, 1.0),
                    height * between(&mut random, 0.5, 2.0),
                )
            };
            let ends = Ends::refracted(end(-1.0), Source::Point(end(1.5)), WATER, false);
            let Some(here) = Crossed::new(0, facet, &ends) else { continue };
            let Some(found) = Problem::new(&facet, &ends).paths() else { continue };
            let mut certain: Vec<DVec2> = Vec::new();
            for weights in found {
                if certain.iter().all(|known| known.distance(weights) > 1e-8) {
                    certain.push(weights);
                }
            }
            let straight = straight_through(&facet, &ends);
            crossed += usize::from(here.arcs.len() > 1);
            ellipses += usize::from(here.arcs.len() == 2 && here.end(0, 0).min_element() > 1e-3);
            for arc in 0..here.arcs.len() {
                for (from, to) in pieces(&here, arc, straight) {
                    let at = |k: u32| from + (to - from) * f64::from(k) / 64.0;
                    // Where light is totally reflected, or an end is behind the surface, there is no sign.
                    let is_whole = (0..=64).all(|k| {
                        let weights = here.weights(arc, at(k)).yz();
                        let sides = facet.normal(weights).dot(ends.point - facet.place(weights)) < 0.0
                            && facet.normal(weights).dot(ends.light - facet.place(weights)) > 0.0;
                        sides && here.defect(arc, at(k), &ends).is_some()
                    });
                    let on_it = |weights: &&DVec2| {
                        let place = DVec3::new(1.0 - weights.element_sum(), weights.x, weights.y);
                        let (distance, t) = here.closest(arc, place);
                        distance < 1e-14 && t > from && t < to
                    };
                    let [first, last] = [from, to].map(|t| here.defect(arc, t, &ends));
                    let (true, Some(first), Some(last)) = (is_whole, first, last) else { continue };
                    // At the end of an arc the next one may hold the path.
                    if first.abs().min(last.abs()) < 1e-7 {
                        continue;
                    }
                    let paths = certain.iter().filter(on_it).count();
                    let changes = first * last < 0.0;
                    assert_eq!(paths % 2 == 1, changes, "{paths} paths from {from} to {to} on {facet:?}, {ends:?}");
                    odd += usize::from(changes);
                    even += usize::from(!changes);
                    several += usize::from(paths > 1);
                }
            }
        }
        println!("{odd} odd, {even} even, {several} several, {ellipses} ellipses, {crossed} with more arcs than one");
        assert!(odd > 750 && even > 750 && several > 0 && ellipses > 25 && crossed > 125);
    }
}
