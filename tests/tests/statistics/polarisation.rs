//! Light at large angles of incidence: two faces transmit other parts of it together than each of unpolarised light.

use std::f64::consts::PI;

use clerestory_film::counters::Counters;
use clerestory_tests::bias::{BLOCK, compare};
use clerestory_tests::comparisons::comparison;
use clerestory_tests::estimate::{Estimate, check_agreement};
use clerestory_tests::forward_tracer::Fault;
use clerestory_tests::methods::{biased_sms, settings};
use clerestory_tests::pane_scene::{INDEX, PaneScene, gather};
use glam::{DVec2, DVec3};
use serde_json::json;

use super::laws::{
    THICKNESS, flat_irradiance, flat_pane, irradiance, point_light, refracted, shaped, sky_irradiance, sun,
    sure_methods, through_wedge,
};

/// What averages at each face lose at 60 degrees.
const LOSS_AT_60_DEGREES: f64 = 0.009;

#[test]
fn every_search_finds_the_light_of_the_closed_form_at_all_angles() {
    const LAMP: f64 = 0.8;
    for degrees in [0.0, 30.0, 45.0, 60.0, 70.0, 80.0, 85.0_f64] {
        let (tangent, cosine) = (degrees.to_radians().tan(), degrees.to_radians().cos());
        // At 85 degrees, the ray crosses the pane more than 11 m aside.
        let mut pane = flat_pane(0.8 / cosine);
        pane["centre"] = json!([LAMP * tangent, 0, 0]);
        let bench = PaneScene { reach: 30.0, ..PaneScene::new(vec![pane], point_light([0.0, 0.0, LAMP])) };
        let air = bench.distance + LAMP - THICKNESS;
        let point = bench.point([air * tangent, 0.0]);
        let expected = flat_irradiance(air, point.position.x);
        for integrator in [vec![json!({"fnee": {}})], sure_methods()].concat() {
            let arrivals = gather(&bench.build(&integrator, 1), &point, 0, &mut Counters::default());
            let found = irradiance(&arrivals, &point);
            let error = (found / expected - 1.0).abs();
            assert!(arrivals.len() == 1 && error < 1e-7, "{integrator} at {degrees} degrees: {error:e}");
        }
    }
}

#[test]
fn the_sun_at_large_angles_loses_what_both_faces_take_together() {
    const RADIUS: f64 = 1.0;
    for (tilt, loss) in [(60.0_f64, LOSS_AT_60_DEGREES), (80.0, 0.05)] {
        let tilt = tilt.to_radians();
        let direction = DVec3::new(tilt.sin(), 0.0, tilt.cos());
        let bench = PaneScene::new(vec![flat_pane(4.0)], sun(direction, RADIUS, 1e4)).at([-tilt.tan(), 0.0]);
        let expected = 1e4 * sky_irradiance(tilt, RADIUS.to_radians(), 1.0, f64::INFINITY);
        for method in ["cone", "fnee", "sms", "sms, half vector"] {
            let found = bench.mean_irradiance(&settings(method), 64, 16);
            let name = format!("the sun at {tilt:.3} behind a flat pane, {method}");
            check_agreement(&name, &[found], &[Estimate::exact(expected)], loss);
        }
    }
}

/// A ray in glass that is tilted across a prism, so that its planes of incidence at the two faces are some degrees
/// apart.
#[test]
fn a_prism_transmits_by_the_angle_between_its_planes_of_incidence() {
    const DEGREES: f64 = 0.001;
    let thickness = 0.0625;
    for (slope, tilt) in [(0.4375, 26.0_f64), (0.25, 30.0), (0.125, 35.0)] {
        let [front, back] = [DVec2::new(slope, 0.0), DVec2::new(-slope, 0.0)];
        let inner = DVec3::new(0.0, tilt.to_radians().sin(), tilt.to_radians().cos());
        let normal = DVec3::new(-front.x, -front.y, 1.0).normalize();
        let direction = -refracted(-inner, -normal, INDEX);
        let (outer, through, factor) = through_wedge(direction, front, back);
        let bench = shaped(thickness, |place| front.dot(place), |place| back.dot(place), sun(outer, DEGREES, 1e6));
        let bench = PaneScene { distance: 0.125, ..bench };
        let middle = DVec3::new(0.0, 0.0, 0.5 * thickness);
        let entry = middle - inner * (middle.dot(normal) / inner.dot(normal));
        let place = entry - direction * ((entry.z + bench.distance) / direction.z);
        let point = bench.point([place.x, place.y]);
        let expected = PI * 1e6 * DEGREES.to_radians().sin().powi(2) * through * factor * direction.z;
        for constraint in ["angle_difference", "half_vector"] {
            let integrator = biased_sms(constraint, 200);
            let arrivals = gather(&bench.build(&integrator, 1), &point, 0, &mut Counters::default());
            let beside = |(found, _): &(DVec3, f64)| (*found - direction).length() < 1e-4;
            let found = irradiance(&arrivals.into_iter().filter(beside).collect::<Vec<_>>(), &point);
            assert!((found / expected - 1.0).abs() < 1e-4, "{integrator}, slope {slope}: {found}, not {expected}");
        }
    }
}

/// Tests for bias under a light at 60 degrees, and requires that averages at each face are noticed.
#[track_caller]
fn check_at_60_degrees(case: &str, integrator: &str, samples: u32) {
    const PHOTONS: u64 = 4_000_000;
    let comparison = comparison(case, "steep", integrator);
    let replicates = comparison.replicates(samples, 1).0;
    for (fault, agrees) in [(Fault::None, true), (Fault::AveragedPerFace, false)] {
        let reference = comparison.reference(PHOTONS, fault).expect("a reference that is traced");
        let report = compare(&replicates, &reference, &[], BLOCK);
        println!("{} against {fault:?}: {report}", comparison.name);
        assert_eq!(report.agrees(), agrees, "{} against {fault:?}: {report}", comparison.name);
    }
}

#[test]
fn pictures_at_60_degrees_are_those_of_light_that_is_polarised_by_the_first_face() {
    check_at_60_degrees("flat", "cone", 8);
    check_at_60_degrees("bump", "cone", 8);
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn pictures_at_60_degrees_by_every_method_are_those_of_polarised_light() {
    check_at_60_degrees("crown", "fnee", 8);
    check_at_60_degrees("flat", "sms", 32);
    check_at_60_degrees("bump", "mnee", 256);
    check_at_60_degrees("cathedral", "path", 512);
}
