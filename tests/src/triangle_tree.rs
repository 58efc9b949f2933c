//! A tree of boxes over the triangles of the forward tracer, halved at the middle triangle of the longest edge.

use glam::DVec3;

use crate::traced_scene::TracedTriangle;

/// Triangles in a leaf.
const LEAF: usize = 4;

/// The tree.
#[derive(Clone, Debug, Default)]
pub struct TriangleTree {
    /// The triangles, in the order of the leaves.
    order: Vec<u32>,
    /// From the root, each node before those below it.
    nodes: Vec<Node>,
}

#[derive(Clone, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// Its triangles in the order.
    first: usize,
    count: usize,
    /// The second of the nodes below it; the first one follows it. Zero for a leaf.
    second: usize,
}

impl TriangleTree {
    /// The tree over some triangles.
    pub fn over(triangles: &[TracedTriangle]) -> Self {
        let boxes: Vec<[DVec3; 2]> = triangles
            .iter()
            .map(|TracedTriangle { corner, edge1, edge2, .. }| {
                let corners = [*corner, *corner + *edge1, *corner + *edge2];
                let reach = corners.iter().fold(0.0, |reach: f64, corner| reach.max(corner.abs().max_element()));
                // Rounding of a hit at the border of a box.
                let pad = DVec3::splat(1e-9 * (1.0 + reach));
                let [a, b, c] = corners;
                [a.min(b).min(c) - pad, a.max(b).max(c) + pad]
            })
            .collect();
        let mut tree = Self { order: (0..triangles.len() as u32).collect(), nodes: Vec::new() };
        if !triangles.is_empty() {
            tree.build(&boxes, 0, triangles.len());
        }
        tree
    }

    fn build(&mut self, boxes: &[[DVec3; 2]], first: usize, count: usize) {
        let mine = &mut self.order[first..first + count];
        let around = |[low, high]: [DVec3; 2], triangle: &u32| {
            let [other_low, other_high] = boxes[*triangle as usize];
            [low.min(other_low), high.max(other_high)]
        };
        let [low, high] = mine.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], around);
        let number = self.nodes.len();
        self.nodes.push(Node { low, high, first, count, second: 0 });
        if count <= LEAF {
            return;
        }
        let axis = (high - low).max_position();
        let middle = |triangle: &u32| boxes[*triangle as usize][0][axis] + boxes[*triangle as usize][1][axis];
        mine.sort_by(|a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
        let half = count / 2;
        self.build(boxes, first, half);
        self.nodes[number].second = self.nodes.len();
        self.build(boxes, first + half, count - half);
    }

    /// Shows `meet` the triangles whose boxes a ray may meet within its reach. `meet` answers how far to look on.
    pub fn visit(&self, origin: DVec3, direction: DVec3, mut reach: f64, meet: &mut dyn FnMut(usize) -> f64) {
        let mut waiting = if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(number) = waiting.pop() {
            let node = &self.nodes[number];
            let (a, b) = ((node.low - origin) / direction, (node.high - origin) / direction);
            // Along an axis on which the ray stands still on the border of the box, the quotient is no number.
            let [enter, leave] = (0..3).fold([0.0, reach], |[enter, leave]: [f64; 2], axis| {
                [enter.max(a[axis].min(b[axis])), leave.min(a[axis].max(b[axis]))]
            });
            if enter > leave {
                continue;
            }
            if node.second == 0 {
                for triangle in &self.order[node.first..node.first + node.count] {
                    reach = meet(*triangle as usize);
                }
            } else {
                waiting.push(node.second);
                waiting.push(number + 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn the_nearest_triangle_is_that_of_all() {
        let mut random = Random::new(11, 0);
        let mut place = |scale: f64| DVec3::new(random.uniform(), random.uniform(), random.uniform()) * scale;
        let triangles: Vec<TracedTriangle> = (0..500)
            .map(|_| {
                let (corner, edge1, edge2) = (place(1.0), place(0.2), place(0.2) - 0.1);
                TracedTriangle { corner, edge1, edge2, normal: edge1.cross(edge2).normalize() }
            })
            .collect();
        let tree = TriangleTree::over(&triangles);
        let mut met = 0;
        for number in 0..1000 {
            let mut direction = (place(2.0) - 1.0).normalize();
            if number % 7 == 0 {
                direction = DVec3::Z;
            }
            let origin = place(1.0);
            let distances = triangles.iter().map(|triangle| triangle.intersect(origin, direction, f64::INFINITY));
            let expected = distances.flatten().fold(f64::INFINITY, f64::min);
            let mut nearest = f64::INFINITY;
            tree.visit(origin, direction, f64::INFINITY, &mut |triangle| {
                nearest = triangles[triangle].intersect(origin, direction, nearest).unwrap_or(nearest);
                nearest
            });
            assert_eq!(nearest, expected);
            met += usize::from(nearest.is_finite());
        }
        assert!(met > 300, "{met} rays meet a triangle");
    }
}
