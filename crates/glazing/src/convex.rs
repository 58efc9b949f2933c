//! Convex pieces from any polygon. A shallow hollow is straightened where the strip that this takes lies under the
//! lead. A deeper one is cut by a lead line from its deepest corner, as glaziers do.

use glam::DVec2;

use crate::polygon;

/// A corner that is this little hollow counts as straight, metres.
const STRAIGHT: f64 = 1e-9;

/// Polygons with a greater product of corners and hollow corners are cut rather than straightened.
const MAX_HOLLOW: usize = 4096;

/// Most looks at an edge for the cuts of a window, a few seconds.
const MAX_TESTS: usize = 1 << 27;

/// Counts looks at edges, over all polygons of a window: intricate drawings take time beyond their size.
#[derive(Debug, Default)]
pub(crate) struct CutTests(usize);

/// Most cuts of one polygon.
const MAX_CUTS: usize = 4096;

/// A cut that ends this near to a corner ends in the corner instead, metres.
const MIN_OFFSET: f64 = 0.004;

/// The convex parts of a polygon, and the cuts between them.
#[derive(Debug, Default)]
pub(crate) struct ConvexParts {
    pub(crate) parts: Vec<Vec<DVec2>>,
    pub(crate) cuts: Vec<[DVec2; 2]>,
}

impl ConvexParts {
    /// Cuts a simple, counterclockwise polygon. Strips up to the width `hidden` along its edges may be left out. `None`
    /// where no cut is possible: the polygon touches itself, or is too intricate.
    pub(crate) fn new(corners: &[DVec2], hidden: f64, max_corners: usize, tests: &mut CutTests) -> Option<Self> {
        let mut result = Self::default();
        let mut open = vec![polygon::cleaned(corners, STRAIGHT)];
        while let Some(corners) = open.pop() {
            if corners.is_empty() {
                continue;
            }
            let straightened = straightened(&corners, hidden);
            if let Some(part) = straightened.and_then(|part| with_fewer_corners(part, hidden, max_corners)) {
                result.parts.push(part);
                continue;
            }
            if result.cuts.len() == MAX_CUTS {
                return None;
            }
            let (cut, halves) = cut(&corners, hidden, tests)?;
            result.cuts.push(cut);
            open.extend(halves.map(|half| polygon::cleaned(&half, STRAIGHT)));
        }
        Some(result)
    }
}

/// A convex polygon inside another that leaves out no more than a strip of a width along its edges.
fn straightened(corners: &[DVec2], hidden: f64) -> Option<Vec<DVec2>> {
    let mut part = corners.to_vec();
    // Each step takes a hollow corner away and makes no other.
    for _ in 0..=corners.len() {
        let count = part.len();
        let hollow: Vec<usize> = (0..count).filter(|&index| polygon::bulge(&part, index) < -STRAIGHT).collect();
        if hollow.len() * count > MAX_HOLLOW {
            return None;
        }
        if hollow.is_empty() {
            return (polygon::area(&part) > 0.0).then_some(part);
        }
        let mut best: Option<(f64, DVec2, DVec2)> = None;
        for index in hollow {
            let (before, at, after) = (part[(index + count - 1) % count], part[index], part[(index + 1) % count]);
            let [arriving, leaving] = [at - before, after - at].map(DVec2::normalize_or_zero);
            for direction in [arriving + leaving, arriving, leaving] {
                let direction = direction.normalize_or_zero();
                // Whatever is cut off lies between the line and a border of the polygon as it was.
                let depth = corners.iter().map(|&corner| -direction.perp_dot(corner - at)).fold(0.0, f64::max);
                if depth <= hidden && best.is_none_or(|(least, ..)| depth < least) {
                    best = Some((depth, at, direction));
                }
            }
        }
        let (_, through, direction) = best?;
        part = polygon::cleaned(&polygon::clip_half_plane(&part, through, direction), STRAIGHT);
        if part.is_empty() {
            return None;
        }
    }
    None
}

/// A convex polygon with no more than a number of corners, where the strips that this takes are hidden.
fn with_fewer_corners(mut corners: Vec<DVec2>, hidden: f64, max_corners: usize) -> Option<Vec<DVec2>> {
    if corners.len() <= max_corners {
        return Some(corners);
    }
    let all = corners.clone();
    // Every second corner of a part of the polygon goes until few enough are left.
    let excess = corners.len() - max_corners;
    if excess > corners.len() / 2 {
        return None;
    }
    let step = corners.len() / excess;
    let mut taken = 0;
    let mut index = 0;
    corners.retain(|_| {
        index += 1;
        let goes = taken < excess && index % step == 0;
        taken += usize::from(goes);
        !goes
    });
    let depth = (all.iter())
        .map(
            |&corner| {
                if polygon::contains(&corners, corner) { 0.0 } else { polygon::distance_to_border(&corners, corner) }
            },
        )
        .fold(0.0, f64::max);
    (depth <= hidden).then_some(corners)
}

/// Cuts a polygon in two at its deepest hollow, or across where it has none.
fn cut(corners: &[DVec2], hidden: f64, tests: &mut CutTests) -> Option<([DVec2; 2], [Vec<DVec2>; 2])> {
    let count = corners.len();
    let start = deepest(corners).unwrap_or(0);
    if polygon::bulge(corners, start) >= 0.0 {
        return split(corners, start, End::Corner(start + count / 2));
    }
    let mut ends = ends(corners, start);
    let length = |end: &End| corners[start].distance(end.point(corners));
    ends.sort_by(|first, second| length(first).total_cmp(&length(second)));
    let mut best: Option<(f64, End)> = None;
    for end in ends {
        let is_better = |cost: f64| best.is_none_or(|(lowest, _)| cost < lowest);
        if !is_better(length(&end) * LEAST_PENALTY) {
            break;
        }
        tests.0 += count;
        if tests.0 > MAX_TESTS {
            return None;
        }
        if is_inside(corners, start, end) {
            let cost = length(&end) * penalty(corners, start, end, hidden);
            if is_better(cost) {
                best = Some((cost, end));
            }
        }
    }
    split(corners, start, best?.1)
}

/// Where a cut from a corner may end.
fn ends(corners: &[DVec2], start: usize) -> Vec<End> {
    let count = corners.len();
    let from = corners[start];
    let aims = aims(corners, start);
    let least = MIN_OFFSET.min(0.05 * polygon::area(corners).sqrt());
    let mut ends = Vec::new();
    for index in 0..count {
        if ![start, (start + 1) % count, (start + count - 1) % count].contains(&index) {
            ends.push(End::Corner(index));
        }
        let next = (index + 1) % count;
        if index != start && next != start {
            let (a, b) = (corners[index], corners[next]);
            let foot = polygon::nearest(a, b, from);
            let hits = aims.into_iter().filter_map(|aim| hit(from, aim, a, b));
            let on_edge = [foot].into_iter().chain(hits).filter(|at| at.distance(a) > least && at.distance(b) > least);
            ends.extend(on_edge.map(|at| End::Edge(index, at)));
        }
    }
    ends
}

/// Directions along which a cut straightens a hollow corner: on along either edge, and halfway between.
fn aims(corners: &[DVec2], index: usize) -> [DVec2; 3] {
    let count = corners.len();
    let (before, at, after) = (corners[(index + count - 1) % count], corners[index], corners[(index + 1) % count]);
    let [on, back] = [at - before, at - after].map(DVec2::normalize_or_zero);
    // At a corner that is nearly straight the halfway direction is the normal.
    let halfway = if (on + back).length() < 1e-3 { on.perp() } else { on + back };
    [on, back, halfway.normalize_or_zero()]
}

/// Where a ray meets a segment.
fn hit(from: DVec2, direction: DVec2, a: DVec2, b: DVec2) -> Option<DVec2> {
    let along = b - a;
    let cross = direction.perp_dot(along);
    let (at, part) = ((a - from).perp_dot(along) / cross, (a - from).perp_dot(direction) / cross);
    (at > 0.0 && (0.0..=1.0).contains(&part)).then(|| a + along * part)
}

/// Where a cut ends.
#[derive(Clone, Copy, Debug)]
enum End {
    Corner(usize),
    /// On the edge from a corner to the next.
    Edge(usize, DVec2),
}

impl End {
    fn point(self, corners: &[DVec2]) -> DVec2 {
        match self {
            Self::Corner(index) => corners[index % corners.len()],
            Self::Edge(_, point) => point,
        }
    }
}

/// The corner that lies deepest inside the convex hull.
fn deepest(corners: &[DVec2]) -> Option<usize> {
    let count = corners.len();
    let mut hull = polygon::hull(corners);
    hull.sort_unstable();
    let mut deepest = None;
    let mut most = STRAIGHT;
    for (&first, &last) in hull.iter().zip(hull.iter().cycle().skip(1)) {
        let (from, to) = (corners[first], corners[last]);
        let mut index = (first + 1) % count;
        while index != last {
            let depth = polygon::nearest(from, to, corners[index]).distance(corners[index]);
            if depth > most && polygon::bulge(corners, index) < 0.0 {
                (deepest, most) = (Some(index), depth);
            }
            index = (index + 1) % count;
        }
    }
    deepest.or_else(|| (0..count).find(|&index| polygon::bulge(corners, index) < -STRAIGHT))
}

/// Whether a cut runs inside the polygon all along.
fn is_inside(corners: &[DVec2], start: usize, end: End) -> bool {
    let (from, to) = (corners[start], end.point(corners));
    let direction = to - from;
    let is_crossed = (0..corners.len()).any(|index| {
        let next = (index + 1) % corners.len();
        let touches = match end {
            End::Corner(corner) => [index, next].contains(&(corner % corners.len())),
            End::Edge(edge, _) => edge == index,
        };
        if touches || [index, next].contains(&start) {
            return false;
        }
        let (a, b) = (corners[index], corners[next]);
        let (side_a, side_b) = (direction.perp_dot(a - from), direction.perp_dot(b - from));
        let along = b - a;
        let (side_from, side_to) = (along.perp_dot(from - a), along.perp_dot(to - a));
        (side_a >= 0.0) != (side_b > 0.0) && (side_from >= 0.0) != (side_to > 0.0)
            || polygon::nearest(from, to, a).distance(a) < STRAIGHT
            || polygon::nearest(from, to, b).distance(b) < STRAIGHT
    });
    let near = |part: f64| polygon::contains(corners, from + direction * part);
    !is_crossed && near(0.5) && near(0.01) && near(0.99)
}

/// The penalty of the best cuts.
const LEAST_PENALTY: f64 = 0.6;

/// Parts at least this round are as good as any: of a disc it is 1, of a square 0.79.
const ROUND: f64 = 0.6;

/// The area of a polygon, as a part of that of a disc with the same perimeter.
fn roundness(corners: &[DVec2]) -> f64 {
    let perimeter: f64 = polygon::edges(corners).map(|[from, to]| from.distance(to)).sum();
    4.0 * std::f64::consts::PI * polygon::area(corners) / (perimeter * perimeter)
}

/// How much worse a cut is than one of its length that leaves no hollow.
fn penalty(corners: &[DVec2], start: usize, end: End, hidden: f64) -> f64 {
    let count = corners.len();
    let to = end.point(corners);
    let stays_hollow = |index: usize, far: DVec2| {
        let (before, at, after) = (corners[(index + count - 1) % count], corners[index], corners[(index + 1) % count]);
        [[before, at, far], [far, at, after]].into_iter().any(|[a, b, c]| (b - a).perp_dot(c - b) < -1e-6)
    };
    let mut penalty = if stays_hollow(start, to) { 3.0 } else { 1.0 };
    if let End::Corner(index) = end {
        let index = index % count;
        let is_hollow = polygon::bulge(corners, index) < -STRAIGHT;
        if is_hollow && !stays_hollow(index, corners[start]) {
            penalty *= LEAST_PENALTY;
        }
        // A cut that grazes an edge leaves a splinter.
        let far = corners[start];
        for neighbour in [(index + 1) % count, (index + count - 1) % count] {
            if polygon::nearest(far, to, corners[neighbour]).distance(corners[neighbour]) < hidden.max(MIN_OFFSET) {
                penalty *= 2.0;
            }
        }
    }
    let Some((_, halves)) = split(corners, start, end) else { return f64::INFINITY };
    // Splinters are worst. The larger half is cut again where it is no good piece.
    let [first, second] = &halves;
    let smaller = if polygon::area(first) < polygon::area(second) { first } else { second };
    let roundest = roundness(smaller).min(ROUND);
    penalty * ROUND / roundest.max(1e-6)
}

/// Both halves of a polygon.
fn split(corners: &[DVec2], start: usize, end: End) -> Option<([DVec2; 2], [Vec<DVec2>; 2])> {
    let count = corners.len();
    let to = end.point(corners);
    let (last, first) = match end {
        End::Corner(index) => (index % count, index % count),
        End::Edge(edge, _) => (edge, (edge + 1) % count),
    };
    let run = |from: usize, to: usize| {
        let length = (to + count - from) % count + 1;
        (0..length).map(move |step| corners[(from + step) % count])
    };
    let mut ahead: Vec<DVec2> = run(start, last).collect();
    let mut behind: Vec<DVec2> = run(first, start).collect();
    if let End::Edge(..) = end {
        ahead.push(to);
        behind.insert(0, to);
    }
    let is_cut = [&ahead, &behind].into_iter().all(|half| half.len() >= 3 && half.len() <= count + 1);
    is_cut.then_some(([corners[start], to], [ahead, behind]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(points: &[[f64; 2]]) -> Vec<DVec2> {
        points.iter().map(|&point| DVec2::from(point)).collect()
    }

    fn check(corners: &[DVec2], hidden: f64) -> ConvexParts {
        let result = ConvexParts::new(corners, hidden, 64, &mut CutTests::default()).unwrap();
        for part in &result.parts {
            assert!(polygon::is_convex(part), "{part:?}");
            assert!(part.len() <= 64);
        }
        if hidden == 0.0 {
            let area: f64 = result.parts.iter().map(|part| polygon::area(part)).sum();
            assert!((area - polygon::area(corners)).abs() < 1e-9);
        }
        result
    }

    #[test]
    fn an_angle_is_cut_at_its_corner() {
        let angle = points(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]]);
        let result = check(&angle, 0.0);
        assert_eq!(result.parts.len(), 2);
        assert_eq!(result.cuts[0][0], DVec2::ONE);
    }

    #[test]
    fn a_shallow_hollow_is_straightened_and_a_deep_one_is_cut() {
        let hollow = |depth: f64| points(&[[0.0, 0.0], [1.0, depth], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        assert_eq!(check(&hollow(0.003), 0.004).cuts.len(), 0);
        assert_eq!(check(&hollow(0.1), 0.004).cuts.len(), 1);
        assert_eq!(check(&hollow(0.1), 0.0).cuts.len(), 1);
    }

    #[test]
    fn stars_and_combs_are_cut() {
        let star: Vec<DVec2> = (0..16)
            .map(|index| {
                let (sine, cosine) = libm::sincos(f64::from(index) * std::f64::consts::TAU / 16.0);
                DVec2::new(cosine, sine) * if index % 2 == 0 { 1.0 } else { 0.5 }
            })
            .collect();
        check(&star, 0.0);
        let mut comb = points(&[[0.0, -1.0], [8.0, -1.0]]);
        for tooth in (0..4).rev() {
            let x = 2.0 * f64::from(tooth);
            comb.extend(points(&[[x + 2.0, 0.0], [x + 2.0, 1.0], [x + 1.0, 1.0], [x + 1.0, 0.0]]));
        }
        comb.push(DVec2::ZERO);
        check(&comb, 0.0);
    }

    #[test]
    fn a_circle_has_few_corners_or_is_cut() {
        let circle: Vec<DVec2> = (0..120)
            .map(|index| DVec2::from(<[f64; 2]>::from(libm::sincos(-f64::from(index) * std::f64::consts::TAU / 120.0))))
            .collect();
        assert!(polygon::area(&circle) > 0.0);
        assert_eq!(check(&circle, 0.004).cuts.len(), 0);
        assert_eq!(check(&circle, 0.0).cuts.len(), 1);
    }
}
