//! Polygons of mesh files, cut into triangles.

use glam::{DVec2, DVec3};

use crate::settings::AssetProblem;

/// Cuts the polygons of a file. A polygon of which a fan around its first corner covers nothing twice becomes that fan;
/// every convex polygon is one. From any other, ears are cut.
pub(super) struct Cutter {
    /// Looks at a corner, for itself and against an ear, that are left for this file: intricate polygons take time
    /// beyond their size.
    tests: u32,
}

/// The most tests for one file, a few seconds.
const MAX_TESTS: u32 = 1 << 30;

/// A triangle of a fan is turned over when it takes more than this part of the polygon's area away.
const TURNED_OVER: f64 = 1e-6;

impl Cutter {
    /// For the polygons of one file.
    pub(super) fn new() -> Self {
        Self { tests: MAX_TESTS }
    }

    /// Adds the triangles of a polygon, as the numbers of their corners. Fewer than three corners have none.
    ///
    /// # Errors
    ///
    /// When the polygons of the file are too intricate.
    pub(super) fn cut(&mut self, corners: &[DVec3], mut add: impl FnMut([usize; 3])) -> Result<(), AssetProblem> {
        let fan = || (1..corners.len().saturating_sub(1)).map(|second| [0, second, second + 1]);
        if corners.len() > 3 {
            let crosses = fan().map(|[a, b, c]| (corners[b] - corners[a]).cross(corners[c] - corners[a]));
            let normal: DVec3 = crosses.clone().sum();
            let least = -TURNED_OVER * normal.length_squared();
            if crosses.into_iter().any(|cross| cross.dot(normal) < least) {
                return self.cut_ears(&flattened(corners, normal), add);
            }
        }
        fan().for_each(&mut add);
        Ok(())
    }

    /// Cuts ears from a polygon that runs counterclockwise.
    fn cut_ears(&mut self, corners: &[DVec2], mut add: impl FnMut([usize; 3])) -> Result<(), AssetProblem> {
        let count = corners.len();
        let mut next: Vec<usize> = (1..count).chain([0]).collect();
        let mut previous: Vec<usize> = [count - 1].into_iter().chain(0..count - 1).collect();
        let turn = |a: usize, b: usize, c: usize| (corners[b] - corners[a]).perp_dot(corners[c] - corners[b]);
        let mut reflex: Vec<usize> = (0..count).filter(|&at| turn(previous[at], at, next[at]) < 0.0).collect();
        let mut left = count;
        let mut at = 0;
        let mut without_ear = 0;
        while left > 3 {
            // Corners on a straight edge are passed again and again until it has become short.
            self.count(1)?;
            let [a, c] = [previous[at], next[at]];
            // A polygon that crosses itself may have no ear: then any corner is cut.
            let is_ear = without_ear > left || turn(a, at, c) > 0.0 && self.is_empty(corners, [a, at, c], &reflex)?;
            if !is_ear {
                without_ear += 1;
                at = c;
                continue;
            }
            add([a, at, c]);
            (next[a], previous[c]) = (c, a);
            left -= 1;
            without_ear = 0;
            reflex.retain(|&other| {
                other != at && (![a, c].contains(&other) || turn(previous[other], other, next[other]) < 0.0)
            });
            at = c;
        }
        add([previous[at], at, next[at]]);
        Ok(())
    }

    /// Whether no reflex corner lies in a triangle. Corners at the same place as one of the triangle's are none that
    /// lie in it: holes are joined to their polygon along an edge that is there twice.
    fn is_empty(&mut self, corners: &[DVec2], triangle: [usize; 3], reflex: &[usize]) -> Result<bool, AssetProblem> {
        self.count(reflex.len() as u32)?;
        let [a, b, c] = triangle.map(|corner| corners[corner]);
        let lies_inside = |point: DVec2| {
            ![a, b, c].contains(&point)
                && (b - a).perp_dot(point - a) >= 0.0
                && (c - b).perp_dot(point - b) >= 0.0
                && (a - c).perp_dot(point - c) >= 0.0
        };
        Ok(!reflex.iter().any(|&corner| lies_inside(corners[corner])))
    }

    /// Takes tests from those that are left.
    fn count(&mut self, tests: u32) -> Result<(), AssetProblem> {
        self.tests = self.tests.checked_sub(tests).ok_or_else(|| {
            AssetProblem::malformed("has polygons that are too intricate: cut them into triangles before exporting")
        })?;
        Ok(())
    }
}

/// The corners seen along the axis that is nearest to the normal, so that they run counterclockwise.
fn flattened(corners: &[DVec3], normal: DVec3) -> Vec<DVec2> {
    let size = normal.abs();
    let (along, flat): (f64, fn(&DVec3) -> DVec2) = if size.x >= size.y && size.x >= size.z {
        (normal.x, |at| DVec2::new(at.y, at.z))
    } else if size.y >= size.z {
        (normal.y, |at| DVec2::new(at.z, at.x))
    } else {
        (normal.z, |at| DVec2::new(at.x, at.y))
    };
    let mirrored = |at: DVec2| if along < 0.0 { DVec2::new(-at.x, at.y) } else { at };
    corners.iter().map(flat).map(mirrored).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(corners: &[DVec3]) -> Vec<[usize; 3]> {
        let mut triangles = Vec::new();
        Cutter::new().cut(corners, |triangle| triangles.push(triangle)).unwrap();
        triangles
    }

    fn flat(corners: &[[f64; 2]]) -> Vec<DVec3> {
        corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.5)).collect()
    }

    /// The doubled areas of the triangles, each with its sign, as seen along a normal.
    fn areas(corners: &[DVec3], normal: DVec3) -> Vec<f64> {
        let cross = |[a, b, c]: [usize; 3]| (corners[b] - corners[a]).cross(corners[c] - corners[a]);
        cut(corners).into_iter().map(|triangle| cross(triangle).dot(normal)).collect()
    }

    #[test]
    fn convex_polygons_are_fans_around_their_first_corner() {
        let pentagon = flat(&[[0.0, 0.0], [1.0, 0.0], [1.5, 1.0], [0.5, 1.5], [-0.5, 1.0]]);
        assert_eq!(cut(&pentagon), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        // A corner on an edge, a corner twice, and a quadrilateral that is not flat.
        let straight = flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0]]);
        assert_eq!(cut(&straight), [[0, 1, 2], [0, 2, 3]]);
        let twice = flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
        assert_eq!(cut(&twice), [[0, 1, 2], [0, 2, 3]]);
        let saddle = [DVec3::ZERO, DVec3::new(1.0, 0.0, 0.4), DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, 1.0, 0.4)];
        assert_eq!(cut(&saddle), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn fewer_than_three_corners_have_no_triangle() {
        for count in 0..3 {
            assert!(cut(&[DVec3::ZERO, DVec3::X][..count]).is_empty());
        }
    }

    #[test]
    fn a_polygon_with_a_dent_is_covered_once() {
        let arrow = [[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]];
        let comb = [[0.0, 0.0], [5.0, 0.0], [5.0, 3.0], [4.0, 1.0], [3.0, 3.0], [2.0, 1.0], [1.0, 3.0], [0.0, 1.0]];
        // A square with a square hole, joined along an edge.
        let ring = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ];
        for (outline, area) in [(&arrow[..], 0.5), (&comb, 10.0), (&ring, 12.0)] {
            for first in 0..outline.len() {
                let mut turned = outline.to_vec();
                turned.rotate_left(first);
                for corners in [flat(&turned), flat(&turned).iter().rev().copied().collect()] {
                    let normal = if corners == flat(&turned) { DVec3::Z } else { DVec3::NEG_Z };
                    let areas = areas(&corners, normal);
                    assert_eq!(areas.len(), outline.len() - 2);
                    assert!(areas.iter().all(|area| *area >= 0.0), "{turned:?}: {areas:?}");
                    assert!((areas.iter().sum::<f64>() - 2.0 * area).abs() < 1e-9, "{turned:?}: {areas:?}");
                }
                // On walls that stand along other axes, too.
                let wall: Vec<DVec3> = turned.iter().map(|&[x, y]| DVec3::new(y, 7.0, x)).collect();
                assert!((areas(&wall, DVec3::Y).iter().sum::<f64>() - 2.0 * area).abs() < 1e-9);
                let wall: Vec<DVec3> = turned.iter().map(|&[x, y]| DVec3::new(7.0, x, y)).collect();
                assert!((areas(&wall, DVec3::X).iter().sum::<f64>() - 2.0 * area).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn polygons_that_cross_themselves_end() {
        let star: Vec<[f64; 2]> =
            (0..7).map(|corner| <[f64; 2]>::from(libm::sincos(f64::from(corner) * 2.7))).collect();
        assert_eq!(cut(&flat(&star)).len(), 5);
        let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        assert_eq!(cut(&flat(&bow)).len(), 2);
    }

    #[test]
    fn intricate_polygons_are_refused_before_they_take_long() {
        let teeth = 2000;
        let tooth = |number: i32| [[f64::from(number), 5.0], [f64::from(number) + 0.5, 1.0]];
        let outline: Vec<[f64; 2]> = (0..teeth).rev().flat_map(tooth).chain([[0.0, 0.0], [2000.0, 0.0]]).collect();
        let mut cutter = Cutter { tests: 1000 };
        let error = cutter.cut(&flat(&outline), |_| {}).unwrap_err().to_string();
        assert!(error.contains("too intricate"), "{error}");
    }

    /// An L with corners along the edge before its dent.
    fn with_straight_edge(corners: u32) -> Vec<DVec3> {
        let along = |corner: u32| [4.0 - 3.0 * f64::from(corner) / f64::from(corners), 1.0];
        let others = [[1.0, 4.0], [0.0, 4.0], [0.0, 0.0], [4.0, 0.0], [4.0, 1.0]];
        flat(&(1..=corners).map(along).chain(others).collect::<Vec<_>>())
    }

    #[test]
    fn corners_on_a_straight_edge_are_counted_however_often_they_are_passed() {
        let few = cut(&with_straight_edge(4));
        assert_eq!(few, [[3, 4, 5], [3, 5, 6], [3, 6, 7], [3, 7, 8], [8, 0, 1], [1, 2, 3], [1, 3, 8]]);
        // A thousand corners on the edge are passed half a million times.
        for (tests, is_cut) in [(600_000, true), (500_000, false)] {
            let mut triangles = 0;
            let result = Cutter { tests }.cut(&with_straight_edge(1000), |_| triangles += 1);
            assert_eq!(result.is_ok(), is_cut, "{triangles} triangles");
        }
        let mut cutter = Cutter { tests: 1 << 20 };
        let error = cutter.cut(&with_straight_edge(1_000_000), |_| {}).unwrap_err().to_string();
        assert!(error.contains("too intricate"), "{error}");
    }
}
