//! Hits are those of brute force, whatever the size and the order of things, and rays do not find again what they
//! leave.

use super::*;
use crate::geometry::testing::{Glass, fixed_seed, rectangular};
use crate::geometry::{Frame, HeightField, PaneBoundary};
use glam::{DMat3, dvec2};
use proptest::prelude::*;
use std::sync::LazyLock;

/// Everything tested against everything, without a hierarchy.
fn by_brute_force(accelerator: &Accelerator, ray: &Ray, max_distance: f64, ray_origin: SurfaceId) -> Option<Hit> {
    let mut counters = Counters::default();
    let query = Query::new(ray, ray_origin, Parts::Drawn);
    let triangles = (0..).zip(&accelerator.corners).map(|(i, c)| accelerator.hit_triangle(&query, i, c));
    let triangles: Vec<_> = triangles.collect();
    let panes = (0..accelerator.panes.len() as u32)
        .map(|i| accelerator.hit_pane(ray, max_distance, i, ray_origin, &mut counters));
    let hits = triangles.into_iter().chain(panes).flatten().filter(|hit| hit.distance <= max_distance);
    hits.reduce(|best, hit| if precedes(&hit, &best) { hit } else { best })
}

fn check(accelerator: &Accelerator, ray: &Ray, max_distance: f64, ray_origin: SurfaceId) -> Option<Hit> {
    let mut counters = Counters::default();
    let found = accelerator.closest_hit(ray, max_distance, ray_origin, &mut counters);
    assert_eq!(found, by_brute_force(accelerator, ray, max_distance, ray_origin), "{ray:?}");
    assert_eq!(accelerator.occluded(ray, max_distance, ray_origin, None, &mut counters), found.is_some(), "{ray:?}");
    for pane in 0..accelerator.panes.len() as u32 {
        let is_pane = |hit: &Hit| matches!(hit.surface, Surface::Pane { index, .. } if index == pane);
        let on_pane = accelerator.solid().closest_hit_on_pane(pane, ray, max_distance, ray_origin, &mut counters);
        assert_eq!(on_pane, found.filter(is_pane), "{ray:?}");
    }
    found
}

/// A grid of squares of two triangles each in the plane z = 0, from `corner` over `size`.
fn floor(corner: DVec3, size: f64, squares: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let n = squares + 1;
    let step = size / f64::from(squares);
    let positions = (0..n * n).map(|i| corner + DVec3::new(f64::from(i % n), f64::from(i / n), 0.0) * step).collect();
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
    rectangular(frame, size, 0.006 * scale, 1.5, DVec3::ZERO, [front, back])
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
    Accelerator::build(&positions, &triangles, &[], panes.collect()).unwrap()
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

/// Waves under clutter, in steps of which each is a sheet, a hole in one that is none, and a ball.
fn water() -> Accelerator {
    let (mut positions, mut triangles, mut surfaces) = (Vec::new(), Vec::new(), Vec::new());
    for (height, hole) in [(0.0, false), (0.7, true), (1.4, false)] {
        let first = triangles.len() as u32;
        let (corners, cells) = floor(DVec3::new(-1.0, -1.0, height), 2.0, 16);
        let start = positions.len() as u32;
        let wave = |p: &DVec3| *p + DVec3::Z * (0.08 * libm::sin(6.0 * p.x + height) * libm::cos(5.0 * p.y));
        positions.extend(corners.iter().map(wave));
        let kept = cells.iter().enumerate().filter(|(k, _)| !hole || *k != 200);
        triangles.extend(kept.map(|(_, triangle)| triangle.map(|corner| corner + start)));
        surfaces.push(first..triangles.len() as u32);
        // Something that belongs to no surface, between them.
        let block = positions.len() as u32;
        positions.extend([DVec3::X, DVec3::Y, DVec3::NEG_ONE].map(|p| 0.4 * p + DVec3::Z * (height + 0.1)));
        triangles.push([block, block + 1, block + 2]);
    }
    let scene = Accelerator::build(&positions, &triangles, &surfaces, vec![pane(random_frame(0.3), 1.0, Glass::Flat)]);
    let scene = scene.unwrap();
    assert_eq!(scene.sheets.len(), 2);
    scene
}

#[test]
fn rays_over_sheets_meet_what_is_there() {
    let scene = water();
    let noise = |i: u32, k: u32| libm::sin(f64::from(i) * (1.7 + f64::from(k)) + f64::from(k)).fract();
    let (mut steep, mut others, mut ways) = (0, 0, [0; 2]);
    for i in 0..20_000 {
        let direction = DVec3::new(noise(i, 0), noise(i, 1), noise(i, 2)).normalize();
        let ray = Ray::new(DVec3::new(noise(i, 3), noise(i, 4), 2.0 * noise(i, 5)), direction);
        let Some(hit) = check(&scene, &ray, f64::INFINITY, SurfaceId::Nothing) else { continue };
        let Surface::Triangle { index, .. } = hit.surface else { continue };
        let mut counters = Counters::default();
        let end = hit.distance;
        assert!(!scene.solid().occluded_before(&ray, end, SurfaceId::Nothing, index, &mut counters), "{ray:?}");
        let onward = DVec3::new(noise(i, 6), noise(i, 7), noise(i, 8)).normalize();
        let next = Ray::new(ray.at(end), onward);
        let ray_origin = SurfaceId::Triangle(index);
        if scene.left_behind(ray_origin, &next).is_some() {
            steep += 1
        } else {
            others += 1
        }
        // On to the next surface, and to one behind that.
        let Some(second) = check(&scene, &next, f64::INFINITY, ray_origin) else { continue };
        let further = Ray::new(next.at(second.distance * (1.0 + 1e-9)), onward);
        let Some(third) = check(&scene, &further, f64::INFINITY, SurfaceId::Nothing) else { continue };
        if let Surface::Triangle { index, .. } = third.surface {
            let end = second.distance + third.distance;
            assert!(scene.solid().occluded_before(&next, end, ray_origin, index, &mut counters), "{next:?}");
            ways[usize::from(scene.left_behind(SurfaceId::Triangle(index), &next).is_some())] += 1;
        }
    }
    assert!(steep > 1000 && others > 1000 && ways.iter().all(|count| *count > 100), "{steep} {others} {ways:?}");
}

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
        check(scene, &ray, max_distance * scale, SurfaceId::Nothing);
    }

    #[test]
    fn rays_that_leave_a_surface_do_not_find_it_again_by_rounding(
        direction in direction(), target in prop::array::uniform3(-1.0..1.0f64), onward in direction(),
    ) {
        let scene = &CLUTTERS[2].2;
        let ray = Ray::new(DVec3::from(target) - direction * 2.0, direction);
        if let Some(Hit { distance, surface: Surface::Triangle { index, .. } }) =
            check(scene, &ray, f64::INFINITY, SurfaceId::Nothing)
        {
            let next = check(scene, &Ray::new(ray.at(distance), onward), f64::INFINITY, SurfaceId::Triangle(index));
            if let Some(Hit { surface: Surface::Triangle { index: next, .. }, .. }) = next {
                prop_assert_ne!(next, index);
            }
        }
    }
}

#[test]
fn an_empty_scene_has_nothing_to_hit() {
    let scene = Accelerator::build(&[], &[], &[], vec![]).unwrap();
    assert_eq!(check(&scene, &Ray::new(DVec3::ZERO, DVec3::Z), f64::INFINITY, SurfaceId::Nothing), None);
    assert_eq!(scene.bounds(), None);
}

#[test]
fn a_scene_of_one_primitive_works() {
    let (positions, _) = floor(DVec3::ZERO, 1.0, 1);
    let scene = Accelerator::build(&positions, &[[0, 1, 3]], &[], vec![]).unwrap();
    let ray = Ray::new(DVec3::new(0.7, 0.2, 1.0), DVec3::NEG_Z);
    assert_eq!(check(&scene, &ray, f64::INFINITY, SurfaceId::Nothing).unwrap().distance, 1.0);
    let scene = Accelerator::build(&[], &[], &[], vec![pane(random_frame(0.0), 1.0, Glass::Flat)]).unwrap();
    let ray = Ray::new(random_frame(0.0).origin + random_frame(0.0).axes.z_axis, -random_frame(0.0).axes.z_axis);
    assert!(check(&scene, &ray, f64::INFINITY, SurfaceId::Nothing).is_some());
}

#[test]
fn a_grid_of_pixel_centres_sees_a_floor_without_holes() {
    for origin in [DVec3::ZERO, DVec3::new(1e4, 3e4, -2e4)] {
        let (positions, triangles) = floor(origin, 1.0, 8);
        let scene = Accelerator::build(&positions, &triangles, &[], vec![]).unwrap();
        for i in 0..32 * 32 {
            let offset = DVec3::new(f64::from(i % 32) + 0.5, f64::from(i / 32) + 0.5, 32.0) / 32.0;
            for (up, direction) in [(1.0, DVec3::new(0.0, 0.0, -1.0)), (-1.0, DVec3::new(-0.0, 0.0, 1.0))] {
                let ray = Ray::new(origin + offset * DVec3::new(1.0, 1.0, up), direction);
                let hit = check(&scene, &ray, f64::INFINITY, SurfaceId::Nothing).expect("the floor has no holes");
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
    let scene = Accelerator::build(&positions, &triangles, &[], vec![]).unwrap();
    for i in 0..1000 {
        // Points on diagonals, on sides and at corners of squares.
        let s = (f64::from(i) + 0.5) / 1000.0;
        let on_floor = DVec3::new(0.1 + s, if i % 2 == 0 { 0.2 + s } else { 0.45 }, 0.3);
        let from = frame.point_to_world(on_floor + DVec3::new(0.3, 0.1, 1.0));
        let target = frame.point_to_world(on_floor);
        let ray = Ray::new(from, (target - from).normalize());
        let hit = check(&scene, &ray, f64::INFINITY, SurfaceId::Nothing).unwrap();
        let Surface::Triangle { index, .. } = hit.surface else { panic!("there are only triangles") };
        let up = frame.vector_to_world(DVec3::new(libm::sin(f64::from(i)), libm::cos(f64::from(i)), 0.1).normalize());
        assert_eq!(check(&scene, &Ray::new(ray.at(hit.distance), up), 10.0, SurfaceId::Triangle(index)), None);
    }
}

#[test]
fn of_two_things_at_the_same_place_the_first_is_reported() {
    let (positions, triangles) = floor(DVec3::ZERO, 1.0, 3);
    let twice: Vec<_> = triangles.iter().rev().chain(&triangles).copied().collect();
    let scene = Accelerator::build(&positions, &twice, &[], vec![]).unwrap();
    for i in 0..100 {
        let ray = Ray::new(DVec3::new(0.01 * f64::from(i), 0.37, 1.0), DVec3::NEG_Z);
        let hit = check(&scene, &ray, f64::INFINITY, SurfaceId::Nothing).unwrap();
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
    let glass = rectangular(frame, size, 0.001, 1.5, DVec3::ZERO, [flat(), flat()]);
    let scene = Accelerator::build(&positions, &triangles, &[], vec![glass]).unwrap();
    for i in 0..400 {
        let target = frame.origin + DVec3::new(f64::from(i % 20) - 9.5, f64::from(i / 20) - 9.5, 0.0) * 5e-4;
        for from in [DVec3::new(0.0, 0.0, 5.0), DVec3::new(900.0, -300.0, 4e3), DVec3::new(1e-3, 0.0, 2e-3)] {
            let ray = Ray::new(target + from, -from.normalize());
            let hit = check(&scene, &ray, f64::INFINITY, SurfaceId::Nothing).unwrap();
            assert!(matches!(hit.surface, Surface::Pane { index: 0, .. }), "{hit:?}");
            let mut counters = Counters::default();
            assert!(!scene.occluded(&ray, from.length(), SurfaceId::Nothing, Some(0), &mut counters));
        }
    }
}

#[test]
fn a_ray_in_the_glass_meets_what_is_stuck_into_it() {
    let frame = random_frame(0.9);
    let glass = || vec![pane(frame, 1.0, Glass::Crown)];
    let ray = Ray::new(frame.point_to_world(DVec3::new(0.0, 0.0, 0.003)), frame.axes.x_axis);
    let mut counters = Counters::default();
    let free = Accelerator::build(&[], &[], &[], glass()).unwrap();
    let boundary = free.closest_hit_inside(0, &ray, None, &mut counters).unwrap();
    assert!(matches!(boundary.surface, Surface::Pane { hit: PaneHit { inside: true, .. }, .. }));
    let nail = [DVec3::new(0.001, -1.0, -1.0), DVec3::new(0.001, 1.0, -1.0), DVec3::new(0.001, 0.0, 1.0)];
    let nail = nail.map(|corner| frame.point_to_world(corner));
    let pierced = Accelerator::build(&nail, &[[0, 1, 2]], &[], glass()).unwrap();
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
        assert_eq!(Accelerator::build(positions, triangles, &[], vec![]).unwrap_err(), expected);
    };
    let corner = AcceleratorError::Corner { triangle: 0, corner: 7, positions: 1 };
    check(&[DVec3::ZERO], &[[0, 7, 0]], corner);
    let infinite = DVec3::new(0.0, f64::INFINITY, 0.0);
    check(&[DVec3::ZERO, infinite], &[], AcceleratorError::Position { index: 1, position: infinite });
    let lost = Frame { origin: infinite, axes: DMat3::IDENTITY };
    let glass = pane(lost, 1.0, Glass::Flat);
    let error = Accelerator::build(&[], &[], &[], vec![glass]).unwrap_err();
    assert_eq!(error, AcceleratorError::PanePlace("test".into()));
}

#[test]
fn a_thousand_times_the_same_triangle_is_no_thousand_levels() {
    let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.0, 0.0, 3.0)];
    let mut triangles = vec![[0, 1, 2]; 50_000];
    triangles.push([0, 1, 3]);
    let accelerator = Accelerator::build(&positions, &triangles, &[], vec![]).unwrap();
    let ray = Ray::new(DVec3::new(0.2, 0.3, 1.0), DVec3::NEG_Z);
    let hit = accelerator.closest_hit(&ray, f64::INFINITY, SurfaceId::Nothing, &mut Counters::default()).unwrap();
    assert!(matches!(hit.surface, Surface::Triangle { index: 0, .. }), "{hit:?}");
}
