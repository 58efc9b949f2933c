//! A room with light subpaths is as bright as without, and its noise is less.

use serde_json::{Value, json};

use super::tests::{EDGE, prepared, sums_of};
use super::weight_tests::{glazed_room, room};
use crate::integrator::allocation::{Allocation, Sharing, Splats};
use crate::scene::Assets;

/// Pictures of each kind, with seeds of their own.
const PICTURES: u64 = 6;

/// Samples of a pixel.
const SAMPLES: u32 = 16;

/// Light that a surface has scattered, or several have.
const PATHS: &str = "D+ (R|T)* L";

/// The room, as an integrator sees it.
fn seen_by(room: &Value, integrator: &str, seed: u64) -> Value {
    let mut scene = room.clone();
    scene["film"] = json!({"width": EDGE, "height": EDGE});
    scene["sampling"] = json!({"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES});
    scene["integrator"] = match integrator {
        "light" => json!({"light": {"max_depth": 12, "subpaths": 8}}),
        _ => json!({integrator: {"max_depth": 12}}),
    };
    if scene.get("path_filter").is_none() {
        scene["path_filter"] = json!(PATHS);
    }
    scene["seed"] = json!(seed);
    scene
}

/// What pictures of a room have in common, over all pixels.
#[derive(Clone, Copy, Debug)]
struct Seen {
    mean: f64,
    /// Standard error of that.
    error: f64,
    /// Variance of a pixel, mean over all.
    noise: f64,
}

fn see(room: &Value, integrator: &str) -> Seen {
    see_with(room, integrator, Allocation::USUAL)
}

fn see_with(room: &Value, integrator: &str, allocation: Allocation) -> Seen {
    let picture = |seed| {
        let scene = prepared(&seen_by(room, integrator, seed), &Assets::new());
        // Whatever a pilot would choose.
        scene.kept_allocation().get_or_init(|| allocation);
        sums_of(&scene)
    };
    let pictures: Vec<Vec<f64>> = (1..=PICTURES)
        .map(|seed| picture(seed).iter().map(|sum| f64::from(sum[0]) / f64::from(SAMPLES)).collect())
        .collect();
    let variance = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (values.len() - 1) as f64
    };
    let pixels = pictures[0].len();
    let means: Vec<f64> = pictures.iter().map(|picture| picture.iter().sum::<f64>() / pixels as f64).collect();
    let noise = (0..pixels).map(|pixel| variance(&pictures.iter().map(|picture| picture[pixel]).collect::<Vec<_>>()));
    Seen {
        mean: means.iter().sum::<f64>() / PICTURES as f64,
        error: (variance(&means) / PICTURES as f64).sqrt(),
        noise: noise.sum::<f64>() / pixels as f64,
    }
}

/// Compares the means, and the noise, over which light subpaths have to be better by a factor.
#[track_caller]
fn check(light: &Value, panes: usize, gain: f64) {
    let room = room(&json!([light]), panes);
    compare(&room, &see(&room, "cone"), "auto", gain);
}

#[track_caller]
fn compare(room: &Value, expected: &Seen, integrator: &str, gain: f64) {
    let what = format!("{integrator}: {} panes, {}", room["panes"].as_array().map_or(0, Vec::len), room["lights"]);
    compare_seen(&see(room, integrator), expected, &what, gain);
}

#[track_caller]
fn compare_seen(found: &Seen, expected: &Seen, what: &str, gain: f64) {
    let error = libm::hypot(found.error, expected.error);
    let what = format!("{found:?}, {expected:?}, {what}");
    assert!((found.mean - expected.mean).abs() < 4.0 * error, "{what}");
    assert!(error < 0.05 * expected.mean, "no power: {what}");
    assert!(found.noise * gain < expected.noise, "more noise: {what}");
}

#[test]
fn lamps_light_a_room_alike() {
    let sphere =
        |centre: [f64; 3]| json!({"sphere": {"name": "bulb", "centre": centre, "radius": 0.1, "radiance": [9, 9, 9]}});
    check(&sphere([0.5, 1.0, 2.0]), 0, 1.5);
    check(&json!({"point": {"name": "spark", "position": [1, 0.5, 1], "intensity": [1, 1, 1]}}), 0, 1.5);
    check(
        &json!({"spot": {
            "name": "spot", "position": [1, 0.5, 2], "direction": [-1, -1, -0.5], "intensity": [1, 1, 1],
            "inner_angle": 30, "outer_angle": 50}}),
        0,
        1.5,
    );
    // It lies on the ceiling.
    let panel = json!({"rectangle": {
        "name": "panel", "centre": [0.2, 0, 3], "edge_u": [0, 0.6, 0], "edge_v": [0.8, 0, 0], "radiance": [1, 1, 1]}});
    check(&panel, 0, 1.5);
}

#[test]
fn light_through_panes_lights_a_room_alike() {
    let sun = json!({"sun": {"name": "sun", "direction": [1, 0.3, 0.7], "angular_radius": 3, "radiance": [9, 9, 9]}});
    let lamp = json!({"sphere": {"name": "lamp", "centre": [4, -1, 2], "radius": 0.3, "radiance": [9, 9, 9]}});
    let sky = json!({"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}});
    check(&sun, 1, 1.2);
    check(&lamp, 2, 1.2);
    // Most of it comes past the pane.
    check(&sky, 1, 0.8);
    let by_chance = Allocation { is_connected: false, sharing: Sharing::Chance, ..Allocation::USUAL };
    let behind_glass = room(&json!([lamp]), 1);
    let [found, expected] = [see_with(&behind_glass, "auto", by_chance), see(&behind_glass, "cone")];
    compare_seen(&found, &expected, "light left to chance", 0.0);
}

#[test]
fn light_that_is_traced_forward_alone_lights_a_room_alike() {
    let bulb = json!({"sphere": {"name": "bulb", "centre": [0.5, 1, 2], "radius": 0.1, "radiance": [9, 9, 9]}});
    let sun = json!({"sun": {"name": "sun", "direction": [1, 0.3, 0.7], "angular_radius": 3, "radiance": [9, 9, 9]}});
    let spark = json!({"point": {"name": "spark", "position": [4, -1, 2], "intensity": [9, 9, 9]}});
    // Its cone ends on the pane.
    let spot = json!({"spot": {
        "name": "spot", "position": [4, -1, 2], "direction": [-1, 0.3, -0.25], "intensity": [9, 9, 9],
        "inner_angle": 4, "outer_angle": 16}});
    for (light, panes, integrator) in [(bulb, 0, "cone"), (sun, 1, "cone"), (spark, 1, "fnee"), (spot, 1, "fnee")] {
        let room = room(&json!([light]), panes);
        compare(&room, &see(&room, integrator), "light", 0.0);
    }
}

#[test]
fn light_of_points_that_is_traced_forward_alone_lights_a_room_alike() {
    let spark = json!({"point": {"name": "spark", "position": [4, -1, 2], "intensity": [9, 9, 9]}});
    let alone = Allocation { is_connected: true, ..Allocation::alone(4) };
    let room = room(&json!([spark]), 1);
    let [found, expected] = [see_with(&room, "auto", alone), see(&room, "auto")];
    compare_seen(&found, &expected, "traced forward alone", 0.0);
}

#[test]
fn light_straight_through_thin_walls_lights_a_room_alike() {
    let sun = json!({"sun": {"name": "sun", "direction": [1, -0.3, 0.7], "angular_radius": 3, "radiance": [9, 9, 9]}});
    let lamp = json!({"sphere": {"name": "lamp", "centre": [4, -1, 2], "radius": 0.3, "radiance": [9, 9, 9]}});
    let sky = json!({"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}});
    for (light, gain) in [(sun, 1.2), (lamp, 1.2), (sky, 0.8)] {
        let mut room = glazed_room(&json!([light]));
        // Light subpaths know no light that walls mirror.
        room["path_filter"] = json!("D+ T* L");
        let expected = see(&room, "path");
        compare(&room, &expected, "auto", gain);
        compare(&room, &expected, "light", 0.0);
    }
}

#[test]
fn curtains_behind_thin_walls_keep_as_much_light_away() {
    let sun = json!({"sun": {"name": "sun", "direction": [1, -0.3, 0.7], "angular_radius": 3, "radiance": [9, 9, 9]}});
    let mut room = glazed_room(&json!([sun]));
    room["path_filter"] = json!("D+ T* L");
    room["materials"]["cloth"] = json!({"metallic_roughness": {
        "base_colour": {"colour": [0.1, 0.1, 0.1]}, "metallic": 0, "specular": 0, "opacity": 0.5}});
    let corners = [[1.95, -2.0, 0.0], [1.95, 2.0, 0.0], [1.95, 2.0, 3.0], [1.95, -2.0, 3.0]];
    let source = json!({"inline": {"positions": corners, "triangles": [[0, 1, 2], [0, 2, 3]]}});
    let curtain = json!({"name": "curtain", "material": "cloth", "source": source});
    room["meshes"].as_array_mut().unwrap().push(curtain);
    let expected = see(&room, "path");
    compare(&room, &expected, "auto", 0.0);
    compare(&room, &expected, "light", 0.0);
}

#[test]
fn methods_look_for_light_in_a_mirror_when_the_rest_is_traced_forward() {
    let sun = json!({"sun": {"name": "sun", "direction": [1, 0.3, 0.7], "angular_radius": 3, "radiance": [9, 9, 9]}});
    let mut room = room(&json!([sun]), 1);
    room["materials"]["silver"] = json!({"mirror": {}});
    room["meshes"][1]["material"] = "silver".into();
    // Both what light subpaths splat and what they do not.
    room["path_filter"] = json!("R* D+ T T L");
    let [found, expected] = [see_with(&room, "auto", Allocation::alone(8)), see(&room, "cone")];
    compare_seen(&found, &expected, "traced forward alone", 1.0);
}

#[test]
fn light_of_points_that_is_traced_forward_alone_lights_a_room_alike_behind_glass() {
    let spark = json!({"point": {"name": "spark", "position": [4, -1, 2], "intensity": [9, 9, 9]}});
    let mut room = room(&json!([spark]), 1);
    // The camera looks into the room through the pane.
    room["camera"] = json!({"perspective": {
        "position": [3.2, 0.2, 1.5], "look_at": [-1, -0.3, 1.2], "up": [0, 0, 1], "vertical_field_of_view": 30}});
    // Methods alone find the light at the first vertex, and share that at others with connections.
    room["path_filter"] = json!("T T D D+ (R|T)* L");
    let alone = Allocation { is_connected: true, ..Allocation::alone(4) };
    let [found, expected] = [see_with(&room, "auto", alone), see(&room, "fnee")];
    compare_seen(&found, &expected, "traced forward alone, seen through glass", 0.0);
}

#[test]
fn few_light_subpaths_light_a_room_alike() {
    let lamp = json!({"sphere": {"name": "lamp", "centre": [4, -1, 2], "radius": 0.3, "radiance": [9, 9, 9]}});
    let few = Allocation { splats: Splats::FEW, is_connected: false, sharing: Sharing::Chance };
    let room = room(&json!([lamp]), 1);
    let [found, expected] = [see_with(&room, "auto", few), see(&room, "cone")];
    compare_seen(&found, &expected, "few light subpaths", 0.0);
}
