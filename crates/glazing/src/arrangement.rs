//! The planar arrangement of lines in a light: its vertices, its edges and the faces between them.
//!
//! Ends and crossings nearer to each other than a tolerance become one vertex. So neighbours share corners exactly, and
//! lines that meet by design leave no slivers. Lines with a loose end are dropped up to their last crossing.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use glam::DVec2;

use crate::filling::MAX_PIECES;
use crate::grid::{SegmentTree, VertexGrid, near_pairs};
use crate::polygon;

/// An edge between two vertices, and the line that it is a part of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edge {
    pub(crate) ends: [usize; 2],
    pub(crate) line: usize,
}

/// The arrangement of lines.
#[derive(Debug)]
pub(crate) struct Arrangement {
    pub(crate) vertices: Vec<DVec2>,
    /// In the order and along the direction of their lines.
    pub(crate) edges: Vec<Edge>,
    /// The vertices around each bounded face, counterclockwise.
    pub(crate) faces: Vec<Vec<usize>>,
    /// The vertices around each connected part of the edges, clockwise.
    pub(crate) rims: Vec<Vec<usize>>,
}

impl Arrangement {
    /// The arrangement of polylines. Where two of them run along each other, the edge belongs to the first. `None`
    /// where they meet more often than those of a window do.
    pub(crate) fn new(lines: &[Vec<DVec2>], tolerance: f64) -> Option<Self> {
        let mut vertices = VertexGrid::new(tolerance);
        let mut segments = Vec::new();
        for (line, points) in lines.iter().enumerate() {
            let ends: Vec<usize> = points.iter().map(|&point| vertices.insert(point)).collect();
            segments.extend(
                ends.windows(2).filter(|pair| pair[0] != pair[1]).map(|pair| Edge { ends: [pair[0], pair[1]], line }),
            );
        }
        let splits = splits(&segments, &mut vertices, tolerance)?;
        let vertices = vertices.into_points();
        let edges = without_loose_ends(edges(&segments, splits, &vertices), vertices.len());
        let (faces, rims) = walks(&edges, &vertices);
        Some(Self { vertices, edges, faces, rims })
    }

    /// The corners of a face or a rim.
    pub(crate) fn corners(&self, walk: &[usize]) -> Vec<DVec2> {
        walk.iter().map(|&vertex| self.vertices[vertex]).collect()
    }

    /// Lines that tie each part that touches no other to what is around it, on four sides. No piece of glass has a
    /// hole. Empty where all parts are connected.
    pub(crate) fn ties(&self) -> Vec<Vec<DVec2>> {
        // The outermost part has the first line.
        let outermost = self.edges.first().map(|edge| edge.ends[0]);
        let ends = |edge: &Edge| edge.ends.map(|end| self.vertices[end]);
        let tree = SegmentTree::new(&self.edges.iter().map(ends).collect::<Vec<_>>(), 0.0);
        let mut ties = Vec::new();
        for rim in self.rims.iter().filter(|rim| outermost.is_none_or(|vertex| !rim.contains(&vertex))) {
            for direction in [DVec2::NEG_X, DVec2::X, DVec2::NEG_Y, DVec2::Y] {
                let along = |vertex: usize| self.vertices[vertex].dot(direction);
                let Some(&vertex) = rim.iter().max_by(|a, b| along(**a).total_cmp(&along(**b))) else { continue };
                let from = self.vertices[vertex];
                let reach = (tree.near([from, from + direction * FARTHEST], 0.0))
                    .map(|edge| &self.edges[edge])
                    .filter(|edge| !edge.ends.contains(&vertex))
                    .filter_map(|edge| reach(from, direction, ends(edge)))
                    .fold(f64::INFINITY, f64::min);
                if reach.is_finite() {
                    ties.push(vec![from, from + direction * reach]);
                }
            }
        }
        ties
    }
}

/// Longer than any window, metres.
const FARTHEST: f64 = 1e4;

/// How far a ray along an axis runs until it meets a segment.
fn reach(from: DVec2, direction: DVec2, [start, end]: [DVec2; 2]) -> Option<f64> {
    let aside = |point: DVec2| direction.perp_dot(point - from);
    let (before, after) = (aside(start), aside(end));
    ((before > 0.0) != (after > 0.0))
        .then(|| direction.dot(start + (end - start) * (before / (before - after)) - from))
        .filter(|&reach| reach > 0.0)
}

/// Segments at a smaller angle run along each other: they meet in ends only, radians.
const PARALLEL: f64 = 1e-9;

/// Most vertices on segments.
const MAX_SPLITS: usize = 10 * MAX_PIECES;

/// The vertices on each segment, besides its ends, with the part of its length at which they lie; `None` where there
/// are too many.
fn splits(segments: &[Edge], vertices: &mut VertexGrid, tolerance: f64) -> Option<Vec<Vec<(f64, usize)>>> {
    let mut splits = vec![Vec::new(); segments.len()];
    let mut count = 0;
    let ends = |index: usize, vertices: &VertexGrid| segments[index].ends.map(|end| vertices.point(end));
    let all: Vec<[DVec2; 2]> = (0..segments.len()).map(|index| ends(index, vertices)).collect();
    let is_complete = near_pairs(&all, tolerance, |[first, second]| {
        let ([a, b], [c, d]) = (all[first], all[second]);
        let mut split = |on: usize, place: f64, vertex: usize| {
            splits[on].push((place, vertex));
            count += 1;
        };
        // Ends on the other segment. Segments along each other meet in nothing else.
        for (on, [from, to], of) in [(first, [a, b], second), (second, [c, d], first)] {
            for end in segments[of].ends.into_iter().filter(|end| !segments[on].ends.contains(end)) {
                let point = vertices.point(end);
                let foot = polygon::nearest(from, to, point);
                if foot.distance(point) <= tolerance {
                    split(on, (foot - from).length(), end);
                }
            }
        }
        let shares_end = segments[first].ends.iter().any(|end| segments[second].ends.contains(end));
        let (along, across) = (b - a, d - c);
        let cross = along.perp_dot(across);
        let at = (c - a).perp_dot(across) / cross;
        let at_other = (c - a).perp_dot(along) / cross;
        let is_crossing = cross.abs() > PARALLEL * along.length() * across.length() && !shares_end;
        if is_crossing && (0.0..=1.0).contains(&at) && (0.0..=1.0).contains(&at_other) {
            let point = a + along * at;
            let vertex = vertices.insert(point);
            for (on, from) in [(first, a), (second, c)] {
                if !segments[on].ends.contains(&vertex) {
                    split(on, (point - from).length(), vertex);
                }
            }
        }
        if count > MAX_SPLITS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    is_complete.then_some(splits)
}

/// The edges into which segments are cut. Edges between the same vertices are one, of the first line.
fn edges(segments: &[Edge], splits: Vec<Vec<(f64, usize)>>, vertices: &[DVec2]) -> Vec<Edge> {
    let mut seen = BTreeMap::new();
    let mut edges = Vec::new();
    for (segment, mut on) in segments.iter().zip(splits) {
        let [from, to] = segment.ends;
        on.sort_unstable_by(|first, second| first.0.total_cmp(&second.0).then(first.1.cmp(&second.1)));
        let mut at = from;
        for next in on.into_iter().map(|(_, vertex)| vertex).chain([to]) {
            let ends = [at, next];
            if at == next || seen.contains_key(&[at.min(next), at.max(next)]) || vertices[at] == vertices[next] {
                at = next;
                continue;
            }
            seen.insert([at.min(next), at.max(next)], ());
            edges.push(Edge { ends, line: segment.line });
            at = next;
        }
    }
    edges
}

/// Edges that lie on a cycle or between cycles.
fn without_loose_ends(mut edges: Vec<Edge>, vertices: usize) -> Vec<Edge> {
    let mut degree = vec![0_u32; vertices];
    for end in edges.iter().flat_map(|edge| edge.ends) {
        degree[end] += 1;
    }
    loop {
        let before = edges.len();
        edges.retain(|edge| {
            let is_kept = edge.ends.iter().all(|&end| degree[end] > 1);
            if !is_kept {
                edge.ends.iter().for_each(|&end| degree[end] -= 1);
            }
            is_kept
        });
        if edges.len() == before {
            return edges;
        }
    }
}

/// The faces, counterclockwise, and the rims, clockwise.
fn walks(edges: &[Edge], vertices: &[DVec2]) -> (Vec<Vec<usize>>, Vec<Vec<usize>>) {
    // Half-edge 2 n runs along edge n, and 2 n + 1 against it.
    let origin = |half: usize| edges[half / 2].ends[half % 2];
    let direction = |half: usize| vertices[origin(half ^ 1)] - vertices[origin(half)];
    let mut around: Vec<Vec<usize>> = vec![Vec::new(); vertices.len()];
    for half in 0..2 * edges.len() {
        around[origin(half)].push(half);
    }
    // The half-edge that follows another around the face to its left.
    let mut next = vec![0; 2 * edges.len()];
    for halves in &mut around {
        halves.sort_unstable_by(|&a, &b| by_angle(direction(a), direction(b)).then(a.cmp(&b)));
        for (index, &half) in halves.iter().enumerate() {
            next[half ^ 1] = halves[(index + halves.len() - 1) % halves.len()];
        }
    }
    let mut is_walked = vec![false; next.len()];
    let (mut faces, mut rims) = (Vec::new(), Vec::new());
    for start in 0..next.len() {
        let mut walk = Vec::new();
        let mut half = start;
        while !is_walked[half] {
            is_walked[half] = true;
            walk.push(origin(half));
            half = next[half];
        }
        let corners: Vec<DVec2> = walk.iter().map(|&vertex| vertices[vertex]).collect();
        match polygon::area(&corners) {
            area if area > 0.0 => faces.push(walk),
            area if area < 0.0 => rims.push(walk),
            _ => {}
        }
    }
    (faces, rims)
}

/// Orders directions counterclockwise from the left.
fn by_angle(first: DVec2, second: DVec2) -> std::cmp::Ordering {
    let is_upper = |direction: DVec2| direction.y > 0.0 || direction.y == 0.0 && direction.x > 0.0;
    (is_upper(first).cmp(&is_upper(second))).then_with(|| second.perp_dot(first).total_cmp(&0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(points: &[[f64; 2]]) -> Vec<DVec2> {
        points.iter().map(|&point| DVec2::from(point)).collect()
    }

    fn frame() -> Vec<DVec2> {
        points(&[[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0], [0.0, 0.0]])
    }

    fn area(arrangement: &Arrangement) -> f64 {
        arrangement.faces.iter().map(|face| polygon::area(&arrangement.corners(face))).sum()
    }

    #[test]
    fn lines_cut_a_frame_into_faces_that_cover_it() {
        let lines = [
            frame(),
            points(&[[1.0, 0.0], [1.0, 2.0]]),
            points(&[[0.0, 1.0], [3.0, 1.0]]),
            points(&[[2.0, 1.0], [2.0, 2.0]]),
        ];
        let arrangement = Arrangement::new(&lines, 1e-6).unwrap();
        assert_eq!(arrangement.faces.len(), 5);
        assert!((area(&arrangement) - 6.0).abs() < 1e-12);
        assert_eq!(arrangement.rims.len(), 1);
        assert!(arrangement.ties().is_empty());
    }

    #[test]
    fn three_lines_through_a_point_share_a_vertex() {
        let lines = [
            frame(),
            points(&[[0.0, 0.0], [3.0, 2.0]]),
            points(&[[0.0, 2.0], [3.0, 0.0]]),
            points(&[[1.5 + 1e-9, 0.0], [1.5, 2.0]]),
        ];
        let arrangement = Arrangement::new(&lines, 1e-6).unwrap();
        assert_eq!((arrangement.faces.len(), arrangement.vertices.len()), (6, 7));
    }

    #[test]
    fn loose_ends_are_dropped_and_doubled_lines_are_one() {
        let lines = [
            frame(),
            points(&[[1.0, 0.0], [1.0, 2.0]]),
            points(&[[1.0, 0.5], [1.0, 1.5]]),
            points(&[[0.0, 1.0], [1.7, 1.0]]),
        ];
        let arrangement = Arrangement::new(&lines, 1e-6).unwrap();
        assert_eq!(arrangement.faces.len(), 3);
        let ends: Vec<_> = arrangement
            .edges
            .iter()
            .map(|edge| (edge.ends[0].min(edge.ends[1]), edge.ends[0].max(edge.ends[1])))
            .collect();
        let mut unique = ends.clone();
        unique.sort_unstable();
        unique.dedup();
        assert_eq!(unique.len(), ends.len());
        assert!(arrangement.edges.iter().all(|edge| edge.line != 2));
    }

    #[test]
    fn a_part_that_touches_no_other_is_tied() {
        let island = points(&[[1.0, 1.0], [1.5, 0.6], [2.0, 1.0], [1.5, 1.4], [1.0, 1.0]]);
        let mut lines = vec![frame(), island];
        let ties = Arrangement::new(&lines, 1e-6).unwrap().ties();
        assert_eq!(ties.len(), 4);
        lines.extend(ties);
        let tied = Arrangement::new(&lines, 1e-6).unwrap();
        assert!(tied.ties().is_empty());
        assert_eq!(tied.faces.len(), 5);
        assert!((area(&tied) - 6.0).abs() < 1e-12);
    }
}
