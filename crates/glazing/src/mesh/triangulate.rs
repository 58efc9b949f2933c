//! Polygons with holes as triangles, by ears. Every corner is kept, so that meshes that share the corners are closed.

use glam::DVec2;

/// The triangles of a polygon with holes, all counterclockwise, as numbers of corners: those of the polygon first, then
/// those of each hole.
pub(super) fn triangulate(outline: &[DVec2], holes: &[&[DVec2]]) -> Vec<[u32; 3]> {
    let corners: Vec<DVec2> = outline.iter().chain(holes.iter().copied().flatten()).copied().collect();
    let mut ring: Vec<usize> = (0..outline.len()).collect();
    let mut start = outline.len();
    let mut open: Vec<Vec<usize>> = Vec::new();
    for hole in holes {
        // Holes run clockwise, and start with their rightmost corner.
        let mut numbers: Vec<usize> = (start..start + hole.len()).rev().collect();
        let rightmost = (0..numbers.len()).max_by(|&a, &b| by_x(corners[numbers[a]], corners[numbers[b]])).unwrap_or(0);
        numbers.rotate_left(rightmost);
        start += hole.len();
        open.push(numbers);
    }
    open.retain(|hole| !hole.is_empty());
    open.sort_by(|first, second| by_x(corners[second[0]], corners[first[0]]));
    for hole in open {
        join(&corners, &mut ring, &hole);
    }
    ears(&corners, ring)
}

fn by_x(first: DVec2, second: DVec2) -> std::cmp::Ordering {
    first.x.total_cmp(&second.x).then(first.y.total_cmp(&second.y))
}

fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - b)
}

/// Joins a hole to a ring by an edge that is there twice: from the hole's rightmost corner to one that it sees.
fn join(corners: &[DVec2], ring: &mut Vec<usize>, hole: &[usize]) {
    let from = corners[hole[0]];
    let count = ring.len();
    // Every other corner is tried, the nearest first, until one is seen.
    let mut order: Vec<usize> = (0..count).filter(|&index| corners[ring[index]].x >= from.x).collect();
    order.sort_by(|&a, &b| {
        let distance = |index: usize| corners[ring[index]].distance_squared(from);
        distance(a).total_cmp(&distance(b)).then(a.cmp(&b))
    });
    let is_seen = |&index: &usize| {
        let to = corners[ring[index]];
        let (before, after) = (corners[ring[(index + count - 1) % count]], corners[ring[(index + 1) % count]]);
        let opens = if turn(before, to, after) > 0.0 {
            turn(before, to, from) > 0.0 && turn(from, to, after) > 0.0
        } else {
            turn(before, to, from) > 0.0 || turn(from, to, after) > 0.0
        };
        opens
            && (0..count).all(|edge| {
                let (a, b) = (corners[ring[edge]], corners[ring[(edge + 1) % count]]);
                if a == to || b == to {
                    return true;
                }
                let sides = |a: DVec2, b: DVec2, from: DVec2, to: DVec2| {
                    let (first, second) = ((b - a).perp_dot(from - a), (b - a).perp_dot(to - a));
                    first > 0.0 && second > 0.0 || first < 0.0 && second < 0.0
                };
                sides(a, b, from, to) || sides(from, to, a, b)
            })
    };
    let index = order.iter().copied().find(|index| is_seen(index)).or(order.first().copied()).unwrap_or(0);
    let bridge = [ring[index], hole[0]];
    let inserted = hole.iter().copied().chain([bridge[1], bridge[0]]);
    let rest = ring.split_off(index + 1);
    ring.extend(inserted);
    ring.extend(rest);
}

/// Cuts the ears of a ring.
fn ears(corners: &[DVec2], ring: Vec<usize>) -> Vec<[u32; 3]> {
    let count = ring.len();
    let mut next: Vec<usize> = (1..count).chain([0]).collect();
    let mut previous: Vec<usize> = [count.saturating_sub(1)].into_iter().chain(0..count.saturating_sub(1)).collect();
    let at = |index: usize| corners[ring[index]];
    let is_hollow = |previous: usize, index: usize, next: usize| turn(at(previous), at(index), at(next)) <= 0.0;
    let mut hollow: Vec<usize> = (0..count).filter(|&index| is_hollow(previous[index], index, next[index])).collect();
    let mut triangles = Vec::with_capacity(count);
    let (mut left, mut index, mut passed) = (count, 0, 0);
    while left > 3 {
        let (before, after) = (previous[index], next[index]);
        let (a, b, c) = (at(before), at(index), at(after));
        let is_ear = || {
            turn(a, b, c) > 0.0
                && !hollow.iter().any(|&other| {
                    let point = at(other);
                    other != before
                        && other != after
                        && ![a, b, c].contains(&point)
                        && turn(a, b, point) >= 0.0
                        && turn(b, c, point) >= 0.0
                        && turn(c, a, point) >= 0.0
                })
        };
        // Rounding may leave straight corners only: then any is cut.
        if passed <= left && !is_ear() {
            passed += 1;
            index = after;
            continue;
        }
        triangles.push([before, index, after].map(|corner| ring[corner] as u32));
        (next[before], previous[after]) = (after, before);
        left -= 1;
        passed = 0;
        hollow.retain(|&other| {
            other != index && (other != before && other != after || is_hollow(previous[other], other, next[other]))
        });
        // The next ear is cut elsewhere, which makes rounder triangles.
        index = next[after];
    }
    if left == 3 {
        triangles.push([previous[index], index, next[index]].map(|corner| ring[corner] as u32));
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon;

    #[test]
    fn triangles_cover_a_polygon_with_holes_in_line() {
        let square = |x: f64, y: f64, size: f64| {
            [[x, y], [x + size, y], [x + size, y + size], [x, y + size]].map(DVec2::from).to_vec()
        };
        let outline = square(0.0, 0.0, 10.0);
        let holes: Vec<Vec<DVec2>> =
            [1.0, 4.0, 7.0].into_iter().flat_map(|x| [1.0, 4.0, 7.0].map(|y| square(x, y, 2.0))).collect();
        let holes: Vec<&[DVec2]> = holes.iter().map(Vec::as_slice).collect();
        let corners: Vec<DVec2> = outline.iter().chain(holes.iter().copied().flatten()).copied().collect();
        let triangles = triangulate(&outline, &holes);
        assert_eq!(triangles.len(), corners.len() + 2 * holes.len() - 2);
        let area: f64 = triangles
            .iter()
            .map(|triangle| {
                let area = polygon::area(&triangle.map(|corner| corners[corner as usize]));
                assert!(area > 0.0);
                area
            })
            .sum();
        assert!((area - (100.0 - 9.0 * 4.0)).abs() < 1e-9);
    }
}
