//! Light does not depend on the unit of length (T9), and light through many panes is the sum of the light through each
//! (T10).

use clerestory_film::counters::Counters;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_tests::estimate::check_agreement;
use clerestory_tests::methods::{biased_sms, unbiased_integrators};
use clerestory_tests::pane_scene::{INDEX, PaneScene, gather, pane};
use clerestory_tests::random::Random;
use clerestory_tests::reference::Image;
use clerestory_tests::rendering::Rendering;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Two panes of `unit` metres, the second partly behind the first, and a light.
fn scaled_scene(unit: f64, light: Value) -> PaneScene {
    let crown = |amplitude: f64| {
        let centre = [0.3 * unit, 0.2 * unit];
        json!({"crown": {"centre": centre, "wavelength": 0.21 * unit, "amplitude": amplitude * unit}})
    };
    let hammered = json!({"hammered": {"wavelength": 0.26 * unit, "amplitude": 3e-4 * unit, "seed": 3}});
    // Which side of a square is longer is a matter of rounding.
    let size = [unit, 0.93 * unit];
    let mut panes = vec![
        pane("near", [0.0; 3], size, 0.009 * unit, [crown(3e-4), crown(-2e-4)]),
        pane("far", [0.6 * unit, 0.1 * unit, 0.4 * unit], size, 0.009 * unit, [json!("flat"), hammered]),
    ];
    for pane in &mut panes {
        pane["absorption"] = json!([3.0 / unit, 5.0 / unit, 9.0 / unit]);
    }
    let bench = PaneScene::new(panes, light);
    let centre = [0.1 * unit, 0.0];
    PaneScene { distance: unit, reach: 8.0 * unit, centre, edge: unit, pixels: 12, filter: "D (TT|TTTT) L", ..bench }
}

/// Two panes of `unit` metres that a light beside the receiver lights from its side, so that it is reflected.
fn mirroring_scene(unit: f64, light: Value) -> PaneScene {
    let through = scaled_scene(unit, light);
    let mut panes = through.panes.clone();
    for (pane, centre) in panes.iter_mut().zip([[0.9, 0.1, 0.0], [1.5, 0.0, 0.4]]) {
        pane["centre"] = json!(centre.map(|coordinate| coordinate * unit));
    }
    PaneScene { panes, reach: 0.625 * unit, filter: "D R L", ..through }
}

/// What is the same in all sizes.
struct Scaled {
    /// The scene of a size under a light.
    of_size: fn(f64, Value) -> PaneScene,
    /// Where the lights are, in units of the size.
    place: [f64; 3],
    /// Towards the sun.
    direction: [f64; 3],
    integrators: Vec<(&'static str, Value)>,
}

/// A point light, a sphere and the sun in a scene of this size, equally bright in all sizes. The place is in units of
/// the scene.
fn scaled_lights(unit: f64, place: [f64; 3], direction: [f64; 3]) -> [(&'static str, Value); 3] {
    let place = place.map(|coordinate| coordinate * unit);
    [
        (
            "lamp",
            json!({"point": {"name": "lamp", "position": place, "intensity": [unit * unit, unit * unit, unit * unit]}}),
        ),
        ("globe", json!({"sphere": {"name": "globe", "centre": place, "radius": 0.4 * unit, "radiance": [1, 1, 1]}})),
        ("sun", json!({"sun": {"name": "sun", "direction": direction, "angular_radius": 10, "radiance": [1, 1, 1]}})),
    ]
}

/// Light that comes through panes, and light that they reflect, by all methods that search for it.
fn scaled_problems() -> [Scaled; 2] {
    let mut reflecting = vec![
        ("fnee", json!({"fnee": {"reflected": true}})),
        ("fnee, published", json!({"fnee": {"reflected": true, "solver": "published", "max_trials": 20_000}})),
        ("sms", json!({"sms": {}})),
        ("sms, half vector", json!({"sms": {"constraint": "half_vector"}})),
        ("sms, biased", biased_sms("angle_difference", 6)),
    ];
    for (_, integrator) in &mut reflecting {
        if let Some(sms) = integrator.get_mut("sms") {
            sms["chains"] = json!(["R"]);
        }
    }
    [
        Scaled {
            of_size: scaled_scene,
            place: [0.7, -0.4, 3.0],
            direction: [0.2, -0.1, 1.0],
            integrators: all_integrators(),
        },
        Scaled {
            of_size: mirroring_scene,
            place: [1.6, -0.2, -0.7],
            direction: [1.0, 0.1, -1.0],
            integrators: reflecting,
        },
    ]
}

/// All methods and settings, biased ones as well.
fn all_integrators() -> Vec<(&'static str, Value)> {
    let biased = [
        ("sms, biased", biased_sms("angle_difference", 6)),
        ("sms, biased, half vector", biased_sms("half_vector", 6)),
        ("mnee, dropped", json!({"mnee": {"missed": "dropped"}})),
        ("fnee, sharp", json!({"fnee": {"selection": "sharp"}})),
        ("fnee, bleed", json!({"fnee": {"selection": "bleed"}})),
    ];
    unbiased_integrators().into_iter().chain(biased).collect()
}

fn render(scene: &PaneScene, integrator: &Value) -> (Image, Counters) {
    let scene = scene.build(integrator, 8);
    let mut rendering = Rendering::new(&scene);
    rendering.render_pass().expect("finite samples");
    (rendering.image(), *rendering.counters())
}

/// Renders the same scenes, the unit of length being `small` and `small` times `factor`.
#[track_caller]
fn check_scale(small: f64, factor: f64, same: impl Fn(&str, [&Image; 2], [&Counters; 2])) {
    for Scaled { of_size, place, direction, integrators } in scaled_problems() {
        let [scenes, larger_scenes] = [small, small * factor]
            .map(|unit| scaled_lights(unit, place, direction).map(|(name, light)| (name, of_size(unit, light))));
        for (name, integrator) in &integrators {
            for ((light_name, scene), (_, larger)) in scenes.iter().zip(&larger_scenes) {
                // What is met by chance is no point light.
                if *light_name == "lamp" && ["path", "cone"].contains(name) {
                    continue;
                }
                let (image, counters) = render(scene, integrator);
                let (larger, larger_counters) = render(larger, integrator);
                let name = format!("{name}, {light_name}, {}, {small} m times {factor}", scene.filter);
                assert!(image.pixels.iter().any(|pixel| pixel.x > 0.0), "{name}: no light");
                same(&name, [&image, &larger], [&counters, &larger_counters]);
            }
        }
    }
}

/// Sizes that the scene format allows for a pane, and 1000 times and 1024 times them.
const SIZES: [f64; 2] = [0.0011, 0.09];

#[test]
fn a_scene_that_is_1024_times_as_large_has_the_same_picture_to_the_last_bit() {
    for size in SIZES {
        check_scale(size, 1024.0, |name, [image, larger], [work, larger_work]| {
            let differing = image.pixels.iter().zip(&larger.pixels).filter(|(a, b)| a != b).count();
            assert!(differing == 0, "{name}: {differing} pixels differ");
            // Iterates of the published search run away until they overflow, which happens sooner in large units.
            let work = if name.contains("published") {
                Counters { height_evaluations: larger_work.height_evaluations, ..*work }
            } else {
                *work
            };
            assert_eq!(work, *larger_work, "{name}");
        });
    }
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn a_scene_that_is_1000_times_as_large_has_the_same_picture_to_rounding() {
    for size in SIZES {
        check_scale(size, 1000.0, |name, [image, larger], _| {
            let sum = |image: &Image| image.pixels.iter().copied().sum::<DVec3>();
            let (sum, larger_sum) = (sum(image), sum(larger));
            let differs = |(a, b): &(&DVec3, &DVec3)| (**a - **b).length() > 1e-5 * a.length();
            let differing = image.pixels.iter().zip(&larger.pixels).filter(differs).count();
            // Diverging iterates of the published search come back elsewhere after another rounding. Now and then a
            // walk for a reflection finds another end.
            let most = match name {
                _ if name.contains("published") => 15,
                _ if name.starts_with("sms") && name.contains("D R L") => 4,
                _ => 0,
            };
            assert!(differing <= most, "{name}: {differing} pixels differ; {sum} and {larger_sum}");
        });
    }
}

const THICKNESS: f64 = 0.006;

/// `count` by `count` panes side by side, in a square of `edge` metres.
fn side_by_side(count: usize, edge: f64, faces: impl Fn(usize) -> [Value; 2]) -> Vec<Value> {
    let size = edge / count as f64;
    let along = |index: usize| (index as f64 + 0.5) * size - 0.5 * edge;
    let one = |k: usize| {
        let centre = [along(k % count), along(k / count), 0.0];
        pane(&format!("pane {k}"), centre, [size; 2], THICKNESS, faces(k))
    };
    (0..count * count).map(one).collect()
}

fn lamp(position: DVec3) -> Value {
    json!({"point": {"name": "lamp", "position": position.to_array(), "intensity": [1, 1, 1]}})
}

/// Methods that find the light of a point light without chance where there is one path in each pane.
fn sure_methods() -> [Value; 3] {
    [json!({"fnee": {}}), biased_sms("angle_difference", 12), json!({"mnee": {"missed": "dropped"}})]
}

fn total(scene: &PreparedScene, point: &ShadingPoint) -> f64 {
    let arrivals = gather(scene, point, 0, &mut Counters::default());
    arrivals.iter().map(|(direction, weight)| weight * direction.z).sum()
}

/// Where light goes in and out of a flat sheet of glass in the plane `z = 0`.
fn through_sheet(from: DVec3, to: DVec3) -> [DVec2; 2] {
    let lateral = (to - from).truncate();
    let tangent = |sine: f64| sine / (1.0 - sine * sine).sqrt();
    let (before, after) = (-from.z, to.z - THICKNESS);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..200 {
        let sine = 0.5 * (low + high);
        let reach = (before + after) * tangent(sine) + THICKNESS * tangent(sine / INDEX);
        if reach < lateral.length() { low = sine } else { high = sine }
    }
    let entry = from.truncate() + lateral.normalize() * (before * tangent(low));
    [entry, entry + lateral.normalize() * (THICKNESS * tangent(low / INDEX))]
}

/// Whether the straight line between two points crosses one of the panes into which a sheet is cut, and no cut.
fn goes_straight(from: DVec3, to: DVec3, piece: impl Fn(DVec2) -> DVec2) -> bool {
    let at = |z: f64| piece(from.lerp(to, (z - from.z) / (to.z - from.z)).truncate());
    at(0.0) == at(THICKNESS)
}

#[test]
fn a_sheet_of_glass_cut_into_panes_throws_the_light_of_the_whole_but_for_the_cuts() {
    let source = DVec3::new(0.13, -0.08, 0.9);
    let edge = 0.32;
    let scene = |count| PaneScene::new(side_by_side(count, edge, |_| [json!("flat"), json!("flat")]), lamp(source));
    let mut random = Random::new(41, 0);
    let points: Vec<[f64; 2]> = (0..200).map(|_| [(); 2].map(|()| 0.6 * (random.uniform() - 0.5))).collect();
    for integrator in sure_methods() {
        let whole = scene(1);
        let built = whole.build(&integrator, 1);
        let lights: Vec<f64> = points.iter().map(|place| total(&built, &whole.point(*place))).collect();
        for count in [1, 2, 4, 8] {
            let cut = scene(count).build(&integrator, 1);
            let piece = |place: DVec2| ((place / edge + 0.5) * count as f64).floor();
            let mut lost = 0;
            for (&[x, y], light) in points.iter().zip(&lights) {
                let origin = DVec3::new(x, y, -1.0);
                let [entry, exit] = through_sheet(origin, source);
                let is_cut = piece(entry) != piece(exit);
                lost += usize::from(is_cut);
                // A walk from the straight line needs one through a pane.
                if integrator["mnee"].is_object() && !goes_straight(origin, source, piece) {
                    continue;
                }
                let expected = if is_cut { 0.0 } else { *light };
                let found = total(&cut, &whole.point([x, y]));
                assert!(
                    (found - expected).abs() <= 1e-9 * expected,
                    "{} panes, {integrator} at {x}, {y}: {found}, expected {expected}",
                    count * count
                );
            }
            println!("{} panes, {integrator}: {lost} of {} paths meet an edge", count * count, points.len());
            assert!(count < 8 || lost > 0);
        }
    }
}

fn relief(k: usize) -> [Value; 2] {
    let hammered = |seed| json!({"hammered": {"wavelength": 0.03, "amplitude": 2e-5, "seed": seed}});
    [hammered(2 * k), hammered(2 * k + 1)]
}

/// Panes that bend light by a hundredth: enough for many of them to throw it at one point 16 m away.
fn bending(k: usize) -> [Value; 2] {
    let hammered = |seed| json!({"hammered": {"wavelength": 0.15, "amplitude": 7e-4, "seed": seed}});
    [hammered(2 * k), hammered(2 * k + 1)]
}

#[test]
fn light_through_many_panes_is_the_sum_of_the_light_through_each() {
    const FAR: f64 = 16.0;
    for (count, least) in [(2, 3), (4, 4), (8, 8)] {
        let bench = PaneScene::new(side_by_side(count, 0.32, bending), lamp(DVec3::new(0.13, -0.08, FAR)));
        let all = PaneScene { distance: FAR, ..bench };
        // Walks that find all paths through each.
        for integrator in [json!({"fnee": {}}), biased_sms("angle_difference", 400)] {
            let point = all.point([0.05, 0.02]);
            let light = |scene: &PaneScene| total(&scene.build(&integrator, 1), &point);
            let each: Vec<f64> =
                all.panes.iter().map(|pane| light(&PaneScene { panes: vec![pane.clone()], ..all.clone() })).collect();
            let (sum, together) = (each.iter().sum::<f64>(), light(&all));
            let lit = each.iter().filter(|light| **light > 0.0).count();
            println!("{integrator}: {lit} of {} panes send light", each.len());
            assert!(lit >= least, "{integrator}: {lit} of {} panes send light", each.len());
            assert!((together - sum).abs() < 1e-6 * sum, "{integrator}: {together} and {sum}");
        }
    }
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn every_method_adds_the_light_of_groups_of_panes() {
    let sun = json!({"sun": {"name": "sun", "direction": [0.2, -0.1, 1], "angular_radius": 15, "radiance": [1, 1, 1]}});
    for (name, integrator) in unbiased_integrators() {
        // Manifold sampling tries every pane for every sample.
        let count = if name.contains("sms") { 4 } else { 8 };
        let bench = PaneScene::new(side_by_side(count, 0.32, relief), sun.clone());
        let bench = PaneScene { distance: 0.3, edge: 0.2, pixels: 16, ..bench };
        let samples = match name {
            "path" => 128,
            "mnee" => 16,
            _ => 2,
        };
        let together = bench.irradiance(&integrator, samples, 16, 4);
        let groups = (1..).zip(bench.panes.chunks(count * count / 4)).map(|(seed, panes)| {
            let group = PaneScene { panes: panes.to_vec(), seed, ..bench.clone() };
            group.irradiance(&integrator, samples, 16, 4)
        });
        let sum = groups.reduce(|sum, group| sum.iter().zip(&group).map(|(a, b)| a.plus(b)).collect());
        check_agreement(
            &format!("{} panes and four quarters, {name}", count * count),
            &together,
            &sum.expect("four groups"),
            0.12,
        );
    }
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn every_method_finds_the_light_through_panes_that_overlap() {
    let sun = json!({"sun": {"name": "sun", "direction": [0.2, -0.1, 1], "angular_radius": 15, "radiance": [1, 1, 1]}});
    let panes = vec![
        pane("near", [-0.05, 0.0, 0.0], [0.2; 2], THICKNESS, relief(0)),
        pane("far", [0.06, 0.02, 0.05], [0.2; 2], THICKNESS, relief(1)),
    ];
    let bench = PaneScene { distance: 0.3, edge: 0.25, pixels: 16, ..PaneScene::new(panes, sun) };
    let bench = PaneScene { filter: "D (TT|TTTT) L", ..bench };
    let chance = bench.irradiance(&json!({"path": {}}), 512, 16, 4);
    let both = |integrator: &Value, name: &str| {
        let mut integrator = integrator.clone();
        integrator[name]["chains"] = json!(["TT", "TTTT"]);
        integrator
    };
    let overlapping = [
        ("sms over both chains", both(&json!({"sms": {}}), "sms")),
        ("mnee over both chains", both(&json!({"mnee": {}}), "mnee")),
        ("fnee, sharp", json!({"fnee": {"selection": "sharp"}})),
        ("fnee, bleed", json!({"fnee": {"selection": "bleed"}})),
        ("sms, sharp", json!({"sms": {"selection": "sharp"}})),
        ("sms, bleed", json!({"sms": {"selection": "bleed"}})),
        ("fnee, random", json!({"fnee": {"selection": "random"}})),
        ("sms, random", json!({"sms": {"selection": "random"}})),
    ];
    for (name, integrator) in unbiased_integrators().into_iter().skip(1).chain(overlapping) {
        // Methods that look for one pane leave the light through two to chance.
        let bench = PaneScene { seed: 1, ..bench.clone() };
        let found = bench.irradiance(&integrator, 32, 16, 4);
        check_agreement(&format!("overlapping panes, {name}"), &found, &chance, 0.08);
    }
}
