//! What is found is shared, what is apart is let through, and what brute force finds is found.

use glam::dvec2;
use proptest::prelude::*;

use super::*;
use crate::geometry::testing::{Glass as Kind, fixed_seed, rectangular};
use crate::geometry::{Frame, HeightField};

const THICKNESS: f64 = 0.003;

fn flat(origin: DVec3, x: DVec3, y: DVec3, size: DVec2) -> Pane {
    let face = || HeightField::flat(size).unwrap();
    rectangular(Frame::new(origin, x, y), size, THICKNESS, 1.5, DVec3::ZERO, [face(), face()])
}

/// A flat pane of 0.3 m x 0.3 m in the plane z = `z`.
fn level(z: f64) -> Pane {
    flat(DVec3::new(0.0, 0.0, z), DVec3::X, DVec3::Y, DVec2::splat(0.3))
}

fn meets(pane: &Pane, shape: &Shape<'_>) -> Option<DVec3> {
    let mut budget = u32::MAX;
    let found = contact(pane, shape, &mut budget);
    assert!(u32::MAX - budget <= MOST_PARTS);
    found
}

fn are_in_contact(one: &Pane, other: &Pane) -> bool {
    let (there, back) = (meets(one, &Shape::Pane(other)).is_some(), meets(other, &Shape::Pane(one)).is_some());
    assert_eq!(there, back, "the order matters");
    there
}

#[test]
fn faces_that_touch_are_told_from_faces_a_nanometre_apart() {
    for far in [0.0, 1.0, 1e3] {
        let pane = level(far);
        assert!(are_in_contact(&pane, &level(far + THICKNESS)), "at {far}");
        assert!(are_in_contact(&pane, &level(far - THICKNESS)), "at {far}");
        assert!(are_in_contact(&pane, &level(far + 0.5 * THICKNESS)), "at {far}");
        assert!(are_in_contact(&pane, &pane), "at {far}");
        assert!(!are_in_contact(&pane, &level(far + THICKNESS + 1e-9)), "at {far}");
        assert!(!are_in_contact(&pane, &level(far - THICKNESS - 1e-9)), "at {far}");
    }
}

#[test]
fn panes_side_by_side_may_meet_at_their_edges_but_not_overlap() {
    let beside = |offset: f64| flat(DVec3::new(offset, 0.0, 0.0), DVec3::X, DVec3::Y, DVec2::splat(0.3));
    for offset in [0.3, 0.1 + 0.2, 0.3 - 1e-6, 0.3 + 1e-9] {
        assert!(!are_in_contact(&level(0.0), &beside(offset)), "{offset}");
    }
    for offset in [0.3 - 1e-5, 0.29, 0.0] {
        assert!(are_in_contact(&level(0.0), &beside(offset)), "{offset}");
    }
    // The other's edge stands on a face, or the border of a face rests on it at an angle.
    let on_edge = flat(DVec3::new(0.0, 0.05, THICKNESS + 0.15), DVec3::X, DVec3::Z, DVec2::splat(0.3));
    assert!(!are_in_contact(&level(0.0), &on_edge));
    let tilt = DVec3::new(0.0, 0.8, 0.6);
    let leaning = flat(DVec3::new(0.0, 0.0, THICKNESS) + tilt * 0.15, DVec3::NEG_X, tilt, DVec2::splat(0.3));
    assert!(leaning.frame.axes.z_axis.z < 0.0, "the glass is on the far side of its border");
    assert!(are_in_contact(&level(0.0), &leaning));
    let leaning = flat(DVec3::new(0.0, 0.0, THICKNESS) + tilt * 0.15, DVec3::X, tilt, DVec2::splat(0.3));
    assert!(!are_in_contact(&level(0.0), &leaning));
}

#[test]
fn panes_that_cross_meet_where_they_cross() {
    let across = flat(DVec3::new(0.1, 0.0, 0.0), DVec3::Y, DVec3::Z, DVec2::splat(0.3));
    let at = meets(&level(0.0), &Shape::Pane(&across)).unwrap();
    assert!(depth(&level(0.0), at) > -1e-12 && depth(&across, at) > -1e-12, "{at}");
}

#[test]
fn relief_decides_whether_panes_meet() {
    let size = DVec2::splat(0.3);
    // A blister of 1 mm in the middle of the upper face.
    let hill = || HeightField::new((0..81).map(|i| if i == 40 { 0.002 } else { 0.0 }).collect(), 9, 9, size).unwrap();
    let plane = || HeightField::flat(size).unwrap();
    let place = Frame::new(DVec3::ZERO, DVec3::X, DVec3::Y);
    let blistered = rectangular(place, size, THICKNESS, 1.5, DVec3::ZERO, [plane(), hill()]);
    let top = THICKNESS + blistered.back.height(DVec2::ZERO);
    assert!(are_in_contact(&blistered, &level(top - 1e-6)));
    assert!(!are_in_contact(&blistered, &level(top + 1e-6)));
    // Beside the blister there is room.
    let beside = flat(DVec3::new(0.2, 0.0, top - 5e-4), DVec3::X, DVec3::Y, dvec2(0.2, 0.3));
    assert!(!are_in_contact(&blistered, &beside));
}

#[test]
fn points_balls_and_polygons_are_found_in_glass_and_on_its_faces() {
    let pane = level(0.0);
    let ball = |z: f64, radius: f64| meets(&pane, &Shape::Ball { centre: DVec3::new(0.01, 0.02, z), radius }).is_some();
    assert!(ball(0.001, 0.0) && ball(0.0, 0.0) && ball(THICKNESS, 0.0));
    assert!(!ball(-1e-9, 0.0) && !ball(THICKNESS + 1e-9, 0.0));
    assert!(ball(0.1, 0.11) && ball(0.1, 10.0), "the ball holds part of the pane, or all of it");
    assert!(!ball(0.1, 0.1 - THICKNESS), "it rests on the face");
    let beside = Shape::Ball { centre: DVec3::new(0.151, 0.0, 0.001), radius: 0.0 };
    assert_eq!(meets(&pane, &beside), None);

    let square = |origin: DVec3, x: DVec3, y: DVec3| {
        meets(&pane, &Shape::Polygon(&[origin, origin + x, origin + x + y, origin + y])).is_some()
    };
    let (x, y, z) = (DVec3::X * 0.1, DVec3::Y * 0.1, DVec3::Z * 0.1);
    assert!(square(DVec3::ZERO, x, y) && square(DVec3::Z * THICKNESS, y, x), "on a face");
    assert!(square(DVec3::new(0.1, 0.1, 0.001), x, y), "partly in the glass");
    assert!(square(z * -0.5, x, z), "through the pane");
    assert!(!square(DVec3::Z * -1e-9, x, y) && !square(DVec3::Z * (THICKNESS + 1e-9), x, y));
    assert!(!square(DVec3::Z * THICKNESS, x, z), "it stands on the face with its edge");
    assert!(!square(DVec3::X * 0.15, y, z), "on the pane's edge");
}

#[test]
fn relief_that_runs_in_parallel_close_by_costs_no_more_than_the_budget() {
    let size = DVec2::splat(0.3);
    let face = || Kind::Crown.face(size, 0.002, 0.4);
    let pane = |z: f64| {
        let place = Frame::new(DVec3::Z * z, DVec3::X, DVec3::Y);
        rectangular(place, size, THICKNESS, 1.5, DVec3::ZERO, [face(), face()])
    };
    assert!(!are_in_contact(&pane(0.0), &pane(THICKNESS + 1e-4)));
    assert!(!are_in_contact(&pane(0.0), &pane(THICKNESS + 1e-8)));
    assert!(are_in_contact(&pane(0.0), &pane(THICKNESS - 1e-8)));
    let mut budget = 10;
    assert_eq!(contact(&pane(0.0), &Shape::Pane(&pane(THICKNESS + 1e-8)), &mut budget), None);
    assert_eq!(budget, 0);
}

/// A pane somewhere near the origin, with relief.
fn any_pane() -> impl Strategy<Value = Pane> {
    let kinds = prop::array::uniform2(prop::sample::select(Kind::ALL.to_vec()));
    let angles = prop::array::uniform3(-3.2..3.2f64);
    let place = prop::array::uniform3(-0.06..0.06f64);
    (kinds, angles, place, 0.002..0.02f64).prop_map(|(kinds, [a, b, c], place, thickness)| {
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, a, b, c);
        let size = dvec2(0.2, 0.15);
        let [front, back] = kinds.map(|kind| kind.face(size, 0.3 * thickness, a));
        let frame = Frame::new(place.into(), turn * DVec3::X, turn * DVec3::Y);
        rectangular(frame, size, thickness, 1.5, DVec3::ZERO, [front, back])
    })
}

/// How deep a point of the world is in the glass, metres along the pane's axes; negative outside.
fn depth(pane: &Pane, point: DVec3) -> f64 {
    let local = pane.frame.point_to_local(point);
    let at = local.truncate();
    let beside = (0.5 * pane.size() - at.abs()).min_element();
    let (front, back) = (pane.front.height(at), pane.thickness + pane.back.height(at));
    beside.min(local.z - front).min(back - local.z)
}

proptest! {
    #![proptest_config(fixed_seed(60))]

    #[test]
    fn contacts_are_those_of_brute_force(one in any_pane(), other in any_pane()) {
        let found = meets(&one, &Shape::Pane(&other));
        if let Some(at) = found {
            prop_assert!(depth(&one, at) > -1e-12 && depth(&other, at) > -1e-12, "{at} is not shared");
        }
        let [min, max] = one.local_bounds();
        let deepest = (0..40_i32.pow(3)).map(|i| {
            let part = DVec3::new(f64::from(i % 40), f64::from(i / 40 % 40), f64::from(i / 1600)) / 39.0;
            let point = one.frame.point_to_world(min + (max - min) * part);
            depth(&one, point).min(depth(&other, point))
        });
        if deepest.fold(f64::NEG_INFINITY, f64::max) > 1e-4 {
            prop_assert!(found.is_some(), "they overlap");
            prop_assert!(meets(&other, &Shape::Pane(&one)).is_some(), "the order matters");
        }
    }
}
