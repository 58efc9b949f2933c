//! Files that other readers accept, although they then fail, hang or show something else.

use serde_json::{Value, json};

use super::builder::{F32, U8, U16, container, floats, shorts};
use super::*;

/// Checks that a file is refused, and what is said about it.
#[track_caller]
fn refused(builder: &Builder, expected: &str) {
    let error = open(&builder.glb()).err().expect("it should be refused").to_string();
    assert!(error.contains(expected), "no {expected:?} in: {error}");
    assert!(error.len() < 600, "{error}");
}

/// Checks files that differ from a square in one member.
#[track_caller]
fn refused_each(cases: &[(&str, Value, &str)]) {
    for (pointer, value, expected) in cases {
        let mut builder = Builder::square();
        builder.set(pointer, value.clone());
        refused(&builder, expected);
    }
}

#[test]
fn references_that_lead_nowhere() {
    refused_each(&[
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            json!(7),
            "meshes[0].primitives[0].attributes.POSITION: names accessors[7], must be below 2, the number of accessors",
        ),
        ("/meshes/0/primitives/0/indices", json!(2), "meshes[0].primitives[0].indices: names accessors[2]"),
        (
            "/meshes/0/primitives/0/material",
            json!(0),
            "meshes[0].primitives[0].material: names materials[0], but the file has no materials",
        ),
        ("/accessors/0/bufferView", json!(9), "accessors[0].bufferView: names bufferViews[9]"),
        ("/bufferViews/0/buffer", json!(1), "bufferViews[0].buffer: names buffers[1]"),
        ("/nodes/0/mesh", json!(3), "nodes[0].mesh: names meshes[3]"),
        ("/nodes/0/camera", json!(0), "nodes[0].camera: names cameras[0], but the file has no cameras"),
        ("/nodes/0/children", json!([1]), "nodes[0].children[0]: names nodes[1]"),
        ("/nodes/0/extensions", json!({"KHR_lights_punctual": {"light": 0}}), "light: names lights[0]"),
        ("/scenes/0/nodes", json!([0, 5]), "scenes[0].nodes[1]: names nodes[5]"),
        ("/scene", json!(1), "scene: names scenes[1]"),
    ]);
}

#[test]
fn accessors_that_leave_their_buffers() {
    let huge = json!(1_u64 << 62);
    refused_each(&[
        ("/accessors/0/count", json!(5), "accessors[0]: 5 elements of 12 bytes, 12 bytes apart from byte 0 on, do not"),
        ("/accessors/0/count", huge.clone(), "accessors[0].count: found 4611686018427387904"),
        ("/accessors/0/byteOffset", json!(4), "accessors[0]: 4 elements"),
        ("/accessors/0/byteOffset", json!(u64::MAX - 3), "accessors[0]:"),
        ("/accessors/0/byteOffset", json!(-4), "accessors[0].byteOffset: invalid value: integer `-4`"),
        ("/bufferViews/0/byteLength", json!(61), "bufferViews[0]: has 61 bytes from byte 0 on, its buffer has 60"),
        ("/bufferViews/1/byteOffset", huge.clone(), "bufferViews[1]: has 12 bytes from byte 4611686018427387904"),
        ("/bufferViews/1/byteOffset", json!(u64::MAX), "bufferViews[1]: has 12 bytes"),
        ("/buffers/0/byteLength", json!(1000), "buffers[0].byteLength: says 1000 bytes, but there are 60"),
        ("/buffers/0/byteLength", huge, "buffers[0].byteLength: says 4611686018427387904 bytes"),
        ("/bufferViews/0/byteStride", json!(0), "accessors[0]: its elements of 12 bytes lie 0 bytes apart"),
        ("/bufferViews/0/byteStride", json!(8), "lie 8 bytes apart (byteStride), must be 12, or a multiple of 4"),
        ("/bufferViews/0/byteStride", json!(13), "lie 13 bytes apart"),
        ("/bufferViews/0/byteStride", json!(256), "lie 256 bytes apart"),
        ("/bufferViews/0/byteStride", json!(u64::MAX), "bytes apart"),
        ("/bufferViews/0/byteOffset", json!(2), "byteOffset 0 in a view at byte 2, must be together a multiple of"),
    ]);
    let mut builder = Builder::square();
    builder.push("buffers", json!({"byteLength": 48}));
    builder.set("/bufferViews/0/buffer", json!(1));
    refused(&builder, "bufferViews[0]: buffers[1] has no bytes");
}

#[test]
fn accessors_of_other_types() {
    let position = "meshes[0].primitives[0].attributes.POSITION: accessors[0] is ";
    refused_each(&[
        ("/accessors/0/type", json!("VEC2"), &format!("{position}VEC2 of f32, must be VEC3 of f32")),
        ("/accessors/0/type", json!("MAT3"), "accessors[0].type: found \"MAT3\", must be SCALAR, VEC2, VEC3 or VEC4"),
        ("/accessors/0/componentType", json!(U16), &format!("{position}VEC3 of u16, must be VEC3 of f32")),
        ("/accessors/0/componentType", json!(5124), "accessors[0].componentType: found 5124, must be 5120"),
        ("/accessors/0/componentType", json!("f32"), "accessors[0].componentType: invalid type: string \"f32\""),
        ("/accessors/1/componentType", json!(5122), "indices: accessors[1] is SCALAR of i16, must be SCALAR of u8"),
        ("/meshes/0/primitives/0/indices", json!(0), "indices: accessors[0] is VEC3 of f32, must be SCALAR of u8"),
        ("/meshes/0/primitives/0/mode", json!(7), "meshes[0].primitives[0].mode: found 7, must be 0 to 6"),
        ("/meshes/0/primitives", json!({}), "meshes[0].primitives: invalid type: map, expected an array"),
    ]);
    let mut builder = Builder::square();
    builder.attribute("NORMAL", "VEC3", &[0.0, 0.0, 1.0].repeat(3), 3);
    refused(&builder, "attributes.NORMAL: accessors[2] has 3 elements, must have 4 as POSITION has");
    let mut builder = Builder::square();
    builder.attribute("TEXCOORD_0", "VEC3", &[0.0; 12], 4);
    refused(&builder, "accessors[2] is VEC3 of f32, must be VEC2 of f32, normalized u8 or normalized u16");
    let mut builder = Builder::square();
    let colours = json!({"componentType": U8, "type": "VEC4", "count": 4});
    let colours = builder.accessor(&[0; 16], colours);
    builder.set("/meshes/0/primitives/0/attributes/COLOR_0", json!(colours));
    refused(&builder, "is VEC4 of u8, must be VEC3 or VEC4 of f32, normalized u8 or normalized u16");
}

#[test]
fn indices_that_name_no_vertex() {
    for (component, bytes, expected) in [
        (U16, shorts(&[0, 1, 4]), "indices: index 2 is 4, must be below 4, the number of vertices"),
        (
            U16,
            shorts(&[0, 65_535, 1]),
            "index 1 is 65535, must be below 4, the number of vertices: values that restart",
        ),
        (U8, vec![0, 1, 255], "index 2 is 255, must be below 4, the number of vertices: values that restart a strip"),
        (5125, vec![0xff; 12], "index 0 is 4294967295"),
    ] {
        let mut builder = Builder::square();
        let accessor = json!({"componentType": component, "type": "SCALAR", "count": 3});
        let accessor = builder.accessor(&bytes, accessor);
        builder.set("/meshes/0/primitives/0/indices", json!(accessor));
        refused(&builder, expected);
    }
}

#[test]
fn numbers_that_are_not_finite() {
    for (number, shown) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (f32::NEG_INFINITY, "-inf")] {
        let mut builder = Builder::square();
        builder.binary[16..20].copy_from_slice(&number.to_le_bytes());
        let expected = format!("attributes.POSITION: element 1 is [1.0, {shown}, 0.0], must be finite");
        refused(&builder, &expected);
    }
    let mut builder = Builder::square();
    builder.attribute("NORMAL", "VEC3", &[f32::NAN; 12], 4);
    refused(&builder, "attributes.NORMAL: element 0 is [NaN, NaN, NaN], must be finite");
    let mut builder = Builder::square();
    builder.attribute("COLOR_0", "VEC3", &[17.0; 12], 4);
    refused(&builder, "attributes.COLOR_0: element 0 is [17.0, 17.0, 17.0], must be 0 to 1");
}

#[test]
fn sparse_accessors_that_lie() {
    let with = |change: &dyn Fn(&mut Value)| {
        let mut builder = Builder::square();
        let indices = builder.view(&shorts(&[1, 3]));
        let values = builder.view(&floats(&[0.0; 6]));
        let mut sparse = json!({
            "count": 2,
            "indices": {"bufferView": indices, "componentType": U16},
            "values": {"bufferView": values},
        });
        change(&mut sparse);
        builder.set("/accessors/0/sparse", sparse);
        builder
    };
    assert!(open(&with(&|_| ()).glb()).is_ok());
    let place = "accessors[0].sparse";
    refused(&with(&|sparse| sparse["count"] = json!(5)), &format!("{place}.count: found 5, must be at most 4"));
    refused(&with(&|sparse| sparse["count"] = json!(4)), &format!("{place}.indices: 4 elements of 2 bytes"));
    refused(&with(&|sparse| sparse["count"] = json!(1_u64 << 62)), &format!("{place}.count"));
    let float = |sparse: &mut Value| sparse["indices"]["componentType"] = json!(F32);
    refused(&with(&float), &format!("{place}.indices: are f32, must be u8, u16 or u32"));
    let nowhere = |sparse: &mut Value| sparse["values"]["bufferView"] = json!(77);
    refused(&with(&nowhere), &format!("{place}.values.bufferView: names bufferViews[77]"));
    let far = |sparse: &mut Value| sparse["values"]["byteOffset"] = json!(4);
    refused(&with(&far), &format!("{place}.values: 2 elements of 12 bytes"));
    for (indices, number) in [([3, 1], 1), ([1, 1], 1), ([1, 4], 1), ([65_535, 3], 0)] {
        let mut builder = with(&|_| ());
        builder.binary[60..64].copy_from_slice(&shorts(&indices));
        let index = indices[number];
        refused(&builder, &format!("{place}.indices: index {number} is {index}, must ascend and be below 4"));
    }
}

#[test]
fn elements_without_a_buffer_cost_memory_without_bytes() {
    for count in [1_u64 << 40, u64::from(u32::MAX), (1 << 20) + 1] {
        let mut builder = Builder::square();
        builder.set("/accessors/0", json!({"componentType": F32, "type": "VEC3", "count": count}));
        refused(&builder, "accessors[0].count");
    }
}

#[test]
fn nodes_that_form_no_tree() {
    let nodes = |nodes: Value, roots: Value| {
        let mut builder = Builder::square();
        builder.set("/nodes", nodes).set("/scenes/0/nodes", roots);
        builder
    };
    let cycle = json!([{"children": [1]}, {"children": [2]}, {"children": [0]}]);
    refused(&nodes(cycle.clone(), json!([0])), "nodes[0]: is its own ancestor: nodes must form a tree");
    refused(&nodes(cycle, json!([])), "nodes[0]: is its own ancestor");
    refused(&nodes(json!([{"children": [0]}]), json!([0])), "nodes[0]: is its own ancestor");
    let shared = json!([{"children": [2]}, {"children": [2]}, {}]);
    refused(
        &nodes(shared, json!([0, 1])),
        "nodes[1].children[0]: names nodes[2], which is a child of nodes[0] already",
    );
    refused(&nodes(json!([{"children": [1, 1]}, {}]), json!([0])), "nodes[0].children[1]: names nodes[1]");
    refused(&nodes(json!([{}]), json!([0, 0])), "nodes[0]: is a root of the scene twice");
    refused(
        &nodes(json!([{"children": [1]}, {}]), json!([0, 1])),
        "scenes[0].nodes[1]: nodes[1] is a child of nodes[0], must be a root",
    );
    let chain = |length: usize| {
        let node = |index| if index + 1 < length { json!({"children": [index + 1]}) } else { json!({"mesh": 0}) };
        nodes((0..length).map(node).collect(), json!([0]))
    };
    assert_eq!(open(&chain(64).glb()).unwrap().nodes().count(), 64);
    refused(&chain(65), "nodes[64]: lies more than 64 nodes deep");
    refused(&chain(50_000), "lies more than 64 nodes deep");
    // Each of 31 nodes names the next one twice: a tree of a thousand million leaves.
    let doubling = (0..31).map(|index| json!({"children": [index + 1, index + 1]})).chain([json!({"mesh": 0})]);
    refused(&nodes(doubling.collect(), json!([0])), "which is a child of nodes[0] already");
}

#[test]
fn placements_that_are_not_affine() {
    let matrix = |place: usize, number: f64| {
        let mut matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        matrix[place] = number;
        json!(matrix)
    };
    refused_each(&[
        ("/nodes/0/matrix", matrix(3, 0.1), "nodes[0].matrix: has the last row 0.1, 0, 0, 1, must have 0, 0, 0, 1"),
        ("/nodes/0/matrix", matrix(15, 0.0), "nodes[0].matrix: has the last row 0, 0, 0, 0"),
        ("/nodes/0/matrix", json!([1, 2, 3]), "nodes[0].matrix: invalid length 3"),
        ("/nodes/0/rotation", json!([0, 0, 0, 0]), "nodes[0].rotation: is a quaternion of length 0.000000, must be 1"),
        ("/nodes/0/rotation", json!([1e200, 0, 0, 1e200]), "nodes[0].rotation: is a quaternion of length inf"),
        ("/nodes/0/translation", json!(["x", 0, 0]), "nodes[0].translation[0]: invalid type: string \"x\""),
    ]);
    let mut builder = Builder::square();
    builder.set("/nodes/0/matrix", matrix(0, 2.0)).set("/nodes/0/scale", json!([1, 1, 1]));
    refused(&builder, "nodes[0]: has a matrix, so it must have no translation, rotation and scale");
    let mut builder = Builder::square();
    builder.set("/nodes/0/scale", json!([1e300, 1, 1])).set("/nodes/0/children", json!([1]));
    builder.push("nodes", json!({"scale": [1e300, 1, 1]}));
    refused(&builder, "nodes[1]: its place in the world is not finite");
    let text = String::from_utf8(Builder::square().json.to_string().into_bytes()).unwrap();
    let text = text.replace("{\"mesh\":0}", "{\"mesh\":0,\"scale\":[1e999,1,1]}");
    let error = open(text.as_bytes()).err().unwrap().to_string();
    assert!(error.contains("number out of range"), "{error}");
}

#[test]
fn sizes_are_summed_over_all_places_before_anything_is_decoded() {
    let instances = |count: usize, corners: usize| {
        let mut builder = Builder::new();
        builder.accessor(&[0; 12], json!({"componentType": F32, "type": "VEC3", "count": 1}));
        let zeros = json!({"componentType": U8, "type": "SCALAR", "count": corners});
        builder.push("accessors", zeros);
        builder.push("meshes", json!({"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}));
        (0..count).for_each(|_| _ = builder.node(json!({"mesh": 0})));
        builder
    };
    let million = 1 << 20;
    assert!(GltfFile::open(&instances(96, million).glb(), &|_| None).is_ok());
    refused(&instances(97, million), "has 33903925 triangles in all places of its meshes together, must have at most");
    let mut builder = instances(1, 3);
    let nodes: Vec<Value> = (0..200_000).map(|_| json!({})).collect();
    builder.set("/nodes", json!(nodes));
    refused(&builder, "nodes: more than 131072 elements");
    let blanks = vec![b' '; 9 << 20];
    let error = open(&container(&[(b"JSON", &blanks)])).err().unwrap().to_string();
    let expected =
        "has 9437184 bytes of JSON without long strings, must have at most 8388608: keep geometry in buffers";
    assert_eq!(error, expected);
}

#[test]
fn factors_out_of_their_range() {
    let material = |material: Value, expected: &str| {
        let mut builder = Builder::square();
        builder.push("materials", material);
        refused(&builder, expected);
    };
    let extension = |name: &str, value: Value| json!({"extensions": {name: value}});
    material(
        json!({"pbrMetallicRoughness": {"metallicFactor": 17}}),
        "materials[0].pbrMetallicRoughness.metallicFactor: found 17.0, must be 0 to 1",
    );
    material(json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, -1, 1]}}), "baseColorFactor[2]: found -1.0");
    material(json!({"emissiveFactor": [2, 0, 0]}), "materials[0].emissiveFactor[0]: found 2.0, must be 0 to 1");
    material(
        json!({"alphaMode": "MASK", "alphaCutoff": -1}),
        "materials[0].alphaCutoff: found -1.0, must be at least 0",
    );
    material(json!({"alphaMode": "GLASS"}), "materials[0].alphaMode: found \"GLASS\", must be");
    material(
        extension("KHR_materials_ior", json!({"ior": 0.5})),
        "materials[0].extensions.KHR_materials_ior.ior: found 0.5, must be at least 1",
    );
    material(extension("KHR_materials_ior", json!({"ior": "x"})), "extensions.KHR_materials_ior.ior: invalid type");
    material(extension("KHR_materials_ior", json!(1.5)), "extensions.KHR_materials_ior: invalid type");
    material(
        extension("KHR_materials_transmission", json!({"transmissionFactor": 2})),
        "transmissionFactor: found 2.0",
    );
    let distance = extension("KHR_materials_volume", json!({"attenuationDistance": 0}));
    material(distance, "attenuationDistance: found 0.0, must be more than 0");
    let strength = extension("KHR_materials_emissive_strength", json!({"emissiveStrength": -1}));
    material(strength, "emissiveStrength: found -1.0, must be at least 0");
    material(json!({"normalTexture": {"index": 0}}), "materials[0].normalTexture.index: names textures[0]");
    let camera = json!([{"type": "perspective", "perspective": {"yfov": 0}}]);
    refused_each(&[
        ("/cameras", camera, "cameras[0].perspective.yfov: found 0.0, must be more than 0 and at most 3.14"),
        ("/cameras", json!([{"type": "fisheye"}]), "cameras[0].type: found \"fisheye\", must be \"perspective\" or"),
        ("/cameras", json!([{"type": "perspective"}]), "cameras[0]: is perspective, but has no member"),
    ]);
    let light = |light: Value, expected: &str| {
        let mut builder = Builder::square();
        builder.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
        refused(&builder, expected);
    };
    let place = "extensions.KHR_lights_punctual.lights[0]";
    light(json!({"type": "area"}), &format!("{place}.type: found \"area\""));
    light(json!({"type": "point", "intensity": -1}), &format!("{place}.intensity: found -1.0, must be at least 0"));
    light(json!({"type": "spot"}), &format!("{place}.spot: is missing"));
    light(json!({"type": "spot", "spot": {"innerConeAngle": 1}}), "innerConeAngle: found 1.0, must be 0 to 0.78");
    light(json!({"type": "spot", "spot": {"outerConeAngle": 2}}), "outerConeAngle: found 2.0, must be more than 0");
}

#[test]
fn files_elsewhere_are_not_read() {
    for uri in [
        "../../../../etc/passwd",
        "..%2f..%2fetc/passwd",
        "%2e%2e/secret",
        "/etc/passwd",
        "file:///etc/passwd",
        "https://example.org/a.bin",
        "C:\\a.bin",
        "a\\b.bin",
        "a//b.bin",
        "",
        "a%00.bin",
        "%ff.bin",
    ] {
        let mut builder = Builder::square();
        builder.set("/buffers/0/uri", json!(uri));
        refused(&builder, "buffers[0].uri: found ");
        assert!(GltfFile::files(&builder.glb()).is_err(), "{uri}");
    }
    let mut builder = Builder::square();
    builder.set("/buffers/0/uri", json!("data:application/octet-stream;base64,$$$$"));
    refused(&builder, "buffers[0].uri: a data: URI that is not base64");
    builder.set("/buffers/0/uri", json!("data:application/octet-stream"));
    refused(&builder, "buffers[0].uri: a data: URI must have a comma");
}

#[test]
fn required_extensions_that_are_not_read_have_a_way_out() {
    for (name, way_out) in [
        ("KHR_draco_mesh_compression", "re-export without Draco compression"),
        ("EXT_meshopt_compression", "re-export without meshopt compression"),
        ("KHR_texture_basisu", "re-export with PNG, JPEG or WebP pictures"),
        ("EXT_mesh_gpu_instancing", "re-export with one node for each instance"),
        ("KHR_materials_pbrSpecularGlossiness", "re-export with metallic-roughness materials"),
        ("ACME_cloud", "re-export without it"),
    ] {
        let mut builder = Builder::square();
        builder.json["extensionsRequired"] = json!(["KHR_materials_volume", name]);
        refused(&builder, &format!("the file needs {name}, which this build does not read: {way_out}"));
    }
    // Compressed geometry without the copy that glTF demands.
    let mut builder = Builder::square();
    builder.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    let draco = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
    builder.set("/meshes/0/primitives/0/extensions", draco);
    refused(&builder, "meshes[0].primitives[0]: has compressed geometry alone: export the scene without Draco");
}

#[test]
fn versions_other_than_two() {
    refused_each(&[
        ("/asset/version", json!("1.0"), "asset.version: found 1.0, must be \"2.0\": export the scene as glTF 2.0"),
        ("/asset/version", json!(1), "asset.version: found 1, must be"),
        ("/asset/minVersion", json!("2.1"), "asset.minVersion: found 2.1, must be at most \"2.0\""),
    ]);
    let first = br#"{"accessors": {"a": {}}, "scenes": {}, "asset": {"version": "1.0"}}"#;
    assert!(open(first).err().unwrap().to_string().contains("asset.version: found 1.0"));
    assert!(open(b"{}").err().unwrap().to_string().contains("asset.version: found null"));
    let mut later = Builder::square();
    later.set("/asset/version", json!("2.1"));
    assert!(open(&later.glb()).is_ok());
}

#[test]
fn a_primitive_that_is_not_there_is_no_panic() {
    let bytes = Builder::square().glb();
    let file = open(&bytes).unwrap();
    let message = |mesh, primitive| file.decode(mesh, primitive).unwrap_err().to_string();
    assert!(message(3, 0).contains("the mesh: names meshes[3], must be below 1"));
    assert!(message(0, 1).contains("meshes[0]: names primitives[1]"));
}
