//! Triangles that lie in one place: in one plane, to rounding, with an area in common.
//!
//! A ray that leaves a triangle misses everything in the same plane at the same place. A ray that arrives meets
//! whichever surface rounding puts first.
//!
//! Faces are sorted by cells of the space of planes, and those of one cell are swept along an axis. Whatever is found
//! is true; what lies beside another by less than [`RIM`] is not found, nor what is left when the budget is spent.

use std::ops::RangeInclusive;

use glam::DVec3;

use super::contact::{RIM, clip, is_narrow};
use super::triangle::coplanar;
use crate::math::Interval;

/// Pairs of faces in one cell that are compared: some tenths of a second.
const MOST_PAIRS: u32 = 1 << 26;

/// Edge of a cell of slopes, and how far the slopes of one plane may differ by rounding.
const SLOPE: (f64, f64) = (1e-6, 1e-9);

/// The same for offsets, relative to the largest coordinate.
const OFFSET: (f64, f64) = (1e-6, 4e-9);

/// Triangles some of which may lie where others do.
pub(crate) struct Faces<'a, C> {
    /// Their numbers.
    pub(crate) triangles: &'a [u32],
    /// The corners of one.
    pub(crate) corners: C,
}

/// A cell of the space of planes: the axis that they are steepest to, slopes along the two others, and where they cross
/// the axis.
type Cell = (u8, [i32; 3]);

/// The normal of a triangle, on the side from which its corners are seen counterclockwise, twice as long as its area.
pub(crate) fn area_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

impl<C: Fn(u32) -> [DVec3; 3]> Faces<'_, C> {
    /// Two triangles that conflict and lie in one place, and a point that they share. Those of which none is specular
    /// never conflict.
    pub(crate) fn coincidence(
        &self,
        is_specular: impl Fn(u32) -> bool,
        conflict: impl Fn(u32, u32) -> bool,
    ) -> Option<([u32; 2], DVec3)> {
        let corners = self.triangles.iter().flat_map(|triangle| (self.corners)(*triangle));
        let largest = corners.map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
        let mut entries = self.entries(largest);
        entries.sort_unstable();
        let mut budget = MOST_PAIRS;
        for cell in entries.chunk_by(|a, b| a.0 == b.0) {
            if cell.len() < 2 || cell.iter().all(|(_, triangle)| !is_specular(*triangle)) {
                continue;
            }
            let triangles = cell.iter().map(|(_, triangle)| *triangle).collect();
            let found = self.sweep(triangles, &mut budget, &is_specular, &conflict);
            if found.is_some() || budget == 0 {
                return found;
            }
        }
        None
    }

    /// The cells of all triangles. They are counted first, so that they take no more memory than they must; what is
    /// beyond [`most_entries`] is left out.
    fn entries(&self, largest: f64) -> Vec<(Cell, u32)> {
        let mut count = 0;
        for &triangle in self.triangles {
            each_cell(&(self.corners)(triangle), largest, |_| count += 1);
        }
        let most = count.min(most_entries(self.triangles.len()));
        let mut entries = Vec::with_capacity(most);
        for &triangle in self.triangles {
            each_cell(&(self.corners)(triangle), largest, |cell| {
                if entries.len() < most {
                    entries.push((cell, triangle));
                }
            });
        }
        entries
    }

    /// Looks at those pairs of triangles in one cell of which one is specular, and whose boxes overlap.
    fn sweep(
        &self,
        mut triangles: Vec<u32>,
        budget: &mut u32,
        is_specular: impl Fn(u32) -> bool,
        conflict: impl Fn(u32, u32) -> bool,
    ) -> Option<([u32; 2], DVec3)> {
        let extent = |triangle: u32, axis: usize| {
            let corners = (self.corners)(triangle).map(|corner| Interval::point(corner[axis]));
            corners.into_iter().fold(Interval::EMPTY, Interval::union)
        };
        let spread = [0, 1, 2].map(|axis| {
            let all = triangles.iter().map(|triangle| extent(*triangle, axis)).fold(Interval::EMPTY, Interval::union);
            all.max - all.min
        });
        let axis = DVec3::from_array(spread).max_position();
        triangles.sort_by(|a, b| extent(*a, axis).min.total_cmp(&extent(*b, axis).min));
        let (mut specular, mut others): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
        for triangle in triangles {
            let own = [0, 1, 2].map(|axis| extent(triangle, axis));
            let reached = if is_specular(triangle) { vec![&mut specular, &mut others] } else { vec![&mut specular] };
            for open in reached {
                open.retain(|other| extent(*other, axis).max >= own[axis].min);
                for &other in open.iter() {
                    *budget = budget.checked_sub(1)?;
                    let overlap = |axis: usize| !own[axis].intersection(extent(other, axis)).is_empty();
                    if (0..3).all(overlap)
                        && conflict(other, triangle)
                        && let Some(at) = common_point(&(self.corners)(other), &(self.corners)(triangle))
                    {
                        return Some(([other, triangle], at));
                    }
                }
            }
            if is_specular(triangle) { &mut specular } else { &mut others }.push(triangle);
        }
        None
    }
}

/// Hands out the cells in which the plane of a triangle may lie.
fn each_cell(corners: &[DVec3; 3], largest: f64, mut each: impl FnMut(Cell)) {
    let normal = area_normal(*corners);
    let size = normal.abs();
    for axis in 0..3 {
        if size[axis] == 0.0 || size[axis] < size.max_element() * (1.0 - SLOPE.1) {
            continue;
        }
        let across = [(axis + 1) % 3, (axis + 2) % 3];
        let slopes = across.map(|other| normal[other] / normal[axis]);
        let at = corners[0];
        let offset = at[axis] + slopes[0] * at[across[0]] + slopes[1] * at[across[1]];
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

/// The cells of a number that may be larger or smaller by the slack. Round numbers, as slopes and offsets often are,
/// lie in the middle of a cell.
fn cells(value: f64, (edge, slack): (f64, f64)) -> RangeInclusive<i32> {
    ((value - slack) / edge).round() as i32..=((value + slack) / edge).round() as i32
}

/// Most entries for a number of triangles: planes that are as steep to three axes have three, and very few have more.
const fn most_entries(triangles: usize) -> usize {
    3 * triangles + triangles / 16 + 64
}

/// A point in the middle of what two triangles share, if they lie in one plane.
fn common_point(a: &[DVec3; 3], b: &[DVec3; 3]) -> Option<DVec3> {
    // The plane of the larger one is known best.
    if !coplanar(a, b) && !coplanar(b, a) {
        return None;
    }
    let normal = area_normal(*b).normalize_or_zero();
    let mut shared = a.to_vec();
    for side in 0..3 {
        let (from, to) = (b[side], b[(side + 1) % 3]);
        shared = clip(&shared, |point| (to - from).cross(point - from).dot(normal));
    }
    let facing = area_normal(*a).dot(normal).signum();
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

    /// What is found among triangles that all conflict; those with even numbers are specular.
    fn found(triangles: &[[DVec3; 3]]) -> Option<([u32; 2], DVec3)> {
        found_of(triangles, |_, _| true, |triangle| triangle.is_multiple_of(2))
    }

    fn found_of(
        triangles: &[[DVec3; 3]],
        conflict: impl Fn(u32, u32) -> bool,
        is_specular: impl Fn(u32) -> bool,
    ) -> Option<([u32; 2], DVec3)> {
        let numbers: Vec<u32> = (0..triangles.len() as u32).collect();
        let corners = |triangle: u32| triangles[triangle as usize];
        Faces { triangles: &numbers, corners }.coincidence(is_specular, conflict)
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
            let floor = placed(&frame, [-3.0, -3.0], [12.0, 12.0]);
            let mut block = placed(&frame, [shift, 0.2], [leg, leg]);
            if turned {
                block.swap(1, 2);
            }
            let (pair, at) = found(&[block, floor]).expect("they lie in one place");
            prop_assert!(pair == [0, 1] || pair == [1, 0]);
            let local = frame.point_to_local(at);
            prop_assert!(local.z.abs() < 1e-12);
            prop_assert!(local.x > shift && local.x < shift + leg && local.y > 0.2 && local.y < 0.2 + leg);
            let beside = |x: f64, z: f64| block.map(|corner| corner + frame.vector_to_world(dvec3(x, 0.0, z)));
            let [x, y] = [shift + leg, 0.2 + leg];
            let across = [[x, y], [shift, y], [x, 0.2]].map(|[x, y]| frame.point_to_world(dvec3(x, y, 0.0)));
            for other in [beside(0.0, 1e-9), beside(leg, 0.0), beside(leg - 1e-6, 0.0), across] {
                let found = found(&[block, other]);
                prop_assert!(found.is_none(), "{other:?} {found:?}");
            }
        }
    }

    #[test]
    fn a_face_along_the_axes_is_in_one_cell_and_so_is_one_that_differs_by_rounding() {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            for height in [0.0, 0.25, 1.0] {
                let frame = Frame { origin: height * axis, ..Frame::around(axis) };
                let corners = placed(&frame, [0.0, 0.0], [1.0, 1.0]);
                let tilted = corners.map(|corner| corner + 1e-13 * corner.x * DVec3::ONE);
                let of = |corners: &[DVec3; 3]| {
                    let mut cells = Vec::new();
                    each_cell(corners, 1.0, |cell| cells.push(cell));
                    cells
                };
                assert_eq!(of(&corners).len(), 1, "{axis} {height}");
                assert_eq!(of(&corners), of(&tilted), "{axis} {height}");
            }
        }
    }

    #[test]
    fn entries_are_no_more_than_are_counted_however_planes_lie() {
        // Slopes and an offset at the borders of cells.
        let corner = |x: f64, y: f64| dvec3(x, y, 0.5e-6 * (x + y) + 0.5e-6);
        let corners = vec![[corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)]; 1000];
        let numbers: Vec<u32> = (0..1000).collect();
        let mut cells = 0;
        each_cell(&corners[0], 1.0, |_| cells += 1);
        assert_eq!(cells, 8);
        let entries = Faces { triangles: &numbers, corners: |triangle| corners[triangle as usize] }.entries(1.0);
        assert_eq!((entries.len(), entries.capacity()), (most_entries(1000), most_entries(1000)));
    }

    #[test]
    fn only_what_conflicts_is_looked_for() {
        let frame = Frame::around(DVec3::Z);
        let corners = placed(&frame, [0.0, 0.0], [1.0, 1.0]);
        let twice = [corners; 2];
        assert!(found_of(&twice, |_, _| true, |_| false).is_none(), "neither is specular");
        assert!(found_of(&twice, |_, _| false, |_| true).is_none());
        assert!(found_of(&twice, |_, _| true, |_| true).is_some());
    }
}
