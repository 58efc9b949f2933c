//! The tree of nodes, cameras and lights.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DVec3};
use serde_json::json;

use super::*;

fn places(builder: &Builder) -> Vec<(usize, DAffine3)> {
    open(&builder.glb()).unwrap().nodes().map(|node| (node.index, node.world)).collect()
}

#[test]
fn nodes_stand_where_their_ancestors_put_them() {
    let mut builder = Builder::square();
    builder.push("nodes", json!({"mesh": 0, "translation": [1, 0, 0]}));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let parent = json!({"children": [1], "rotation": [0, 0, half, half], "scale": [2, 2, 2], "name": "wing"});
    builder.node(parent);
    let bytes = builder.glb();
    let file = open(&bytes).unwrap();
    let nodes: Vec<Node<'_>> = file.nodes().collect();
    assert_eq!(nodes.iter().map(|node| node.index).collect::<Vec<_>>(), [0, 2, 1]);
    assert_eq!(nodes[1].name, Some("wing"));
    assert_eq!((nodes[0].mesh, nodes[1].mesh), (Some(0), None));
    assert_eq!(nodes[0].world, DAffine3::IDENTITY);
    // One metre along x, turned by a right angle about z and scaled by two.
    assert!((nodes[2].world.transform_point3(DVec3::X) - DVec3::new(0.0, 4.0, 0.0)).length() < 1e-12);
}

#[test]
fn matrices_are_in_the_order_of_their_columns() {
    let mut builder = Builder::square();
    builder.set("/nodes/0/matrix", json!([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, -3, 0, 5, 6, 7, 1]));
    let [(_, world)] = places(&builder)[..] else { panic!("one node") };
    assert_eq!(world.transform_point3(DVec3::new(1.0, 0.0, 1.0)), DVec3::new(5.0, 7.0, 4.0));
    assert_eq!(world.matrix3.determinant(), -3.0, "it mirrors");
}

#[test]
fn the_default_scene_is_shown_then_the_first_then_all() {
    let mut builder = Builder::square();
    builder.push("nodes", json!({}));
    builder.push("scenes", json!({"nodes": [1]}));
    builder.set("/scene", json!(1));
    let shown = |builder: &Builder| places(builder).into_iter().map(|(node, _)| node).collect::<Vec<_>>();
    assert_eq!(shown(&builder), [1]);
    builder.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(shown(&builder), [0]);
    builder.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(shown(&builder), [0, 1]);
}

#[test]
fn names_and_extras_are_kept() {
    let mut builder = Builder::square();
    let tag = json!({"clerestory": {"kind": "pane", "thickness": 0.002}});
    builder.set("/nodes/0/extras", tag.clone()).set("/nodes/0/name", json!("Fenster \u{fc}ber T\u{fc}r"));
    builder.set("/meshes/0/extras", json!([1])).set("/meshes/0/name", json!(""));
    builder.push("materials", json!({"name": "glass", "extras": tag}));
    let bytes = builder.glb();
    let file = open(&bytes).unwrap();
    let node = file.nodes().next().unwrap();
    assert_eq!((node.name, node.extras), (Some("Fenster \u{fc}ber T\u{fc}r"), &tag));
    let mesh = file.meshes().next().unwrap();
    assert_eq!((mesh.name, mesh.extras), (Some(""), &json!([1])));
    assert_eq!((file.materials()[0].name.as_deref(), &file.materials()[0].extras), (Some("glass"), &tag));
}

#[test]
fn cameras_and_lights_belong_to_nodes() {
    let mut builder = Builder::square();
    builder.json["cameras"] = json!([
        {"type": "perspective", "name": "west", "perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 3, "znear": 0.1, "zfar": 10}},
    ]);
    builder.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "directional", "intensity": 1000, "color": [1, 0.5, 0.25], "name": "sun"},
        {"type": "point", "range": 5},
        {"type": "spot", "spot": {"innerConeAngle": 0.2, "outerConeAngle": FRAC_PI_2 + 5e-8}},
        {"type": "spot", "spot": {}},
    ]}});
    builder.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    builder.json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
    builder.node(json!({"camera": 1}));
    builder.node(json!({"extensions": {"KHR_lights_punctual": {"light": 2}}}));
    let bytes = builder.glb();
    let file = open(&bytes).unwrap();
    let nodes: Vec<Node<'_>> = file.nodes().collect();
    assert_eq!((nodes[1].camera, nodes[1].light), (Some(1), None));
    assert_eq!((nodes[2].camera, nodes[2].light), (None, Some(2)));
    let perspective = Projection::Perspective { vertical_angle: 0.5, aspect: Some(1.5) };
    assert_eq!(file.cameras()[0], Camera { name: Some("west".to_owned()), projection: perspective });
    assert_eq!(file.cameras()[1].projection, Projection::Orthographic { half_extent: [2.0, 3.0] });
    let kinds: Vec<LightKind> = file.lights().iter().map(|light| light.kind).collect();
    let spot = LightKind::Spot { inner_angle: 0.2, outer_angle: FRAC_PI_2 };
    let default = LightKind::Spot { inner_angle: 0.0, outer_angle: FRAC_PI_2 / 2.0 };
    assert_eq!(kinds, [LightKind::Directional, LightKind::Point, spot, default]);
    assert_eq!((file.lights()[0].intensity, file.lights()[0].colour), (1000.0, [1.0, 0.5, 0.25]));
    assert_eq!((file.lights()[1].intensity, file.lights()[1].range), (1.0, Some(5.0)));
    assert_eq!(file.lights()[0].name.as_deref(), Some("sun"));
    assert_eq!(file.notes(), ["ranges of lights are left out (1): light does not end at a distance"]);
}

#[test]
fn a_rotation_of_single_precision_turns_without_scaling() {
    let mut builder = Builder::square();
    builder.set("/nodes/0/rotation", json!([0.270_598_1, 0.270_598_1, 0.653_281_5, 0.653_281_5]));
    let [(_, world)] = places(&builder)[..] else { panic!("one node") };
    let product = world.matrix3.transpose() * world.matrix3;
    assert!((product - DMat3::IDENTITY).to_cols_array().iter().all(|number| number.abs() < 1e-15));
}
