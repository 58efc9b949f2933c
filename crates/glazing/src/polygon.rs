//! Simple polygons, counterclockwise, as lists of corners.

use glam::DVec2;

/// Signed area: positive for counterclockwise polygons.
pub fn area(corners: &[DVec2]) -> f64 {
    let Some(&origin) = corners.first() else { return 0.0 };
    0.5 * edges(corners).map(|[from, to]| (from - origin).perp_dot(to - origin)).sum::<f64>()
}

/// The edges, each from a corner to the next.
pub(crate) fn edges(corners: &[DVec2]) -> impl Iterator<Item = [DVec2; 2]> + '_ {
    corners.iter().zip(corners.iter().cycle().skip(1)).map(|(&from, &to)| [from, to])
}

/// The lower left and upper right corner of the bounding box.
pub(crate) fn bounds(corners: &[DVec2]) -> [DVec2; 2] {
    let start = [DVec2::INFINITY, DVec2::NEG_INFINITY];
    corners.iter().fold(start, |[low, high], &corner| [low.min(corner), high.max(corner)])
}

/// Whether a point lies inside, by the even-odd rule.
pub(crate) fn contains(corners: &[DVec2], point: DVec2) -> bool {
    let crosses = |[from, to]: [DVec2; 2]| {
        (from.y > point.y) != (to.y > point.y)
            && point.x < from.x + (to.x - from.x) * ((point.y - from.y) / (to.y - from.y))
    };
    edges(corners).filter(|&edge| crosses(edge)).count() % 2 == 1
}

/// The distance of a point from the nearest edge.
pub(crate) fn distance_to_border(corners: &[DVec2], point: DVec2) -> f64 {
    edges(corners).map(|[from, to]| nearest(from, to, point).distance(point)).fold(f64::INFINITY, f64::min)
}

/// The point of a segment that is nearest to a point.
pub(crate) fn nearest(from: DVec2, to: DVec2, point: DVec2) -> DVec2 {
    let along = to - from;
    let part = ((point - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    if part.is_nan() { from } else { from + along * part }
}

/// A point inside a simple polygon, away from its edges where possible.
pub(crate) fn inner_point(corners: &[DVec2]) -> DVec2 {
    let [low, high] = bounds(corners);
    // Halfway between two heights of corners, so that no corner lies on the line.
    let middle = 0.5 * (low.y + high.y);
    let below = corners.iter().map(|corner| corner.y).filter(|&y| y <= middle).fold(low.y, f64::max);
    let above = corners.iter().map(|corner| corner.y).filter(|&y| y > middle).fold(high.y, f64::min);
    let y = 0.5 * (below + above);
    let crossings = crossings(corners, DVec2::new(0.0, y), DVec2::X);
    let widest = (crossings.chunks_exact(2))
        .max_by(|first, second| (first[1] - first[0]).total_cmp(&(second[1] - second[0])))
        .map(|span| DVec2::new(0.5 * (span[0] + span[1]), y));
    widest.unwrap_or(0.5 * (low + high))
}

/// Where a line enters and leaves a polygon, as multiples of its direction, in order.
pub(crate) fn crossings(corners: &[DVec2], through: DVec2, direction: DVec2) -> Vec<f64> {
    let normal = direction.perp();
    let side = |corner: DVec2| normal.dot(corner - through);
    let mut found: Vec<f64> = edges(corners)
        .filter(|&[from, to]| (side(from) > 0.0) != (side(to) > 0.0))
        .map(|[from, to]| {
            let (before, after) = (side(from), side(to));
            let at = from + (to - from) * (before / (before - after));
            direction.dot(at - through) / direction.length_squared()
        })
        .collect();
    found.sort_unstable_by(f64::total_cmp);
    found
}

/// The parts of a segment that lie inside a polygon.
pub(crate) fn clip_segment(corners: &[DVec2], from: DVec2, to: DVec2) -> Vec<[DVec2; 2]> {
    let direction = to - from;
    let at = |part: f64| {
        if part <= 0.0 {
            from
        } else if part >= 1.0 {
            to
        } else {
            from + direction * part
        }
    };
    (crossings(corners, from, direction).chunks_exact(2))
        .filter(|span| span[1] > 0.0 && span[0] < 1.0)
        .map(|span| [at(span[0]), at(span[1])])
        .collect()
}

/// The parts of a segment that lie outside of a polygon.
pub(crate) fn clip_segment_outside(corners: &[DVec2], from: DVec2, to: DVec2) -> Vec<[DVec2; 2]> {
    let mut start = from;
    let mut outside = Vec::new();
    for [enters, leaves] in clip_segment(corners, from, to) {
        outside.push([start, enters]);
        start = leaves;
    }
    outside.push([start, to]);
    outside.retain(|[start, end]| start != end);
    outside
}

/// Segments that follow each other, as polylines.
pub(crate) fn joined(segments: impl IntoIterator<Item = [DVec2; 2]>) -> Vec<Vec<DVec2>> {
    let mut lines: Vec<Vec<DVec2>> = Vec::new();
    for [from, to] in segments {
        match lines.last_mut() {
            Some(line) if line.last() == Some(&from) => line.push(to),
            _ => lines.push(vec![from, to]),
        }
    }
    lines
}

/// The part of a polygon to the left of the line through a point along a direction.
pub(crate) fn clip_half_plane(corners: &[DVec2], through: DVec2, direction: DVec2) -> Vec<DVec2> {
    let side = |corner: DVec2| direction.perp_dot(corner - through);
    let mut clipped = Vec::with_capacity(corners.len() + 1);
    for [from, to] in edges(corners) {
        let (before, after) = (side(from), side(to));
        if before >= 0.0 {
            clipped.push(from);
        }
        if before > 0.0 && after < 0.0 || before < 0.0 && after > 0.0 {
            clipped.push(from + (to - from) * (before / (before - after)));
        }
    }
    clipped
}

/// The corners of the convex hull of points, counterclockwise, without those on straight edges.
pub fn convex_hull(points: &[DVec2]) -> Vec<DVec2> {
    let corners: Vec<DVec2> = hull(points).into_iter().map(|index| points[index]).collect();
    let size = corners.iter().fold(0.0, |size: f64, corner| size.max(corner.distance(corners[0])));
    cleaned(&corners, 1e-9 * size)
}

/// A convex polygon without the strip of a width along its edges; empty where nothing is left.
pub fn inset_convex(corners: &[DVec2], width: f64) -> Vec<DVec2> {
    let mut inset = corners.to_vec();
    for [from, to] in edges(corners) {
        let direction = (to - from).normalize_or_zero();
        inset = clip_half_plane(&inset, from + direction.perp() * width, direction);
    }
    cleaned(&inset, 1e-9)
}

/// Whether a simple polygon turns left at every corner.
pub(crate) fn is_convex(corners: &[DVec2]) -> bool {
    corners.len() >= 3 && (0..corners.len()).all(|index| bulge(corners, index) > 0.0)
}

/// How far a corner lies outside of the line from the corner before it to the one after it.
pub(crate) fn bulge(corners: &[DVec2], index: usize) -> f64 {
    let count = corners.len();
    let (before, at, after) = (corners[(index + count - 1) % count], corners[index], corners[(index + 1) % count]);
    let chord = after - before;
    let cross = (at - before).perp_dot(after - at);
    let length = chord.length();
    if length > 0.0 { cross / length } else { 0.0 }
}

/// Without corners that deviate from the line of their neighbours by no more than a distance, and without spikes.
pub(crate) fn cleaned(corners: &[DVec2], distance: f64) -> Vec<DVec2> {
    let mut kept = corners.to_vec();
    let mut index = 0;
    let mut passed = 0;
    while kept.len() >= 3 && passed < kept.len() {
        let at = index % kept.len();
        let (before, after) = (kept[(at + kept.len() - 1) % kept.len()], kept[(at + 1) % kept.len()]);
        let is_spike = before.distance(after) <= distance || kept[at].distance(after) <= distance;
        if is_spike || bulge(&kept, at).abs() <= distance {
            kept.remove(at);
            // The neighbours may have become straight.
            index = (at + kept.len()).saturating_sub(1) % kept.len().max(1);
            passed = 0;
        } else {
            index = at + 1;
            passed += 1;
        }
    }
    if kept.len() < 3 { Vec::new() } else { kept }
}

/// The convex hull, as indices into a list of points, counterclockwise.
pub(crate) fn hull(points: &[DVec2]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_unstable_by(|&a, &b| {
        points[a].x.total_cmp(&points[b].x).then(points[a].y.total_cmp(&points[b].y)).then(a.cmp(&b))
    });
    let mut hull: Vec<usize> = Vec::new();
    for half in [order.clone(), order.into_iter().rev().collect()] {
        let start = hull.len();
        for point in half {
            while let [.., first, second] = hull[start..]
                && (points[second] - points[first]).perp_dot(points[point] - points[second]) <= 0.0
            {
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop();
    }
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Vec<DVec2> {
        [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(DVec2::from).to_vec()
    }

    #[test]
    fn a_square_has_its_area_its_inside_and_its_inset() {
        assert_eq!(area(&square()), 4.0);
        assert!(contains(&square(), DVec2::splat(0.1)) && !contains(&square(), DVec2::splat(2.1)));
        assert_eq!(distance_to_border(&square(), DVec2::new(0.5, 1.0)), 0.5);
        assert_eq!(area(&inset_convex(&square(), 0.25)), 2.25);
        assert!(inset_convex(&square(), 1.25).is_empty());
        assert_eq!(hull(&square()).len(), 4);
    }

    #[test]
    fn a_segment_is_clipped_to_each_part_inside() {
        let notched: Vec<DVec2> =
            [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 0.5], [0.0, 2.0]].map(DVec2::from).to_vec();
        let parts = clip_segment(&notched, DVec2::new(-1.0, 1.0), DVec2::new(3.5, 1.0));
        assert_eq!(parts.len(), 2);
        assert!(parts[0][0].distance(DVec2::new(0.0, 1.0)) < 1e-12 && parts[1][1] == DVec2::new(3.5, 1.0));
        assert!(contains(&notched, inner_point(&notched)));
    }

    #[test]
    fn cleaning_drops_spikes_and_straight_corners() {
        let dirty = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [3.0, 2.0], [2.0, 2.0], [0.0, 2.0]];
        assert_eq!(cleaned(&dirty.map(DVec2::from), 1e-9).len(), 4);
    }
}
