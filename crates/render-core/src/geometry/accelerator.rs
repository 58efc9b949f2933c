//! What a ray meets first among the triangles and panes of a scene.
//!
//! A hierarchy in single precision (the module `hierarchy`) decides which primitives are tested. The tests are in double
//! precision, triangles in world coordinates, panes in their own. What a ray has just left is skipped by identity.
//!
//! At equal distances the smaller number wins, triangles before panes, so that a result does not depend on the order
//! in which the hierarchy is walked.

use glam::DVec3;
use thiserror::Error;

use super::hierarchy::{Hierarchy, MOST_LEVELS};
use super::triangle::{ShearedRay, coplanar};
use super::{Face, Leaving, Pane, PaneHit, Ray};
use crate::counters::Counters;

/// Why there can be no hierarchy over a scene.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AcceleratorError {
    /// A triangle names a corner that does not exist.
    #[error("triangle {triangle} has corner {corner}, but there are only {positions} positions")]
    Corner {
        /// The triangle.
        triangle: usize,
        /// The index that it names.
        corner: u32,
        /// Number of positions.
        positions: usize,
    },
    /// A coordinate is infinite, not a number, or beyond anything that can be computed with.
    #[error("position {index} is {position}: coordinates must be numbers below 1e100")]
    Position {
        /// Index of the position.
        index: usize,
        /// The position.
        position: DVec3,
    },
    /// A pane hangs at no finite place.
    #[error("pane {0:?} hangs at a place that is not finite")]
    PanePlace(String),
    /// There are too many primitives to number them.
    #[error("{0} triangles and panes: at most 2^31 are possible")]
    TooMany(usize),
    /// The primitives are nested so deeply that the hierarchy cannot be walked.
    #[error(
        "the triangles are so unevenly distributed that the hierarchy over them has {0} levels; at most 31 are possible"
    )]
    TooDeep(usize),
}

/// What a ray has met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// A triangle.
    Triangle {
        /// Its number in the scene.
        index: u32,
        /// Weights of its second and third corner.
        barycentric: [f64; 2],
    },
    /// The boundary of a pane.
    Pane {
        /// Its number in the scene.
        index: u32,
        /// Where, in the pane's frame.
        hit: PaneHit,
    },
}

/// Where a ray meets the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray in metres.
    pub distance: f64,
    /// What was met.
    pub surface: Surface,
}

/// The triangles and panes of a scene, and the hierarchy over both.
#[derive(Clone, Debug)]
pub struct Accelerator {
    panes: Vec<Pane>,
    /// For each pane, whether a triangle reaches into its box.
    pierced: Vec<bool>,
    /// Corners of all triangles by number.
    corners: Vec<[DVec3; 3]>,
    /// The primitives in the order of the hierarchy's leaves.
    leaves: Vec<Primitive>,
    hierarchy: Option<Hierarchy>,
}

#[derive(Clone, Copy, Debug)]
enum Primitive {
    Triangle { index: u32, corners: [DVec3; 3] },
    Pane { index: u32 },
}

impl Accelerator {
    /// The hierarchy over triangles, given by the indices of their corners, and panes.
    ///
    /// # Errors
    /// [`AcceleratorError`] when an index or a coordinate is out of range.
    pub fn build(positions: &[DVec3], triangles: &[[u32; 3]], panes: Vec<Pane>) -> Result<Self, AcceleratorError> {
        let corners = gather(positions, triangles)?;
        if let Some(lost) = panes.iter().find(|pane| !pane.world_bounds().iter().all(|corner| in_range(*corner))) {
            return Err(AcceleratorError::PanePlace(lost.name.clone()));
        }
        if corners.len() + panes.len() > 1 << 31 {
            return Err(AcceleratorError::TooMany(corners.len() + panes.len()));
        }
        let triangle_boxes = corners.iter().map(|[a, b, c]| [a.min(*b).min(*c), a.max(*b).max(*c)]);
        let boxes: Vec<_> = triangle_boxes.chain(panes.iter().map(Pane::world_bounds)).collect();
        let pierced = panes.iter().map(|pane| corners.iter().any(|triangle| reaches_into(triangle, pane))).collect();
        let hierarchy = Hierarchy::over(&boxes);
        let levels = hierarchy.as_ref().map_or(0, Hierarchy::levels);
        if levels > MOST_LEVELS {
            return Err(AcceleratorError::TooDeep(levels));
        }
        let order = hierarchy.as_ref().map_or(&[][..], Hierarchy::leaves);
        let primitive = |&index: &u32| match corners.get(index as usize) {
            Some(&corners) => Primitive::Triangle { index, corners },
            None => Primitive::Pane { index: index - corners.len() as u32 },
        };
        let leaves = order.iter().map(primitive).collect();
        Ok(Self { panes, pierced, corners, leaves, hierarchy })
    }

    /// The panes, by number.
    pub fn panes(&self) -> &[Pane] {
        &self.panes
    }

    /// The corners of a triangle.
    pub fn corners(&self, triangle: u32) -> &[DVec3; 3] {
        &self.corners[triangle as usize]
    }

    /// Corners of a box that holds everything; `None` when there is nothing.
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        self.hierarchy.as_ref().map(Hierarchy::bounds)
    }

    /// The nearest triangle or pane within `max_distance` of a ray through the air.
    pub fn closest_hit(&self, ray: &Ray, max_distance: f64, leaving: Leaving, counters: &mut Counters) -> Option<Hit> {
        counters.rays += 1;
        let sheared = ShearedRay::new(ray);
        self.nearest(ray, max_distance, |primitive| match primitive {
            Primitive::Triangle { index, corners } => self.hit_triangle(&sheared, *index, corners, leaving),
            Primitive::Pane { index } => self.hit_pane(ray, max_distance, *index, leaving, counters),
        })
    }

    /// What [`Self::closest_hit`] finds, when that is the given pane. Asking for one pane alone is quicker, above all where the
    /// ray misses it: then nothing else is looked at.
    pub fn closest_hit_on_pane(
        &self,
        pane: u32,
        ray: &Ray,
        max_distance: f64,
        leaving: Leaving,
        counters: &mut Counters,
    ) -> Option<Hit> {
        counters.rays += 1;
        let hit = self.hit_pane(ray, max_distance, pane, leaving, counters)?;
        let blocked = hit.distance > max_distance
            || self.any(ray, hit.distance, leaving, Some(pane), counters, |other| precedes(other, &hit));
        (!blocked).then_some(hit)
    }

    /// The nearest triangle, or the boundary of the pane in whose glass the ray starts, for a ray through that glass.
    /// Other panes are not seen. `leaving` is the face of the pane on which the ray starts, if any.
    pub fn closest_hit_inside(
        &self,
        pane_index: u32,
        ray: &Ray,
        leaving: Option<Face>,
        counters: &mut Counters,
    ) -> Option<Hit> {
        counters.rays += 1;
        let pane = &self.panes[pane_index as usize];
        let boundary = pane
            .intersect_inside(&to_local(pane, ray), leaving, counters)
            .map(|hit| Hit { distance: hit.distance, surface: Surface::Pane { index: pane_index, hit } });
        if !self.pierced[pane_index as usize] {
            return boundary;
        }
        let max_distance = boundary.map_or(f64::INFINITY, |hit| hit.distance);
        let sheared = ShearedRay::new(ray);
        let triangle = self.nearest(ray, max_distance, |primitive| match primitive {
            Primitive::Triangle { index, corners } => self.hit_triangle(&sheared, *index, corners, Leaving::Nothing),
            Primitive::Pane { .. } => None,
        });
        triangle.or(boundary)
    }

    /// Whether anything stands within `max_distance` in the way of a ray through the air. Panes do, but for
    /// `ignored_pane`.
    pub fn occluded(
        &self,
        ray: &Ray,
        max_distance: f64,
        leaving: Leaving,
        ignored_pane: Option<u32>,
        counters: &mut Counters,
    ) -> bool {
        counters.rays += 1;
        self.any(ray, max_distance, leaving, ignored_pane, counters, |hit| hit.distance <= max_distance)
    }

    /// Whether `test` says yes to a hit on a triangle, or on a pane other than `ignored_pane`. Some beyond `max_distance` are
    /// tested as well.
    fn any(
        &self,
        ray: &Ray,
        max_distance: f64,
        leaving: Leaving,
        ignored_pane: Option<u32>,
        counters: &mut Counters,
        test: impl Fn(&Hit) -> bool,
    ) -> bool {
        let Some(hierarchy) = &self.hierarchy else { return false };
        let sheared = ShearedRay::new(ray);
        hierarchy.any(ray, max_distance, |leaf| {
            let hit = match &self.leaves[leaf] {
                Primitive::Triangle { index, corners } => self.hit_triangle(&sheared, *index, corners, leaving),
                Primitive::Pane { index } if Some(*index) == ignored_pane => None,
                Primitive::Pane { index } => self.hit_pane(ray, max_distance, *index, leaving, counters),
            };
            hit.is_some_and(|hit| test(&hit))
        })
    }

    fn nearest(&self, ray: &Ray, max_distance: f64, mut test: impl FnMut(&Primitive) -> Option<Hit>) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        self.hierarchy.as_ref()?.visit(ray, max_distance, |leaf| {
            let hit = test(&self.leaves[leaf])?;
            if hit.distance > max_distance || nearest.is_some_and(|best| precedes(&best, &hit)) {
                return None;
            }
            nearest = Some(hit);
            Some(hit.distance)
        });
        nearest
    }

    fn hit_triangle(&self, ray: &ShearedRay, index: u32, corners: &[DVec3; 3], leaving: Leaving) -> Option<Hit> {
        if leaving == Leaving::Triangle(index) {
            return None;
        }
        let hit = ray.intersect(corners)?;
        if let Leaving::Triangle(start) = leaving
            && hit.distance <= 1e-9 * (corners[0] - corners[1]).abs().max_element()
            && coplanar(&self.corners[start as usize], corners)
        {
            // On the edge to a neighbour in the same plane, the ray leaves both.
            return None;
        }
        let surface = Surface::Triangle { index, barycentric: hit.barycentric };
        Some(Hit { distance: hit.distance, surface })
    }

    fn hit_pane(
        &self,
        ray: &Ray,
        max_distance: f64,
        index: u32,
        leaving: Leaving,
        counters: &mut Counters,
    ) -> Option<Hit> {
        let pane = &self.panes[index as usize];
        let face = match leaving {
            Leaving::Pane { index: own, face } if own == index => Some(face),
            _ => None,
        };
        let hit = pane.intersect_outside(&to_local(pane, ray), max_distance, face, counters)?;
        Some(Hit { distance: hit.distance, surface: Surface::Pane { index, hit } })
    }
}

/// Whether `a` is the one to report of two hits.
fn precedes(a: &Hit, b: &Hit) -> bool {
    let rank = |hit: &Hit| match hit.surface {
        Surface::Triangle { index, .. } => (0, index),
        Surface::Pane { index, .. } => (1, index),
    };
    a.distance < b.distance || (a.distance == b.distance && rank(a) < rank(b))
}

fn gather(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Vec<[DVec3; 3]>, AcceleratorError> {
    if let Some(index) = positions.iter().position(|position| !in_range(*position)) {
        return Err(AcceleratorError::Position { index, position: positions[index] });
    }
    let corner = |triangle: usize, corner: u32| {
        let missing = AcceleratorError::Corner { triangle, corner, positions: positions.len() };
        positions.get(corner as usize).copied().ok_or(missing)
    };
    let gathered =
        triangles.iter().enumerate().map(|(i, [a, b, c])| Ok([corner(i, *a)?, corner(i, *b)?, corner(i, *c)?]));
    gathered.collect()
}

fn in_range(p: DVec3) -> bool {
    p.is_finite() && p.abs().max_element() < 1e100
}

/// Whether the box around a triangle, in the pane's frame, overlaps the box around its glass.
fn reaches_into(triangle: &[DVec3; 3], pane: &Pane) -> bool {
    let [a, b, c] = triangle.map(|corner| pane.frame.point_to_local(corner));
    let (min, max) = (a.min(b).min(c), a.max(b).max(c));
    let [low, high] = pane.local_bounds();
    let slack = 64.0 * f64::EPSILON * (min.abs().max(max.abs()).max_element() + pane.frame.origin.abs().max_element());
    (min - slack).cmple(high).all() && (max + slack).cmpge(low).all()
}

fn to_local(pane: &Pane, ray: &Ray) -> Ray {
    Ray::new(pane.frame.point_to_local(ray.origin), pane.frame.vector_to_local(ray.direction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::testing::{Glass, fixed_seed};
    use crate::geometry::{Frame, HeightField, PaneBoundary};
    use glam::{DMat3, dvec2};
    use proptest::prelude::*;
    use std::sync::LazyLock;

    /// Everything tested against everything, without a hierarchy.
    fn by_brute_force(accelerator: &Accelerator, ray: &Ray, max_distance: f64, leaving: Leaving) -> Option<Hit> {
        let mut counters = Counters::default();
        let sheared = ShearedRay::new(ray);
        let triangles = (0..).zip(&accelerator.corners).map(|(i, c)| accelerator.hit_triangle(&sheared, i, c, leaving));
        let triangles: Vec<_> = triangles.collect();
        let panes = (0..accelerator.panes.len() as u32)
            .map(|i| accelerator.hit_pane(ray, max_distance, i, leaving, &mut counters));
        let hits = triangles.into_iter().chain(panes).flatten().filter(|hit| hit.distance <= max_distance);
        hits.reduce(|best, hit| if precedes(&hit, &best) { hit } else { best })
    }

    fn check(accelerator: &Accelerator, ray: &Ray, max_distance: f64, leaving: Leaving) -> Option<Hit> {
        let mut counters = Counters::default();
        let found = accelerator.closest_hit(ray, max_distance, leaving, &mut counters);
        assert_eq!(found, by_brute_force(accelerator, ray, max_distance, leaving), "{ray:?}");
        assert_eq!(accelerator.occluded(ray, max_distance, leaving, None, &mut counters), found.is_some(), "{ray:?}");
        for pane in 0..accelerator.panes.len() as u32 {
            let is_pane = |hit: &Hit| matches!(hit.surface, Surface::Pane { index, .. } if index == pane);
            let on_pane = accelerator.closest_hit_on_pane(pane, ray, max_distance, leaving, &mut counters);
            assert_eq!(on_pane, found.filter(is_pane), "{ray:?}");
        }
        found
    }

    /// A grid of squares of two triangles each in the plane z = 0, from `corner` over `size`.
    fn floor(corner: DVec3, size: f64, squares: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let n = squares + 1;
        let step = size / f64::from(squares);
        let positions =
            (0..n * n).map(|i| corner + DVec3::new(f64::from(i % n), f64::from(i / n), 0.0) * step).collect();
        let triangles = (0..squares * squares).flat_map(|i| {
            let a = i / squares * n + i % squares;
            [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]
        });
        (positions, triangles.collect())
    }

    fn random_frame(seed: f64) -> Frame {
        let x = DVec3::new(libm::sin(seed), libm::cos(3.0 * seed), libm::sin(7.0 * seed + 1.0)).normalize();
        let y = x.cross(DVec3::new(libm::cos(5.0 * seed), 0.3, libm::sin(11.0 * seed))).normalize();
        Frame::new(DVec3::new(libm::sin(13.0 * seed), libm::sin(17.0 * seed), libm::sin(19.0 * seed)), x, y)
    }

    fn pane(frame: Frame, scale: f64, kind: Glass) -> Pane {
        let size = dvec2(0.4, 0.3) * scale;
        let faces = [0.1, 0.7].map(|variant| kind.face(size, 0.002 * scale, variant));
        let [front, back] = faces;
        Pane::new("pane".into(), frame, size, 0.006 * scale, 1.5, DVec3::ZERO, front, back).unwrap()
    }

    /// Triangles and panes without any order around `centre`, of the size of `scale`.
    fn clutter(centre: DVec3, scale: f64) -> Accelerator {
        let noise = |i: u32| {
            DVec3::new(libm::sin(f64::from(i) * 1.7), libm::sin(f64::from(i) * 2.9), libm::sin(f64::from(i) * 5.3))
        };
        let positions: Vec<_> = (0..600).map(|i| centre + (noise(i / 3) + 0.2 * noise(i + 1000)) * scale).collect();
        let triangles: Vec<_> = (0..200).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let panes = (0..8).map(|i| {
            let mut frame = random_frame(f64::from(i));
            frame.origin = centre + frame.origin * scale;
            pane(frame, scale, Glass::ALL[i as usize % 4])
        });
        Accelerator::build(&positions, &triangles, panes.collect()).unwrap()
    }

    /// One scene for each scale, at the origin and far from it.
    static CLUTTERS: LazyLock<Vec<(DVec3, f64, Accelerator)>> = LazyLock::new(|| {
        let places = [1e-3, 1.0, 1e3].into_iter().flat_map(|scale| [(scale, 0.0), (scale, 1e4)]);
        let scene = |(scale, far): (f64, f64)| {
            let centre = DVec3::new(far, -far, 0.5 * far) * scale;
            (centre, scale, clutter(centre, scale))
        };
        places.map(scene).collect()
    });

    fn direction() -> impl Strategy<Value = DVec3> {
        let component = || prop_oneof![4 => -1.0..1.0f64, 1 => Just(0.0), 1 => Just(-0.0), 1 => -1e-8..1e-8f64];
        [component(), component(), component()]
            .prop_map(DVec3::from)
            .prop_filter("a direction has a length", |d| d.length() > 1e-3)
            .prop_map(DVec3::normalize)
    }

    proptest! {
        #![proptest_config(fixed_seed(4000))]

        #[test]
        fn the_hierarchy_finds_what_brute_force_finds(
            direction in direction(), target in prop::array::uniform3(-1.0..1.0f64), distance in 0.0..4.0f64,
            max_distance in prop_oneof![Just(f64::INFINITY), 0.0..3.0f64],
            scene in 0usize..6,
        ) {
            let (centre, scale, ref scene) = CLUTTERS[scene];
            let ray = Ray::new(centre + (DVec3::from(target) - direction * distance) * scale, direction);
            check(scene, &ray, max_distance * scale, Leaving::Nothing);
        }

        #[test]
        fn rays_that_leave_a_surface_do_not_find_it_again_by_rounding(
            direction in direction(), target in prop::array::uniform3(-1.0..1.0f64), onward in direction(),
        ) {
            let scene = &CLUTTERS[2].2;
            let ray = Ray::new(DVec3::from(target) - direction * 2.0, direction);
            if let Some(Hit { distance, surface: Surface::Triangle { index, .. } }) =
                check(scene, &ray, f64::INFINITY, Leaving::Nothing)
            {
                let next = check(scene, &Ray::new(ray.at(distance), onward), f64::INFINITY, Leaving::Triangle(index));
                if let Some(Hit { surface: Surface::Triangle { index: next, .. }, .. }) = next {
                    prop_assert_ne!(next, index);
                }
            }
        }
    }

    #[test]
    fn an_empty_scene_has_nothing_to_hit() {
        let scene = Accelerator::build(&[], &[], vec![]).unwrap();
        assert_eq!(check(&scene, &Ray::new(DVec3::ZERO, DVec3::Z), f64::INFINITY, Leaving::Nothing), None);
        assert_eq!(scene.bounds(), None);
    }

    #[test]
    fn a_scene_of_one_primitive_works() {
        let (positions, _) = floor(DVec3::ZERO, 1.0, 1);
        let scene = Accelerator::build(&positions, &[[0, 1, 3]], vec![]).unwrap();
        let ray = Ray::new(DVec3::new(0.7, 0.2, 1.0), DVec3::NEG_Z);
        assert_eq!(check(&scene, &ray, f64::INFINITY, Leaving::Nothing).unwrap().distance, 1.0);
        let scene = Accelerator::build(&[], &[], vec![pane(random_frame(0.0), 1.0, Glass::Flat)]).unwrap();
        let ray = Ray::new(random_frame(0.0).origin + random_frame(0.0).axes.z_axis, -random_frame(0.0).axes.z_axis);
        assert!(check(&scene, &ray, f64::INFINITY, Leaving::Nothing).is_some());
    }

    #[test]
    fn a_grid_of_pixel_centres_sees_a_floor_without_holes() {
        for origin in [DVec3::ZERO, DVec3::new(1e4, 3e4, -2e4)] {
            let (positions, triangles) = floor(origin, 1.0, 8);
            let scene = Accelerator::build(&positions, &triangles, vec![]).unwrap();
            for i in 0..32 * 32 {
                let offset = DVec3::new(f64::from(i % 32) + 0.5, f64::from(i / 32) + 0.5, 32.0) / 32.0;
                for (up, direction) in [(1.0, DVec3::new(0.0, 0.0, -1.0)), (-1.0, DVec3::new(-0.0, 0.0, 1.0))] {
                    let ray = Ray::new(origin + offset * DVec3::new(1.0, 1.0, up), direction);
                    let hit = check(&scene, &ray, f64::INFINITY, Leaving::Nothing).expect("the floor has no holes");
                    assert!((hit.distance - 1.0).abs() < 1e-11);
                }
            }
        }
    }

    #[test]
    fn a_ray_from_an_edge_between_two_triangles_of_a_plane_is_not_shadowed_by_either() {
        let (positions, triangles) = floor(DVec3::new(0.1, 0.2, 0.3), 1.0, 4);
        let frame = random_frame(0.3);
        let positions: Vec<_> = positions.into_iter().map(|p| frame.point_to_world(p)).collect();
        let scene = Accelerator::build(&positions, &triangles, vec![]).unwrap();
        for i in 0..1000 {
            // Points on diagonals, on sides and at corners of squares.
            let s = (f64::from(i) + 0.5) / 1000.0;
            let on_floor = DVec3::new(0.1 + s, if i % 2 == 0 { 0.2 + s } else { 0.45 }, 0.3);
            let from = frame.point_to_world(on_floor + DVec3::new(0.3, 0.1, 1.0));
            let target = frame.point_to_world(on_floor);
            let ray = Ray::new(from, (target - from).normalize());
            let hit = check(&scene, &ray, f64::INFINITY, Leaving::Nothing).unwrap();
            let Surface::Triangle { index, .. } = hit.surface else { panic!("there are only triangles") };
            let up =
                frame.vector_to_world(DVec3::new(libm::sin(f64::from(i)), libm::cos(f64::from(i)), 0.1).normalize());
            assert_eq!(check(&scene, &Ray::new(ray.at(hit.distance), up), 10.0, Leaving::Triangle(index)), None);
        }
    }

    #[test]
    fn of_two_things_at_the_same_place_the_first_is_reported() {
        let (positions, triangles) = floor(DVec3::ZERO, 1.0, 3);
        let twice: Vec<_> = triangles.iter().rev().chain(&triangles).copied().collect();
        let scene = Accelerator::build(&positions, &twice, vec![]).unwrap();
        for i in 0..100 {
            let ray = Ray::new(DVec3::new(0.01 * f64::from(i), 0.37, 1.0), DVec3::NEG_Z);
            let hit = check(&scene, &ray, f64::INFINITY, Leaving::Nothing).unwrap();
            assert!(matches!(hit.surface, Surface::Triangle { index, .. } if index < triangles.len() as u32));
        }
    }

    #[test]
    fn a_tiny_pane_in_a_large_scene_is_neither_missed_nor_walked_through() {
        // A pane of 1 mm glass in a landscape of 10 km.
        let (positions, triangles) = floor(DVec3::new(-5e3, -5e3, -1.0), 1e4, 8);
        let frame = Frame::new(DVec3::new(1234.0, -2345.0, 3.0), DVec3::X, DVec3::Y);
        let size = dvec2(0.01, 0.01);
        let flat = || HeightField::flat(size).unwrap();
        let glass = Pane::new("tiny".into(), frame, size, 0.001, 1.5, DVec3::ZERO, flat(), flat()).unwrap();
        let scene = Accelerator::build(&positions, &triangles, vec![glass]).unwrap();
        for i in 0..400 {
            let target = frame.origin + DVec3::new(f64::from(i % 20) - 9.5, f64::from(i / 20) - 9.5, 0.0) * 5e-4;
            for from in [DVec3::new(0.0, 0.0, 5.0), DVec3::new(900.0, -300.0, 4e3), DVec3::new(1e-3, 0.0, 2e-3)] {
                let ray = Ray::new(target + from, -from.normalize());
                let hit = check(&scene, &ray, f64::INFINITY, Leaving::Nothing).unwrap();
                assert!(matches!(hit.surface, Surface::Pane { index: 0, .. }), "{hit:?}");
                let mut counters = Counters::default();
                assert!(!scene.occluded(&ray, from.length(), Leaving::Nothing, Some(0), &mut counters));
            }
        }
    }

    #[test]
    fn a_ray_in_the_glass_meets_what_is_stuck_into_it() {
        let frame = random_frame(0.9);
        let glass = || vec![pane(frame, 1.0, Glass::Crown)];
        let ray = Ray::new(frame.point_to_world(DVec3::new(0.0, 0.0, 0.003)), frame.axes.x_axis);
        let mut counters = Counters::default();
        let free = Accelerator::build(&[], &[], glass()).unwrap();
        let boundary = free.closest_hit_inside(0, &ray, None, &mut counters).unwrap();
        assert!(matches!(boundary.surface, Surface::Pane { hit: PaneHit { inside: true, .. }, .. }));
        let nail = [DVec3::new(0.001, -1.0, -1.0), DVec3::new(0.001, 1.0, -1.0), DVec3::new(0.001, 0.0, 1.0)];
        let nail = nail.map(|corner| frame.point_to_world(corner));
        let pierced = Accelerator::build(&nail, &[[0, 1, 2]], glass()).unwrap();
        let hit = pierced.closest_hit_inside(0, &ray, None, &mut counters).unwrap();
        assert!(matches!(hit.surface, Surface::Triangle { index: 0, .. }));
        assert!((hit.distance - 0.001).abs() < 1e-14);
        let back = Ray::new(ray.origin, -ray.direction);
        let hit = pierced.closest_hit_inside(0, &back, None, &mut counters).unwrap();
        let Surface::Pane { hit, .. } = hit.surface else { panic!("the triangle is on the other side") };
        assert!(hit.inside && (hit.boundary != PaneBoundary::Edge || hit.point.x < -0.199));
    }

    #[test]
    fn bad_meshes_are_refused() {
        let check = |positions: &[DVec3], triangles: &[[u32; 3]], expected| {
            assert_eq!(Accelerator::build(positions, triangles, vec![]).unwrap_err(), expected);
        };
        let corner = AcceleratorError::Corner { triangle: 0, corner: 7, positions: 1 };
        check(&[DVec3::ZERO], &[[0, 7, 0]], corner);
        let infinite = DVec3::new(0.0, f64::INFINITY, 0.0);
        check(&[DVec3::ZERO, infinite], &[], AcceleratorError::Position { index: 1, position: infinite });
        let lost = Frame { origin: infinite, axes: DMat3::IDENTITY };
        let glass = pane(lost, 1.0, Glass::Flat);
        let error = Accelerator::build(&[], &[], vec![glass]).unwrap_err();
        assert_eq!(error, AcceleratorError::PanePlace("pane".into()));
    }
}
