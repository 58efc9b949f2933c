//! Light through water given as a mesh, against the same light traced forward through the same mesh.

use std::collections::BTreeMap;

use clerestory_render_core::scene::{SceneBundle, SceneDescription};
use clerestory_tests::bias::{BiasReport, compare};
use clerestory_tests::comparisons::pictures;
use clerestory_tests::forward_tracer::{Fault, Tracing};
use clerestory_tests::mesh_tracer::{Sheet, SheetScene};
use clerestory_tests::reference::{Image, Reference};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Edge of the parts of the picture that are compared, pixels.
const BLOCK: usize = 8;

/// Waves that fold their light on a part of the floor, on a mesh whose triangles can be seen in it.
fn water() -> SheetScene {
    let waves = [(DVec2::new(9.0, 4.0), 0.3), (DVec2::new(-5.0, 8.0), 1.1), (DVec2::new(14.0, -6.0), 2.0)];
    let sheet = Sheet::new(1.0, 48, |place| {
        let (mut height, mut slope) = (0.0, DVec2::ZERO);
        for (wave, phase) in waves {
            let amplitude = 0.09 / wave.length();
            height += amplitude * libm::sin(wave.dot(place) + phase);
            slope += wave * (amplitude * libm::cos(wave.dot(place) + phase));
        }
        (height, slope)
    });
    SheetScene {
        sheet,
        index: 1.33,
        lamp: DVec3::new(0.3, -0.2, 4.0),
        intensity: 16.0,
        floor: -0.7,
        reflectance: 0.6,
        edge: 1.0,
        pixels: 64,
    }
}

fn reference(scene: &SheetScene, photons: u64, fault: Fault) -> Reference {
    Reference::from_batches(&scene.trace(&Tracing { photons, batches: 32, seed: 7, fault }))
}

fn rendered(scene: &SheetScene, integrator: &Value, samples: u32) -> Vec<Image> {
    let description = scene.description(integrator, samples).to_string();
    let description = SceneDescription::parse(description.as_bytes()).expect("a valid scene");
    let bundle = SceneBundle::from_parts(description, BTreeMap::new()).expect("nothing is missing");
    pictures(&bundle, samples, 1, &|_| 1).0
}

/// Compares a method with light traced forward, and requires that faults are noticed.
#[track_caller]
fn check(integrator: &Value, samples: u32, faults: &[Fault]) -> (BiasReport, Vec<Image>, Reference, Vec<bool>) {
    let scene = water();
    let (truth, folds) = (reference(&scene, 40_000_000, Fault::None), scene.folds());
    let replicates = rendered(&scene, integrator, samples);
    let report = compare(&replicates, &truth, &folds, BLOCK);
    println!("{integrator}: {report}");
    assert!(report.agrees(), "{integrator}: {report}");
    for &fault in faults {
        let report = compare(&replicates, &reference(&scene, 2_000_000, fault), &folds, BLOCK);
        println!("{integrator} against {fault:?}: {report}");
        assert!(!report.agrees(), "{integrator} against {fault:?}: {report}");
    }
    (report, replicates, truth, folds)
}

#[test]
fn the_caustic_of_conic_is_that_of_light_traced_forward() {
    let every = [Fault::MissingFresnelFactor, Fault::DroppedSaddles, Fault::Scaled];
    let (report, replicates, truth, folds) = check(&json!({"conic": {"chains": ["T"]}}), 16, &every);
    assert!(report.has_power() && report.fold_regions[0] > 0, "{report}");
    // Block by block, away from folds, to a percent.
    let ours = Image::mean(&replicates);
    let blocks = truth.mean.width / BLOCK;
    let mut apart = 0;
    for block in 0..blocks * blocks {
        let corner = (block / blocks * truth.mean.width + block % blocks) * BLOCK;
        let pixels: Vec<usize> =
            (0..BLOCK * BLOCK).map(|k| corner + k / BLOCK * truth.mean.width + k % BLOCK).collect();
        if pixels.iter().any(|&pixel| folds[pixel]) {
            continue;
        }
        apart += 1;
        let sum = |image: &Image| pixels.iter().map(|&pixel| image.pixels[pixel].y).sum::<f64>();
        let ratio = sum(&ours) / sum(&truth.mean);
        assert!((ratio - 1.0).abs() < 0.01, "block {block}: {ratio}");
    }
    println!("{apart} of {} blocks without folds", blocks * blocks);
    assert!(apart > 5, "{apart}");
}

#[test]
fn the_caustic_of_sms_is_that_of_light_traced_forward() {
    let (report, ..) =
        check(&json!({"sms": {"chains": ["T"]}}), 4, &[Fault::MissingFresnelFactor, Fault::DroppedSaddles]);
    assert!(report.mean_error < 0.005, "{report}");
}

#[test]
fn the_published_walk_along_the_conic_finds_a_part_of_it() {
    let scene = water();
    let truth = reference(&scene, 4_000_000, Fault::None);
    let report =
        compare(&rendered(&scene, &json!({"conic": {"chains": ["T"], "search": "published"}}), 1), &truth, &[], BLOCK);
    println!("published: {report}");
    assert!(!report.agrees() && report.mean_ratio.iter().all(|ratio| *ratio < 1.0), "{report}");
}
