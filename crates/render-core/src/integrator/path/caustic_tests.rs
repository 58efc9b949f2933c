//! Which light is in the layer `caustic`: by scenes in which all light is, none is, or that of a path filter.

use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::tests::{EDGE, pane, square};
use crate::document::{SceneBundle, SceneDescription};
use crate::integrator::{PreparedScene, render_node};
use crate::scene::Assets;
use clerestory_film::{NodeAddress, NodeLayers};

/// Samples of a pixel.
const SAMPLES: u32 = 64;

/// What a pass brings: the sums over both planes, and over the layer `caustic` of both.
struct Picture {
    all: Vec<[f32; 3]>,
    caustic: Vec<[f32; 3]>,
}

fn description(scene: &Value) -> SceneDescription {
    SceneDescription::parse(scene.to_string().as_bytes()).unwrap()
}

fn picture(scene: &Value) -> Picture {
    let bundle = SceneBundle::from_parts(description(scene), Assets::new()).unwrap();
    let scene = PreparedScene::build(&bundle).unwrap();
    // The layer is made also where no light can be in it.
    let grid = scene.description().grid(EDGE).with_caustic(true);
    let black = || vec![[0.0; 3]; (EDGE * EDGE) as usize];
    let mut sums = Picture { all: black(), caustic: black() };
    for tile in 0..grid.len() {
        let address = NodeAddress { frame: 0, tile, level: 0, index: 0 };
        let rendered = render_node(&scene, &grid, address, &AtomicBool::new(false)).unwrap();
        let NodeLayers { beauty, caustic, .. } = rendered.node.into_layers();
        for (sums, added) in [(&mut sums.all, beauty), (&mut sums.caustic, caustic.unwrap())] {
            sums.as_flattened_mut().iter_mut().zip(added.as_flattened()).for_each(|(sum, added)| *sum += added);
        }
    }
    sums
}

/// A floor seen at an angle, below things, lit by a lamp.
fn floor(meshes: &[Value], panes: &Value, method: &Value) -> Value {
    let mut all = vec![json!({"name": "floor", "material": "plaster", "source": square(0.5, 0.0)})];
    all.extend_from_slice(meshes);
    json!({
        "version": 2, "name": "floor", "film": {"width": EDGE, "height": EDGE},
        "camera": {"orthographic": {
            "position": [-0.5, 0, 0.4], "look_at": [0, 0, 0], "up": [0, 1, 0], "height": 0.2}},
        "integrator": method,
        "sampling": {"samples_per_pass": SAMPLES, "samples_per_block": SAMPLES},
        "materials": {
            "plaster": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}},
            "glass": {"dielectric": {"index_of_refraction": 1.5}},
            "metal": {"mirror": {"reflectance": [0.9, 0.9, 0.9]}},
            "sheet": {"thin_wall": {}}
        },
        "meshes": all, "panes": panes,
        "lights": [{"sphere": {"name": "lamp", "centre": [0.1, 0, 1.5], "radius": 0.4, "radiance": [1, 1, 1]}}]
    })
}

/// A pane that covers a part of the lamp.
fn half_a_pane() -> Value {
    let mut pane = pane(0.5, 0.4);
    pane["centre"] = json!([0.25, 0, 0.5]);
    json!([pane])
}

fn filtered(mut scene: Value, filter: &str) -> Value {
    scene["path_filter"] = json!(filter);
    scene
}

/// Mean of the red channel, and its standard error over the pixels.
fn mean(sums: &[[f32; 3]]) -> (f64, f64) {
    let means: Vec<f64> = sums.iter().map(|sum| f64::from(sum[0]) / f64::from(SAMPLES)).collect();
    let count = means.len() as f64;
    let mean = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

/// All light is caustic, to the last bit.
#[track_caller]
fn check_all(scene: &Value) {
    let Picture { all, caustic } = picture(scene);
    assert!(mean(&all).0 > 0.0, "no light: {scene}");
    assert!(all == caustic, "{:?} and {:?}: {scene}", mean(&all), mean(&caustic));
}

/// No light is.
#[track_caller]
fn check_none(scene: &Value) {
    let Picture { all, caustic } = picture(scene);
    assert!(mean(&all).0 > 0.0, "no light: {scene}");
    assert_eq!(mean(&caustic).0, 0.0, "{scene}");
}

#[test]
fn light_through_a_pane_is_caustic_by_every_method() {
    for method in ["path", "cone", "fnee", "sms", "mnee", "auto", "light"] {
        let scene = floor(&[], &half_a_pane(), &json!({method: {"max_depth": 8}}));
        check_all(&filtered(scene.clone(), ".*D [RT]+ L"));
        check_none(&filtered(scene, ".*D L | [RT]* L"));
    }
}

#[test]
fn the_layer_has_the_light_of_its_paths_and_the_rest_has_the_other() {
    for method in ["path", "cone", "auto", "light"] {
        let scene = floor(&[], &half_a_pane(), &json!({method: {"max_depth": 8}}));
        let Picture { all, caustic } = picture(&scene);
        let rest: Vec<[f32; 3]> =
            all.iter().zip(&caustic).map(|(all, caustic)| [0, 1, 2].map(|i| all[i] - caustic[i])).collect();
        for (part, filter) in [(caustic, ".*D [RT]+ L"), (rest, ".*D L | [RT]* L")] {
            let (found, expected) = (mean(&part), mean(&picture(&filtered(scene.clone(), filter)).all));
            let error = libm::hypot(found.1, expected.1);
            assert!((found.0 - expected.0).abs() < 4.0 * error, "{method}, {filter}: {found:?}, {expected:?}");
            assert!(error < 0.15 * expected.0, "no power: {method}, {filter}: {found:?}, {expected:?}");
        }
    }
}

#[test]
fn mirrors_of_metal_make_no_caustics_and_water_does() {
    // A wall at the side of the floor, which mirrors the lamp.
    let wall = |material: &str| {
        let positions = [[0.45, -2.0, 0.01], [0.45, 2.0, 0.01], [0.45, 2.0, 3.0], [0.45, -2.0, 3.0]];
        let source = json!({"inline": {"positions": positions, "triangles": [[0, 2, 1], [0, 3, 2]]}});
        json!({"name": material, "material": material, "source": source})
    };
    let reflected = |material: &str, others: &[Value], panes: &Value, method: Value| {
        filtered(floor(&[&[wall(material)], others].concat(), panes, &method), "D R L")
    };
    let conic = || json!({"conic": {"max_depth": 6, "chains": ["R"]}});
    let sms = || json!({"sms": {"max_depth": 6, "chains": ["R"]}});
    let path = || json!({"path": {"max_depth": 6}});
    // Glass that is not on the way.
    let aside = json!({"name": "pool", "material": "glass", "source": square(0.05, -0.5)});
    for method in [path(), conic(), sms()] {
        check_none(&reflected("metal", &[], &json!([]), method.clone()));
        check_none(&reflected("metal", std::slice::from_ref(&aside), &json!([]), method.clone()));
        check_all(&reflected("glass", &[], &json!([]), method));
    }
    let both = json!({"name": "speculum", "material": "metal", "source": square(0.05, -0.5)});
    check_all(&reflected("glass", &[both], &json!([]), conic()));
    check_all(&reflected("sheet", &[], &json!([]), path()));
}

#[test]
fn light_straight_through_a_thin_wall_is_not_caustic() {
    let sheet = json!({"name": "sheet", "material": "sheet", "source": square(1.0, 0.8)});
    for method in ["path", "auto"] {
        check_none(&filtered(floor(std::slice::from_ref(&sheet), &json!([]), &json!({method: {}})), "D T L"));
    }
}

#[test]
fn a_lamp_seen_through_glass_is_not_caustic() {
    let mut scene = floor(&[], &json!([pane(0.5, 1.2)]), &json!({"path": {}}));
    scene["camera"]["orthographic"]["position"] = json!([0.1, 0, 0.2]);
    scene["camera"]["orthographic"]["look_at"] = json!([0.1, 0, 1.5]);
    check_none(&filtered(scene, "T* L"));
}

#[test]
fn the_layer_is_there_where_glass_may_send_light_to_a_surface() {
    let has = |scene: &Value| description(scene).grid(EDGE).has_caustic;
    let path = json!({"path": {}});
    let thing = |material: &str| json!({"name": "thing", "material": material, "source": square(0.1, 0.2)});
    assert!(has(&floor(&[], &json!([pane(0.5, 1.2)]), &path)));
    assert!(has(&floor(&[thing("glass")], &json!([]), &path)));
    assert!(has(&floor(&[thing("sheet")], &json!([]), &path)));
    assert!(!has(&floor(&[thing("metal")], &json!([]), &path)));
    assert!(!has(&floor(&[], &json!([]), &path)));
    assert!(!has(&filtered(floor(&[], &json!([pane(0.5, 1.2)]), &path), "D* L")));
}
