//! Rays meet panes where dense sampling says, whatever their outline.

use super::*;
use crate::geometry::testing::{Glass, fixed_seed, rectangular};
use glam::dvec2;
use proptest::prelude::*;

const SAMPLES: usize = 100_000;

/// A pane of about half a metre times `scale`; its faces are parallel or differ.
fn pane(kind: Glass, thickness: f64, parallel: bool, scale: f64) -> Pane {
    let size = dvec2(0.5, 0.4) * scale;
    let amplitude = if parallel { 0.004 } else { 0.3 * thickness } * scale;
    let front = kind.face(size, amplitude, 0.2);
    let back = if parallel { front.clone() } else { kind.face(size, amplitude, 0.9) };
    let frame = Frame::new(DVec3::ZERO, DVec3::X, DVec3::Y);
    rectangular(frame, size, thickness * scale, 1.5, DVec3::ZERO, [front, back])
}

/// Convex outlines in a rectangle of side 1 about the origin: the rectangle, a diamond, and some of an arch.
const OUTLINES: [&[[f64; 2]]; 3] = [
    &[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]],
    &[[0.0, -0.5], [0.5, 0.0], [0.0, 0.5], [-0.5, 0.0]],
    &[[-0.5, -0.5], [0.3, -0.5], [0.5, -0.1], [0.45, 0.2], [0.3, 0.4], [0.05, 0.5], [-0.3, 0.4]],
];

/// The same glass, of which a part is left.
fn cut(pane: Pane, outline: usize) -> Pane {
    let size = pane.size();
    let corners = OUTLINES[outline].iter().map(|corner| DVec2::from(*corner) * size).collect();
    let outline = Outline::polygon(corners).unwrap();
    let Pane { name, frame, thickness, index_of_refraction, absorption, layers, front, back, .. } = pane;
    let faces = [front, back];
    Pane::new(PaneParts { name, frame, outline, thickness, index_of_refraction, absorption, layers, faces }).unwrap()
}

fn any_pane() -> impl Strategy<Value = (Pane, f64)> {
    let kinds = prop::sample::select(Glass::ALL.to_vec());
    let thickness = prop::sample::select(vec![1e-4, 1e-3, 3e-3]);
    let scale = prop::sample::select(vec![1e-3, 1.0, 1e3]);
    (kinds, thickness, prop::bool::ANY, scale, 0..OUTLINES.len())
        .prop_map(|(k, t, parallel, s, outline)| (cut(pane(k, t, parallel, s), outline), s))
}

/// Depth of a point over the outline in the glass; negative outside.
fn depth(pane: &Pane, p: DVec3) -> f64 {
    let xy = p.truncate();
    (p.z - pane.front.height(xy)).min(pane.thickness - p.z + pane.back.height(xy))
}

/// Where a ray lies over the outline and between the extreme heights of the glass.
fn stretch_near_glass(pane: &Pane, ray: &Ray) -> Interval {
    let [min, max] = pane.local_bounds();
    let within = pane.outline.stretch(ray).intersection(Interval::new(0.0, f64::INFINITY));
    (0..3).fold(within, |stretch, axis| {
        let (o, d) = (ray.origin[axis], ray.direction[axis]);
        let (a, b) = ((min[axis] - o) / d, (max[axis] - o) / d);
        if a.is_nan() || b.is_nan() { stretch } else { stretch.intersection(Interval::new(a.min(b), a.max(b))) }
    })
}

/// Compares a hit with the depth at many points of the ray: before the hit the ray stays on its side, which `sign`
/// makes positive, and behind it, it is on the other one.
fn check(pane: &Pane, scale: f64, ray: &Ray, hit: Option<PaneHit>, sign: f64) -> Result<(), TestCaseError> {
    // Rounding of points at most 2 m away.
    let noise = 2e-15 * scale;
    let near = stretch_near_glass(pane, ray);
    if !near.is_empty() {
        let step = (near.max - near.min) / SAMPLES as f64;
        for i in 1..SAMPLES {
            let t = near.min + step * i as f64;
            if hit.is_some_and(|hit| t >= hit.distance) {
                break;
            }
            let depth = sign * depth(pane, ray.at(t));
            prop_assert!(depth > -noise, "missed the boundary before {} of {:?}: {:?}", t, ray, hit);
        }
    }
    let Some(hit) = hit else { return Ok(()) };
    prop_assert_eq!(hit.inside, sign > 0.0);
    prop_assert!((hit.point - ray.at(hit.distance)).length() < noise, "{:?} of {:?}", hit, ray);
    let least = pane.outline.cuts().iter().map(|cut| cut.distance(hit.point.truncate())).fold(0.0, f64::min);
    prop_assert!(pane.outline.bounds().grown(noise).contains(hit.point.truncate()) && least > -noise);
    match hit.boundary {
        PaneBoundary::Face(face) => {
            let (height, gradient) = pane.surface(face).slope(hit.point.truncate());
            prop_assert!((hit.point.z - pane.base_height(face) - height).abs() < noise);
            prop_assert!((hit.gradient - gradient).length() < 1e-9);
            let step = (near.max - near.min) / SAMPLES as f64;
            let beyond = (1..=1000).map(|i| hit.distance + step * f64::from(i) / 1000.0);
            let least = beyond.map(|t| sign * depth(pane, ray.at(t))).fold(f64::INFINITY, f64::min);
            prop_assert!(least < noise, "false hit {:?} of {:?}: {}", hit, ray, least);
        }
        PaneBoundary::Edge => {
            let at = hit.point.truncate();
            let to_sides = (0.5 * pane.size() - at.abs()).min_element();
            let to_edge = pane.outline.cuts().iter().map(|cut| cut.distance(at)).fold(to_sides, f64::min);
            prop_assert!(to_edge.abs() < noise && depth(pane, hit.point) > -noise, "{:?} of {:?}", hit, ray);
        }
    }
    Ok(())
}

fn angle() -> impl Strategy<Value = f64> {
    0.0..std::f64::consts::TAU
}

/// Points of the outline in units of its size: anywhere, on its border, in its corners.
fn place() -> impl Strategy<Value = DVec2> {
    let coordinate = || prop_oneof![6 => -0.5..0.5f64, 1 => Just(-0.5), 1 => Just(0.5)];
    (coordinate(), coordinate()).prop_map(|(x, y)| dvec2(x, y))
}

/// Angles to the plane from 1e-4 rad to a right angle, and 0.
fn elevation() -> impl Strategy<Value = f64> {
    prop_oneof![6 => (-4.0..0.19f64).prop_map(|e| libm::pow(10.0, e)), 1 => Just(0.0)]
}

fn direction(azimuth: f64, elevation: f64) -> DVec3 {
    let across = libm::cos(elevation);
    DVec3::new(across * libm::cos(azimuth), across * libm::sin(azimuth), libm::sin(elevation))
}

proptest! {
    #![proptest_config(fixed_seed(400))]

    #[test]
    fn rays_from_the_air_meet_what_dense_sampling_says(
        (pane, scale) in any_pane(), place in place(), depth_aimed_at in -1.0..2.0f64, azimuth in angle(),
        elevation in elevation(), up in prop::bool::ANY,
    ) {
        let direction = direction(azimuth, if up { elevation } else { -elevation });
        let target = (place * pane.size()).extend(depth_aimed_at * pane.thickness);
        let ray = Ray::new(target - direction * scale, direction);
        let hit = pane.intersect_outside(&ray, f64::INFINITY, None, &mut Counters::default());
        check(&pane, scale, &ray, hit, -1.0)?;
    }

    #[test]
    fn rays_from_within_the_glass_meet_what_dense_sampling_says(
        (pane, scale) in any_pane(), place in place(), s in 0.01..0.99f64, azimuth in angle(),
        elevation in elevation(), up in prop::bool::ANY,
    ) {
        let xy = pane.outline.nearest(place * pane.size() * 0.999_999, 0.0);
        let z = pane.front.height(xy) * (1.0 - s) + (pane.thickness + pane.back.height(xy)) * s;
        let ray = Ray::new(xy.extend(z), direction(azimuth, if up { elevation } else { -elevation }));
        let hit = pane.intersect_inside(&ray, None, &mut Counters::default());
        prop_assert!(hit.is_some());
        check(&pane, scale, &ray, hit, 1.0)?;
    }

    #[test]
    fn rays_from_a_face_meet_what_dense_sampling_says(
        (pane, scale) in any_pane(), place in place(), turns in prop::collection::vec((angle(), elevation()), 6),
        face in prop::sample::select(vec![Face::Front, Face::Back]), into_glass in prop::bool::ANY,
    ) {
        // A ray that is thrown on from each face that it meets, at grazing angles to that face too.
        let xy = pane.outline.nearest(place * pane.size(), 0.0);
        let (height, mut gradient) = pane.surface(face).slope(xy);
        let (mut from, mut face) = (xy.extend(pane.base_height(face) + height), face);
        for (azimuth, elevation) in turns {
            let along = dvec2(libm::cos(azimuth), libm::sin(azimuth));
            let tangent = along.extend(gradient.dot(along)).normalize();
            let normal = DVec3::new(-gradient.x, -gradient.y, 1.0).normalize();
            let normal = if (face == Face::Front) == into_glass { normal } else { -normal };
            let elevation = elevation.max(1e-9);
            let direction = tangent * libm::cos(elevation) + normal * libm::sin(elevation);
            let ray = Ray::new(from, direction.normalize());
            let mut counters = Counters::default();
            let hit = if into_glass {
                pane.intersect_inside(&ray, Some(face), &mut counters)
            } else {
                pane.intersect_outside(&ray, f64::INFINITY, Some(face), &mut counters)
            };
            prop_assert!(hit.is_some() || !into_glass);
            check(&pane, scale, &ray, hit, if into_glass { 1.0 } else { -1.0 })?;
            match hit {
                Some(PaneHit { boundary: PaneBoundary::Face(met), point, gradient: g, .. }) => {
                    (from, face, gradient) = (point, met, g);
                }
                _ => break,
            }
        }
    }

    #[test]
    fn nothing_is_met_beyond_the_largest_distance(
        (pane, scale) in any_pane(), place in place(), azimuth in angle(), elevation in elevation(),
        fraction in 0.5..1.5f64,
    ) {
        let direction = direction(azimuth, elevation);
        let ray = Ray::new((place * pane.size()).extend(0.0) - direction * scale, direction);
        let mut counters = Counters::default();
        if let Some(hit) = pane.intersect_outside(&ray, f64::INFINITY, None, &mut counters) {
            let limited = pane.intersect_outside(&ray, hit.distance * fraction, None, &mut counters);
            prop_assert_eq!(limited.is_some(), fraction >= 1.0);
        }
    }
}

#[test]
fn glass_of_no_thickness_or_with_bad_numbers_is_refused() {
    let size = dvec2(0.5, 0.4);
    let make = |thickness: f64, index: f64, absorption: DVec3, amplitude: f64, face_size: DVec2| {
        let front = Glass::Bumpy.face(size, amplitude, 0.0);
        let frame = Frame::new(DVec3::ZERO, DVec3::X, DVec3::Y);
        let back = HeightField::flat(face_size).unwrap();
        let parts = PaneParts {
            name: String::new(),
            frame,
            outline: Outline::centred(size),
            thickness,
            index_of_refraction: index,
            absorption,
            layers: [DVec3::ZERO; 2],
            faces: [Arc::new(front), Arc::new(back)],
        };
        Pane::new(parts).map(|_| ())
    };
    assert_eq!(make(0.003, 1.5, DVec3::ONE, 0.001, size), Ok(()));
    assert_eq!(make(0.0, 1.5, DVec3::ZERO, 0.0, size), Err(PaneError::Thickness(0.0)));
    assert_eq!(make(0.003, 0.9, DVec3::ZERO, 0.0, size), Err(PaneError::IndexOfRefraction(0.9)));
    let negative = DVec3::new(0.0, -2.0, 0.0);
    assert_eq!(make(0.003, 1.5, negative, 0.0, size), Err(PaneError::Absorption(-2.0)));
    let (larger, smaller) = (dvec2(0.6, 0.5), dvec2(0.6, 0.39));
    assert_eq!(make(0.003, 1.5, DVec3::ZERO, 0.0, larger), Ok(()));
    let beyond = PaneError::BeyondFace { face: smaller, pane: Rect::new(-0.5 * size, 0.5 * size) };
    assert_eq!(make(0.003, 1.5, DVec3::ZERO, 0.0, smaller), Err(beyond));
    assert!(matches!(make(0.001, 1.5, DVec3::ZERO, 0.01, size), Err(PaneError::TooThin { .. })));
}

#[test]
fn the_world_box_holds_the_glass() {
    let mut pane = pane(Glass::Crown, 3e-3, true, 1.0);
    let x = DVec3::new(0.6, 0.64, 0.48).normalize();
    pane.frame = Frame::new(DVec3::new(3.0, -2.0, 7.0), x, x.any_orthonormal_vector());
    let [min, max] = pane.world_bounds();
    for i in 0..=100 {
        for j in 0..=100 {
            let xy = (dvec2(f64::from(i), f64::from(j)) / 100.0 - 0.5) * pane.size();
            for face in [Face::Front, Face::Back] {
                let local = xy.extend(pane.base_height(face) + pane.surface(face).height(xy));
                let p = pane.frame.point_to_world(local);
                assert!(p.cmpge(min).all() && p.cmple(max).all());
            }
        }
    }
}
