//! The imported references, our own spline and our own forward tracer confirm each other.

use std::path::{Path, PathBuf};

use clerestory_render_core::geometry::HeightField;
use clerestory_tests::bias::{BLOCK, MEAN_POWER, compare};
use clerestory_tests::forward_tracer::{Fault, Tracing, photon, trace};
use clerestory_tests::random::Random;
use clerestory_tests::reference::{Image, Reference};
use clerestory_tests::traced_scene::{TracedLight, TracedScene, read_height_map};
use glam::DVec2;

const CASES: [&str; 4] = ["crown", "bump", "flat", "cathedral"];

fn references() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/references")
}

fn load(name: &str) -> (TracedScene, Reference) {
    let scene = TracedScene::load(&references().join(format!("{name}.json"))).expect("a scene");
    (scene, Reference::read(&references().join(format!("{name}-reference.exr"))).expect("a reference"))
}

#[derive(serde::Deserialize)]
struct Case {
    spline_probes: std::collections::BTreeMap<String, Vec<Probe>>,
}

#[derive(serde::Deserialize)]
struct Probe {
    u: f64,
    v: f64,
    h: f64,
    dh_du: f64,
    dh_dv: f64,
}

fn probes(case: &str) -> std::collections::BTreeMap<String, Vec<Probe>> {
    let bytes = std::fs::read(references().join(format!("cases/{case}.json"))).expect("a case");
    serde_json::from_slice::<Case>(&bytes).expect("probes").spline_probes
}

/// Compares `evaluate(u, v)`, a height with its derivatives by u and v, with every probe of a face.
#[track_caller]
fn check_probes(case: &str, face: &str, largest: f64, evaluate: impl Fn(f64, f64) -> [f64; 3]) {
    let probes = &probes(case)[face];
    assert!(probes.len() >= 12);
    for probe in probes {
        let ours = evaluate(probe.u, probe.v);
        // A derivative by u is a difference of heights over a grid step, of which there are at most 256.
        for (ours, theirs, scale) in
            [(ours[0], probe.h, 1.0), (ours[1], probe.dh_du, 256.0), (ours[2], probe.dh_dv, 256.0)]
        {
            assert!((ours - theirs).abs() <= 1e-12 * largest * scale, "{case} {face}: {ours} is not {theirs}");
        }
    }
}

#[test]
fn the_splines_of_the_renderer_and_of_the_forward_tracer_match_the_probes() {
    for case in CASES {
        let (scene, _) = load(&format!("{case}-point"));
        let size = scene.panes[0].size;
        for (face, file, spline) in [("h1", "front", &scene.panes[0].front), ("h2", "back", &scene.panes[0].back)] {
            let [low, high] = spline.bounds();
            let largest = low.abs().max(high.abs());
            check_probes(case, face, largest, |u, v| {
                let value = spline.value(u, v);
                [value.height, value.du, value.dv]
            });
            let (heights, columns, rows) =
                read_height_map(&references().join(format!("heights/{case}-{file}.exr"))).unwrap();
            let field = HeightField::new(heights, columns, rows, size).unwrap();
            check_probes(case, face, largest, |u, v| {
                let jet = field.jet((DVec2::new(u, v) - 0.5) * size);
                [jet.height, jet.gradient.x * size.x, jet.gradient.y * size.y]
            });
        }
    }
}

/// 32 stratified batches: their scatter is small, so that they serve as replicates with power.
fn batches(scene: &TracedScene, photons: u64, fault: Fault) -> Vec<Image> {
    trace(scene, &Tracing { photons, batches: 32, seed: 7, fault })
}

#[track_caller]
fn check_agreement(light: &str) {
    for case in CASES {
        let (scene, reference) = load(&format!("{case}-{light}"));
        let report = compare(&batches(&scene, 3_000_000, Fault::None), &reference, &[], BLOCK);
        println!("{case}-{light}: {report}");
        assert!(report.agrees() && report.mean_deviation() < 0.0005, "{case}-{light}: {report}");
        // So few photons have power for the mean, and some for the blocks.
        assert!(report.mean_error < MEAN_POWER && report.block_error < 0.03, "{case}-{light}: {report}");
    }
}

#[test]
fn the_forward_tracer_reproduces_the_imported_point_lights() {
    check_agreement("point");
}

#[test]
fn the_forward_tracer_reproduces_the_imported_spheres() {
    check_agreement("sphere");
}

#[test]
fn planted_faults_differ_from_the_imported_references() {
    for name in ["cathedral-point", "crown-sphere"] {
        let (scene, reference) = load(name);
        for fault in [Fault::MissingFresnelFactor, Fault::DroppedSaddles, Fault::Scaled] {
            let report = compare(&batches(&scene, 500_000, fault), &reference, &[], BLOCK);
            println!("{name} {fault:?}: {report}");
            assert!(!report.agrees(), "{name} with {fault:?}: {report}");
        }
    }
}

#[test]
fn spheres_at_growing_distance_converge_to_the_sun() {
    for case in CASES {
        let scene = TracedScene::load(&references().join(format!("{case}-sun.json"))).unwrap();
        let sun = scene.lights[0];
        let TracedLight::Sun { direction, one_minus_cos, radiance } = sun else { panic!("a sun") };
        let sine = (one_minus_cos * (2.0 - one_minus_cos)).sqrt();
        // The same random numbers make the same photons but for the parallax.
        let difference = |distance: f64| {
            let sphere = TracedLight::Sphere { centre: direction * distance, radius: sine * distance, radiance };
            let random = &mut Random::new(5, 0);
            let (mut shift, mut brightness, mut count) = (0.0, 0.0, 0.0);
            for _ in 0..20_000 {
                let [face, lamp] = [(); 2].map(|()| [random.uniform(), random.uniform()]);
                let follow = |light| photon(&scene, light, 0, face, lamp, Fault::None);
                if let (Some(near), Some(far)) = (follow(&sphere), follow(&sun)) {
                    shift += near.position.distance(far.position);
                    brightness += (near.radiance.y / far.radiance.y - 1.0).abs();
                    count += 1.0;
                }
            }
            assert!(count > 10_000.0);
            [shift / count, brightness / count]
        };
        let [near, far, farthest] = [50.0, 500.0, 5000.0].map(difference);
        println!("{case}: pixels and brightness {near:.2?} {far:.2?} {farthest:.2?}");
        // The parallax falls as the inverse of the distance; at 50 m it is of the order of a pixel.
        for quantity in 0..2 {
            let ratios = [near[quantity] / far[quantity], far[quantity] / farthest[quantity]];
            assert!(ratios.iter().all(|ratio| (9.0..11.0).contains(ratio)), "{case}: {ratios:?}");
        }
        assert!(farthest[0] < 0.05 && farthest[1] < 1e-4, "{case}: {farthest:?}");
    }
}

#[test]
fn every_reference_scene_is_valid() {
    for case in CASES {
        for light in ["point", "sphere", "sun"] {
            let file = references().join(format!("{case}-{light}.json"));
            if let Err(error) = clerestory_render_core::document::load(&file) {
                panic!("{}: {error}", file.display());
            }
        }
    }
}
