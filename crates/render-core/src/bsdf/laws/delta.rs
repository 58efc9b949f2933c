//! Laws of materials that scatter into single directions.

use std::sync::Arc;

use glam::DVec3;
use serde_json::json;

use super::super::{Bsdf, DeltaBsdf, SampleKind, SpecularEvent};
use super::cases::{COSINES, Case, GLASS, material};
use super::stream;

const SAMPLES: u32 = 20_000;

/// Materials of single directions, each with the part of light that it scatters.
fn materials() -> Vec<(&'static str, Arc<dyn Bsdf>, f64)> {
    let grey = json!({"colour": [0.7, 0.7, 0.7]});
    let white = json!({"colour": [1, 1, 1]});
    vec![
        ("mirror", material(json!({"mirror": {"reflectance": [0.7, 0.7, 0.7]}})), 0.7),
        ("dielectric", material(json!({"dielectric": {"index_of_refraction": GLASS}})), 1.0),
        ("polished conductor", material(json!({"conductor": {"reflectance": white, "roughness": 0}})), 1.0),
        ("nearly polished", material(json!({"conductor": {"reflectance": white, "roughness": 0.031}})), 1.0),
        ("clear glass", material(json!({"rough_dielectric": {"index_of_refraction": GLASS, "roughness": 0}})), 1.0),
        ("thin wall", material(json!({"thin_wall": {}})), 1.0),
        ("grey wall", material(json!({"thin_wall": {"index_of_refraction": 1, "tint": grey}})), 0.7),
    ]
}

/// The mean of the power that is scattered.
fn power(case: &Case) -> f64 {
    let ratio = if case.incident.dot(case.at.normals.geometric) < 0.0 { GLASS } else { 1.0 / GLASS };
    let bends = case.bsdf.as_delta().is_some_and(|delta| delta.index_of_refraction().is_some());
    let mut sum = 0.0;
    for index in 0..SAMPLES {
        let sample = case.bsdf.sample(&case.at, case.incident, &mut stream(index)).unwrap();
        let SampleKind::Delta(event) = sample.kind else { panic!("{} scatters into a solid angle", case.name) };
        let goes_through =
            sample.direction.dot(case.at.normals.geometric) * case.incident.dot(case.at.normals.geometric) > 0.0;
        assert_eq!(goes_through, event == SpecularEvent::Transmission, "{}", case.name);
        let of_radiance = if goes_through && bends { ratio * ratio } else { 1.0 };
        sum += sample.weight.x * of_radiance / f64::from(SAMPLES);
    }
    sum
}

#[test]
fn power_is_conserved_and_nothing_can_be_connected() {
    for (name, bsdf, part) in materials() {
        assert!(bsdf.is_delta(), "{name}");
        for cosine in COSINES.into_iter().flat_map(|cosine| [cosine, -cosine]) {
            let case = Case::flat(name, bsdf.clone(), 0.1, cosine);
            assert_eq!(case.value(DVec3::Z), DVec3::ZERO);
            assert_eq!(case.bsdf.pdf(&case.at, case.incident, DVec3::Z), 0.0);
            let found = power(&case);
            assert!((found / part - 1.0).abs() < 1e-9, "{}: {found}", case.name);
        }
    }
}

#[test]
fn a_thin_wall_mirrors_what_two_faces_do_and_bends_nothing() {
    let bsdf = material(json!({"thin_wall": {"index_of_refraction": 1.5}}));
    assert!(bsdf.as_delta().is_none());
    let case = Case::flat("thin wall", bsdf, 0.1, 1.0);
    let mut mirrored = 0.0;
    for index in 0..SAMPLES {
        let sample = case.bsdf.sample(&case.at, case.incident, &mut stream(index)).unwrap();
        match sample.kind {
            SampleKind::Delta(SpecularEvent::Transmission) => assert_eq!(sample.direction, case.incident),
            _ => mirrored += 1.0 / f64::from(SAMPLES),
        }
    }
    // Two faces of 4 percent: 0.08 / 1.04.
    let expected: f64 = 0.08 / 1.04;
    let error = (expected * (1.0 - expected) / f64::from(SAMPLES)).sqrt();
    assert!((mirrored - expected).abs() < 4.0 * error, "{mirrored}");
}

#[test]
fn polish_decides_for_all_that_a_material_says() {
    for (roughness, is_polished) in [(0.0, true), (0.0316, true), (0.0317, false), (1.0, false)] {
        for kind in ["conductor", "rough_dielectric"] {
            let mut settings = json!({"roughness": roughness});
            if kind == "conductor" {
                settings["reflectance"] = json!({"colour": [1, 1, 1]});
            }
            let bsdf = material(json!({kind: settings}));
            let case = Case::flat(kind, bsdf, 0.1, 0.6);
            let samples = (0..50).filter_map(|index| case.bsdf.sample(&case.at, case.incident, &mut stream(index)));
            let deltas = samples.map(|sample| matches!(sample.kind, SampleKind::Delta(_)));
            assert!(deltas.into_iter().all(|delta| delta == is_polished), "{kind} of roughness {roughness}");
            let is_delta = [case.bsdf.is_delta(), case.bsdf.as_delta().is_some()];
            assert_eq!(is_delta, [is_polished; 2], "{kind} of roughness {roughness}");
        }
    }
}

#[test]
fn a_conductor_reflects_its_colour_along_the_normal_and_all_light_beside_it() {
    let colour = DVec3::new(0.95, 0.64, 0.54);
    let bsdf = material(json!({"conductor": {"reflectance": {"colour": colour.to_array()}, "roughness": 0}}));
    let reflected = |cosine: f64| {
        let case = Case::flat("copper", bsdf.clone(), 0.1, cosine);
        bsdf.as_delta().and_then(|delta: &dyn DeltaBsdf| delta.reflect(case.incident, &case.at)).unwrap().colour
    };
    assert!((reflected(1.0) - colour).length() < 1e-12);
    assert!((reflected(1e-4) - DVec3::ONE).length() < 1e-3);
}
