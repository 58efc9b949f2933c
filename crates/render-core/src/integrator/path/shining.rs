//! Meshes that shine: against lights of the same shape, closed forms, and with panes and bodies of glass between.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use glam::DVec3;
use image::{ImageBuffer, Luma};
use serde_json::{Value, json};

use super::tests::{EDGE, SAMPLES, mean, mean_with, pane, square};
use crate::document::{SceneBundle, SceneDescription};
use crate::integrator::PreparedScene;
use crate::scene::Asset;
use crate::texture::picture_samples::encode_png;

/// A black thing.
fn black(name: &str, source: Value) -> Value {
    json!({"name": name, "material": "black", "source": source})
}

/// A floor that is seen at an angle, with things above it.
fn floor_with(meshes: &[Value], panes: &Value, lights: &Value, integrator: &Value) -> Value {
    let mut all = vec![json!({"name": "floor", "material": "plaster", "source": square(0.5, 0.0)})];
    all.extend_from_slice(meshes);
    json!({
        "version": 2, "name": "floor", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [-0.5, 0, 0.4], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 0.2}},
        "integrator": integrator,
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": {
            "plaster": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}},
            "black": {"diffuse": {"reflectance": {"colour": [0, 0, 0]}}},
            "glass": {"dielectric": {"index_of_refraction": 1.5}}
        },
        "meshes": all, "panes": panes, "lights": lights
    })
}

/// A rectangle over the floor, as a light that shines downwards.
fn panel() -> Value {
    json!({"rectangle": {
        "name": "panel", "centre": [0.2, 0, 1], "edge_u": [0, 0.6, 0], "edge_v": [0.8, 0, 0], "radiance": [1, 1, 1]}})
}

/// The same rectangle of two triangles.
fn quad() -> Value {
    json!({"inline": {
        "positions": [[-0.2, -0.3, 1], [0.6, -0.3, 1], [0.6, 0.3, 1], [-0.2, 0.3, 1]],
        "triangles": [[0, 1, 2], [0, 2, 3]],
        "texture_coordinates": [[0, 0], [1, 0], [1, 1], [0, 1]]}})
}

fn shining(name: &str) -> Value {
    json!({"mesh": {"name": name, "mesh": name, "radiance": [1, 1, 1]}})
}

#[track_caller]
fn check_alike(what: &str, [(found, error), (expected, expected_error)]: [(f64, f64); 2], precision: f64) {
    let error = libm::hypot(error, expected_error);
    assert!(error < precision * expected, "{what}: {expected} and {found} are known to {error}");
    assert!((found - expected).abs() < 4.0 * error, "{what}: {found}, not {expected}, +- {error}");
}

/// Points that shine little, so that not all lights are asked.
fn sparks() -> Vec<Value> {
    let spark = |number: u32| {
        let position = [-0.4 + 0.2 * f64::from(number), 0.3, 0.8];
        json!({"point": {"name": format!("spark {number}"), "position": position, "intensity": [0.003, 0, 0]}})
    };
    (0..5).map(spark).collect()
}

#[test]
fn a_panel_of_two_triangles_shines_as_a_rectangle_does() {
    let (path, none) = (json!({"path": {}}), json!([]));
    for sparks in [Vec::new(), sparks()] {
        let lights = |light: Value| json!([&sparks[..], &[light]].concat());
        let expected = mean(&floor_with(&[], &none, &lights(panel()), &path));
        let found = mean(&floor_with(&[black("quad", quad())], &none, &lights(shining("quad")), &path));
        check_alike("in the open", [found, expected], 0.005);
    }
}

#[test]
fn light_of_a_mesh_through_a_pane_is_found_once_by_every_method() {
    let panes = json!([pane(0.5, 1.2)]);
    let with = |method: &str| json!({method: {"max_depth": 6}});
    let expected = mean(&floor_with(&[], &panes, &json!([panel()]), &with("cone")));
    for method in ["path", "cone", "fnee", "sms", "mnee", "auto"] {
        let scene = floor_with(&[black("quad", quad())], &panes, &json!([shining("quad")]), &with(method));
        check_alike(method, [mean(&scene), expected], 0.03);
    }
}

#[test]
fn light_of_a_mesh_through_water_is_found_once_by_every_method() {
    let water = json!({"name": "water", "material": "glass", "source": square(0.6, 0.3)});
    let with = |method: &str, chains: Value| json!({method: {"max_depth": 6, "chains": chains}});
    let path = json!({"path": {"max_depth": 6}});
    let expected = mean(&floor_with(std::slice::from_ref(&water), &json!([]), &json!([panel()]), &path));
    let meshes = [black("quad", quad()), water];
    for method in [path, with("conic", json!(["T"])), with("sms", json!(["T"])), with("mnee", json!(["T"]))] {
        let scene = floor_with(&meshes, &json!([]), &json!([shining("quad")]), &method);
        check_alike(&method.to_string(), [mean(&scene), expected], 0.03);
    }
}

/// A sphere of 512 triangles with the surface of a sphere of a radius, and so about its light.
fn ball(centre: DVec3, radius: f64) -> Value {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut triangles: Vec<[DVec3; 3]> = (0..8)
        .map(|bits: usize| [0, 1, 2].map(|axis| if bits >> axis & 1 == 0 { axes[axis] } else { -axes[axis] }))
        .collect();
    for _ in 0..3 {
        let halves = |[a, b, c]: [DVec3; 3]| {
            let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(halves).collect();
    }
    let area: f64 = triangles.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length()).sum();
    let scale = radius * (4.0 * PI / area).sqrt();
    let corners = triangles.iter().flatten().map(|corner| (centre + *corner * scale).to_array());
    let positions: Vec<[f64; 3]> = corners.collect();
    let triangles: Vec<[usize; 3]> = (0..512).map(|number| [3 * number, 3 * number + 1, 3 * number + 2]).collect();
    json!({"inline": {"positions": positions, "triangles": triangles}})
}

#[test]
fn a_ball_of_triangles_shines_as_a_sphere_does() {
    let sphere = json!([{"sphere": {"name": "ball", "centre": [0.3, 0, 1], "radius": 0.25, "radiance": [1, 1, 1]}}]);
    let mesh = black("ball", ball(DVec3::new(0.3, 0.0, 1.0), 0.25));
    for (panes, method) in [(json!([]), "path"), (json!([pane(0.5, 1.2)]), "cone")] {
        let method = json!({method: {"max_depth": 6}});
        let expected = mean(&floor_with(&[], &panes, &sphere, &method));
        let found = mean(&floor_with(std::slice::from_ref(&mesh), &panes, &json!([shining("ball")]), &method));
        check_alike(&method.to_string(), [found, expected], 0.015);
    }
}

/// Inside a box whose walls emit L and reflect the part r of light, radiance is L / (1 - r) everywhere.
#[test]
fn walls_that_shine_and_reflect_make_the_radiance_of_a_furnace() {
    let corners: Vec<[f64; 3]> =
        (0..8).map(|bits| [0, 1, 2].map(|axis| if bits >> axis & 1 == 0 { -0.6 } else { 0.6 })).collect();
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let walls = json!({"inline": {"positions": corners, "triangles": triangles}});
    let mut scene = floor_with(&[], &json!([]), &json!([shining("walls")]), &json!({"path": {"max_depth": 1000}}));
    scene["meshes"] = json!([{"name": "walls", "material": "plaster", "source": walls}]);
    let (mean, error) = mean(&scene);
    assert!(error < 0.004, "{error}");
    assert!((mean - 2.0).abs() < 4.0 * error, "{mean} +- {error}");
}

#[test]
fn where_its_picture_is_black_a_mesh_does_not_shine() {
    let picture = ImageBuffer::from_fn(2, 1, |x, _| Luma([if x == 0 { 0_u8 } else { 255 }]));
    let assets = BTreeMap::from([("glow.png".to_owned(), Asset::new(encode_png(picture.into())))]);
    let mut light = shining("quad");
    light["mesh"]["texture"] = json!({"file": "glow.png", "filter": "nearest", "wrap": ["clamp", "clamp"]});
    let mut half = panel();
    half["rectangle"]["centre"] = json!([0.4, 0, 1]);
    half["rectangle"]["edge_v"] = json!([0.4, 0, 0]);
    for (panes, method) in [(json!([]), "path"), (json!([pane(0.5, 1.2)]), "fnee")] {
        let method = json!({method: {"max_depth": 6}});
        let expected = mean(&floor_with(&[], &panes, &json!([half]), &method));
        let scene = floor_with(&[black("quad", quad())], &panes, &json!([light]), &method);
        check_alike(&method.to_string(), [mean_with(&scene, &assets), expected], 0.03);
    }
}

#[test]
fn what_is_left_to_chance_has_the_name_of_the_light_once() {
    let mesh = black("ball", ball(DVec3::new(0.3, 0.0, 1.0), 0.01));
    let scene = floor_with(&[mesh], &json!([pane(0.5, 1.2)]), &json!([shining("ball")]), &json!({"path": {}}));
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    let bundle = SceneBundle::from_parts(description, BTreeMap::new()).unwrap();
    let late = PreparedScene::build(&bundle).unwrap().left_to_chance();
    assert!(late.len() == 1 && late[0].starts_with("light of the small light \"ball\" that"), "{late:?}");
}

#[test]
fn a_light_that_becomes_another_mesh_or_another_colour_is_built_again() {
    let scene = |mesh: &str, radiance: f64| {
        let light = json!([{"mesh": {"name": "lamp", "mesh": mesh, "radiance": [radiance, 1, 1]}}]);
        let meshes = [black("quad", quad()), black("lid", square(0.1, 0.8))];
        let scene = floor_with(&meshes, &json!([]), &light, &json!({"path": {}}));
        let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
        SceneBundle::from_parts(description, BTreeMap::new()).unwrap()
    };
    let mut prepared = PreparedScene::build(&scene("quad", 1.0)).unwrap();
    for (mesh, radiance) in [("quad", 3.0), ("lid", 3.0), ("lid", 2.0)] {
        prepared = prepared.changed(&scene(mesh, radiance)).unwrap();
        let light = &prepared.scene().lights()[0];
        let index = if mesh == "quad" { 1 } else { 2 };
        let triangles = prepared.scene().meshes()[index].triangle_range();
        assert_eq!((light.emission().x, light.triangles()), (radiance, Some(triangles)), "{mesh}");
    }
}

#[test]
fn a_mesh_that_is_partly_there_shines_in_proportion() {
    let light = json!([shining("lamp")]);
    let lamp = |opacity: f64| {
        let mut scene = floor_with(&[black("lamp", quad())], &json!([]), &light, &json!({"path": {}}));
        scene["materials"]["black"] = json!({"metallic_roughness": {
            "base_colour": {"colour": [0, 0, 0]}, "specular": 0, "metallic": 0, "opacity": opacity}});
        mean(&scene)
    };
    let [(whole, whole_error), (part, part_error)] = [1.0, 0.3].map(lamp);
    let error = libm::hypot(part_error, 0.3 * whole_error);
    assert!((part - 0.3 * whole).abs() < 4.0 * error, "{part} +- {part_error}, {whole} +- {whole_error}");
    assert!(error < 0.01 * part, "no power: {error} of {part}");
}
