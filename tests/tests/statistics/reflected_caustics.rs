//! Light that the outside of a pane reflects: by `fnee` in two unknowns, by `sms` over one vertex, and by the path
//! tracer.

use std::collections::BTreeMap;

use clerestory_film::counters::Counters;
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::ShadingPoint;
use clerestory_tests::estimate::{Estimate, check_agreement};
use clerestory_tests::methods::biased_sms;
use clerestory_tests::pane_scene::{INDEX, PaneScene, gather, pane};
use clerestory_tests::rendering::block_means;
use glam::DVec3;
use rayon::prelude::*;
use serde_json::{Value, json};

/// Parts of the picture along each edge.
const BLOCKS: usize = 4;

/// A floor seen from above, 0.4 m wide, in a picture of 8 x 8 pixels. Above it is a pane, lit by a lamp on the floor's
/// side.
fn scene(light: &Value, integrator: Value) -> PreparedScene {
    let description = json!({
        "version": 1, "name": "reflected caustic", "seed": 3,
        "film": {"width": 8, "height": 8},
        "camera": {"orthographic": {"position": [0, 0, -0.9], "look_at": [0, 0, -1], "up": [0, 1, 0], "height": 0.4}},
        "integrator": integrator,
        "path_filter": "D R L",
        "materials": {"floor": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}}},
        "meshes": [{"name": "floor", "material": "floor", "source": {"inline": {
            "positions": [[-0.25, -0.25, -1], [0.25, -0.25, -1], [0.25, 0.25, -1], [-0.25, 0.25, -1]],
            "triangles": [[0, 1, 2], [0, 2, 3]]}}}],
        "panes": [{"name": "pane", "centre": [0.5, 0, 0], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
            "width": 0.8, "height": 0.6, "thickness": 0.003,
            "front": {"crown": {"centre": [0.3, 0.4], "wavelength": 0.1, "amplitude": 2e-4}},
            "back": {"hammered": {"wavelength": 0.05, "amplitude": 1e-4}}}],
        "lights": [light],
    });
    let description = SceneDescription::parse(description.to_string().as_bytes()).expect("a valid scene");
    let bundle = SceneBundle::from_parts(description, BTreeMap::new()).expect("no assets are missing");
    PreparedScene::build(&bundle).expect("a scene that can be built")
}

/// Compares all methods with this many passes of the path tracer.
#[track_caller]
fn check_by_chance(name: &str, light: &Value, passes: u32) {
    let chance = block_means(&scene(light, json!({"path": {}})), passes, BLOCKS);
    for (method, integrator) in searches() {
        // The search of the paper finds some paths rarely.
        let passes = if method == "fnee, published" { 400 } else { 100 };
        let ours = block_means(&scene(light, integrator), passes, BLOCKS);
        check_agreement(&format!("{name}, {method}"), &ours, &chance, 0.12);
    }
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn light_of_a_panel_off_a_pane_is_what_the_path_tracer_finds() {
    let panel = json!({"rectangle": {"name": "panel", "centre": [0.7, 0.1, -0.7],
        "edge_u": [0.36, 0, 0.48], "edge_v": [0, 1.2, 0], "radiance": [9, 9, 9]}});
    check_by_chance("panel", &panel, 2500);
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn light_of_a_large_sun_off_a_pane_is_what_the_path_tracer_finds() {
    // From below, past the floor.
    let sun = json!({"sun": {"name": "sun", "direction": [0.5, 0.1, -1], "angular_radius": 15, "radiance": [9, 9, 9]}});
    // It is found more seldom than the panel.
    check_by_chance("sun", &sun, 6000);
}

/// As published, with enough trials that tests do not notice the cut.
fn published() -> Value {
    json!({"fnee": {"reflected": true, "solver": "published", "max_trials": 20_000}})
}

fn sms(constraint: &str) -> Value {
    json!({"sms": {"chains": ["R"], "constraint": constraint}})
}

/// All methods that find the light of a point light that a pane reflects, without bias.
fn searches() -> [(&'static str, Value); 4] {
    [
        ("fnee", json!({"fnee": {"reflected": true}})),
        ("fnee, published", published()),
        ("sms", sms("angle_difference")),
        ("sms, half vector", sms("half_vector")),
    ]
}

/// Where the point light is.
const LAMP: DVec3 = DVec3::new(0.2, 0.05, -0.6);

/// A pane whose front a point light on the receiver's side lights.
fn lit_front(front: Value) -> PaneScene {
    let light = json!({"point": {"name": "lamp", "position": LAMP.to_array(), "intensity": [1, 1, 1]}});
    PaneScene::new(vec![pane("pane", [0.1, 0.0, 0.0], [0.4, 0.36], 0.003, [front, json!("flat")])], light)
}

#[test]
fn flat_panes_reflect_a_point_of_light_as_closed_forms_say() {
    let bench = lit_front(json!("flat"));
    for place in [[0.0, 0.0], [0.1, 0.05], [-0.1, 0.2], [0.2, 0.05]] {
        let point = bench.point(place);
        let towards = DVec3::new(LAMP.x, LAMP.y, -LAMP.z) - point.position;
        let cosine = towards.normalize().z;
        let inner = (1.0 - (1.0 - cosine * cosine) / (INDEX * INDEX)).sqrt();
        let perpendicular = (cosine - INDEX * inner) / (cosine + INDEX * inner);
        let parallel = (INDEX * cosine - inner) / (INDEX * cosine + inner);
        let reflected = 0.5 * (perpendicular * perpendicular + parallel * parallel);
        let expected = reflected / towards.length_squared();
        for (name, integrator) in searches() {
            // Each search leads to the one path.
            let arrivals = gather(&bench.build(&integrator, 1), &point, 0, &mut Counters::default());
            let [(direction, light)] = arrivals[..] else { panic!("{name} at {place:?}: {arrivals:?}") };
            let off = (direction - towards.normalize()).length();
            assert!(
                off < 1e-7 && (light / expected - 1.0).abs() < 1e-7,
                "{name} at {place:?}: {light}, not {expected}"
            );
        }
    }
}

/// Walks that find each path, and none that is not there.
const WALKS: u32 = 3000;

/// First vertices that are nearer to each other than this part of the shortest segment are of the same path, by `sms`.
const SAME_PATH: f64 = 1e-5;

#[test]
fn searches_in_two_unknowns_find_each_path_from_a_point_of_light() {
    const ESTIMATES: u32 = 80_000;
    let hammered = |amplitude: f64| json!({"hammered": {"wavelength": 0.07, "amplitude": amplitude, "seed": 4}});
    let points = [(1.4e-4, [0.0, 0.0]), (2e-4, [0.0, 0.0]), (2e-4, [0.1, 0.05]), (2e-4, [-0.1, 0.12])];
    let every = |(amplitude, place): (f64, [f64; 2])| {
        let bench = lit_front(hammered(amplitude));
        let mut walks = biased_sms("angle_difference", WALKS);
        walks["sms"]["chains"] = json!(["R"]);
        let point = bench.point(place);
        let known = gather(&bench.build(&walks, 1), &point, 0, &mut Counters::default());
        (bench, point, known)
    };
    let problems = points.map(every);
    let paths = problems.each_ref().map(|(.., known)| known.len());
    assert_eq!(paths, [1, 3, 3, 1], "paths from each point");
    let expected: Vec<Estimate> =
        problems.iter().flat_map(|(.., known)| known.iter().map(|(_, light)| Estimate::exact(*light))).collect();
    for (name, integrator) in searches() {
        let by_path = |(bench, point, known): &(PaneScene, ShadingPoint, Vec<(DVec3, f64)>)| -> Vec<Estimate> {
            let scene = bench.build(&integrator, 1);
            let counters = &mut Counters::default();
            let mut light = vec![vec![0.0; ESTIMATES as usize]; known.len()];
            for estimate in 0..ESTIMATES {
                for (direction, weight) in gather(&scene, point, estimate, counters) {
                    let path = known.iter().position(|(other, _)| (*other - direction).length() < SAME_PATH);
                    let path = path.unwrap_or_else(|| panic!("{name}: a path along {direction} that no walk finds"));
                    light[path][estimate as usize] += weight;
                }
            }
            assert_eq!(counters.truncated, 0, "{name}");
            light.iter().map(|light| Estimate::of(light)).collect()
        };
        let found: Vec<Estimate> = problems.par_iter().flat_map_iter(by_path).collect();
        check_agreement(&format!("{name}, {} paths", found.len()), &found, &expected, 0.04);
    }
}
