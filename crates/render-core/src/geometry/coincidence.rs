//! Triangles that lie in one place: in one plane, to rounding, with an area in common.
//!
//! A ray that leaves a triangle sees nothing of what lies in the same plane at the same place, and one that arrives meets whichever
//! rounding puts first.
//!
//! Faces are sorted by cells of the space of planes, and those of one cell are swept along an axis. Whatever is found is true; what lies
//! beside another by less than [`RIM`] is not found, nor what is left when the budget is spent.

use glam::DVec3;

use super::contact::{RIM, clip, is_narrow};
use super::triangle::coplanar;

/// Pairs of faces in one cell that are compared: some tenths of a second.
const MOST_PAIRS: u32 = 1 << 26;

/// Edge of a cell of slopes, and how far the slopes of one plane may differ by rounding.
const SLOPE: (f64, f64) = (1e-6, 1e-9);

/// The same for offsets, relative to the largest coordinate.
const OFFSET: (f64, f64) = (1e-6, 4e-9);

/// A triangle that may lie where another does.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CandidateFace {
    /// Its number.
    pub(crate) triangle: u32,
    /// Its corners.
    pub(crate) corners: [DVec3; 3],
    /// Whether it may conflict with any other; those that may not are never compared with one another.
    pub(crate) is_smooth: bool,
}

impl CandidateFace {
    /// The normal, on the side from which its corners are seen counterclockwise, not of unit length.
    pub(crate) fn area_normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }
}

/// A cell of the space of planes: the axis that they are steepest to, slopes along the two others, and where they cross the axis.
type Cell = (u8, [i64; 3]);

/// One face in one cell.
struct Entry {
    cell: Cell,
    face: u32,
}

/// Two faces that conflict and lie in one place, and a point that they share.
pub(crate) fn coincidence(
    faces: &[CandidateFace],
    conflict: impl Fn(&CandidateFace, &CandidateFace) -> bool,
) -> Option<([u32; 2], DVec3)> {
    let largest =
        faces.iter().flat_map(|face| face.corners).map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
    let mut entries = Vec::with_capacity(faces.len());
    for (face, candidate) in (0u32..).zip(faces) {
        each_cell(candidate, largest, |cell| entries.push(Entry { cell, face }));
    }
    entries.sort_unstable_by_key(|entry| (entry.cell, entry.face));
    let mut budget = MOST_PAIRS;
    for group in entries.chunk_by(|a, b| a.cell == b.cell) {
        let members: Vec<&CandidateFace> = group.iter().map(|entry| &faces[entry.face as usize]).collect();
        if members.len() < 2 || members.iter().all(|face| !face.is_smooth) {
            continue;
        }
        let found = sweep(members, &mut budget, |a, b| conflict(a, b).then(|| common_point(a, b)).flatten());
        if found.is_some() || budget == 0 {
            return found;
        }
    }
    None
}

/// Hands out the cells in which the plane of a face may lie.
fn each_cell(face: &CandidateFace, largest: f64, mut each: impl FnMut(Cell)) {
    let normal = face.area_normal();
    let size = normal.abs();
    for axis in 0..3 {
        if size[axis] == 0.0 || size[axis] < size.max_element() * (1.0 - SLOPE.1) {
            continue;
        }
        let across = [(axis + 1) % 3, (axis + 2) % 3];
        let slopes = across.map(|other| normal[other] / normal[axis]);
        let [a, ..] = face.corners;
        let offset = a[axis] + slopes[0] * a[across[0]] + slopes[1] * a[across[1]];
        let [first, second] = slopes.map(|slope| cells(slope, SLOPE));
        for first in first {
            for second in second.clone() {
                for third in cells(offset / largest, OFFSET) {
                    each((axis as u8, [first, second, third]));
                }
            }
        }
    }
}

/// The cells of a number that may be larger or smaller by the slack.
fn cells(value: f64, (edge, slack): (f64, f64)) -> std::ops::RangeInclusive<i64> {
    ((value - slack) / edge).floor() as i64..=((value + slack) / edge).floor() as i64
}

/// The first of the pairs whose boxes overlap that have what is asked for.
fn sweep(
    mut faces: Vec<&CandidateFace>,
    budget: &mut u32,
    shared: impl Fn(&CandidateFace, &CandidateFace) -> Option<DVec3>,
) -> Option<([u32; 2], DVec3)> {
    let extent = |face: &CandidateFace, axis: usize| {
        let [a, b, c] = face.corners.map(|corner| corner[axis]);
        (a.min(b).min(c), a.max(b).max(c))
    };
    let spread = |axis: usize| {
        let all = faces.iter().map(|face| extent(face, axis));
        let (min, max) =
            all.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), (low, high)| (min.min(low), max.max(high)));
        max - min
    };
    let spreads = DVec3::from_array([0, 1, 2].map(spread));
    let axis = spreads.max_position();
    faces.sort_by(|a, b| extent(a, axis).0.total_cmp(&extent(b, axis).0));
    let (mut smooth, mut others): (Vec<&CandidateFace>, Vec<&CandidateFace>) = (Vec::new(), Vec::new());
    for face in faces {
        let begin = extent(face, axis).0;
        for (open, is_compared) in [(&mut smooth, true), (&mut others, face.is_smooth)] {
            if !is_compared {
                continue;
            }
            open.retain(|other| extent(other, axis).1 >= begin);
            for other in open.iter() {
                *budget = budget.checked_sub(1)?;
                let meets = |axis: usize| {
                    let ((low, high), (other_low, other_high)) = (extent(face, axis), extent(other, axis));
                    low <= other_high && other_low <= high
                };
                if (0..3).all(meets)
                    && let Some(at) = shared(other, face)
                {
                    return Some(([other.triangle, face.triangle], at));
                }
            }
        }
        if face.is_smooth { &mut smooth } else { &mut others }.push(face);
    }
    None
}

/// A point in the middle of what two triangles share, if they lie in one plane.
fn common_point(a: &CandidateFace, b: &CandidateFace) -> Option<DVec3> {
    // The plane of the larger one is known best.
    if !coplanar(&a.corners, &b.corners) && !coplanar(&b.corners, &a.corners) {
        return None;
    }
    let normal = b.area_normal().normalize_or_zero();
    let mut shared = a.corners.to_vec();
    for side in 0..3 {
        let (from, to) = (b.corners[side], b.corners[(side + 1) % 3]);
        shared = clip(&shared, |point| (to - from).cross(point - from).dot(normal));
    }
    let facing = a.area_normal().dot(normal).signum();
    let is_area = shared.len() > 2 && !is_narrow(&shared, normal * facing, RIM);
    is_area.then(|| shared.iter().sum::<DVec3>() / shared.len() as f64)
}

#[cfg(test)]
mod tests {
    use glam::dvec3;
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::Frame;
    use crate::geometry::testing::fixed_seed;

    fn face(triangle: u32, corners: [DVec3; 3]) -> CandidateFace {
        CandidateFace { triangle, corners, is_smooth: triangle.is_multiple_of(2) }
    }

    fn any_conflicts(_: &CandidateFace, _: &CandidateFace) -> bool {
        true
    }

    /// A triangle with a right angle at a place in a plane.
    fn placed(frame: &Frame, at: [f64; 2], legs: [f64; 2]) -> [DVec3; 3] {
        let corner = |x: f64, y: f64| frame.point_to_world(dvec3(at[0] + x, at[1] + y, 0.0));
        [corner(0.0, 0.0), corner(legs[0], 0.0), corner(0.0, legs[1])]
    }

    proptest! {
        #![proptest_config(fixed_seed(256))]

        #[test]
        fn what_lies_in_one_plane_at_one_place_is_found_and_what_lies_beside_or_before_it_is_not(
            direction in prop::array::uniform3(-1.0..1.0f64), origin in prop::array::uniform3(-30.0..30.0f64),
            leg in 1e-3..1.0f64, shift in 0.1..0.9f64, turned: bool,
        ) {
            let direction = DVec3::from(direction);
            prop_assume!(direction.length() > 0.1);
            let frame = Frame { origin: DVec3::from(origin), ..Frame::around(direction.normalize()) };
            let floor = face(1, placed(&frame, [-3.0, -3.0], [12.0, 12.0]));
            let mut block = placed(&frame, [shift, 0.2], [leg, leg]);
            if turned {
                block.swap(1, 2);
            }
            let (pair, at) = coincidence(&[floor, face(2, block)], any_conflicts).expect("they lie in one place");
            prop_assert!(pair == [1, 2] || pair == [2, 1]);
            let local = frame.point_to_local(at);
            prop_assert!(local.z.abs() < 1e-12);
            prop_assert!(local.x > shift && local.x < shift + leg && local.y > 0.2 && local.y < 0.2 + leg);
            let beside = |x: f64, z: f64| block.map(|corner| corner + frame.vector_to_world(dvec3(x, 0.0, z)));
            let [x, y] = [shift + leg, 0.2 + leg];
            let across = [[x, y], [shift, y], [x, 0.2]].map(|[x, y]| frame.point_to_world(dvec3(x, y, 0.0)));
            for other in [beside(0.0, 1e-9), beside(leg, 0.0), beside(leg - 1e-6, 0.0), across] {
                let found = coincidence(&[face(1, other), face(2, block)], any_conflicts);
                prop_assert!(found.is_none(), "{other:?} {found:?}");
            }
        }
    }

    #[test]
    fn only_what_conflicts_is_looked_for() {
        let frame = Frame::around(DVec3::Z);
        let corners = placed(&frame, [0.0, 0.0], [1.0, 1.0]);
        assert!(coincidence(&[face(1, corners), face(3, corners)], any_conflicts).is_none(), "neither is smooth");
        assert!(coincidence(&[face(1, corners), face(2, corners)], |_, _| false).is_none());
        assert!(coincidence(&[face(2, corners), face(4, corners)], any_conflicts).is_some());
    }
}
