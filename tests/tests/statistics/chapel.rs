//! Light of the chapel's own windows is the light that chance finds, and that photons bring. There is stained glass
//! with its lead, bars and layers, and there are diamonds with a pane before them.

use std::collections::BTreeMap;

use clerestory_render_core::document::chapel::chapel;
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_tests::bias::{BLOCK, BiasReport};
use clerestory_tests::estimate::check_agreement;
use clerestory_tests::rendering::block_means;
use clerestory_tests::traced_scene::TracedScene;
use clerestory_tests::triangle_tree::TriangleTree;
use glam::DVec3;
use serde_json::{Value, json};

use crate::windows::check_against_photons;

/// Angular radius of the sun, degrees, with which chance meets it often.
const SUN: f64 = 12.0;

/// From the middle of the window to the screen, metres.
const DISTANCE: f64 = 2.0;

/// A screen that faces the chapel's sun through one of its windows, and sees the light of one kind of path.
fn lit_screen(window: &str, filter: &str, integrator: &str, [sun, edge, seen]: [f64; 3], seed: u64) -> SceneBundle {
    let mut scene = serde_json::to_value(chapel().expect("pictures").scene).expect("JSON");
    let light =
        (scene["lights"].as_array().expect("lights").iter()).find_map(|light| light.get("sun")).expect("a sun").clone();
    let towards = DVec3::from(serde_json::from_value::<[f64; 3]>(light["direction"].clone()).expect("a direction"));
    let towards = towards.normalize();
    let is_it = |candidate: &&Value| candidate["name"] == window;
    let window = scene["windows"].as_array().expect("windows").iter().find(is_it).expect("a window").clone();
    let sill = DVec3::from(serde_json::from_value::<[f64; 3]>(window["sill"].clone()).expect("a place"));
    let height = window["design"]["opening"]["arch"]["height"].as_f64().expect("a height");
    let centre = sill + DVec3::Z * (0.45 * height) - towards * DISTANCE;
    let (x, y) = towards.any_orthonormal_pair();
    let corner = |[across, up]: [f64; 2]| (centre + x * across + y * up).to_array();
    let positions = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner);
    scene["seed"] = json!(seed);
    scene["film"] = json!({"width": edge as u32, "height": edge as u32});
    scene["camera"] = json!({"orthographic": {
        "position": (centre + towards * 0.3).to_array(), "look_at": centre.to_array(), "up": y.to_array(),
        "height": seen}});
    scene["integrator"] = json!(integrator);
    scene["path_filter"] = json!(filter);
    scene["sampling"] = json!({"samples_per_pass": 16, "samples_per_block": 16});
    scene["materials"] = json!({"screen": {"diffuse": {"reflectance": {"colour": [0.8, 0.8, 0.8]}}}});
    scene["meshes"] = json!([{"name": "screen", "material": "screen", "source": {"inline": {
        "positions": positions, "triangles": [[0, 1, 2], [0, 2, 3]]}}}]);
    scene["windows"] = json!([window]);
    scene["lights"] = json!([{"sun": {
        "name": "sun", "direction": light["direction"], "angular_radius": sun, "radiance": [1, 1, 1]}}]);
    let description = SceneDescription::parse(scene.to_string().as_bytes()).expect("a valid scene");
    SceneBundle::from_parts(description, BTreeMap::new()).expect("a scene without files")
}

/// Compares means over quarters of the picture from so many passes of chance and of each method, and asks that a part
/// of the light could not be missing.
#[track_caller]
fn check(window: &str, filter: &str, integrators: &[&str], [by_chance, passes]: [u32; 2], fault: f64) {
    let means = |integrator: &str, passes: u32, seed: u64| {
        let bundle = lit_screen(window, filter, integrator, [SUN, 16.0, 0.5], seed);
        block_means(&PreparedScene::build(&bundle).expect("a scene that can be built"), passes, 2)
    };
    let chance = means("path", by_chance, 1);
    for (integrator, seed) in integrators.iter().zip(2..) {
        check_agreement(&format!("{window}, {integrator}"), &means(integrator, passes, seed), &chance, fault);
    }
}

/// The screen alone, without lead, bars and stone.
fn without_lead(scene: &mut TracedScene) {
    scene.triangles.truncate(2);
    scene.tree = TriangleTree::over(&scene.triangles);
}

/// Sunlight through a window is what a number of photons brings, to the precision that every bias test has to have.
#[track_caller]
fn check_sunlight(window: &str, photons: u64) {
    let bundle = lit_screen(window, "D TT L", "auto", [0.27, 32.0, 0.8], 1);
    let methods = [(window.to_owned(), bundle)];
    let reports = check_against_photons(&methods, [160, photons], 2 * BLOCK, ("no lead", &without_lead));
    assert!(reports.iter().all(BiasReport::has_power), "{window}: {}", reports[0]);
}

#[test]
#[ignore = "takes ten minutes; `tests/run long` has it"]
fn light_through_the_northern_lancet_of_the_chapel_is_that_of_photons() {
    // With fewer, its error would be larger than a bias test may have.
    check_sunlight("east north", 70_000_000);
}

#[test]
#[ignore = "takes ten minutes; `tests/run long` has it"]
fn light_through_the_middle_lancet_of_the_chapel_is_that_of_photons() {
    check_sunlight("east middle", 50_000_000);
}

#[test]
#[ignore = "takes ten minutes; `tests/run long` has it"]
fn light_through_the_southern_lancet_of_the_chapel_is_that_of_photons() {
    check_sunlight("east south", 50_000_000);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn light_through_stained_glass_of_the_chapel_is_that_of_path_tracing() {
    check("east middle", "D TT L", &["auto"], [256, 32], 0.12);
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn light_through_windows_of_the_chapel_by_every_method_is_that_of_path_tracing() {
    check("east middle", "D TT L", &["cone", "fnee"], [512, 64], 0.08);
    check("south 2", "D TTTT L", &["auto", "cone", "fnee"], [512, 64], 0.08);
}

/// Pieces beside each other are a little tilted, and yet none is behind the other.
#[test]
fn light_through_diamonds_and_a_pane_before_them_is_that_of_path_tracing() {
    check("south 1", "D TTTT L", &["auto"], [256, 32], 0.1);
}
