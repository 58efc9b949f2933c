//! What is near: vertices by their place, and pairs of segments.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use glam::DVec2;
use rstar::{AABB, RTree, RTreeObject};

use crate::polygon;

/// Vertices, of which no two lie within a tolerance.
pub(crate) struct VertexGrid {
    tolerance: f64,
    points: Vec<DVec2>,
    cells: BTreeMap<(i64, i64), Vec<usize>>,
}

impl VertexGrid {
    /// An empty grid.
    pub(crate) fn new(tolerance: f64) -> Self {
        Self { tolerance, points: Vec::new(), cells: BTreeMap::new() }
    }

    /// The vertex at a point: the nearest within the tolerance, or a new one.
    pub(crate) fn insert(&mut self, point: DVec2) -> usize {
        let cell = |value: f64| (value / self.tolerance).floor() as i64;
        let (x, y) = (cell(point.x), cell(point.y));
        let mut nearest = None;
        let mut least = self.tolerance;
        for column in x - 1..=x + 1 {
            for (_, vertices) in self.cells.range((column, y - 1)..=(column, y + 1)) {
                for &vertex in vertices {
                    let distance = self.points[vertex].distance(point);
                    if distance <= least {
                        (nearest, least) = (Some(vertex), distance);
                    }
                }
            }
        }
        nearest.unwrap_or_else(|| {
            self.points.push(point);
            self.cells.entry((x, y)).or_default().push(self.points.len() - 1);
            self.points.len() - 1
        })
    }

    /// The place of a vertex.
    pub(crate) fn point(&self, vertex: usize) -> DVec2 {
        self.points[vertex]
    }

    /// The places of all vertices.
    pub(crate) fn into_points(self) -> Vec<DVec2> {
        self.points
    }
}

/// Segments by their bounding boxes.
pub(crate) struct SegmentTree {
    tree: RTree<Numbered>,
}

/// A bounding box with the number of what it holds.
struct Numbered {
    bounds: AABB<[f64; 2]>,
    number: usize,
}

impl RTreeObject for Numbered {
    type Envelope = AABB<[f64; 2]>;

    fn envelope(&self) -> Self::Envelope {
        self.bounds
    }
}

impl SegmentTree {
    /// The tree of segments, each widened by a tolerance.
    pub(crate) fn new(segments: &[[DVec2; 2]], tolerance: f64) -> Self {
        let numbered =
            |(number, &segment): (usize, &[DVec2; 2])| Numbered { bounds: around(segment, tolerance), number };
        Self { tree: RTree::bulk_load(segments.iter().enumerate().map(numbered).collect()) }
    }

    /// The numbers of the segments whose bounding boxes meet that of another one, in no particular order.
    pub(crate) fn near(&self, segment: [DVec2; 2], tolerance: f64) -> impl Iterator<Item = usize> + '_ {
        self.tree.locate_in_envelope_intersecting(around(segment, tolerance)).map(|other| other.number)
    }
}

/// The bounding box of a segment that is widened by a tolerance.
fn around([from, to]: [DVec2; 2], tolerance: f64) -> AABB<[f64; 2]> {
    AABB::from_corners((from.min(to) - tolerance).to_array(), (from.max(to) + tolerance).to_array())
}

/// Most pairs of segments that are looked at, a second or so.
const MAX_PAIRS: usize = 1 << 25;

/// Visits the pairs of segments that may be within a tolerance of each other, the lower number first, in ascending
/// order, as long as `visit` goes on. Says whether it has visited all.
pub(crate) fn near_pairs(
    segments: &[[DVec2; 2]],
    tolerance: f64,
    mut visit: impl FnMut([usize; 2]) -> ControlFlow<()>,
) -> bool {
    let tree = SegmentTree::new(segments, tolerance);
    let mut left = MAX_PAIRS;
    for (first, &segment) in segments.iter().enumerate() {
        let mut near: Vec<usize> = tree.near(segment, tolerance).filter(|&second| second > first).collect();
        if near.len() > left {
            return false;
        }
        left -= near.len();
        near.sort_unstable();
        if near.into_iter().any(|second| visit([first, second]).is_break()) {
            return false;
        }
    }
    true
}

/// A point where a polygon crosses itself.
pub(crate) fn crossing(corners: &[DVec2]) -> Option<DVec2> {
    let segments: Vec<[DVec2; 2]> = polygon::edges(corners).collect();
    let mut found = None;
    near_pairs(&segments, 1e-9, |[first, second]| {
        let ([a, b], [c, d]) = (segments[first], segments[second]);
        let side = |from: DVec2, to: DVec2, point: DVec2| (to - from).perp_dot(point - from);
        if side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0 {
            found = Some(a + (b - a) * ((c - a).perp_dot(d - c) / (b - a).perp_dot(d - c)));
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    });
    found
}
