//! The caustics in the room, which `cone` renders from behind, against light traced forward.

use std::path::Path;

use clerestory_render_core::document;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_tests::bias::{BLOCK, compare};
use clerestory_tests::forward_tracer::{Fault, Tracing, trace};
use clerestory_tests::reference::{Image, Reference};
use clerestory_tests::rendering::Rendering;
use clerestory_tests::sun_scene::{SunScene, reference_file};
use clerestory_tests::traced_scene::TracedScene;

const SIZE: [u32; 2] = [96, 72];
const REPLICATES: u64 = 32;
const SAMPLES: u32 = 8;
/// Samples under suns so large that their caustics are blurred.
const FEWER_SAMPLES: u32 = 4;
/// The sun's own angular radius, and larger ones.
const ANGLES: [f64; 3] = [0.27, 1.0, 3.0];
const SHORT_SAMPLES: u32 = 2;
const PHOTONS: u64 = 8_000_000;
const FAULTY_PHOTONS: u64 = 2_000_000;

fn scenes() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

fn replicates(angular_radius: f64, integrator: &str, samples: u32, path_filter: Option<&str>) -> Vec<Image> {
    let bundle = document::load(&scenes().join("room.json")).expect("the room ships");
    (1..=REPLICATES)
        .map(|seed| {
            let variant = SunScene { angular_radius, integrator, seed, size: SIZE, path_filter };
            let scene: PreparedScene = variant.build(&bundle).expect("the room can be built");
            let mut rendering = Rendering::new(&scene);
            for _ in 0..samples {
                rendering.render_pass().expect("the room renders");
            }
            rendering.image()
        })
        .collect()
}

fn traced(angular_radius: f64, photons: u64, fault: Fault) -> Reference {
    let bundle = document::load(&scenes().join("room.json")).expect("the room ships");
    let variant = SunScene { angular_radius, integrator: "cone", seed: 0, size: SIZE, path_filter: Some("D TT L") };
    let bundle = variant.bundle(&bundle).expect("the changed room is valid");
    let scene = TracedScene::build(&bundle, &scenes()).expect("the room can be traced");
    Reference::from_batches(&trace(&scene, &Tracing { photons, batches: 32, seed: 3, fault }))
}

/// Tests the caustics of integrators against forward tracing, and that faults are noticed.
#[track_caller]
fn check_caustics(angular_radius: f64, integrators: &[&str], samples: u32, faults: &[Fault]) {
    let reference = traced(angular_radius, PHOTONS, Fault::None);
    let wrong: Vec<(&Fault, Reference)> =
        faults.iter().map(|fault| (fault, traced(angular_radius, FAULTY_PHOTONS, *fault))).collect();
    for integrator in integrators {
        let ours = replicates(angular_radius, integrator, samples, Some("D TT L"));
        let report = compare(&ours, &reference, &[], BLOCK);
        println!("{integrator} room, {angular_radius} degrees: {report}");
        assert!(report.agrees() && report.mean_error < 0.005, "{integrator}, {angular_radius} degrees: {report}");
        for (fault, wrong) in &wrong {
            let report = compare(&ours, wrong, &[], BLOCK);
            println!("{integrator} room, {angular_radius} degrees, against {fault:?}: {report}");
            assert!(!report.agrees(), "{integrator}, {angular_radius} degrees, against {fault:?}: {report}");
        }
    }
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn cone_and_fnee_throw_the_caustics_that_forward_tracing_throws() {
    let [sun, ..] = ANGLES;
    check_caustics(sun, &["cone", "fnee"], SAMPLES, &[Fault::MissingFresnelFactor, Fault::DroppedSaddles]);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn cone_throws_the_caustics_of_larger_suns_that_forward_tracing_throws() {
    let [_, large, larger] = ANGLES;
    check_caustics(large, &["cone"], FEWER_SAMPLES, &[Fault::MissingFresnelFactor]);
    check_caustics(larger, &["cone"], FEWER_SAMPLES, &[Fault::MissingFresnelFactor]);
}

/// Compares the stored reference for each of some angles with pictures by `cone`.
#[track_caller]
fn check_stored_references(angles: &[f64]) {
    for &angle in angles {
        let reference = Reference::read(&reference_file(&scenes().join("room"), angle)).expect("the reference ships");
        let ours = replicates(angle, "cone", SHORT_SAMPLES, None);
        let report = compare(&ours, &reference, &[], BLOCK);
        println!("the room by cone, {angle} degrees: {report}");
        assert!(report.agrees() && report.mean_error < 0.005, "{angle} degrees: {report}");
        let report = compare(&ours, &reference.scaled(1.04), &[], BLOCK);
        assert!(!report.agrees(), "{angle} degrees, against a reference that is 4 percent too bright: {report}");
    }
}

#[test]
fn the_stored_reference_is_a_picture_of_the_room() {
    check_stored_references(&ANGLES[..1]);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn the_stored_references_of_larger_suns_are_pictures_of_the_room() {
    check_stored_references(&ANGLES[1..]);
}

#[test]
fn the_stored_references_have_their_standard_error() {
    for angle in ANGLES {
        let reference = Reference::read(&reference_file(&scenes().join("room"), angle)).expect("the reference ships");
        let square = |image: &Image| image.pixels.iter().map(|pixel| pixel.length_squared()).sum::<f64>();
        let noise = (square(&reference.standard_error) / square(&reference.mean)).sqrt();
        println!("{angle} degrees: noise {noise:.4} of the root mean square");
        assert!(noise > 0.0 && noise < 0.03, "{angle} degrees: {noise}");
        let [a, b] = &reference.halves;
        let apart: f64 = a.pixels.iter().zip(&b.pixels).map(|(&a, &b)| ((a - b) * 0.5).length_squared()).sum();
        // Half the difference of two halves scatters like the error of their mean.
        let ratio = (apart / square(&reference.standard_error)).sqrt();
        assert!((0.8..1.25).contains(&ratio), "{angle} degrees: {ratio}");
    }
}
