//! Light through water given as a mesh, against the same light traced forward through the same mesh, and connection by
//! connection.

use std::collections::BTreeMap;

use clerestory_film::counters::Counters;
use clerestory_film::{SampleStream, SamplerSettings};
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::document::SceneDescription;
use clerestory_render_core::document::water::{WaterSettings, WaterView, pool};
use clerestory_render_core::geometry::{Ray, Surface, SurfaceId};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_render_core::specular::{SpecularEvent, SpecularMethod};
use clerestory_tests::bias::{BiasReport, compare};
use clerestory_tests::comparisons::pictures;
use clerestory_tests::estimate::Estimate;
use clerestory_tests::forward_tracer::{Fault, Tracing};
use clerestory_tests::mesh_tracer::{Lamp, LitSheet, SheetScene};
use clerestory_tests::random::Random;
use clerestory_tests::reference::{Image, Reference};
use clerestory_tests::sheet_connections::{FOLDING, GENTLE, STEEP, SheetConnections, water};
use glam::DVec3;
use rayon::prelude::*;
use serde_json::{Value, json};

/// Edge of the parts of the picture that are compared, pixels.
const BLOCK: usize = 8;

/// The light of a point through a sheet.
fn through(scene: &SheetScene) -> LitSheet<'_> {
    LitSheet { scene, lamp: Lamp::Point, event: SpecularEvent::Transmission }
}

fn reference(sheet: &LitSheet<'_>, photons: u64, fault: Fault) -> Reference {
    Reference::from_batches(&sheet.trace(&Tracing { photons, batches: 32, seed: 7, fault }))
}

fn bundle(sheet: &LitSheet<'_>, integrator: &Value, samples: u32) -> SceneBundle {
    let description = sheet.description(integrator, samples).to_string();
    let description = SceneDescription::parse(description.as_bytes()).expect("a valid scene");
    SceneBundle::from_parts(description, BTreeMap::new()).expect("nothing is missing")
}

fn rendered(sheet: &LitSheet<'_>, integrator: &Value, samples: u32) -> Vec<Image> {
    pictures(&bundle(sheet, integrator, samples), samples, 1, &|_| 1).0
}

/// How much light is traced and rendered.
#[derive(Clone, Copy)]
struct Effort {
    photons: u64,
    /// Photons where there are faults.
    faulty: u64,
    /// For each pixel of each replicate.
    samples: u32,
}

/// As many photons as notice most faults.
const FAULTY: u64 = 4_000_000;

/// Compares a method with light traced forward, and requires that faults are noticed.
#[track_caller]
fn check(
    sheet: &LitSheet<'_>,
    integrator: &Value,
    Effort { photons, faulty, samples }: Effort,
    faults: &[Fault],
) -> (BiasReport, f64) {
    let folds = sheet.folds();
    let replicates = rendered(sheet, integrator, samples);
    let truth = reference(sheet, photons, Fault::None);
    let report = compare(&replicates, &truth, &folds, BLOCK);
    println!("{integrator}: {report}");
    assert!(report.agrees(), "{integrator}: {report}");
    // With as few photons as the faults have, nothing is noticed where there is nothing.
    let control = compare(&replicates, &reference(sheet, faulty, Fault::None), &folds, BLOCK);
    assert!(control.agrees(), "{integrator}: {control}");
    for &fault in faults {
        let report = compare(&replicates, &reference(sheet, faulty, fault), &folds, BLOCK);
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
#[ignore = "takes a minute; `tests/run long` has it"]
fn the_light_of_conic_is_that_of_light_traced_forward() {
    let conic = json!({"conic": {"chains": ["T"]}});
    let effort = Effort { photons: 40_000_000, faulty: FAULTY, samples: 24 };
    let (report, largest) =
        check(&through(&water(GENTLE)), &conic, effort, &[Fault::MissingFresnelFactor, Fault::Scaled]);
    assert!(report.has_power() && report.fold_regions == [0, 0] && largest < 0.01, "{largest} {report}");
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn the_folded_light_of_conic_is_that_of_light_traced_forward() {
    let conic = json!({"conic": {"chains": ["T"]}});
    let effort = Effort { photons: 240_000_000, faulty: FAULTY, samples: 96 };
    let (report, largest) = check(
        &through(&water(FOLDING)),
        &conic,
        effort,
        &[Fault::MissingFresnelFactor, Fault::DroppedSaddles, Fault::Scaled],
    );
    assert!(
        report.has_power() && report.blocks > 10 && report.block_error < 0.003 && largest < 0.01,
        "{largest} {report}"
    );
    assert!(report.fold_regions[0] > 0 && report.fold_error < 0.003 && report.fold_deviation < 0.01, "{report}");
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn the_light_of_conic_over_steep_waves_is_that_of_light_traced_forward() {
    let conic = json!({"conic": {"chains": ["T"]}});
    let effort = Effort { photons: 80_000_000, faulty: FAULTY, samples: 48 };
    let (report, _) =
        check(&through(&water(STEEP)), &conic, effort, &[Fault::MissingFresnelFactor, Fault::DroppedSaddles]);
    assert!(report.mean_error < 0.001 && report.fold_regions[0] > 0, "{report}");
    assert!(report.fold_error < 0.003 && report.fold_deviation < 0.01, "{report}");
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn the_light_of_sms_is_that_of_light_traced_forward() {
    let sms = json!({"sms": {"chains": ["T"]}});
    let effort = |samples| Effort { photons: 40_000_000, faulty: FAULTY, samples };
    check(&through(&water(GENTLE)), &sms, effort(4), &[Fault::MissingFresnelFactor]);
    check(&through(&water(FOLDING)), &sms, effort(12), &[Fault::DroppedSaddles]);
}

/// A fault that so few connections notice, relative. The binary `bias` takes as many as notice half a percent.
const FAULT: f64 = 0.05;

#[test]
fn the_light_of_sms_is_that_of_conic_point_by_point() {
    for (waves, method) in [("gentle", "sms"), ("steep", "sms"), ("gentle", "sms, half vector")] {
        let connections = SheetConnections::new(waves, method);
        let light = connections.relative_light(200_000, 3);
        println!("{}: {light}", connections.name);
        assert!(light.agrees() && light.would_notice(FAULT), "{}: {light}", connections.name);
        assert!(light.elsewhere < 1e-4, "{}: {light}", connections.name);
        assert!(waves == "gentle" || light.saddles > FAULT, "{}: {light}", connections.name);
    }
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn the_published_walk_along_the_conic_has_all_light_where_nothing_folds_and_lacks_light_where_it_does() {
    let report = |steepness| {
        let scene = water(steepness);
        let published = json!({"conic": {"chains": ["T"], "search": "published"}});
        let sheet = through(&scene);
        let report = compare(&rendered(&sheet, &published, 1), &reference(&sheet, 4_000_000, Fault::None), &[], BLOCK);
        println!("published, {steepness}: {report}");
        report
    };
    let (gentle, folding) = (report(GENTLE), report(FOLDING));
    assert!(gentle.agrees() && gentle.mean_error < 0.005, "{gentle}");
    assert!(!folding.agrees() && folding.mean_ratio[0] < 0.97, "{folding}");
}

/// Replicates of the light on points of a floor.
const REPLICATES: u32 = 32;

/// The mean light of a method with rays, without them, and by rays alone, at this many points of a floor in each
/// replicate. The points of the light are the same with and without.
fn light_by_rays(scene: &PreparedScene, reach: f64, height: f64, points: u32) -> Vec<[f64; 3]> {
    let method = scene.method().expect("a specular method");
    let replicate = |replicate: u32| {
        let mut random = Random::new(3, u64::from(replicate));
        let mut light = [0.0; 3];
        for index in 0..points {
            let mut across = || 2.0 * reach * random.uniform() - reach;
            let above = DVec3::new(across(), across(), height);
            let lights = light_at(scene, &*method, above, [index, replicate]);
            for (sum, light) in light.iter_mut().zip(lights) {
                *sum += light / f64::from(points);
            }
        }
        light
    };
    (0..REPLICATES).into_par_iter().map(replicate).collect()
}

/// As [`light_by_rays`], on the floor below a place.
fn light_at(scene: &PreparedScene, method: &dyn SpecularMethod, above: DVec3, number: [u32; 2]) -> [f64; 3] {
    let counters = &mut Counters::default();
    let down = Ray::new(above, DVec3::NEG_Z);
    let hit = scene.scene().accelerator().closest_hit(&down, 2.0, SurfaceId::Nothing, counters).expect("a floor");
    let Surface::Triangle { index: floor, .. } = hit.surface else { panic!("panes in a pool") };
    let position = down.at(hit.distance);
    let settings = SamplerSettings { seed: 9, samples_per_block: 1 };
    let mut gather = |bounces: u32| {
        let point = ShadingPoint { position, normal: DVec3::Z, surface: SurfaceId::Triangle(floor), bounces };
        let mut stream = SampleStream::new(&settings, 0, number, 0);
        let mut arrivals = Vec::new();
        method.sample_li(
            scene.scene(),
            &point,
            0,
            &[SpecularEvent::Transmission],
            &mut stream,
            counters,
            &mut |arrival| {
                arrivals.push((arrival.direction, arrival.weight.x * arrival.direction.z));
            },
        );
        arrivals
    };
    // Rays are sent from what the camera sees, and from nothing else.
    let (first, later) = (gather(0), gather(1));
    let sum = |arrivals: &[(DVec3, f64)]| arrivals.iter().map(|(_, light)| light).sum::<f64>();
    let by_rays = first.iter().filter(|(direction, _)| later.iter().all(|(other, _)| other != direction));
    [sum(&first), sum(&later), by_rays.map(|(_, light)| light).sum()]
}

#[test]
fn rays_to_where_waves_focus_the_sun_neither_add_nor_take_light() {
    let triangles = "20000".parse().expect("a number of triangles");
    let description = pool(&WaterSettings { triangles, time: 0.0, view: WaterView::Floor });
    let bundle = SceneBundle::from_parts(description, BTreeMap::new()).expect("nothing is missing");
    let scene = PreparedScene::build(&bundle).expect("the scene can be built");
    let light = light_by_rays(&scene, 0.8, 1.0, 30_000);
    let of = |value: fn(&[f64; 3]) -> f64| Estimate::of(&light.iter().map(value).collect::<Vec<f64>>());
    let (combined, alone) = (of(|light| light[0]), of(|light| light[1]));
    println!("combined {combined:?}, alone {alone:?}, by rays {:?}", of(|light| light[2]));
    // The same points of the sun: what both find alike cancels.
    let nothing = Estimate::exact(0.0);
    let limit = 1e-3;
    assert!(of(|light| light[0] - light[1]).probability(&nothing) > limit);
    let lost = of(|light| light[0] - light[2] - light[1]).probability(&nothing);
    let twice = of(|light| light[0] + light[2] - light[1]).probability(&nothing);
    assert!(lost < limit && twice < limit, "rays that are lost or count twice would not be noticed: {lost} {twice}");
    assert!(combined.relative_error() < alone.relative_error());
}

/// Compares `conic` under a lamp that is seen in more than one direction with light traced forward.
#[track_caller]
fn check_extended(lamp: Lamp, samples: u32) {
    let conic = json!({"conic": {"chains": ["T"]}});
    let scene = water(FOLDING);
    let sheet = LitSheet { scene: &scene, lamp, event: SpecularEvent::Transmission };
    let effort = Effort { photons: 24_000_000, faulty: FAULTY, samples };
    let (report, _) = check(&sheet, &conic, effort, &[Fault::DroppedSaddles, Fault::Scaled]);
    // Nothing is pooled: each block is compared by itself, folds and all.
    assert!(report.has_power() && report.blocks == 64, "{lamp:?}: {report}");
    let built = PreparedScene::build(&bundle(&sheet, &conic, 1)).expect("the scene can be built");
    let light = light_by_rays(&built, 0.5 * scene.edge, scene.floor + 0.1, 1000);
    let mean = |which: usize| light.iter().map(|light| light[which]).sum::<f64>() / f64::from(REPLICATES);
    let by_rays = mean(2) / mean(0);
    println!("{lamp:?}: {:.2} percent of the light is found by rays", 100.0 * by_rays);
    assert!(by_rays > 10.0 * report.mean_error, "lost rays would not be noticed: {by_rays} {report}");
}

#[test]
fn the_light_of_the_sun_by_search_and_rays_is_that_of_light_traced_forward() {
    check_extended(Lamp::Sun(0.8), 22);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn the_light_of_a_sphere_by_search_and_rays_is_that_of_light_traced_forward() {
    check_extended(Lamp::Sphere(0.06), 18);
}

/// Slopes of waves whose reflections fold on the floor below them.
const REFLECTING: f64 = 0.015;

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn the_folded_light_that_water_reflects_by_conic_is_that_of_light_traced_forward() {
    let conic = json!({"conic": {"chains": ["R"]}});
    // Under water, so far aside that from 2 to about 10 percent come back.
    let scene = SheetScene { lamp: DVec3::new(0.6, -0.4, -0.9), floor: -1.2, edge: 1.6, ..water(REFLECTING) };
    let sheet = LitSheet { scene: &scene, lamp: Lamp::Point, event: SpecularEvent::Reflection };
    let effort = Effort { photons: 80_000_000, faulty: 3 * FAULTY, samples: 48 };
    let (report, _) =
        check(&sheet, &conic, effort, &[Fault::MissingFresnelFactor, Fault::DroppedSaddles, Fault::Scaled]);
    assert!(report.mean_error < 0.001 && report.blocks > 10 && report.block_error < 0.005, "{report}");
    assert!(report.fold_regions[0] > 0 && report.fold_error < 0.005 && report.fold_deviation < 0.01, "{report}");
}
