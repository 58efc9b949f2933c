//! What authors of scenes get wrong, and what they are told.

use serde_json::{Value, json};

use super::SceneDescription;

/// A small valid scene with one of everything.
pub(crate) fn valid_scene() -> Value {
    json!({
        "version": 1,
        "name": "test",
        "film": {"width": 32, "height": 24},
        "camera": {"perspective": {
            "position": [0, 0, -2], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 40
        }},
        "integrator": {"fnee": {}},
        "materials": {"stone": {"diffuse": {"reflectance": {"colour": [0.6, 0.5, 0.4]}}}},
        "meshes": [
            {"name": "floor", "material": "stone", "source": {"inline": {
                "positions": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]],
                "triangles": [[0, 1, 2], [0, 2, 3]]
            }}}
        ],
        "panes": [
            {
                "name": "left", "centre": [0, 0, 1], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
                "width": 0.3, "height": 0.4, "thickness": 0.002,
                "front": {"crown": {"centre": [0.2, 0.3], "wavelength": 0.02, "amplitude": 2e-5}},
                "back": {"bump": {"centre": [0, 0], "radius": [0.05, 0.04], "amplitude": 1e-4}}
            },
            {
                "name": "right", "centre": [0.5, 0, 1], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0],
                "width": 0.3, "height": 0.4, "thickness": 0.002,
                "front": {"hammered": {"wavelength": 0.02, "amplitude": 2e-5}},
                "back": {"cylinder": {"axis": 80, "wavelength": 0.04, "amplitude": 2e-5}}
            }
        ],
        "lights": [
            {"point": {"name": "lamp", "position": [0, 0, 5], "intensity": [1, 1, 1]}},
            {"sphere": {"name": "globe", "centre": [0, 0, 5], "radius": 0.1, "radiance": [1, 1, 1]}},
            {"rectangle": {
                "name": "panel", "centre": [0, 0, 5], "edge_u": [1, 0, 0], "edge_v": [0, 1, 0], "radiance": [1, 1, 1]
            }},
            {"sun": {"name": "sun", "direction": [0, 0.6, 0.8], "angular_radius": 0.27, "radiance": [1, 1, 1]}},
            {"disk": {
                "name": "aperture", "centre": [0, 0, 5], "normal": [0, 0, -1], "radius": 0.1, "radiance": [1, 1, 1]
            }}
        ]
    })
}

/// The valid scene with the value at a JSON pointer replaced, or with a member added there.
pub(super) fn with(pointer: &str, value: Value) -> String {
    let mut scene = valid_scene();
    let (parent, name) = pointer.rsplit_once('/').unwrap();
    match scene.pointer_mut(parent).unwrap() {
        Value::Object(members) => drop(members.insert(name.to_owned(), value)),
        Value::Array(elements) => elements[name.parse::<usize>().unwrap()] = value,
        other => panic!("{other} has no members"),
    }
    scene.to_string()
}

/// The valid scene without the member at a JSON pointer.
fn without(pointer: &str) -> String {
    let mut scene = valid_scene();
    let (parent, name) = pointer.rsplit_once('/').unwrap();
    scene.pointer_mut(parent).unwrap().as_object_mut().unwrap().remove(name).unwrap();
    scene.to_string()
}

/// The valid scene with `text`, which stands there once, replaced by `other`.
fn replaced(text: &str, other: &str) -> String {
    let scene = valid_scene().to_string();
    assert_eq!(scene.matches(text).count(), 1, "{text}");
    scene.replace(text, other)
}

#[track_caller]
fn check(json: &str, path: &str, fragments: &[&str]) {
    let error = SceneDescription::parse(json.as_bytes()).expect_err("this scene is malformed");
    let message = error.to_string();
    assert_eq!(error.path(), path, "{message}");
    assert!(message.starts_with(path), "{message}");
    for fragment in fragments {
        assert!(message.contains(fragment), "no {fragment:?} in: {message}");
    }
}

#[test]
fn the_scene_that_the_others_are_made_of_is_valid() {
    let parsed = SceneDescription::parse(valid_scene().to_string().as_bytes()).unwrap();
    assert_eq!(parsed.panes.len(), 2);
}

#[test]
fn text_that_is_not_a_scene_is_refused() {
    check("", "$", &["not valid JSON", "an empty file", "docs/scene-format.md"]);
    check("{\"version\": 1,", "$", &["not valid JSON", "line 1 column 14"]);
    check("[1, 2]", "$", &["must be an object"]);
    check(&format!("{} x", valid_scene()), "$", &["trailing characters"]);
    check(&"[".repeat(100_000), "$", &["EOF"]);
    check(&" ".repeat((8 << 20) + 1), "$", &["8388609 bytes", "PLY"]);
}

#[test]
fn a_byte_order_mark_is_no_part_of_a_scene() {
    let scene = valid_scene().to_string();
    let marked = SceneDescription::parse(format!("\u{feff}{scene}").as_bytes()).unwrap();
    assert_eq!(marked, SceneDescription::parse(scene.as_bytes()).unwrap());
}

#[track_caller]
fn check_bytes(bytes: &[u8], fragments: &[&str]) {
    let message = SceneDescription::parse(bytes).expect_err("this is no scene").to_string();
    for fragment in ["$: not valid JSON: "].iter().chain(fragments) {
        assert!(message.contains(fragment), "no {fragment:?} in: {message}");
    }
}

#[test]
fn files_of_other_formats_are_named_with_what_to_do() {
    let scene = valid_scene().to_string();
    let utf_16 = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let json = "a scene is a JSON file, see docs/scene-format.md";
    let export = "export its meshes as OBJ or PLY and name them in a scene file";
    let cases: [(&[u8], &[&str]); 17] = [
        (b"glTF\x02\0\0\0\x10\0\0\0", &["this looks like a glTF binary (GLB)", json, export]),
        (b"{\"asset\": {\"version\": \"2.0\"}, \"scenes\": [{\"nodes\": [0]}]}", &["a glTF file", json, export]),
        (b"{\"asset\": {\"version\": \"2.0\"}, \"scenes\": [", &["a glTF file"]),
        (b"# Blender\nmtllib a.mtl\nv 0 0 0\n", &["an OBJ mesh", "as the source of a mesh"]),
        (b"ply\nformat ascii 1.0\n", &["a PLY mesh", "as the source of a mesh"]),
        (b"solid ball\n", &["an STL mesh", "convert it to OBJ or PLY"]),
        (b"v/1\x01", &["an OpenEXR picture", "names pictures as textures and height maps"]),
        (b"\x89PNG\r\n\x1a\n", &["a PNG picture"]),
        (b"\xff\xd8\xff\xe0", &["a JPEG picture"]),
        (b"PK\x03\x04", &["a ZIP archive", "unpack it"]),
        (b"\x1f\x8b\x08", &["a gzip archive", "unpack it"]),
        (b"BLENDER-v405", &["a Blender file", export]),
        (b"%PDF-1.7", &["a PDF document", "give the scene file"]),
        (b"<scene version=\"3.0.0\">", &["a Mitsuba scene", export]),
        (b"#usda 1.0\n", &["a USD file", export]),
        (b"LookAt 0 0 0  0 0 1  0 1 0\nWorldBegin\n", &["a pbrt scene", export]),
        (&utf_16(&format!("\u{feff}{scene}")), &["UTF-16 text", "save it as UTF-8"]),
    ];
    for (bytes, fragments) in cases {
        check_bytes(bytes, fragments);
    }
    check_bytes(&utf_16(&scene), &["UTF-16 text"]);
    // A large file is named as well, not only called too large.
    check_bytes(&[b"glTF".to_vec(), vec![7; 9 << 20]].concat(), &["a glTF binary"]);
}

#[test]
fn text_in_another_encoding_is_named_with_its_place() {
    let scene =
        serde_json::to_string_pretty(&with("/name", json!("verre sal\u{e9}")).parse::<Value>().unwrap()).unwrap();
    let latin_1: Vec<u8> = scene.chars().map(|character| character as u8).collect();
    check_bytes(&latin_1, &["not UTF-8 at line", "the byte e9", "in Latin-1 \"\u{e9}\"", "save the file as UTF-8"]);
    check_bytes(b"{\n  \"name\": \"\xc3\xa9t\xe9\"}", &["line 2 column 14"]);
}

#[test]
fn what_other_dialects_allow_is_explained() {
    let cases = [
        ("{\n  // the floor\n  \"version\": 1}", "line 2 column 3", "JSON has no comments"),
        ("{\"version\": 1, /* the floor */ \"name\": 2}", "line 1 column", "JSON has no comments"),
        ("# a scene\n{\"version\": 1}", "line 1 column 1", "JSON has no comments"),
        ("{\"version\": 1 // one\n}", "line 1 column", "JSON has no comments"),
        ("{\"version\": 1,\n}", "line 2 column 1", "no comma after the last"),
        ("{\"a\": [1,2,]}", "line 1 column 12", "no comma after the last"),
        ("{'version': 1}", "line 1 column 2", "double quotes"),
        ("{version: 1}", "line 1 column 2", "double quotes"),
        ("{\"a\": 'b'}", "line 1 column", "double quotes"),
        ("{\"a\": NaN}", "line 1 column", "must be finite"),
        ("{\"a\": -Infinity}", "line 1 column", "must be finite"),
        ("{\"a\": .5}", "line 1 column", "begins with a digit"),
        ("{\"a\": +5}", "line 1 column", "begins with a digit"),
        ("{\"a\": True}", "line 1 column", "true, false and null"),
        ("{\"a\": \"b\nc\"}", "line", "on the line on which it begins"),
    ];
    for (text, place, hint) in cases {
        check_bytes(text.as_bytes(), &[place, hint]);
    }
}

#[test]
fn another_version_is_named_before_anything_else_is_judged() {
    let future = r#"{"version": 3, "galaxies": [], "name": 7}"#;
    check(future, "version", &["version 3 is not supported, this build reads 1 to 2"]);
    check(&with("/version", json!(1.5)), "version", &["version 1.5 is not supported"]);
    check(&with("/version", json!("1")), "version", &["invalid type: string \"1\", expected u32"]);
    check(&without("/version"), "$", &["missing field `version`"]);
}

#[test]
fn members_that_are_unknown_missing_or_of_the_wrong_type_are_named() {
    check(&with("/pane", json!([])), "pane", &["unknown field `pane`", "`panes`", "`lights`"]);
    check(&with("/panes/1/tilt", json!(3)), "panes[1].tilt", &["unknown field `tilt`", "`thickness`"]);
    check(
        &with("/panes/0/front/crown/colour", json!(3)),
        "panes[0].front.crown.colour",
        &["unknown field `colour`", "`wavelength`"],
    );
    check(&with("/panes/0/front", json!({"crow": {}})), "panes[0].front", &["unknown variant `crow`", "`crown`"]);
    check(&without("/panes/0/width"), "panes[0]", &["missing field `width`"]);
    check(&without("/camera/perspective/up"), "camera.perspective", &["missing field `up`"]);
    check(&with("/film/width", json!("wide")), "film.width", &["string \"wide\"", "expected u32"]);
    check(&with("/film/width", json!(-3)), "film.width", &["integer `-3`", "expected u32"]);
    check(&with("/film/width", json!(3.5)), "film.width", &["3.5", "expected u32"]);
    check(&with("/panes/0/centre", json!([0, 1])), "panes[0].centre", &["length 2", "array of length 3"]);
    check(&with("/panes/0/centre", json!([0, 1, 2, 3])), "panes[0].centre", &["too many elements"]);
    check(&with("/panes/0/centre/1", json!(null)), "panes[0].centre[1]", &["null", "expected f64"]);
    check(&with("/seed", json!(-1)), "seed", &["integer `-1`", "expected u64"]);
    check(&with("/integrator", json!({"fnee": {"solver": "best"}})), "integrator.fnee.solver", &["`published`"]);
}

#[test]
fn members_that_stand_there_twice_are_refused() {
    check(&replaced("\"name\":\"test\"", "\"name\":\"test\",\"name\":\"again\""), "$", &["duplicate field `name`"]);
    let stone = "\"stone\":{\"diffuse\":{\"reflectance\":{\"colour\":[0,0,0]}}}";
    check(
        &with("/materials", json!("here")).replace("\"here\"", &format!("{{{stone},{stone}}}")),
        "materials",
        &["duplicate material `stone`"],
    );
    check(
        &with("/integrator", json!("here")).replace("\"here\"", "{\"path\":{},\"cone\":{}}"),
        "integrator",
        &["exactly one member, named after the choice"],
    );
    check(&with("/integrator", json!(7)), "integrator", &["exactly one member, named after the choice"]);
    check(&with("/integrator", json!({})), "integrator", &["exactly one member, named after the choice"]);
}

#[test]
fn other_spellings_of_the_same_values_are_refused() {
    check(&with("/film", json!([32, 24])), "film", &["found an array, must be an object"]);
    check(&with("/panes/1/back", json!({"flat": null})), "panes[1].back", &["found an object, must be \"flat\""]);
}

#[test]
fn numbers_that_no_double_can_hold_are_refused() {
    let huge = with("/panes/1/thickness", json!("here")).replace("\"here\"", "1e999");
    check(&huge, "panes[1].thickness", &["number out of range", "must be a finite number"]);
    let not_a_number = with("/panes/1/thickness", json!("here")).replace("\"here\"", "NaN");
    check(&not_a_number, "$", &["not valid JSON"]);
}

#[test]
fn values_out_of_range_are_named_with_what_would_be_right() {
    let cases: &[(&str, Value, &str, &[&str])] = &[
        ("/name", json!(""), "name", &["\"\"", "1 to 200 bytes"]),
        ("/film/width", json!(0), "film.width", &["found 0", "1 to 16384"]),
        ("/film/height", json!(16385), "film.height", &["found 16385", "1 to 16384"]),
        ("/camera/perspective/look_at", json!([0, 0, -2]), "camera.perspective.look_at", &["another point"]),
        ("/camera/perspective/up", json!([0, 0, 3]), "camera.perspective.up", &["[0.0, 0.0, 3.0]", "not parallel"]),
        ("/camera/perspective/up", json!([0, 0, 0]), "camera.perspective.up", &["length above"]),
        (
            "/camera/perspective/vertical_field_of_view",
            json!(180),
            "camera.perspective.vertical_field_of_view",
            &["found 180.0", "more than 0 and at most 179"],
        ),
        ("/integrator", json!({"path": {"max_depth": 0}}), "integrator.path.max_depth", &["1 to 1000"]),
        ("/integrator", json!({"fnee": {"max_trials": 0}}), "integrator.fnee.max_trials", &["1 to 1000000"]),
        ("/integrator", json!({"sms": {"chains": []}}), "integrator.sms.chains", &["0 words", "1 to 16 words"]),
        ("/integrator", json!({"sms": {"chains": ["TX"]}}), "integrator.sms.chains[0]", &["\"TX\"", "letters R and T"]),
        ("/integrator", json!({"sms": {"chains": ["T", "T"]}}), "integrator.sms.chains[1]", &["\"T\"", "another"]),
        (
            "/integrator",
            json!({"conic": {"chains": ["TT"]}}),
            "integrator.conic.chains[0]",
            &["\"TT\"", "one letter of R and T"],
        ),
        (
            "/integrator",
            json!({"conic": {"casters": ["left"]}}),
            "integrator.conic.casters[0]",
            &["\"left\"", "a specular mesh"],
        ),
        ("/integrator", json!({"mnee": {"chains": ["R"]}}), "integrator.mnee.chains[0]", &["\"R\"", "letters T"]),
        ("/integrator", json!({"sms": {"casters": ["middle"]}}), "integrator.sms.casters[0]", &["(left, right)"]),
        ("/integrator", json!({"mnee": {"receivers": ["left"]}}), "integrator.mnee.receivers[0]", &["\"left\""]),
        (
            "/materials/stone",
            json!({"dielectric": {"index_of_refraction": 0.9}}),
            "materials.stone.dielectric.index_of_refraction",
            &["found 0.9", "1 to 3"],
        ),
        (
            "/materials/stone",
            json!({"mirror": {"reflectance": [0, 2, 0]}}),
            "materials.stone.mirror.reflectance[1]",
            &["found 2"],
        ),
        (
            "/materials/stone",
            json!({"conductor": {"reflectance": {"colour": [1, 1, 1]}, "roughness": 1.5}}),
            "materials.stone.conductor.roughness",
            &["found 1.5", "0 to 1"],
        ),
        (
            "/materials/stone",
            json!({"conductor": {"reflectance": {"texture": {"file": "../gold.png"}}, "roughness": 0.5}}),
            "materials.stone.conductor.reflectance.texture.file",
            &["../gold.png"],
        ),
        (
            "/materials/stone",
            json!({"rough_dielectric": {"index_of_refraction": 4, "roughness": 0.1}}),
            "materials.stone.rough_dielectric.index_of_refraction",
            &["found 4.0", "1 to 3"],
        ),
        (
            "/materials/stone",
            json!({"thin_wall": {"tint": {"colour": [1, 1, 1.1]}}}),
            "materials.stone.thin_wall.tint.colour[2]",
            &["found 1.1"],
        ),
        (
            "/materials/stone",
            json!({"thin_wall": {"opacity": 0.5, "opacity_threshold": 1.5}}),
            "materials.stone.thin_wall.opacity_threshold",
            &["found 1.5", "0 to 1"],
        ),
        (
            "/materials/stone",
            json!({"metallic_roughness": {"opacity": 2}}),
            "materials.stone.metallic_roughness.opacity",
            &["found 2.0", "0 to 1"],
        ),
        (
            "/materials/stone",
            json!({"metallic_roughness": {"metallic": -0.5}}),
            "materials.stone.metallic_roughness.metallic",
            &["found -0.5", "0 to 1"],
        ),
        (
            "/materials/stone",
            json!({"metallic_roughness": {"index_of_refraction": 0.5}}),
            "materials.stone.metallic_roughness.index_of_refraction",
            &["found 0.5", "0, or 1 and more"],
        ),
        (
            "/meshes/0/source/inline/normals",
            json!([[0, 0, 1]]),
            "meshes[0].source.inline.normals",
            &["1 normals", "one for each position"],
        ),
        (
            "/meshes/0/source",
            json!({"waves": {"size": [2, 0], "cells": [8, 8], "wavelengths": [0.3, 0.7], "height": 0.01}}),
            "meshes[0].source.waves.size[1]",
            &["found 0.0", "0.001 to 100000"],
        ),
        (
            "/meshes/0/source",
            json!({"waves": {"size": [2, 2], "cells": [8, 5000], "wavelengths": [0.3, 0.7], "height": 0.01}}),
            "meshes[0].source.waves.cells[1]",
            &["found 5000", "1 to 4096"],
        ),
        (
            "/meshes/0/source",
            json!({"waves": {"size": [2, 2], "cells": [8, 8], "wavelengths": [0.7, 0.3], "height": 0.01}}),
            "meshes[0].source.waves.wavelengths[1]",
            &["found 0.3", "0.7 to"],
        ),
        (
            "/sampling",
            json!({"samples_per_pass": 16, "samples_per_block": 48}),
            "sampling.samples_per_block",
            &["found 48", "a power of two times samples_per_pass (16)"],
        ),
        ("/path_filter", json!("D TX L"), "path_filter", &["\"D TX L\"", "'X'"]),
        ("/path_filter", json!("D (TT"), "path_filter", &["such as \"D TT L\"", "cannot be read"]),
        ("/sampling", json!({"samples_per_pass": 0}), "sampling.samples_per_pass", &["found 0"]),
        (
            "/materials/stone/diffuse/reflectance/colour/1",
            json!(1.2),
            "materials.stone.diffuse.reflectance.colour[1]",
            &["found 1.2", "0 to 1"],
        ),
        ("/meshes/0/material", json!("wood"), "meshes[0].material", &["\"wood\"", "(stone)"]),
        ("/meshes/0/scale", json!(0), "meshes[0].scale", &["found 0.0"]),
        (
            "/meshes/0/source/inline/triangles",
            json!([]),
            "meshes[0].source.inline.triangles",
            &["no triangle", "at least one"],
        ),
        (
            "/meshes/0/source/inline/triangles/1",
            json!([0, 2, 4]),
            "meshes[0].source.inline.triangles[1]",
            &["[0, 2, 4]", "below 4"],
        ),
        (
            "/meshes/0/source/inline/triangles/1",
            json!([0, 2, 2]),
            "meshes[0].source.inline.triangles[1]",
            &["not on one line"],
        ),
        (
            "/meshes/0/source/inline/positions/3/0",
            json!(1e7),
            "meshes[0].source.inline.positions[3][0]",
            &["found 10000000.0", "-1000000 to 1000000"],
        ),
        (
            "/meshes/0/source/inline/texture_coordinates",
            json!([[0, 0]]),
            "meshes[0].source.inline.texture_coordinates",
            &["1 pairs", "4 pairs"],
        ),
        ("/panes/1/name", json!("left"), "panes[1].name", &["\"left\"", "no earlier one"]),
        ("/panes/0/width", json!(0), "panes[0].width", &["found 0.0", "0.001 to 100"]),
        ("/panes/0/height", json!(-1), "panes[0].height", &["found -1.0"]),
        ("/panes/0/thickness", json!(0), "panes[0].thickness", &["found 0.0", "more than 0"]),
        ("/panes/0/index_of_refraction", json!(0.9), "panes[0].index_of_refraction", &["found 0.9", "1 to 3"]),
        ("/panes/0/absorption", json!([0, -1, 0]), "panes[0].absorption[1]", &["found -1.0"]),
        ("/panes/0/x_axis", json!([0, 0, 0]), "panes[0].x_axis", &["length above"]),
        ("/panes/0/y_axis", json!([2, 0, 0]), "panes[0].y_axis", &["not parallel to x_axis"]),
        ("/panes/0/front/crown/wavelength", json!(1e-4), "panes[0].front.crown.wavelength", &["found 0.0001", "1024"]),
        ("/panes/0/front/crown/amplitude", json!(1), "panes[0].front.crown.amplitude", &["-0.002 to 0.002"]),
        ("/panes/0/back/bump/radius/0", json!(0), "panes[0].back.bump.radius[0]", &["found 0.0"]),
        ("/lights/1/sphere/name", json!("lamp"), "lights[1].sphere.name", &["no earlier one"]),
        ("/lights/0/point/name", json!(""), "lights[0].point.name", &["1 to 200 bytes"]),
        ("/lights/2/rectangle/name", json!("a".repeat(201)), "lights[2].rectangle.name", &["1 to 200 bytes"]),
        ("/lights/3/sun/name", json!("a\u{1b}[2J"), "lights[3].sun.name", &["control characters"]),
        ("/lights/4/disk/name", json!(""), "lights[4].disk.name", &["1 to 200 bytes"]),
        ("/lights/0/point/intensity/2", json!(-1), "lights[0].point.intensity[2]", &["found -1.0"]),
        ("/lights/1/sphere/radius", json!(0), "lights[1].sphere.radius", &["more than 0"]),
        ("/lights/1/sphere/radiance/0", json!(-0.5), "lights[1].sphere.radiance[0]", &["found -0.5"]),
        ("/lights/2/rectangle/edge_v", json!([1, 1, 0]), "lights[2].rectangle.edge_v", &["perpendicular to edge_u"]),
        ("/lights/3/sun/direction", json!([0, 0, 0]), "lights[3].sun.direction", &["length above"]),
        ("/lights/3/sun/angular_radius", json!(0), "lights[3].sun.angular_radius", &["0.001 to 90"]),
        ("/lights/4/disk/name", json!("sun"), "lights[4].disk.name", &["no earlier one"]),
        ("/lights/4/disk/centre/1", json!(1e13), "lights[4].disk.centre[1]", &["found 10000000000000.0"]),
        ("/lights/4/disk/normal", json!([0, 0, 0]), "lights[4].disk.normal", &["length above"]),
        ("/lights/4/disk/radius", json!(-0.1), "lights[4].disk.radius", &["found -0.1", "more than 0"]),
        ("/lights/4/disk/radiance/2", json!(-1), "lights[4].disk.radiance[2]", &["found -1.0"]),
    ];
    for (pointer, value, path, fragments) in cases {
        check(&with(pointer, value.clone()), path, fragments);
    }
}

#[test]
fn spots_and_environments_are_checked() {
    let spot = |name: &str, value: Value| {
        let mut spot = json!({
            "name": "spot", "position": [0, 0, 3], "direction": [0, 0, -1], "intensity": [1, 1, 1], "inner_angle": 10,
            "outer_angle": 40});
        spot[name] = value;
        with("/lights/4", json!({"spot": spot}))
    };
    assert!(SceneDescription::parse(spot("inner_angle", json!(40)).as_bytes()).is_ok());
    let angle = "lights[4].spot.outer_angle";
    check(&spot("outer_angle", json!(0)), angle, &["found 0.0", "more than 0 and at most 90"]);
    check(&spot("outer_angle", json!(91)), angle, &["found 91.0"]);
    check(&spot("inner_angle", json!(41)), "lights[4].spot.inner_angle", &["found 41.0", "0 to 40"]);
    check(&spot("direction", json!([0, 0, 0])), "lights[4].spot.direction", &["length above"]);
    check(&spot("intensity", json!([1, 1, -1])), "lights[4].spot.intensity[2]", &["found -1.0"]);
    check(&spot("position", json!([0, 0, 1e13])), "lights[4].spot.position[2]", &["found 10000000000000.0"]);

    let sky = |name: &str, value: Value| {
        let mut sky = json!({"name": "sky", "radiance": {"colour": [1, 1, 1]}});
        sky[name] = value;
        json!({"environment": sky})
    };
    let with_sky = |name: &str, value: Value| with("/lights/4", sky(name, value));
    assert!(SceneDescription::parse(with_sky("rotate", json!([0, 0, 90])).as_bytes()).is_ok());
    let radiance = "lights[4].environment.radiance";
    let negative = with_sky("radiance", json!({"colour": [0, -1, 0]}));
    check(&negative, &format!("{radiance}.colour[1]"), &["found -1.0"]);
    let above = with_sky("radiance", json!({"picture": {"file": "../sky.exr"}}));
    check(&above, &format!("{radiance}.picture.file"), &["a path relative to the scene file"]);
    check(&with_sky("scale", json!(-1)), "lights[4].environment.scale", &["found -1.0", "0 to 1000000"]);
    check(&with_sky("rotate", json!([1e9, 0, 0])), "lights[4].environment.rotate[0]", &["found 1000000000.0"]);
    let mut two = valid_scene();
    two["lights"][1] = sky("name", json!("a"));
    two["lights"][3] = sky("name", json!("b"));
    check(&two.to_string(), "lights[3].environment", &["a second environment", "lights[1] is one"]);
}

#[test]
fn meshes_that_shine_are_checked() {
    let shining = |name: &str, value: Value| {
        let mut light = json!({"name": "glow", "mesh": "floor", "radiance": [1, 1, 1]});
        light[name] = value;
        json!({"mesh": light})
    };
    let with_light = |name: &str, value: Value| with("/lights/4", shining(name, value));
    assert!(SceneDescription::parse(with_light("mesh", json!("floor")).as_bytes()).is_ok());
    check(&with_light("mesh", json!("flor")), "lights[4].mesh.mesh", &["\"flor\"", "the name of a mesh of the scene"]);
    check(&with_light("radiance", json!([1, -1, 1])), "lights[4].mesh.radiance[1]", &["found -1.0"]);
    let above = with_light("texture", json!({"file": "../glow.png"}));
    check(&above, "lights[4].mesh.texture.file", &["a path relative to the scene file"]);
    let mut two = valid_scene();
    two["lights"][1] = shining("name", json!("a"));
    two["lights"][3] = shining("name", json!("b"));
    check(&two.to_string(), "lights[3].mesh.mesh", &["\"floor\"", "a mesh that no other light is"]);
}

#[test]
fn names_of_files_stay_below_the_scene_file() {
    let path = "meshes[0].source.ply.file";
    for name in ["", "/etc/passwd", "../up.ply", "a/../../b.ply", "a//b.ply", "./a.ply", "c:\\a.ply", "a\nb.ply"] {
        let mesh = json!({"ply": {"file": name}});
        check(&with("/meshes/0/source", mesh), path, &["a path relative to the scene file"]);
    }
    let mesh = json!({"ply": {"file": "meshes/floor.v2.ply"}});
    assert!(SceneDescription::parse(with("/meshes/0/source", mesh).as_bytes()).is_ok());
}
