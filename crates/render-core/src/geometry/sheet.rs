//! Triangles that cover a convex region of a plane once, like the surface of water, and which rays therefore meet them
//! once at the most.
//!
//! Consider triangles that all turn the same way, seen along an axis. They cover each place as often as their border
//! winds around it. Edges that two triangles share in opposite directions cancel, and the rest is the border. If the
//! border is one convex polygon, gone around once, the triangles are the graph of a function over it. Then a line that
//! is steeper than the steepest triangle meets them once. This is the mean value theorem along the line's shadow, which
//! lies in the polygon.

use std::f64::consts::PI;
use std::ops::Range;

use glam::{DVec2, DVec3};

/// What is known of such triangles.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    /// Their numbers in the scene.
    triangles: Range<u32>,
    /// The axis along which they cover each place once.
    axis: usize,
    /// Their steepest slope, with slack for rounding.
    slope: f64,
}

/// Fewer triangles are not worth a hierarchy of their own.
const FEWEST: usize = 64;

/// Slack of slopes, relative, and for how far the border may bend inwards in all, radians: what rounding makes of one
/// that is straight. A way around such bends is longer by the square of them, which the slack of slopes covers.
const SLACK: f64 = 1e-6;

impl Sheet {
    /// Some triangles of a scene, given by numbers and corners, if they are a sheet.
    pub(super) fn of(range: Range<u32>, positions: &[DVec3], triangles: &[[u32; 3]]) -> Option<Self> {
        let triangles = triangles.get(range.start as usize..range.end as usize)?;
        if triangles.len() < FEWEST {
            return None;
        }
        let area = |[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [*a, *b, *c].map(|corner| positions[corner as usize]);
            (b - a).cross(c - a)
        };
        let all: DVec3 = triangles.iter().map(area).sum();
        let axis = (0..3).fold(0, |longest, axis| if all[axis].abs() > all[longest].abs() { axis } else { longest });
        let across = [(axis + 1) % 3, (axis + 2) % 3];
        let mut steepest = 0.0;
        for triangle in triangles {
            let area = area(triangle);
            let slope = DVec2::new(area[across[0]], area[across[1]]).length() / (area[axis] * all[axis].signum());
            if !(slope >= 0.0 && slope.is_finite()) {
                return None;
            }
            steepest = f64::max(steepest, slope);
        }
        let seen = |corner: u32| {
            let place = positions[corner as usize];
            DVec2::new(place[across[0]], place[across[1]]) * DVec2::new(1.0, all[axis].signum())
        };
        let border: Vec<DVec2> = border(triangles)?.into_iter().map(seen).collect();
        is_convex(&border).then_some(Self { triangles: range, axis, slope: steepest * (1.0 + SLACK) })
    }

    /// The numbers of its triangles.
    pub(super) fn triangles(&self) -> Range<u32> {
        self.triangles.clone()
    }

    /// Whether a straight line in a direction meets it once at the most.
    pub(super) fn meets_once(&self, direction: DVec3) -> bool {
        let across = DVec2::new(direction[(self.axis + 1) % 3], direction[(self.axis + 2) % 3]).length();
        direction[self.axis].abs() > self.slope * across
    }
}

/// The corners along the border of triangles, if that is one polygon.
fn border(triangles: &[[u32; 3]]) -> Option<Vec<u32>> {
    let first = triangles.iter().flatten().copied().min()?;
    let last = triangles.iter().flatten().copied().max()?;
    // The edges that lead to and from a corner cancel if each other corner follows it as often as it comes before it.
    // Of these sums of random numbers, others are zero by a chance of 2^-64.
    let mut sums = vec![0_u64; (last - first) as usize + 1];
    for &[a, b, c] in triangles {
        let [x, y, z] = [a, b, c].map(scrambled);
        for (corner, next, previous) in [(a, y, z), (b, z, x), (c, x, y)] {
            let sum = &mut sums[(corner - first) as usize];
            *sum = sum.wrapping_add(next).wrapping_sub(previous);
        }
    }
    let is_on_border = |corner: u32| sums[(corner - first) as usize] != 0;
    let mut edges: Vec<[u32; 2]> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .filter(|edge| edge.iter().copied().all(is_on_border))
        .collect();
    edges.sort_unstable_by_key(|&[from, to]| (from.min(to), from.max(to), from));
    // Of edges with the same ends there is left what does not cancel; more than one would be gone along twice.
    let mut left: Vec<[u32; 2]> = Vec::new();
    for same in edges.chunk_by(|a, b| a.contains(&b[0]) && a.contains(&b[1])) {
        let forwards = same.iter().filter(|edge| **edge == same[0]).count();
        match forwards as i64 - (same.len() - forwards) as i64 {
            0 => {}
            1 => left.push(same[0]),
            -1 => left.push([same[0][1], same[0][0]]),
            _ => return None,
        }
    }
    left.sort_unstable();
    if left.windows(2).any(|edges| edges[0][0] == edges[1][0]) {
        return None;
    }
    let mut polygon = Vec::with_capacity(left.len());
    let mut at = left.first()?[0];
    for _ in 0..left.len() {
        polygon.push(at);
        at = left[left.binary_search_by_key(&at, |edge| edge[0]).ok()?][1];
    }
    let mut once = polygon.clone();
    once.sort_unstable();
    once.dedup();
    (at == polygon[0] && once.len() == left.len()).then_some(polygon)
}

/// Whether a polygon turns to the left everywhere, or as good as that, and goes around once.
fn is_convex(polygon: &[DVec2]) -> bool {
    let (mut turned, mut inwards) = (0.0, 0.0);
    for (k, &corner) in polygon.iter().enumerate() {
        let before = corner - polygon[(k + polygon.len() - 1) % polygon.len()];
        let after = polygon[(k + 1) % polygon.len()] - corner;
        let angle = libm::atan2(before.perp_dot(after), before.dot(after));
        inwards += f64::max(-angle, 0.0);
        if before == DVec2::ZERO || inwards > SLACK {
            return false;
        }
        turned += angle;
    }
    (turned - 2.0 * PI).abs() < 1.0
}

/// A number without any order for each corner (Steele, Lea and Flood 2014: the mixing function of SplitMix).
fn scrambled(corner: u32) -> u64 {
    let mut state = (u64::from(corner) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    state ^ (state >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELLS: u32 = 12;

    /// A square of cells of two triangles each over [0, 1]^2, some left out, with corners where `place` brings them.
    fn mesh(keep: impl Fn(u32, u32) -> bool, place: impl Fn(DVec2) -> DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let n = CELLS + 1;
        let position = |i| place(DVec2::new(f64::from(i % n), f64::from(i / n)) / f64::from(CELLS));
        let cells = (0..CELLS * CELLS).map(|i| (i % CELLS, i / CELLS)).filter(|&(x, y)| keep(x, y));
        let triangles = cells.flat_map(|(x, y)| {
            let a = y * n + x;
            [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]
        });
        ((0..n * n).map(position).collect(), triangles.collect())
    }

    fn sheet((positions, triangles): (Vec<DVec3>, Vec<[u32; 3]>)) -> Option<Sheet> {
        Sheet::of(0..triangles.len() as u32, &positions, &triangles)
    }

    fn waves(at: DVec2) -> DVec3 {
        at.extend(0.1 * libm::sin(5.0 * at.x) * libm::cos(4.0 * at.y))
    }

    fn all(_: u32, _: u32) -> bool {
        true
    }

    #[test]
    fn waves_over_a_convex_region_are_a_sheet_however_they_lie() {
        for turned in 0..3 {
            let turn = |p: DVec3| [p, DVec3::new(p.y, p.z, p.x), DVec3::new(p.z, p.x, -p.y)][turned];
            let found = sheet(mesh(all, |at| turn(waves(at)))).unwrap();
            assert!(found.slope > 0.4 && found.slope < 0.6, "{found:?}");
            assert!(found.meets_once(turn(DVec3::new(0.6, 0.0, 0.8))));
            assert!(!found.meets_once(turn(DVec3::new(0.9, 0.3, 0.1))));
        }
        let sheared = |at: DVec2| waves(DVec2::new(at.x + 0.3 * at.y, at.y));
        assert!(sheet(mesh(all, sheared)).is_some());
        // The outer triangles of the cells at two corners.
        let (positions, mut triangles) = mesh(all, waves);
        triangles.remove(265);
        triangles.remove(22);
        assert!(sheet((positions, triangles)).is_some());
    }

    #[test]
    fn what_a_steep_line_may_meet_twice_is_no_sheet() {
        // A hole, a notch, and two pieces.
        assert!(sheet(mesh(|x, y| x != 5 || y != 6, waves)).is_none());
        assert!(sheet(mesh(|x, y| x != 5 || y != 0, waves)).is_none());
        assert!(sheet(mesh(|x, _| x != 5, waves)).is_none());
        // A corner cut off in steps.
        assert!(sheet(mesh(|x, y| x + y > 2, waves)).is_none());
        // One above another.
        let (mut positions, mut triangles) = mesh(all, waves);
        let (count, more) = (positions.len() as u32, positions.clone());
        positions.extend(more.iter().map(|place| *place + DVec3::Z));
        let above: Vec<[u32; 3]> = triangles.iter().map(|corners| corners.map(|corner| corner + count)).collect();
        triangles.extend(above);
        assert!(sheet((positions, triangles)).is_none());
        // A breaker, and a ramp that winds around twice.
        assert!(sheet(mesh(all, |at| DVec3::new(at.x + 0.2 * libm::sin(9.0 * at.x), at.y, at.x))).is_none());
        let ramp = |at: DVec2| {
            let (sine, cosine) = libm::sincos(4.0 * PI * at.x);
            DVec3::new(-cosine, sine, 0.0) * (1.0 + at.y) + DVec3::Z * at.x
        };
        assert!(sheet(mesh(all, ramp)).is_none());
        // Triangles that share no corners, of which nothing is known, and one that is upright.
        let (positions, triangles) = mesh(all, waves);
        let apart = (0..triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let places = triangles.iter().flatten().map(|corner| positions[*corner as usize]).collect();
        assert!(sheet((places, apart)).is_none());
        assert!(sheet(mesh(all, |at| DVec3::new(at.x.min(0.75), at.y, (at.x - 0.75).max(0.0)))).is_none());
    }
}
