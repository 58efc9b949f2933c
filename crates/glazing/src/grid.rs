//! Grids that find what is near: vertices by their place, and pairs of segments.

use std::collections::BTreeMap;

use glam::DVec2;

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

/// A grid of square cells with the segments that pass through each.
pub(crate) struct Segments {
    /// The row, column and segment of every passage, in order.
    passages: Vec<(i64, i64, usize)>,
}

impl Segments {
    /// The grid of segments, each widened by a tolerance.
    pub(crate) fn new(segments: &[[DVec2; 2]], tolerance: f64) -> Self {
        let corners: Vec<DVec2> = segments.iter().flatten().copied().collect();
        let [low, high] = polygon::bounds(&corners);
        let extent = (high - low).max(DVec2::splat(1e-6));
        // About one cell for each segment.
        let cell = (extent.x * extent.y / (segments.len().max(1) as f64)).sqrt().max(extent.max_element() / 4096.0);
        let index = |value: f64, low: f64| ((value - low) / cell).floor() as i64;
        let mut passages = Vec::new();
        for (segment, &[from, to]) in segments.iter().enumerate() {
            let [lowest, highest] = [from.min(to) - tolerance, from.max(to) + tolerance];
            for column in index(lowest.x, low.x)..=index(highest.x, low.x) {
                // The heights at which the segment passes the column.
                let borders = [column, column + 1].map(|border| low.x + border as f64 * cell);
                let slope = (to.y - from.y) / (to.x - from.x);
                let [first, last] = if slope.is_finite() {
                    let height = |x: f64| from.y + slope * (x.clamp(from.x.min(to.x), from.x.max(to.x)) - from.x);
                    let heights = [height(borders[0] - tolerance), height(borders[1] + tolerance)];
                    [heights[0].min(heights[1]) - tolerance, heights[0].max(heights[1]) + tolerance]
                } else {
                    [lowest.y, highest.y]
                };
                passages.extend((index(first, low.y)..=index(last, low.y)).map(|row| (row, column, segment)));
            }
        }
        passages.sort_unstable();
        Self { passages }
    }

    /// All pairs of segments that share a cell, the lower number first.
    pub(crate) fn near_pairs(&self) -> Vec<[usize; 2]> {
        let mut pairs = Vec::new();
        for cell in self.passages.chunk_by(|first, second| (first.0, first.1) == (second.0, second.1)) {
            for (index, &(.., first)) in cell.iter().enumerate() {
                pairs.extend(cell[index + 1..].iter().map(|&(.., second)| [first, second]));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }
}

/// A point where a polygon crosses itself.
pub(crate) fn crossing(corners: &[DVec2]) -> Option<DVec2> {
    let segments: Vec<[DVec2; 2]> = polygon::edges(corners).collect();
    let crosses = |[first, second]: [usize; 2]| {
        let ([a, b], [c, d]) = (segments[first], segments[second]);
        let side = |from: DVec2, to: DVec2, point: DVec2| (to - from).perp_dot(point - from);
        let is_crossed = side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0;
        is_crossed.then(|| a + (b - a) * ((c - a).perp_dot(d - c) / (b - a).perp_dot(d - c)))
    };
    Segments::new(&segments, 1e-9).near_pairs().into_iter().find_map(crosses)
}
