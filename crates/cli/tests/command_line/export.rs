//! Scenes as folders of files for other programs.

use std::fs;

use serde_json::{Value, json};

use crate::support::Folder;

/// A folder with a scene of all kinds of things, far from the origin.
fn folder() -> Folder {
    let folder = Folder::new();
    let mut scene: Value = serde_json::from_slice(&fs::read(folder.path("scene.json")).unwrap()).unwrap();
    scene["camera"] = json!({"orthographic":
        {"position": [1000, 0, 3], "look_at": [1000, 0, 0], "up": [0, 1, 0], "height": 2}});
    scene["materials"]["glass"] = json!({"dielectric": {"index_of_refraction": 1.5}});
    scene["materials"]["silver"] = json!({"mirror": {"reflectance": [0.9, 0.8, 0.7]}});
    scene["meshes"][0]["translate"] = json!([1000, 0, 0]);
    for (name, material, height) in [("drop", "glass", 0.5), ("plate \"A\"", "silver", 0.25)] {
        let mut mesh = scene["meshes"][0].clone();
        mesh["name"] = json!(name);
        mesh["material"] = json!(material);
        mesh["translate"][2] = json!(height);
        scene["meshes"].as_array_mut().unwrap().push(mesh);
    }
    scene["panes"] = json!([{
        "name": "quarry", "centre": [1000, 0, 1], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 0.3, "height": 0.2,
        "thickness": 0.004, "absorption": [10, 20, 40],
        "front": {"crown": {"centre": [0.1, 0], "wavelength": 0.03, "amplitude": 2e-5}}
    }]);
    scene["lights"] = json!([
        {"point": {"name": "lamp", "position": [1000, 1, 2], "intensity": [5, 5, 5]}},
        {"sphere": {"name": "globe", "centre": [1001, 1, 2], "radius": 0.1, "radiance": [1, 2, 3]}},
        {"rectangle": {"name": "panel", "centre": [1000, 0, 4], "edge_u": [0, 1, 0], "edge_v": [2, 0, 0],
            "radiance": [4, 4, 4]}},
        {"disk": {"name": "spot", "centre": [999, 0, 4], "normal": [0, 0, -2], "radius": 0.5, "radiance": [4, 4, 4]}},
        {"sun": {"name": "sun", "direction": [0, 3, 4], "angular_radius": 0.267, "radiance": [9, 9, 9]}}
    ]);
    fs::write(folder.path("all.json"), scene.to_string()).unwrap();
    folder
}

#[test]
fn a_folder_has_what_the_scene_has_in_plain_members() {
    let folder = folder();
    let output = folder.run(&["export", "--to", "mitsuba", "all.json", "out"]);
    let messages = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{messages}");
    assert!(messages.contains("of the scene is the origin of the exported one"), "{messages}");
    assert!(messages.contains("light through glass by chance"), "{messages}");
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.starts_with("Wrote out: 7 files, "), "{text}");

    let scene: Value = serde_json::from_slice(&fs::read(folder.path("out/scene.json")).unwrap()).unwrap();
    let origin = scene["origin"].as_array().unwrap();
    assert!((origin[0].as_f64().unwrap() - 1000.0).abs() < 2.0, "{origin:?}");
    assert_eq!(scene["units"]["radiance"], "W/(m2 sr)");
    assert_eq!((&scene["film"]["width"], &scene["max_depth"]), (&json!(24), &json!(4)));
    assert_eq!(scene["camera"]["orthographic"]["height"], json!(2.0));
    let materials: Vec<&Value> = scene["materials"].as_array().unwrap().iter().collect();
    assert_eq!(materials[0], &json!({"name": "glass", "dielectric": {"index_of_refraction": 1.5}}));
    assert_eq!(scene["lights"].as_array().unwrap().len(), 5);
    assert_eq!(scene["lights"][1]["sphere"]["radiance"], json!([1.0, 2.0, 3.0]));
    assert_eq!(scene["meshes"][2]["name"], "plate \"A\"");
    assert!(scene["panes"][0]["error"].as_f64().unwrap() <= 1e-6);
    let files = ["/meshes/0/file", "/meshes/1/file", "/meshes/2/file", "/panes/0/faces", "/panes/0/edge"];
    for file in files {
        let name = scene.pointer(file).and_then(Value::as_str).unwrap();
        let ply = fs::read(folder.path(&format!("out/{name}"))).unwrap();
        assert!(ply.starts_with(b"ply\nformat binary_little_endian 1.0\n"), "{name}");
    }
}

#[test]
fn what_mitsuba_does_in_another_way_by_itself_is_written_out() {
    let folder = folder();
    folder.succeeds(&["export", "--to", "mitsuba", "all.json", "out"]);
    let xml = fs::read_to_string(folder.path("out/scene.xml")).unwrap();
    for part in [
        "<scene version=\"3.0.0\">",
        // Glass that absorbs takes an integrator that knows media.
        "<integrator type=\"volpath\">",
        // Four vertices are five segments.
        "<integer name=\"max_depth\" value=\"5\"/>",
        "<string name=\"component_format\" value=\"float32\"/>",
        "<rfilter type=\"box\"/>",
        // Half the width: 2 m times 24/16, halved.
        "<scale x=\"1.5\" y=\"1.5\"/>",
        "<bsdf type=\"twosided\"",
        "<float name=\"ext_ior\" value=\"1\"/>",
        "<string name=\"material\" value=\"none\"/>",
        "<rgb name=\"sigma_t\" value=\"0.25, 0.5, 1\"/>",
        "<float name=\"scale\" value=\"40\"/>",
        "<emitter type=\"point\" id=\"light-0000-lamp\">",
    ] {
        assert!(xml.contains(part), "no {part} in {xml}");
    }
    // Shapes of lights have no material.
    for light in xml.split("<shape ").filter(|shape| shape.contains("type=\"area\"")) {
        assert!(!light.split("</shape>").next().unwrap().contains("bsdf"), "{light}");
    }
    folder.succeeds(&["export", "--to", "mitsuba", "scene.json", "perspective"]);
    let xml = fs::read_to_string(folder.path("perspective/scene.xml")).unwrap();
    assert!(xml.contains("name=\"fov_axis\" value=\"y\"") && xml.contains("name=\"fov\" value=\"60\""), "{xml}");
    assert!(xml.contains("<integrator type=\"path\">"), "{xml}");
}

#[test]
fn a_texture_is_written_once_and_its_v_is_counted_from_the_top() {
    let folder = Folder::new();
    let mut scene: Value = serde_json::from_slice(&fs::read(folder.path("scene.json")).unwrap()).unwrap();
    // The picture that render writes is any PNG.
    folder.succeeds(&["render", "scene.json", "--spp", "4", "--png", "-o", "paint.exr"]);
    for name in ["white", "black"] {
        scene["materials"][name] = json!({"diffuse": {"reflectance": {"texture": {"file": "paint.png"}}}});
    }
    scene["meshes"][0]["source"]["inline"]["texture_coordinates"] = json!([[0, 0], [1, 0], [1, 0.75], [0, 0.75]]);
    let mut second = scene["meshes"][0].clone();
    second["name"] = json!("second");
    second["material"] = json!("black");
    second["translate"] = json!([0, 0, -1]);
    scene["meshes"].as_array_mut().unwrap().push(second);
    fs::write(folder.path("painted.json"), scene.to_string()).unwrap();
    folder.succeeds(&["export", "--to", "mitsuba", "painted.json", "out"]);
    let exported: Value = serde_json::from_slice(&fs::read(folder.path("out/scene.json")).unwrap()).unwrap();
    for material in exported["materials"].as_array().unwrap() {
        assert_eq!(material["diffuse"]["reflectance"]["texture"]["file"], "textures/0000.png");
    }
    assert_eq!(fs::read_dir(folder.path("out/textures")).unwrap().count(), 1);
    let mesh = exported["meshes"][0]["file"].as_str().unwrap();
    let ply = fs::read(folder.path(&format!("out/{mesh}"))).unwrap();
    let body = ply.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let values: Vec<f32> =
        ply[body..body + 60].chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
    assert_eq!(values[..5], [-1.0, -1.0, 0.0, 0.0, 1.0]);
    assert_eq!(values[10..], [1.0, 1.0, 0.0, 1.0, 0.25]);
}

#[test]
fn what_mitsuba_has_no_twin_for_is_approximated_and_named() {
    let folder = Folder::new();
    let mut scene: Value = serde_json::from_slice(&fs::read(folder.path("scene.json")).unwrap()).unwrap();
    folder.succeeds(&["render", "scene.json", "--spp", "4", "--png", "-o", "paint.exr"]);
    let picture = |settings: Value| {
        let mut picture = json!({"file": "paint.png"});
        picture.as_object_mut().unwrap().extend(settings.as_object().unwrap().clone());
        picture
    };
    let materials = [
        (
            "matt",
            json!({"metallic_roughness": {"metallic": 0, "specular": 0, "base_colour": {"colour": [0.5, 0.4, 0.3]}}}),
        ),
        ("brass", json!({"conductor": {"reflectance": {"colour": [0.9, 0.7, 0.4]}, "roughness": 0.3}})),
        ("steel", json!({"conductor": {"reflectance": {"colour": [0.6, 0.6, 0.6]}, "roughness": 0.3}})),
        ("frosted", json!({"rough_dielectric": {"roughness": 0.4}})),
        ("window", json!({"thin_wall": {"tint": {"colour": [0.9, 0.8, 0.5]}}})),
        (
            "varnish",
            json!({"metallic_roughness": {"metallic": {"texture": picture(json!({})), "channel": "green"},
            "roughness": 0.4, "base_colour": {"texture": picture(json!({"factor": [1, 0.5, 0.5]}))}}}),
        ),
        (
            "worn",
            json!({"metallic_roughness": {"metallic": 0,
            "roughness": {"texture": picture(json!({"wrap": ["clamp", "repeat"],
                "transform": [[2, 0, 0], [0, 4, 0.5]]}))}}}),
        ),
    ];
    let mesh = scene["meshes"][0].clone();
    scene["meshes"] = json!([]);
    for (name, material) in materials {
        scene["materials"][name] = material;
        let mut mesh = mesh.clone();
        mesh["name"] = json!(name);
        mesh["material"] = json!(name);
        mesh["translate"] = json!([0, 0, -0.1 * scene["meshes"].as_array().unwrap().len() as f64]);
        mesh["source"]["inline"]["texture_coordinates"] = json!([[0, 0], [1, 0], [1, 0.75], [0, 0.75]]);
        scene["meshes"].as_array_mut().unwrap().push(mesh);
    }
    let spot = |name: &str, inner: f64| {
        json!({"spot": {"name": name, "position": [0, 0, 2], "direction": [0, 0, -1], "intensity": [1, 1, 1],
            "inner_angle": inner, "outer_angle": 30}})
    };
    scene["lights"] = json!([spot("sharp", 30.0), spot("soft", 10.0),
        {"environment": {"name": "sky", "radiance": {"picture": {"file": "paint.exr"}}, "rotate": [0, 0, 90]}}]);
    scene["panes"] = json!([{"name": "ruby", "centre": [0, 0, 5], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 1,
        "height": 1, "thickness": 0.002, "layers": {"front": [0, 1, 2], "back": [0, 0, 0]}}]);
    fs::write(folder.path("all.json"), scene.to_string()).unwrap();
    let output = folder.run(&["export", "--to", "mitsuba", "all.json", "out"]);
    let messages = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{messages}");
    for said in [
        "materials.brass, materials.steel, materials.varnish are approximated by `principled`: its facets",
        "materials.frosted is approximated by `roughdielectric`",
        "materials.varnish, materials.worn are approximated by `principled`: its base",
        "materials.worn is approximated by one wrap mode",
        "lights[soft] is approximated by `spot`",
        "panes[ruby] is approximated by glass of one colour",
    ] {
        assert!(messages.contains(said), "no {said} in {messages}");
    }
    assert!(!messages.contains("materials.matt") && !messages.contains("materials.window"), "{messages}");
    let exported: Value = serde_json::from_slice(&fs::read(folder.path("out/scene.json")).unwrap()).unwrap();
    let approximations = exported["mitsuba_approximations"].as_array().unwrap();
    assert!(approximations.iter().any(|one| one["place"] == "lights[soft]" && one["by"] == "`spot`"));
    let absorption = |channel: usize| exported["panes"][0]["absorption"][channel].as_f64().unwrap();
    assert!(absorption(0) == 0.0 && (absorption(1) - 500.0).abs() < 1e-6 && (absorption(2) - 1000.0).abs() < 1e-6);
    assert_eq!(exported["materials"][2]["diffuse"]["reflectance"]["colour"], json!([0.5, 0.4, 0.3]));
    let xml = fs::read_to_string(folder.path("out/scene.xml")).unwrap();
    for part in [
        "<bsdf type=\"thindielectric\"",
        "<rgb name=\"specular_transmittance\" value=\"0.9, 0.8, 0.5\"/>",
        "<boolean name=\"raw\" value=\"true\"/>",
        "<string name=\"wrap_mode\" value=\"clamp\"/>",
        // 4 v + 0.5 with v from the top.
        "<matrix value=\"2 0 0 0 0 4 0 -3.5 0 0 1 0 0 0 0 1\"/>",
        "<emitter type=\"envmap\"",
        "<float name=\"beam_width\" value=\"30\"/>",
    ] {
        assert!(xml.contains(part), "no {part} in {xml}");
    }
}

#[test]
fn what_cannot_be_exported_is_named_with_what_would_be_right() {
    let folder = folder();
    let export = ["export", "--to", "mitsuba", "all.json", "out"];
    let with = |options: &[&'static str]| [&export[..], options].concat();
    folder.fails(&with(&["--tolerance", "0.1"]), 1, &["all.json", "--tolerance: found 0.1", "0.0002 m", "\"quarry\""]);
    folder.fails(&with(&["--tolerance", "0"]), 1, &["--tolerance: found 0", "more than 0"]);
    folder.fails(
        &with(&["--set", "lights[sun].angular_radius=85"]),
        1,
        &["lights[sun].angular_radius: found 85", "at most 80"],
    );
    folder.fails(&["export", "--to", "blender", "all.json", "out"], 2, &["--to", "blender", "mitsuba"]);
    assert!(!folder.path("out").exists());
    folder.fails(&["export", "--to", "mitsuba", "all.json", "all.json"], 1, &["all.json", "is a file", "a folder"]);
    folder.succeeds(&export);
    folder.fails(&export, 1, &["out", "there are files in it", "a new or an empty folder"]);
}
