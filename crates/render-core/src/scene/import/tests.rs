//! Files of other programs as things of a scene.

use serde_json::{Value, json};

use super::gltf::tests::builder::{Builder, F32, SQUARE, floats};
use super::*;
use crate::bsdf::MaterialDescription;
use crate::document::{SceneBundle, SceneDescription};
use crate::integrator::PreparedScene;
use crate::light::LightDescription;
use crate::scene::description::CameraDescription;
use crate::scene::{Asset, Assets};
use crate::settings::{JsonPath, SceneError};

/// A square of the file `a.glb` that stands upright: x to the right, y up.
fn file(change: impl FnOnce(&mut Builder)) -> Assets {
    let mut builder = Builder::square();
    change(&mut builder);
    Assets::from([("a.glb".to_owned(), Asset::new(builder.glb()))])
}

fn import(settings: Value) -> ImportDescription {
    let mut import = json!({"name": "hall", "source": {"gltf": {"file": "a.glb"}}});
    import.as_object_mut().unwrap().extend(settings.as_object().unwrap().clone());
    serde_json::from_value(import).unwrap()
}

fn expanded(settings: Value, assets: &Assets) -> Expansion {
    expand(&import(settings), assets, &JsonPath::Root).unwrap()
}

/// A scene of the import in daylight.
fn scene(imports: Value) -> SceneDescription {
    SceneDescription::parse(scene_text(imports).as_bytes()).unwrap()
}

fn scene_text(imports: Value) -> String {
    let scene = json!({
        "version": 2, "name": "imported", "film": {"width": 8, "height": 8},
        "camera": {"perspective": {
            "position": [0.5, -3, 0.5], "look_at": [0.5, 0, 0.5], "up": [0, 0, 1], "vertical_field_of_view": 30
        }},
        "materials": {"plaster": {"diffuse": {"reflectance": {"colour": [0.5, 0.5, 0.5]}}}},
        "imports": imports,
        "lights": [{"sun": {"name": "sun", "direction": [0, -1, 0.2], "angular_radius": 1, "radiance": [1, 1, 1]}}]
    });
    scene.to_string()
}

fn built(imports: Value, assets: Assets) -> Result<PreparedScene, SceneError> {
    PreparedScene::build(&SceneBundle::from_parts(scene(imports), assets)?)
}

#[test]
fn y_of_a_gltf_file_is_z_of_the_scene_and_units_become_metres() {
    let assets = file(|builder| builder.json["nodes"][0]["translation"] = json!([1, 2, 3]));
    let place = |settings: Value| {
        let imports = json!([import(settings)]);
        let scene = built(imports, assets.clone()).unwrap();
        scene.scene().bounds().unwrap().map(|corner| corner.to_array().map(|x| (x * 1e6).round() / 1e6))
    };
    assert_eq!(place(json!({})), [[1.0, -3.0, 2.0], [2.0, -3.0, 3.0]]);
    assert_eq!(place(json!({"up": "z"})), [[1.0, 2.0, 3.0], [2.0, 3.0, 3.0]]);
    assert_eq!(place(json!({"metres_per_unit": 0.01})), [[0.01, -0.03, 0.02], [0.02, -0.03, 0.03]]);
    let moved = place(json!({"rotate": [0, 0, 90], "translate": [0, 0, 10]}));
    assert_eq!(moved, [[3.0, 1.0, 12.0], [3.0, 2.0, 13.0]]);
}

#[test]
fn a_mirrored_node_keeps_the_outside_of_its_triangles() {
    let outside = |scale: Value| {
        let assets = file(|builder| builder.json["nodes"][0]["scale"] = scale);
        built(json!([import(json!({}))]), assets).unwrap().scene().triangle_normal(0).to_array()
    };
    assert_eq!(outside(json!([1, 1, 1])), [0.0, -1.0, 0.0]);
    // Mirrored in x, a square that faces the viewer still does.
    assert_eq!(outside(json!([-1, 1, 1])), [0.0, -1.0, 0.0]);
    assert_eq!(outside(json!([1, 1, -1])), [0.0, 1.0, 0.0]);
}

#[test]
fn names_that_repeat_get_numbers_and_begin_with_that_of_the_import() {
    let assets = file(|builder| {
        builder.json["nodes"][0]["name"] = json!("Wall");
        builder.node(json!({"mesh": 0, "name": "Wall", "translation": [2, 0, 0]}));
        builder.node(json!({"mesh": 0, "translation": [4, 0, 0]}));
    });
    let names: Vec<String> = expanded(json!({}), &assets).meshes.into_iter().map(|mesh| mesh.name).collect();
    assert_eq!(names, ["hall/Wall", "hall/Wall 2", "hall/mesh 0"]);
}

#[test]
fn rules_give_other_materials_by_the_names_of_nodes_and_materials() {
    let assets = file(|builder| {
        builder.json["nodes"][0]["name"] = json!("North wall");
        builder.push(
            "materials",
            json!({"name": "Stone", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1]}}),
        );
        builder.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    });
    let rule = |pattern: &str| json!({"materials": [{"match": pattern, "material": "plaster"}]});
    let material = |settings: Value| expanded(settings, &assets).meshes[0].material.clone();
    assert_eq!(material(json!({})), "hall/Stone");
    assert_eq!([material(rule("*wall")), material(rule("Stone"))], ["plaster"; 2]);
    assert_eq!(material(rule("South*")), "hall/Stone");
    let materials = expanded(json!({}), &assets).materials;
    assert!(matches!(materials["hall/Stone"], MaterialDescription::MetallicRoughness(_)), "{materials:?}");
    let unknown = json!([import(json!({"materials": [{"match": "*", "material": "velvet"}]}))]);
    let error = SceneDescription::parse(scene_text(unknown).as_bytes()).unwrap_err();
    assert_eq!(error.path(), "imports[0].materials[0].material", "{error}");
}

#[test]
fn a_window_becomes_a_pane_by_rule_or_by_what_its_program_says() {
    let named = |name: &'static str| file(move |builder| builder.json["nodes"][0]["name"] = json!(name));
    let rule = json!({"glaze": [{"match": "Window*", "thickness": 0.003, "front": {"crown": {
        "centre": [0.2, 0.3], "wavelength": 0.03, "amplitude": 1e-5, "seed": 4}}}]});
    let glazed = expanded(rule.clone(), &named("Window.001"));
    let [pane] = &glazed.panes[..] else { panic!("{glazed:?}") };
    assert_eq!((glazed.meshes.len(), pane.name.as_str()), (0, "hall/Window.001"));
    assert!((pane.width - 0.998).abs() < 1e-9 && (pane.height - 0.998).abs() < 1e-9 && pane.thickness == 0.003);
    assert!((pane.y_axis[2] - 1.0).abs() < 1e-12 && (pane.centre[2] - 0.5).abs() < 1e-12, "{pane:?}");
    assert!(built(json!([import(rule.clone())]), named("Window.001")).unwrap().scene().panes().len() == 1);

    let unglazed = expanded(rule, &named("Wall"));
    assert_eq!((unglazed.meshes.len(), unglazed.panes.len()), (1, 0));
    assert_eq!(expanded(json!({}), &named("Fenster")).glazable, [("Fenster".to_owned(), 1)]);

    let tag = json!({"clerestory": {"kind": "pane", "thickness": 0.0015, "profile": "hammered"}});
    let tagged = expanded(json!({}), &file(|builder| builder.json["nodes"][0]["extras"] = tag));
    assert_eq!((tagged.panes.len(), tagged.panes[0].thickness), (1, 0.0015));
}

#[test]
fn what_is_no_pane_stays_a_mesh_and_says_why() {
    let assets = file(|builder| {
        let triangle =
            builder.accessor(&floats(&SQUARE[..9]), json!({"componentType": F32, "type": "VEC3", "count": 3}));
        builder.json["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": triangle}});
        builder.json["nodes"][0]["name"] = json!("Window");
    });
    let expansion = expanded(json!({"glaze": [{"match": "*"}]}), &assets);
    assert_eq!((expansion.meshes.len(), expansion.panes.len()), (1, 0));
    assert!(expansion.unglazed[0].0 == "Window" && expansion.unglazed[0].1.contains("no rectangle"), "{expansion:?}");
}

#[test]
fn cameras_and_lights_are_where_their_nodes_are() {
    let assets = file(|builder| {
        builder.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 1.5}}]);
        let light = |kind: &str| json!({"type": kind, "intensity": 683.0, "color": [1, 0.5, 0], "spot": {}});
        builder.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        builder.json["extensions"] =
            json!({"KHR_lights_punctual": {"lights": [light("point"), light("directional"), light("spot")]}});
        builder.node(json!({"camera": 0, "name": "Eye", "translation": [0, 1.5, 4]}));
        for index in 0..3 {
            let lamp = json!({"KHR_lights_punctual": {"light": index}});
            builder.node(json!({"name": "Lamp", "translation": [0, 2, 0], "extensions": lamp}));
        }
    });
    let expansion = expanded(json!({}), &assets);
    let camera = &expansion.cameras[0];
    let CameraDescription::Perspective { position, look_at, up, vertical_field_of_view } = camera.camera else {
        panic!("{camera:?}")
    };
    assert_eq!((position, look_at, up), ([0.0, -4.0, 1.5], [0.0, -3.0, 1.5], [0.0, 0.0, 1.0]));
    assert!((vertical_field_of_view - 45.836_623_610_465_86).abs() < 1e-9 && camera.aspect == Some(1.5));
    let [LightDescription::Point(point), LightDescription::Sun(sun), LightDescription::Spot(spot)] =
        &expansion.lights[..]
    else {
        panic!("{:?}", expansion.lights)
    };
    // 683 candelas are a watt in each steradian.
    assert_eq!((point.position, point.intensity), ([0.0, 0.0, 2.0], [1.0, 0.5, 0.0]));
    assert_eq!((spot.direction, sun.direction), ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0]));
    let sine = libm::sin(sun.angular_radius.to_radians());
    assert!((sun.radiance[0] * std::f64::consts::PI * sine * sine - 1.0).abs() < 1e-12);
    assert!(expanded(json!({"lights": false}), &assets).lights.is_empty());
}

#[test]
fn faults_in_a_file_name_the_import_and_the_place_in_the_file() {
    let assets = file(|builder| builder.json["accessors"][0]["count"] = json!(5_000_000));
    let error = built(json!([import(json!({}))]), assets).unwrap_err();
    assert_eq!(error.path(), "imports[0].source.gltf.file", "{error}");
    assert!(error.to_string().contains("accessors[0]"), "{error}");
    // What only the scene refuses has the name of the thing.
    let far = file(|builder| {
        builder.json["nodes"][0]["name"] = json!("Wall");
        builder.json["nodes"][0]["translation"] = json!([1e9, 0, 0]);
    });
    let error = built(json!([import(json!({}))]), far).unwrap_err();
    assert!(error.path().starts_with("meshes[hall/Wall]"), "{error}");
}

#[test]
fn an_obj_file_has_its_parts_with_the_materials_of_its_library() {
    let text = "mtllib a.mtl\no Wall\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl stone\nf 1 2 3 4\n\
                o Window\nv 2 0 0\nv 3 0 0\nv 3 1 0\nv 2 1 0\nusemtl glass\nf 5 6 7 8\n";
    let library = "newmtl stone\nKd 0.4 0.3 0.2\nnewmtl glass\nKd 1 1 1\nd 0.2\nNi 1.5\n";
    let asset = |text: &str| Asset::new(text.as_bytes().to_vec());
    let assets = Assets::from([("a.obj".to_owned(), asset(text)), ("a.mtl".to_owned(), asset(library))]);
    let source = json!({"source": {"obj": {"file": "a.obj", "files": ["a.mtl"]}}});
    let expansion = expanded(source.clone(), &assets);
    let names: Vec<[&str; 2]> =
        expansion.meshes.iter().map(|mesh| [mesh.name.as_str(), mesh.material.as_str()]).collect();
    assert_eq!(names, [["hall/Wall", "hall/stone"], ["hall/Window", "hall/glass"]]);
    assert!(matches!(expansion.materials["hall/glass"], MaterialDescription::ThinWall(_)));
    assert_eq!(expansion.glazable, [("Window".to_owned(), 1)]);
    let mut glazed = source;
    glazed["glaze"] = json!([{"match": "glass"}]);
    let scene = built(json!([import(glazed)]), assets).unwrap();
    assert_eq!((scene.scene().meshes().len(), scene.scene().panes().len()), (1, 1));
    assert_eq!(scene.scene().bounds().unwrap()[1].z, 1.0);
}
