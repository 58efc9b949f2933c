//! Files of other programs as things of a scene.

use clerestory_film::counters::Counters;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::gltf::tests::builder::{Builder, F32, SQUARE, U16, floats, shorts};
use super::*;
use crate::bsdf::MaterialDescription;
use crate::document::{SceneBundle, SceneDescription};
use crate::geometry::{Ray, SurfaceId};
use crate::integrator::PreparedScene;
use crate::light::{LightDescription, MeshLight};
use crate::scene::description::{CameraDescription, MeshSource, PaneDescription};
use crate::scene::{Asset, Assets};
use crate::settings::{JsonPath, SceneError};
use crate::texture::picture_samples::encode_png;
use crate::texture::{Channel, ColourDescription, ValueDescription};

mod obj;
mod windows;

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
    assert_eq!(expanded(json!({}), &named("Fenster")).windows[0].name, "Fenster");

    let tag = json!({"clerestory": {"kind": "pane", "thickness": 0.0015, "profile": "crown"}});
    let tagged = expanded(json!({}), &file(|builder| builder.json["nodes"][0]["extras"] = tag));
    assert_eq!((tagged.panes.len(), tagged.panes[0].thickness), (1, 0.0015));
}

#[test]
fn a_rectangle_becomes_a_leaded_window_that_stands_upright_in_it() {
    let named = |turn: Value| {
        file(move |builder| {
            builder.json["nodes"][0]["name"] = json!("Window");
            builder.json["nodes"][0]["rotation"] = turn;
        })
    };
    let rule = json!({"lead": [{"match": "Window", "design": {"filling": {"rectangles": {"width": 0.25, "height": 0.2}},
        "tilt": 0}}]});
    // As it is, and lying on its side.
    for turn in [json!([0, 0, 0, 1]), json!([0, 0, 0.5f64.sqrt(), 0.5f64.sqrt()])] {
        let expansion = expanded(rule.clone(), &named(turn.clone()));
        let leaded = &expansion.leaded;
        assert_eq!((expansion.leaded_windows, leaded.panes.len(), leaded.sheets.len()), (1, 20, 1));
        assert!(expansion.meshes.is_empty() && expansion.panes.is_empty() && expansion.unglazed.is_empty());
        for pane in &leaded.panes {
            assert!((pane.y_axis[2] - 1.0).abs() < 1e-9 && pane.height < pane.width, "{turn}: {pane:?}");
        }
        let scene = built(json!([import(rule.clone())]), named(turn)).unwrap();
        assert_eq!(scene.scene().panes().len(), 20);
    }
}

#[test]
fn an_opening_that_takes_no_window_stays_a_mesh_and_says_why() {
    let assets = file(|builder| builder.json["nodes"][0]["scale"] = json!([0.004, 0.004, 1]));
    let expansion = expanded(json!({"lead": [{"match": "*"}]}), &assets);
    assert_eq!((expansion.meshes.len(), expansion.leaded_windows), (1, 0));
    assert!(expansion.unglazed[0].1.contains("design.opening.arch.width"), "{:?}", expansion.unglazed);
    let wrong = json!([import(json!({"lead": [{"match": "*", "design": {"tilt": 9}}]}))]);
    let error = SceneDescription::parse(scene_text(wrong).as_bytes()).unwrap_err();
    assert_eq!(error.path(), "imports[0].lead[0].design.tilt", "{error}");
}

/// Triangles in the plane of the square.
fn flat_shape(builder: &mut Builder, corners: &[[f32; 2]]) {
    let places: Vec<f32> = corners.iter().flat_map(|[x, y]| [*x, *y, 0.0]).collect();
    let about = json!({"componentType": F32, "type": "VEC3", "count": corners.len()});
    let positions = builder.accessor(&floats(&places), about);
    builder.json["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": positions}});
    builder.json["nodes"][0]["name"] = json!("Window");
}

#[test]
fn a_flat_arch_becomes_a_pane_of_its_outline_with_a_rim_left_free() {
    // A lancet of straight edges, as a fan.
    let outline = [[0.0, 0.0], [0.6, 0.0], [0.6, 0.5], [0.45, 0.9], [0.3, 1.0], [0.15, 0.9], [0.0, 0.5]];
    let fan: Vec<[f32; 2]> = (1..6).flat_map(|corner| [outline[0], outline[corner], outline[corner + 1]]).collect();
    let rule = json!({"glaze": [{"match": "Window", "inset": 0.01, "front": {"hammered": {
        "wavelength": 0.05, "amplitude": 1e-5}}}]});
    let assets = || file(|builder| flat_shape(builder, &fan));
    let glazed = expanded(rule.clone(), &assets());
    let [pane] = &glazed.panes[..] else { panic!("{glazed:?}") };
    assert!(glazed.meshes.is_empty() && pane.outline.len() == 7, "{pane:?}");
    assert!((pane.width - 0.58).abs() < 1e-6 && (pane.height - 0.98).abs() < 1e-6, "{pane:?}");
    let scene = built(json!([import(rule)]), assets()).unwrap();
    let is_glass = |x: f64, z: f64| {
        let ray = Ray::new(DVec3::new(x, -3.0, z), DVec3::Y);
        let hit = scene.scene().accelerator().closest_hit(&ray, 4.0, SurfaceId::Nothing, &mut Counters::default());
        hit.is_some()
    };
    assert!(is_glass(0.3, 0.97) && is_glass(0.02, 0.3) && !is_glass(0.005, 0.3) && !is_glass(0.05, 0.95));
}

#[test]
fn a_shape_of_any_outline_becomes_a_leaded_window() {
    // A lancet, and an arrow with a hollow edge.
    let lancet = [[0.0, 0.0], [0.6, 0.0], [0.6, 0.5], [0.45, 0.9], [0.3, 1.0], [0.15, 0.9], [0.0, 0.5]];
    let fan: Vec<[f32; 2]> = (1..6).flat_map(|corner| [lancet[0], lancet[corner], lancet[corner + 1]]).collect();
    let arrow = [[0.0, 0.0], [1.0, 0.0], [0.3, 0.3], [0.0, 0.0], [0.3, 0.3], [0.0, 1.0]];
    let design = json!({"filling": {"rectangles": {"width": 0.1, "height": 0.1}}, "lead": "none", "bars": "none"});
    let rule = json!({"lead": [{"match": "Window", "design": design}]});
    for (corners, area) in [(&fan[..], 0.495), (&arrow, 0.3)] {
        let expansion = expanded(rule.clone(), &file(|builder| flat_shape(builder, corners)));
        assert_eq!((expansion.leaded_windows, expansion.meshes.len()), (1, 0), "{:?}", expansion.unglazed);
        let shoelace = |pane: &PaneDescription| {
            let corners: Vec<DVec2> = pane.outline.iter().copied().map(DVec2::from).collect();
            clerestory_glazing::area(&corners)
        };
        let glass: f64 = expansion.leaded.panes.iter().map(shoelace).sum();
        assert!((glass / area - 1.0).abs() < 0.01, "{glass} of {area}");
        for pane in &expansion.leaded.panes {
            let at = DVec3::from(pane.centre);
            assert!((-0.01..1.01).contains(&at.x) && (-0.01..1.01).contains(&at.z) && at.y.abs() < 0.01, "{at}");
        }
    }
}

#[test]
fn what_is_no_pane_stays_a_mesh_and_says_why() {
    let assets = file(|builder| {
        let arrow = [[0.0, 0.0], [1.0, 0.0], [0.3, 0.3], [0.0, 0.0], [0.3, 0.3], [0.0, 1.0]];
        flat_shape(builder, &arrow);
    });
    let expansion = expanded(json!({"glaze": [{"match": "*"}]}), &assets);
    assert_eq!((expansion.meshes.len(), expansion.panes.len()), (1, 0));
    assert!(expansion.unglazed[0].0 == "Window" && expansion.unglazed[0].1.contains("not convex"), "{expansion:?}");
    assert!(matches!(expansion.meshes[0].source, MeshSource::Gltf(_)), "its texture coordinates stay: {expansion:?}");
}

#[test]
fn a_window_that_is_too_large_for_its_relief_stays_a_mesh_and_says_how_large_it_may_be() {
    let assets = file(|builder| builder.json["nodes"][0]["scale"] = json!([9, 1, 1]));
    let rule = |front: Value| json!({"glaze": [{"match": "*", "front": front}]});
    let hammered = expanded(rule(json!({"hammered": {"wavelength": 0.02, "amplitude": 1e-4}})), &assets);
    assert_eq!((hammered.meshes.len(), hammered.panes.len()), (1, 0));
    let remark = hammered.remarks().next().unwrap();
    assert!(remark.contains("measures 9.00 m") && remark.contains("at most 0.85 m: divide it"), "{remark}");
    assert_eq!(expanded(rule(json!("flat")), &assets).panes.len(), 1);
}

#[test]
fn a_building_does_without_faces_of_no_area_and_normals_of_no_length() {
    let assets = file(|builder| {
        let corners = |corners: &[f32]| (floats(corners), json!({"componentType": F32, "type": "VEC3", "count": 3}));
        let [line, normals] = [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0], [0.0; 9]].map(|values| {
            let (bytes, accessor) = corners(&values);
            builder.accessor(&bytes, accessor)
        });
        let (bytes, accessor) = corners(&SQUARE[..9]);
        let triangle = builder.accessor(&bytes, accessor);
        builder.json["meshes"][0]["primitives"] = json!([
            {"attributes": {"POSITION": line}},
            {"attributes": {"POSITION": triangle, "NORMAL": normals}}
        ]);
    });
    let scene = built(json!([import(json!({}))]), assets).unwrap();
    let [line, triangle] = scene.scene().meshes() else { panic!("two meshes") };
    assert_eq!([line.triangles(), line.omitted_triangles()], [0, 1]);
    assert_eq!(triangle.corner_normals(0), Some(&[scene.scene().triangle_normal(0); 3]));
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

/// The square of a material that emits light.
fn emitting(strength: f64, generator: &str) -> Assets {
    let extensions = json!({"KHR_materials_emissive_strength": {"emissiveStrength": strength}});
    file(|builder| {
        builder.json["asset"]["generator"] = json!(generator);
        builder.json["extensionsUsed"] = json!(["KHR_materials_emissive_strength"]);
        let material = json!({"name": "Lamp", "emissiveFactor": [1, 0.5, 0], "extensions": extensions});
        builder.push("materials", material);
        builder.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        builder.json["nodes"][0]["name"] = json!("Panel");
    })
}

fn shining(expansion: &Expansion) -> &MeshLight {
    let [LightDescription::Mesh(light)] = &expansion.lights[..] else { panic!("{:?}", expansion.lights) };
    light
}

#[test]
fn a_mesh_whose_material_emits_light_is_a_light() {
    // 683 cd/m2 are a watt in each steradian and square metre; Blender writes watts.
    for (strength, generator) in [(683.0, "other"), (1.0, "Khronos glTF Blender I/O v4.5.51")] {
        let assets = emitting(strength, generator);
        let expansion = expanded(json!({}), &assets);
        let light = shining(&expansion);
        assert_eq!((light.name.as_str(), light.mesh.as_str()), ("hall/Panel", "hall/Panel"));
        assert_eq!((light.radiance, &light.texture), ([1.0, 0.5, 0.0], &None), "{generator}");
        let scene = built(json!([import(json!({}))]), assets).unwrap();
        let (triangles, mesh) = (scene.scene().lights()[1].triangles(), &scene.scene().meshes()[0]);
        assert_eq!((triangles, mesh.name()), (Some(mesh.triangle_range()), "hall/Panel"));
    }
    let assets = emitting(683.0, "other");
    let rule = json!({"materials": [{"match": "Lamp", "material": "plaster"}]});
    assert!(expanded(rule, &assets).lights.is_empty());
    assert!(expanded(json!({"lights": false}), &assets).lights.is_empty());
    let glazed = expanded(json!({"glaze": [{"match": "Panel"}]}), &assets);
    assert!(glazed.lights.is_empty() && glazed.notes[0].contains("emits no light"), "{:?}", glazed.notes);
}

#[test]
fn a_light_of_the_scene_takes_the_place_of_what_a_file_makes_of_its_mesh() {
    let mut scene: Value = serde_json::from_str(&scene_text(json!([import(json!({}))]))).unwrap();
    scene["lights"] = json!([{"mesh": {"name": "dim", "mesh": "hall/Panel", "radiance": [0.1, 0.1, 0.1]}}]);
    let of = |scene: &Value| {
        let description = SceneDescription::parse(scene.to_string().as_bytes())?;
        PreparedScene::build(&SceneBundle::from_parts(description, emitting(683.0, "other"))?)
    };
    let prepared = of(&scene).unwrap();
    let [light] = prepared.scene().lights() else { panic!("{:?}", prepared.scene().lights()) };
    assert_eq!((light.name.as_str(), light.emission().x), ("dim", 0.1));
    scene["lights"][0]["mesh"]["mesh"] = json!("hall/Pane");
    let error = of(&scene).unwrap_err();
    assert_eq!(error.path(), "lights[dim].mesh.mesh", "{error}");
}

#[test]
fn colours_of_vertices_multiply_the_base_colour() {
    let assets = file(|builder| {
        builder.attribute("COLOR_0", "VEC3", &[1.0, 0.5, 0.0, 1.0, 0.5, 0.2, 1.0, 0.5, 0.4, 1.0, 0.5, 1.0], 4);
        let material = json!({
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0},
            "extensions": {"KHR_materials_specular": {"specularFactor": 0}}
        });
        builder.json["extensionsUsed"] = json!(["KHR_materials_specular"]);
        builder.push("materials", material);
        builder.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    });
    let prepared = built(json!([import(json!({}))]), assets).unwrap();
    let scene = prepared.scene();
    // The middle of the first triangle.
    let albedo = scene.bsdf(0).albedo(&scene.surface_point(0, [1.0 / 3.0, 1.0 / 3.0]));
    assert!((albedo - DVec3::new(0.5, 0.25, 0.1)).length() < 1e-6, "{albedo}");
}

#[test]
fn bodies_absorb_over_metres_and_thin_walls_let_a_part_through() {
    let assets = file(|builder| {
        let volume = json!({"thicknessFactor": 1, "attenuationDistance": 50, "attenuationColor": [1, 0.5, 0.1]});
        let transmission = |factor: f64| json!({"transmissionFactor": factor});
        let body = json!({
            "name": "Body", "pbrMetallicRoughness": {"roughnessFactor": 0, "metallicFactor": 0},
            "extensions": {"KHR_materials_volume": volume, "KHR_materials_transmission": transmission(1.0)}
        });
        let wall = json!({"name": "Wall", "extensions": {"KHR_materials_transmission": transmission(0.4)}});
        builder.json["extensionsUsed"] = json!(["KHR_materials_volume", "KHR_materials_transmission"]);
        let tetrahedron = [0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2];
        let closed =
            builder.accessor(&shorts(&tetrahedron), json!({"componentType": U16, "type": "SCALAR", "count": 12}));
        for (number, material) in [body, wall].into_iter().enumerate() {
            builder.push("materials", material);
            let primitive = json!({"attributes": {"POSITION": 0}, "indices": closed, "material": number});
            let mesh = builder.push("meshes", json!({"primitives": [primitive]}));
            builder.node(json!({"mesh": mesh}));
        }
    });
    let expansion = expanded(json!({"metres_per_unit": 0.01}), &assets);
    let MaterialDescription::Dielectric(body) = &expansion.materials["hall/Body"] else { panic!("{expansion:?}") };
    // Half the green is left over 50 units of a centimetre.
    for (absorption, kept) in body.absorption.into_iter().zip([1.0, 0.5, 0.1_f64]) {
        assert!((absorption + 2.0 * libm::log(kept)).abs() < 1e-9, "{absorption}");
    }
    let MaterialDescription::MetallicRoughness(wall) = &expansion.materials["hall/Wall"] else {
        panic!("{expansion:?}")
    };
    assert_eq!(wall.transmission, ValueDescription::number(0.4));
}

#[test]
fn normal_maps_come_with_their_strength() {
    let assets = file(|builder| {
        builder.attribute("TEXCOORD_0", "VEC2", &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0], 4);
        let view = builder.view(&encode_png(image::RgbImage::from_pixel(1, 1, image::Rgb([229, 128, 204])).into()));
        builder.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
        builder.push("textures", json!({"source": 0}));
        builder.push("materials", json!({"normalTexture": {"index": 0, "scale": 0.5}}));
        builder.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    });
    let prepared = built(json!([import(json!({}))]), assets).unwrap();
    let scene = prepared.scene();
    let normals = scene.surface_point(0, [0.2, 0.2]).normals;
    // The square stands upright and looks along -y; u grows along x.
    let bump = |code: f64| 2.0 * code / 255.0 - 1.0;
    let expected = DVec3::new(0.5 * bump(229.0), -bump(204.0), 0.5 * bump(128.0)).normalize();
    assert!((normals.geometric + DVec3::Y).length() < 1e-6, "{normals:?}");
    assert!((normals.shading - expected).length() < 1e-5, "{normals:?}, not {expected}");
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
fn materials_of_an_obj_file_shine() {
    let text = "mtllib a.mtl\no Wall\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl lamp\nf 1/1 2/2 3/3\n";
    let asset = |bytes: &[u8]| Asset::new(bytes.to_vec());
    let picture = encode_png(image::DynamicImage::new_rgb8(2, 2));
    let of = |library: &str| {
        let assets = [("a.obj", text.as_bytes()), ("a.mtl", library.as_bytes()), ("a.png", &picture)];
        let assets = Assets::from(assets.map(|(name, bytes)| (name.to_owned(), asset(bytes))));
        expanded(json!({"source": {"obj": {"file": "a.obj", "files": ["a.mtl", "a.png"]}}}), &assets)
    };
    assert_eq!(shining(&of("newmtl lamp\nKe 3 2 1\n")).radiance, [3.0, 2.0, 1.0]);
    let expansion = of("newmtl lamp\nmap_Ke a.png\n");
    let light = shining(&expansion);
    assert_eq!((light.radiance, light.texture.as_ref().unwrap().file.as_str()), ([1.0; 3], "a.png"));
    assert!(of("newmtl lamp\nKe 0 0 0\nmap_Ke a.png\n").lights.is_empty());
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
    assert_eq!(expansion.windows[0].name, "Window");
    let mut glazed = source;
    glazed["glaze"] = json!([{"match": "glass"}]);
    let scene = built(json!([import(glazed)]), assets).unwrap();
    assert_eq!((scene.scene().meshes().len(), scene.scene().panes().len()), (1, 1));
    assert_eq!(scene.scene().bounds().unwrap()[1].z, 1.0);
}

/// The material of the square with these settings, and the notes on it.
fn described(material: Value) -> (MaterialDescription, Vec<String>) {
    let assets = file(|builder| {
        builder.push("images", json!({"uri": "leaf.png"}));
        builder.push("textures", json!({"source": 0}));
        builder.push("materials", material);
        builder.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    });
    let expansion = expanded(json!({}), &assets);
    let (_, material) = expansion.materials.into_iter().next().unwrap();
    (material, expansion.notes)
}

#[test]
fn what_a_gltf_file_masks_or_blends_has_its_opacity() {
    let material = |alpha: Value| {
        let mut material = json!({
            "name": "leaf",
            "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.8], "baseColorTexture": {"index": 0}}});
        material.as_object_mut().unwrap().extend(alpha.as_object().unwrap().clone());
        let (MaterialDescription::MetallicRoughness(material), notes) = described(material) else { panic!() };
        assert_eq!(notes, Vec::<String>::new());
        let opacity = serde_json::to_value(&material.opacity).unwrap();
        (opacity, material.opacity_threshold)
    };
    let texture = json!({"file": "a.glb", "image": 0, "factor": [0.8, 0.8, 0.8]});
    let picture = json!({"texture": texture, "channel": "alpha"});
    assert_eq!(material(json!({})), (json!(1.0), None));
    assert_eq!(material(json!({"alphaMode": "BLEND"})), (picture.clone(), None));
    assert_eq!(material(json!({"alphaMode": "MASK"})), (picture.clone(), Some(0.5)));
    assert_eq!(material(json!({"alphaMode": "MASK", "alphaCutoff": 0.25})), (picture, Some(0.25)));
    assert_eq!(material(json!({"alphaMode": "MASK", "alphaCutoff": 1.5})), (json!(0.0), None));
}

#[test]
fn what_blends_and_is_smooth_or_called_glass_is_window_glass() {
    let is_glass = |name: &str, roughness: f64, alpha: f64| {
        let (material, notes) = described(json!({
            "name": name, "alphaMode": "BLEND",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 1, 1, alpha], "metallicFactor": 0, "roughnessFactor": roughness}}));
        let MaterialDescription::ThinWall(wall) = material else { return false };
        assert!(notes.len() == 1 && notes[0].contains("window glass"), "{notes:?}");
        // The file lets white light through where nothing is, and red light by half where there is something.
        assert_eq!(wall.tint, ColourDescription::Colour([1.0 - 0.5 * alpha, 1.0, 1.0]));
        true
    };
    assert!(is_glass("Window 1", 1.0, 0.25) && is_glass("anything", 0.1, 0.25));
    assert!(!is_glass("curtain", 1.0, 0.25) && !is_glass("Window 1", 0.1, 0.95));
}

#[test]
fn a_picture_of_opacity_cuts_leaves_out_of_an_obj_file() {
    let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl leaf\nf 1/1 2/1 3/1\n";
    let picture = |pixel: image::DynamicImage| Asset::new(encode_png(pixel));
    let grey = picture(image::ImageBuffer::from_pixel(1, 1, image::Luma([9_u8])).into());
    let with_alpha = picture(image::ImageBuffer::from_pixel(1, 1, image::LumaA([9_u8, 9])).into());
    for (asset, channel) in [(grey, Channel::Red), (with_alpha, Channel::Alpha)] {
        let library = Asset::new(b"newmtl leaf\nKd 0.1 0.4 0.1\nd 0.5\nmap_d leaf.png\n".to_vec());
        let assets = Assets::from([
            ("a.obj".to_owned(), Asset::new(text.as_bytes().to_vec())),
            ("a.mtl".to_owned(), library),
            ("leaf.png".to_owned(), asset),
        ]);
        let source = json!({"source": {"obj": {"file": "a.obj", "files": ["a.mtl", "leaf.png"]}}});
        let expansion = expanded(source, &assets);
        let MaterialDescription::MetallicRoughness(leaf) = &expansion.materials["hall/leaf"] else { panic!() };
        let ValueDescription::Texture(opacity) = &leaf.opacity else { panic!("{leaf:?}") };
        assert_eq!((opacity.channel, opacity.texture.factor), (channel, [0.5; 3]));
        assert_eq!((&leaf.metallic, &leaf.specular), (&ValueDescription::number(0.0), &ValueDescription::number(0.0)));
    }
}
