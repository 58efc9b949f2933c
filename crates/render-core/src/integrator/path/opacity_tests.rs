//! Surfaces that are only partly there let the rest of all light by, whatever finds it.

use std::f64::consts::PI;

use image::{ImageBuffer, LumaA};
use serde_json::{Value, json};

use super::tests::{EDGE, SAMPLES, floor_under_lamp, mean, mean_with, methods, pane, square, sums};
use super::thin_wall_tests::{Lit, REFLECTANCE, lights};
use crate::scene::{Asset, Assets};
use crate::texture::picture_samples::{encode_exr, encode_png};

/// Two opacities whose veils let different parts of the light by.
const OPACITIES: [f64; 2] = [0.3, 0.6];

/// A black surface of which a part is there.
fn veil(opacity: &Value) -> Value {
    json!({"metallic_roughness": {
        "base_colour": {"colour": [0, 0, 0]}, "metallic": 0, "specular": 0, "opacity": opacity}})
}

/// A place on a floor below other things, seen from below them.
fn floor_below(meshes: &[Value], materials: &Value, light: &Value) -> Value {
    let mut all = materials.clone();
    let grey = [REFLECTANCE; 3];
    all["floor"] = json!({"diffuse": {"reflectance": {"colour": grey}}});
    let floor = json!({"name": "floor", "material": "floor", "source": square(0.1, 0.0)});
    let meshes = [&[floor], meshes].concat();
    json!({
        "version": 2, "name": "floor", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [-0.5, 0.1, 0.4], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 1e-4}},
        "integrator": {"path": {"max_depth": 1}},
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": all,
        "meshes": meshes,
        "lights": [light]
    })
}

#[test]
fn what_is_there_of_veils_keeps_as_much_light_away() {
    for Lit { light, irradiance } in lights() {
        for count in 1..=OPACITIES.len() {
            let mut materials = json!({});
            let mut meshes = Vec::new();
            for (index, opacity) in OPACITIES[..count].iter().enumerate() {
                materials[format!("veil {index}")] = veil(&json!(opacity));
                let source = square(100.0, 1.0 + 0.3 * index as f64);
                let name = format!("veil {index}");
                meshes.push(json!({"name": name, "material": name, "source": source}));
            }
            let (found, error) = mean(&floor_below(&meshes, &materials, &light));
            let open = irradiance(&|_| 1.0) * REFLECTANCE / PI;
            let expected: f64 = OPACITIES[..count].iter().map(|opacity| 1.0 - opacity).product();
            let what = format!("{found} +- {error}, not {expected} of {open}: {light}");
            // Veils are no vertices: this is found with one.
            assert!((found - expected * open).abs() < 4.0 * error, "{what}");
            assert!(error < 0.01 * found, "{what}");
        }
    }
}

/// A picture of two columns: the first is not there, the second is grey and there.
fn half_a_leaf() -> (String, Asset) {
    let picture = ImageBuffer::from_fn(2, 1, |x, _| LumaA([200_u8, if x == 0 { 20 } else { 255 }]));
    ("leaf.png".to_owned(), Asset::new(encode_png(picture.into())))
}

#[test]
fn what_a_picture_cuts_out_is_what_geometry_cuts_out() {
    let texture = json!({"file": "leaf.png", "filter": "nearest"});
    let cut_out = json!({"texture": texture, "channel": "alpha"});
    let mut leaf = veil(&cut_out);
    leaf["metallic_roughness"]["opacity_threshold"] = json!(0.5);
    let materials = json!({"leaf": leaf, "black": veil(&json!(1))});
    let quad = |left: f64| {
        let [u_left, z] = [(left + 0.4) / 0.8, 0.5];
        json!({"inline": {
            "positions": [[left, -0.4, z], [0.4, -0.4, z], [0.4, 0.4, z], [left, 0.4, z]],
            "triangles": [[0, 1, 2], [0, 2, 3]],
            "texture_coordinates": [[u_left, 0], [1, 0], [1, 1], [u_left, 1]]
        }})
    };
    let assets = Assets::from([half_a_leaf()]);
    for Lit { light, .. } in lights() {
        let of = |material: &str, left: f64| {
            let mesh = json!({"name": "leaf", "material": material, "source": quad(left)});
            mean_with(&floor_below(&[mesh], &materials, &light), &assets)
        };
        let (picture, picture_error) = of("leaf", -0.4);
        let (geometry, geometry_error) = of("black", 0.0);
        let error = libm::hypot(picture_error, geometry_error);
        assert!((picture - geometry).abs() < 4.0 * error + 1e-9, "{picture}, not {geometry} +- {error}: {light}");
        assert!(error <= 0.02 * geometry, "{error} of {geometry}: {light}");
    }
}

/// The floor under a lamp, with veils on both sides of a pane and of water.
fn veiled(opacity: f64, order: [[u32; 3]; 2], method: &Value) -> Value {
    let sheet = |z: f64| {
        json!({"inline": {
            "positions": [[-3, -3, z], [3, -3, z], [3, 3, z], [-3, 3, z]], "triangles": order}})
    };
    let mesh =
        |name: &str, material: &str, source: Value| json!({"name": name, "material": material, "source": source});
    let meshes = [
        mesh("water", "water", square(0.1, 0.9)),
        mesh("below", "veil", sheet(0.3)),
        mesh("above", "veil", sheet(1.2)),
    ];
    let plaster = json!({"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}});
    let mut scene = floor_under_lamp(&plaster, &meshes, &json!([pane(0.6, 0.4)]), method);
    // The camera is below the veils.
    scene["camera"]["orthographic"]["position"] = json!([-0.3, 0, 0.24]);
    scene["materials"]["veil"] = veil(&json!(opacity));
    scene
}

const ORDER: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

#[test]
fn every_method_finds_as_much_light_through_veils() {
    let path = json!({"path": {"max_depth": 6}});
    let (open, open_error) = mean(&veiled(0.0, ORDER, &path));
    for method in methods() {
        let (found, error) = mean(&veiled(0.4, ORDER, &method));
        let expected = 0.6 * 0.6 * open;
        let errors = (found - expected).abs() / libm::hypot(error, 0.36 * open_error);
        assert!(errors < 4.0 && error < 0.04 * found, "{method}: {found} +- {error}, not {expected}");
    }
}

#[test]
fn an_uneven_environment_shines_through_veils_before_a_pane() {
    // A picture with one bright place, near the zenith.
    let bright: Vec<f32> = (0..32 * 16).map(|texel| if texel / 32 == 1 { 20.0 } else { 0.2 }).collect();
    let assets = Assets::from([("sky.exr".to_owned(), Asset::new(encode_exr(32, 16, &[("Y", &bright)])))]);
    let sky = json!([{"environment": {"name": "sky", "radiance": {"picture": {"file": "sky.exr"}}}}]);
    let of = |opacity: f64, method: &Value| {
        let mut scene = veiled(opacity, ORDER, method);
        scene["lights"] = sky.clone();
        mean_with(&scene, &assets)
    };
    let (open, open_error) = of(0.0, &json!({"path": {"max_depth": 6}}));
    for method in [json!({"path": {"max_depth": 6}}), json!({"cone": {"max_depth": 6}})] {
        let (found, error) = of(0.4, &method);
        let expected = 0.36 * open;
        let errors = (found - expected).abs() / libm::hypot(error, 0.36 * open_error);
        assert!(errors < 4.0 && error < 0.03 * found, "{method}: {found} +- {error}, not {expected}");
    }
}

#[test]
fn the_order_of_triangles_and_threads_does_not_matter() {
    let method = json!({"cone": {"max_depth": 6}});
    let scene = veiled(0.4, ORDER, &method);
    let with_threads = |count: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
        pool.install(|| sums(&scene, &Assets::new()))
    };
    assert_eq!(with_threads(1), with_threads(2));
    let ((one, one_error), (other, other_error)) = (mean(&scene), mean(&veiled(0.4, [[2, 3, 0], [1, 2, 0]], &method)));
    assert!((one - other).abs() < 4.0 * libm::hypot(one_error, other_error), "{one} and {other}");
}
