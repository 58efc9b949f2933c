//! Light through panes, against what Fresnel's equations say of it; and light that several methods must find alike.

use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::*;
use crate::document::{SceneBundle, SceneDescription};
use crate::integrator::render_node;
use crate::scene::Assets;
use clerestory_film::NodeAddress;

/// Edge of the images, pixels.
pub(super) const EDGE: u32 = 16;

/// Samples of a pixel.
pub(super) const SAMPLES: u32 = 256;

/// The scene, ready to be rendered.
pub(super) fn prepared(scene: &Value, assets: &Assets) -> PreparedScene {
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    PreparedScene::build(&SceneBundle::from_parts(description, assets.clone()).unwrap()).unwrap()
}

/// The sums of all pixels.
pub(super) fn sums(scene: &Value, assets: &Assets) -> Vec<[f32; 3]> {
    sums_of(&prepared(scene, assets))
}

/// The same of a scene that is ready.
pub(super) fn sums_of(scene: &PreparedScene) -> Vec<[f32; 3]> {
    let grid = scene.description().grid(EDGE);
    let mut sums = vec![[0.0; 3]; (EDGE * EDGE) as usize];
    for tile in 0..grid.len() {
        let address = NodeAddress { frame: 0, tile, level: 0, index: 0 };
        let rendered = render_node(scene, &grid, address, &AtomicBool::new(false)).unwrap();
        for (sum, pixel) in sums.as_flattened_mut().iter_mut().zip(rendered.node.layers().beauty.as_flattened()) {
            *sum += pixel;
        }
    }
    sums
}

/// Mean of the red channel, and its standard error.
pub(super) fn mean(scene: &Value) -> (f64, f64) {
    mean_with(scene, &Assets::new())
}

/// The same of a scene with files.
pub(super) fn mean_with(scene: &Value, assets: &Assets) -> (f64, f64) {
    mean_of(scene, assets, 0)
}

/// Mean of a channel, and its standard error.
pub(super) fn mean_of(scene: &Value, assets: &Assets, channel: usize) -> (f64, f64) {
    let sums = sums(scene, assets);
    let means: Vec<f64> = sums.iter().map(|sum| f64::from(sum[channel]) / f64::from(SAMPLES)).collect();
    let count = means.len() as f64;
    let mean = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

/// A camera that looks straight through two flat panes at a panel of radiance 1.
fn two_panes(gap: f64, at: f64) -> Value {
    let thickness = 0.003;
    let pane = |name: &str, z: f64| {
        json!({
            "name": name, "centre": [0, 0, at + z], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
            "width": 0.3, "height": 0.3, "thickness": thickness
        })
    };
    json!({
        "version": 1, "name": "two panes", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [0, 0, at - 1.0], "look_at": [0, 0, at], "up": [0, 1, 0], "height": 0.1}},
        "integrator": {"path": {"max_depth": 1000}},
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "panes": [pane("near", 0.0), pane("far", thickness + gap)],
        "lights": [{"rectangle": {
            "name": "panel", "centre": [0, 0, at + 1.0], "edge_u": [0, 2, 0], "edge_v": [2, 0, 0], "radiance": [1, 1, 1]
        }}]
    })
}

/// A camera that looks straight through a body with parallel faces, 0.1 m apart, at a panel of radiance 1.
fn body(index_of_refraction: f64, absorption: f64, roughness: f64) -> Value {
    let mut scene = two_panes(0.0, 0.0);
    scene["panes"] = json!([]);
    scene["materials"] = json!({"amber": {"rough_dielectric": {
        "index_of_refraction": index_of_refraction, "roughness": roughness, "absorption": [absorption, 1, 1]
    }}});
    let corners: Vec<[f64; 3]> = (0..8).map(|bits| [0, 1, 2].map(|axis| f64::from(bits >> axis & 1) - 0.5)).collect();
    let positions: Vec<[f64; 3]> = corners.iter().map(|[x, y, z]| [*x, *y, 0.1 * z]).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    scene["meshes"] = json!([{
        "name": "block", "material": "amber", "source": {"inline": {"positions": positions, "triangles": triangles}}
    }]);
    scene
}

#[test]
fn a_body_absorbs_over_the_way_through_it() {
    for (index, absorption) in [(1.0, 7.0), (1.5, 7.0), (1.5, 0.0_f64)] {
        let reflected = ((index - 1.0) / (index + 1.0_f64)).powi(2);
        let kept = libm::exp(-0.1 * absorption);
        // Over all reflections between both faces.
        let expected = (1.0 - reflected) * (1.0 - reflected) * kept / (1.0 - reflected * reflected * kept * kept);
        let (mean, error) = mean(&body(index, absorption, 0.0));
        assert!((mean - expected).abs() < 4.0 * error + 1e-6, "{index}, {absorption}: {mean} +- {error}, {expected}");
        assert!(absorption == 0.0 || (mean - expected / kept).abs() > 20.0 * error, "no power");
    }
}

#[test]
fn light_within_a_body_is_absorbed_on_its_way() {
    const COEFFICIENT: f64 = 7.0;
    let mut scene = body(1.0, COEFFICIENT, 0.0);
    scene["lights"] = json!([{"rectangle": {
        "name": "panel", "centre": [0, 0, 0], "edge_u": [0, 0.9, 0], "edge_v": [0.9, 0, 0], "radiance": [1, 1, 1]
    }}]);
    let (met, error) = mean(&scene);
    let expected = libm::exp(-0.05 * COEFFICIENT);
    assert!((met - expected).abs() < 4.0 * error + 1e-4, "{met} +- {error}, {expected}");

    // A wall in the body, lit by a point in it.
    let (height, aside, intensity) = (0.04, 0.2, 3.0);
    scene["materials"]["plaster"] = json!({"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}});
    let corners = [[-0.4, -0.4, height], [-0.4, 0.4, height], [0.4, 0.4, height], [0.4, -0.4, height]];
    let wall = json!({"inline": {"positions": corners, "triangles": [[0, 1, 2], [0, 2, 3]]}});
    let wall = json!({"name": "wall", "material": "plaster", "source": wall});
    scene["meshes"].as_array_mut().unwrap().push(wall);
    scene["lights"] = json!([{"point": {
        "name": "lamp", "position": [aside, 0, 0], "intensity": [intensity, intensity, intensity]
    }}]);
    scene["integrator"] = json!({"path": {"max_depth": 2}});
    // The picture is a square of 0.1 m around the axis.
    let cells = 50;
    let middle = |cell: i32| (f64::from(cell) + 0.5) * 0.1 / f64::from(cells) - 0.05;
    let at = |x: f64, y: f64| {
        let distance = ((x - aside) * (x - aside) + y * y + height * height).sqrt();
        let irradiance = intensity * height / (distance * distance * distance);
        0.5 / std::f64::consts::PI * irradiance * libm::exp(-COEFFICIENT * (distance + 0.05 + height))
    };
    let sum: f64 = (0..cells).flat_map(|x| (0..cells).map(move |y| at(middle(x), middle(y)))).sum();
    let expected = sum / f64::from(cells * cells);
    let (seen, error) = mean(&scene);
    assert!((seen / expected - 1.0).abs() < 4.0 * error / expected + 2e-3, "{seen} +- {error}, {expected}");
}

#[test]
fn two_panes_let_through_what_fresnel_says_however_near_they_are() {
    let reflected = ((1.52 - 1.0) / (1.52 + 1.0_f64)).powi(2);
    // Over all reflections between the four faces.
    let expected = (1.0 - reflected) / (1.0 + 3.0 * reflected);
    for (gap, at) in [(1e-3, 0.0), (1e-6, 0.0), (1e-9, 1.0), (1e-6, 1e3), (1e-9, 1e3)] {
        let (mean, error) = mean(&two_panes(gap, at));
        assert!(error < 0.002, "{error}");
        assert!((mean - expected).abs() < 4.0 * error, "{gap} m apart at {at} m: {mean} +- {error}, not {expected}");
    }
}

#[test]
fn a_lamp_that_lies_on_the_ceiling_shines_as_one_just_below_it_does() {
    let room = |gap: f64| {
        let square = |z: f64| {
            json!({"inline": {
                "positions": [[-2, -2, z], [2, -2, z], [2, 2, z], [-2, 2, z]], "triangles": [[0, 1, 2], [0, 2, 3]]
            }})
        };
        let mesh = |name: &str, z: f64| json!({"name": name, "material": "plaster", "source": square(z)});
        json!({
            "version": 1, "name": "room", "film": {"width": EDGE, "height": EDGE},
            "camera": {"perspective": {
                "position": [0, -1.5, 1], "look_at": [0, 0, 1.2], "up": [0, 0, 1], "vertical_field_of_view": 120
            }},
            "integrator": {"path": {}},
            "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
            "materials": {"plaster": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}}},
            "meshes": [mesh("floor", 0.0), mesh("ceiling", 2.7)],
            "lights": [{"rectangle": {
                "name": "lamp", "centre": [0.13, 0.21, 2.7 - gap], "edge_u": [0, 1, 0], "edge_v": [1, 0, 0],
                "radiance": [1, 1, 1]
            }}]
        })
    };
    let ((on, _), (below, _)) = (mean(&room(0.0)), mean(&room(1e-6)));
    assert!(below > 0.02 && (on / below - 1.0).abs() < 1e-3, "{on} on the ceiling, {below} below it");
}

/// Two quads that meet at a right angle, and a box before them: all white.
fn white_things(lights: &Value) -> Value {
    let corners: Vec<[f64; 3]> =
        (0..8).map(|bits| [0, 1, 2].map(|axis| if bits >> axis & 1 == 0 { 0.3 } else { 0.7 })).collect();
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let walls = json!({"inline": {
        "positions": [[0, -2, 0], [2, -2, 0], [2, 2, 0], [0, 2, 0], [0, -2, 2], [0, 2, 2]],
        "triangles": [[0, 1, 2], [0, 2, 3], [0, 3, 5], [0, 5, 4]]
    }});
    let mesh = |name: &str, source: Value| json!({"name": name, "material": "white", "source": source});
    json!({
        "version": 1, "name": "furnace", "film": {"width": EDGE, "height": EDGE},
        "camera": {"perspective": {
            "position": [3, -1, 2], "look_at": [0.5, 0.2, 0.4], "up": [0, 0, 1], "vertical_field_of_view": 50
        }},
        "integrator": {"path": {"max_depth": 1000}},
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": {"white": {"diffuse": {"reflectance": {"colour": [1, 1, 1]}}}},
        "meshes": [
            mesh("walls", walls), mesh("box", json!({"inline": {"positions": corners, "triangles": triangles}}))],
        "lights": lights
    })
}

#[test]
fn white_things_in_a_white_environment_cannot_be_seen() {
    let sky = json!([{"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}}]);
    let (mean, error) = mean(&white_things(&sky));
    assert!(error < 0.002 && (mean - 1.0).abs() < 4.0 * error, "{mean} +- {error}");
}

#[test]
fn glass_and_mirrors_in_a_white_environment_cannot_be_seen() {
    let sky = json!([{"environment": {"name": "sky", "radiance": {"colour": [1, 1, 1]}}}]);
    let mut scene = white_things(&sky);
    scene["materials"]["glass"] = json!({"dielectric": {"index_of_refraction": 1.5}});
    scene["materials"]["mirror"] = json!({"mirror": {}});
    scene["materials"]["wall"] = json!({"thin_wall": {}});
    scene["meshes"][0]["material"] = "mirror".into();
    scene["meshes"][1]["material"] = "glass".into();
    let wall = json!({"inline": {
        "positions": [[1.5, -2, 0], [0.9, 2, 0.3], [0.9, 2, 2], [1.5, -2, 1.8]], "triangles": [[0, 1, 2], [0, 2, 3]]}});
    scene["meshes"].as_array_mut().unwrap().push(json!({"name": "wall", "material": "wall", "source": wall}));
    // So large that its black edge is hardly seen.
    scene["panes"] = json!([{
        "name": "pane", "centre": [2.4, 0, 0], "x_axis": [0, 1, 0], "y_axis": [0.1, 0, 1],
        "width": 40, "height": 40, "thickness": 0.003}]);
    let (mean, error) = mean(&scene);
    assert!(error < 0.002 && (mean - 1.0).abs() < 4.0 * error, "{mean} +- {error}");
}

#[test]
fn an_environment_beside_many_lights_is_the_sum_of_both() {
    let sky = json!({"environment": {"name": "sky", "radiance": {"colour": [0.25, 1, 1]}, "scale": 2}});
    let sun = json!({"sun": {"name": "sun", "direction": [1, 0, 1], "angular_radius": 20, "radiance": [3, 3, 3]}});
    let lamp = |number: u32| {
        json!({"point": {
            "name": format!("lamp {number}"), "position": [1, -1.5 + 0.7 * f64::from(number), 1.5],
            "intensity": [0.2, 1, 1]}})
    };
    let lamps: Vec<Value> = (0..4).map(lamp).collect();
    let of = |lights: &[Value]| mean(&white_things(&json!(lights)));
    let all = of(&[&lamps[..], &[sky.clone(), sun.clone()]].concat());
    let parts = [of(&lamps), of(&[sky]), of(&[sun])];
    let sum: f64 = parts.iter().map(|(mean, _)| mean).sum();
    assert!((all.0 / sum - 1.0).abs() < 0.02, "{} not {sum}", all.0);
}

/// A square in a plane of constant z.
pub(super) fn square(half: f64, z: f64) -> Value {
    json!({"inline": {
        "positions": [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]],
        "triangles": [[0, 1, 2], [0, 2, 3]]
    }})
}

/// A floor of a material under a lamp, with other things between them, seen at an angle.
pub(super) fn floor_under_lamp(floor: &Value, meshes: &[Value], panes: &Value, integrator: &Value) -> Value {
    let mut all = vec![json!({"name": "floor", "material": "floor", "source": square(0.5, 0.0)})];
    all.extend_from_slice(meshes);
    json!({
        "version": 1, "name": "floor", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [-0.5, 0, 0.4], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 0.2}},
        "integrator": integrator,
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": {
            "floor": floor, "wall": {"thin_wall": {"index_of_refraction": 1}},
            "water": {"dielectric": {"index_of_refraction": 1.33}}
        },
        "meshes": all,
        "panes": panes,
        "lights": [{"sphere": {"name": "lamp", "centre": [0.6, 0, 2], "radius": 0.6, "radiance": [1, 1, 1]}}]
    })
}

pub(super) fn pane(z: f64, edge: f64) -> Value {
    json!({
        "name": "pane", "centre": [0.3, 0, z], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
        "width": edge, "height": edge, "thickness": 0.003
    })
}

/// Methods that look for light over several things, and that which looks for none.
pub(super) fn methods() -> Vec<Value> {
    let chains = json!(["T", "TT", "TTT"]);
    vec![
        json!({"path": {"max_depth": 6}}),
        json!({"cone": {"max_depth": 6}}),
        json!({"fnee": {"max_depth": 6}}),
        json!({"sms": {"max_depth": 6, "chains": chains}}),
        json!({"mnee": {"max_depth": 6, "chains": chains}}),
        json!({"auto": {"max_depth": 6}}),
    ]
}

#[test]
fn light_through_a_thin_wall_is_found_once_by_every_method() {
    let plaster = json!({"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}});
    // Below the wall, light of the methods goes through a pane and through water.
    let water = json!({"name": "water", "material": "water", "source": square(0.1, 0.9), "translate": [0, 0.2, 0]});
    let wall = json!({"name": "wall", "material": "wall", "source": square(3.0, 1.2)});
    let panes = json!([pane(0.6, 0.4)]);
    let path = json!({"path": {"max_depth": 6}});
    let (open, open_error) = mean(&floor_under_lamp(&plaster, std::slice::from_ref(&water), &panes, &path));
    for method in methods() {
        let (found, error) = mean(&floor_under_lamp(&plaster, &[water.clone(), wall.clone()], &panes, &method));
        let errors = (found - open).abs() / libm::hypot(error, open_error);
        assert!(errors < 4.0 && error < 0.04 * found, "{method}: {found} +- {error}, not {open} +- {open_error}");
    }
}

#[test]
fn every_method_finds_the_same_light_on_rough_surfaces() {
    let floors = [
        json!({"metallic_roughness": {"metallic": 0.3, "roughness": 0.5}}),
        json!({"conductor": {"reflectance": {"colour": [0.9, 0.8, 0.7]}, "roughness": 0.6}}),
        json!({"rough_dielectric": {"roughness": 0.5}}),
    ];
    let panes = json!([pane(0.6, 1.5)]);
    for floor in floors {
        let path = json!({"path": {"max_depth": 6}});
        let (expected, expected_error) = mean(&floor_under_lamp(&floor, &[], &panes, &path));
        for method in [json!({"cone": {"max_depth": 6}}), json!({"sms": {"max_depth": 6}})] {
            let (found, error) = mean(&floor_under_lamp(&floor, &[], &panes, &method));
            let errors = (found - expected).abs() / libm::hypot(error, expected_error);
            assert!(errors < 4.0, "{floor}, {method}: {found} +- {error}, not {expected} +- {expected_error}");
            assert!(expected > 0.001 && error < 0.04 * found, "{floor}, {method}: {found} +- {error}");
        }
    }
}
