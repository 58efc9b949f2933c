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

/// Slopes of waves that throw no folds onto the floor, and of waves that do.
const GENTLE: f64 = 0.08;
const FOLDING: f64 = 0.11;

/// Waves on a mesh whose triangles can be seen in their light.
fn water(steepness: f64) -> SheetScene {
    let waves = [(DVec2::new(27.0, 12.0), 0.3), (DVec2::new(-15.0, 24.0), 1.1), (DVec2::new(42.0, -18.0), 2.0)];
    let sheet = Sheet::new(1.0, 80, |place| {
        let (mut height, mut slope) = (0.0, DVec2::ZERO);
        for (wave, phase) in waves {
            height += steepness / wave.length() * libm::sin(wave.dot(place) + phase);
            slope += wave * (steepness / wave.length() * libm::cos(wave.dot(place) + phase));
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
fn check(scene: &SheetScene, integrator: &Value, samples: u32, faults: &[Fault]) -> (BiasReport, f64) {
    let folds = scene.folds();
    let replicates = rendered(scene, integrator, samples);
    let truth = reference(scene, 40_000_000, Fault::None);
    let report = compare(&replicates, &truth, &folds, BLOCK);
    println!("{integrator}: {report}");
    assert!(report.agrees(), "{integrator}: {report}");
    for &fault in faults {
        let report = compare(&replicates, &reference(scene, 4_000_000, fault), &folds, BLOCK);
        println!("{integrator} against {fault:?}: {report}");
        assert!(!report.agrees(), "{integrator} against {fault:?}: {report}");
    }
    let largest = largest_deviation(&Image::mean(&replicates), &truth.mean, &folds);
    println!("{integrator}: no block without folds is off by more than {:.2} percent", 100.0 * largest);
    (report, largest)
}

/// By how much the light of a block that no fold crosses differs, relative: the most of all such blocks.
fn largest_deviation(ours: &Image, truth: &Image, folds: &[bool]) -> f64 {
    let blocks = truth.width / BLOCK;
    let deviations = (0..blocks * blocks).filter_map(|block| {
        let corner = (block / blocks * truth.width + block % blocks) * BLOCK;
        let pixels = (0..BLOCK * BLOCK).map(|k| corner + k / BLOCK * truth.width + k % BLOCK);
        let sum = |image: &Image| pixels.clone().map(|pixel| image.pixels[pixel].y).sum::<f64>();
        pixels.clone().all(|pixel| !folds[pixel]).then(|| (sum(ours) / sum(truth) - 1.0).abs())
    });
    deviations.fold(0.0, f64::max)
}

#[test]
fn the_light_of_conic_is_that_of_light_traced_forward() {
    let conic = json!({"conic": {"chains": ["T"]}});
    let (report, largest) = check(&water(GENTLE), &conic, 24, &[Fault::MissingFresnelFactor, Fault::Scaled]);
    assert!(report.has_power() && report.fold_regions == [0, 0] && largest < 0.01, "{largest} {report}");
    let (report, _) = check(&water(FOLDING), &conic, 16, &[Fault::MissingFresnelFactor, Fault::DroppedSaddles]);
    assert!(report.blocks > 10 && report.block_error < 0.01 && report.fold_error < 0.02, "{report}");
}

#[test]
fn the_light_of_sms_is_that_of_light_traced_forward() {
    let sms = json!({"sms": {"chains": ["T"]}});
    check(&water(GENTLE), &sms, 4, &[Fault::MissingFresnelFactor]);
    check(&water(FOLDING), &sms, 12, &[Fault::DroppedSaddles]);
}

#[test]
fn the_published_walk_along_the_conic_lacks_light_and_more_where_it_folds() {
    let report = |steepness| {
        let scene = water(steepness);
        let published = json!({"conic": {"chains": ["T"], "search": "published"}});
        let report = compare(&rendered(&scene, &published, 1), &reference(&scene, 4_000_000, Fault::None), &[], BLOCK);
        println!("published, {steepness}: {report}");
        assert!(!report.agrees(), "{report}");
        report.mean_ratio[0]
    };
    let (gentle, folding) = (report(GENTLE), report(FOLDING));
    assert!(folding < 0.95 && (0.95..0.99).contains(&gentle), "{gentle} {folding}");
}
