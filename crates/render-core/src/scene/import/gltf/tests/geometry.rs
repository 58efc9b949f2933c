//! Triangles and attributes.

use glam::{DVec2, DVec3, DVec4};
use serde_json::json;

use super::builder::{F32, SQUARE, U8, U16, floats, shorts};
use super::*;

const CORNERS: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];

fn decode(builder: &Builder) -> Primitive {
    open(&builder.glb()).unwrap().decode(0, 0).unwrap()
}

#[test]
fn a_square_has_two_triangles_and_its_size_is_known_before() {
    let bytes = Builder::square().glb();
    let file = open(&bytes).unwrap();
    let [mesh] = file.meshes().collect::<Vec<_>>()[..] else { panic!("one mesh") };
    let expected = PrimitiveInfo {
        triangles: 2,
        vertices: 4,
        material: None,
        has_normals: false,
        has_tangents: false,
        has_texture_coordinates: [false; 2],
        has_colours: false,
    };
    assert_eq!(mesh.primitives, [expected]);
    let decoded = file.decode(0, 0).unwrap();
    assert_eq!(decoded.positions, CORNERS);
    assert_eq!(decoded.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert!(decoded.normals.is_empty() && decoded.colours.is_empty());
    assert!(file.notes().is_empty(), "{:?}", file.notes());
}

#[test]
fn attributes_follow_their_vertices() {
    let mut builder = Builder::square();
    builder.attribute("NORMAL", "VEC3", &[0.0, 0.0, 2.0].repeat(4), 4);
    builder.attribute("TANGENT", "VEC4", &[1.0, 0.0, 0.0, -1.0].repeat(4), 4);
    builder.attribute("TEXCOORD_0", "VEC2", &[0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75], 4);
    builder.attribute("TEXCOORD_1", "VEC2", &[0.5; 8], 4);
    builder.attribute("COLOR_0", "VEC3", &[0.25, 0.5, 1.0].repeat(4), 4);
    let bytes = builder.glb();
    let file = open(&bytes).unwrap();
    let info = &file.meshes().next().unwrap().primitives[0];
    assert!(info.has_normals && info.has_tangents && info.has_colours);
    assert_eq!(info.has_texture_coordinates, [true; 2]);
    let decoded = file.decode(0, 0).unwrap();
    assert_eq!(decoded.normals, [DVec3::new(0.0, 0.0, 2.0); 4]);
    assert_eq!(decoded.tangents, [DVec4::new(1.0, 0.0, 0.0, -1.0); 4]);
    assert_eq!(decoded.texture_coordinates[0][1], DVec2::new(0.5, 0.75));
    assert_eq!(decoded.texture_coordinates[1], [DVec2::splat(0.5); 4]);
    assert_eq!(decoded.colours, [[0.25, 0.5, 1.0, 1.0]; 4]);
}

#[test]
fn strips_and_fans_turn_like_triangles() {
    let upwards = |decoded: &Primitive| {
        let cross = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| decoded.positions[corner as usize]);
            (b - a).cross(c - a).z
        };
        decoded.triangles.iter().map(|corners| cross(*corners)).collect::<Vec<_>>()
    };
    let with = |mode: u32, indices: &[u16]| {
        let mut builder = Builder::square();
        let accessor = json!({"componentType": U16, "type": "SCALAR", "count": indices.len()});
        let accessor = builder.accessor(&shorts(indices), accessor);
        builder.set("/meshes/0/primitives/0/indices", json!(accessor)).set("/meshes/0/primitives/0/mode", json!(mode));
        decode(&builder)
    };
    let strip = with(5, &[0, 1, 3, 2]);
    assert_eq!(strip.triangles, [[0, 1, 3], [1, 2, 3]]);
    assert_eq!(upwards(&strip), [1.0, 1.0]);
    let fan = with(6, &[0, 1, 2, 3]);
    assert_eq!(fan.triangles, [[1, 2, 0], [2, 3, 0]]);
    assert_eq!(upwards(&fan), [1.0, 1.0]);
    // Corners that complete no triangle are ignored.
    assert_eq!(with(4, &[0, 1, 2, 0, 2]).triangles, [[0, 1, 2]]);
    assert!(with(5, &[0, 1]).triangles.is_empty());
}

#[test]
fn without_indices_vertices_are_corners() {
    let mut builder = Builder::square();
    builder.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
    assert_eq!(decode(&builder).triangles, [[0, 1, 2]]);
    builder.set("/meshes/0/primitives/0/mode", json!(6));
    assert_eq!(decode(&builder).triangles, [[1, 2, 0], [2, 3, 0]]);
}

#[test]
fn points_and_lines_are_counted_and_reported() {
    let mut builder = Builder::square();
    for mode in 0..4 {
        let primitive = json!({"attributes": {"POSITION": 0}, "indices": 1, "mode": mode});
        builder.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }
    let bytes = builder.glb();
    let file = open(&bytes).unwrap();
    let triangles: Vec<usize> =
        file.meshes().next().unwrap().primitives.iter().map(|primitive| primitive.triangles).collect();
    assert_eq!(triangles, [2, 0, 0, 0, 0]);
    assert_eq!(file.decode(0, 1).unwrap(), Primitive::default());
    assert_eq!(file.notes(), ["points and lines are left out (primitives: 4)"]);
}

#[test]
fn primitives_of_a_shared_list_have_the_vertices_that_they_name() {
    let mut builder = Builder::new();
    let count = 1000;
    let positions: Vec<f32> = (0..count).flat_map(|vertex| [vertex as f32, 0.5, 0.0]).collect();
    builder.accessor(&floats(&positions), json!({"componentType": F32, "type": "VEC3", "count": count}));
    let corners = json!({"componentType": U16, "type": "SCALAR", "count": 3});
    builder.accessor(&shorts(&[900, 7, 500]), corners.clone());
    let many = (0..300).flat_map(|corner| [2 * corner, 2 * corner + 4, 2 * corner + 2]).collect::<Vec<u16>>();
    builder.accessor(&shorts(&many), json!({"componentType": U16, "type": "SCALAR", "count": many.len()}));
    let primitive = |indices| json!({"attributes": {"POSITION": 0}, "indices": indices});
    builder.push("meshes", json!({"primitives": [primitive(1), primitive(2)]}));
    let bytes = builder.glb();
    let file = open(&bytes).unwrap();
    assert_eq!(file.meshes().next().unwrap().primitives[0].vertices, 3);
    let few = file.decode(0, 0).unwrap();
    assert_eq!(few.triangles, [[2, 0, 1]]);
    assert_eq!(few.positions.iter().map(|position| position.x).collect::<Vec<_>>(), [7.0, 500.0, 900.0]);
    let half = file.decode(0, 1).unwrap();
    assert_eq!(half.positions.len(), 302);
    assert_eq!(half.triangles[10], [10, 12, 11]);
    assert_eq!(half.positions[12].x, 24.0);
}

#[test]
fn elements_may_lie_apart_and_among_others() {
    let mut builder = Builder::square();
    // Position and texture coordinate of each vertex, side by side.
    let interleaved: Vec<f32> = SQUARE.chunks(3).flat_map(|corner| [corner, &[corner[0], 0.5]].concat()).collect();
    let view = builder.view(&floats(&interleaved));
    builder.set(&format!("/bufferViews/{view}/byteStride"), json!(20));
    let of_view = |shape: &str, offset: usize| {
        let view = json!({"bufferView": view, "byteOffset": offset});
        let numbers = json!({"componentType": F32, "type": shape, "count": 4});
        let members = [view, numbers].map(|object| object.as_object().unwrap().clone());
        Value::Object(members.into_iter().flatten().collect())
    };
    let positions = builder.push("accessors", of_view("VEC3", 0));
    let coordinates = builder.push("accessors", of_view("VEC2", 12));
    builder.set("/meshes/0/primitives/0/attributes", json!({"POSITION": positions, "TEXCOORD_0": coordinates}));
    let decoded = decode(&builder);
    assert_eq!(decoded.positions, CORNERS);
    let expected = [[0.0, 0.5], [1.0, 0.5], [1.0, 0.5], [0.0, 0.5]].map(DVec2::from);
    assert_eq!(decoded.texture_coordinates[0], expected);
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut builder = Builder::square();
    let indices = builder.view(&[1, 3]);
    let values = builder.view(&floats(&[5.0, 6.0, 7.0, -1.0, -2.0, -3.0]));
    let sparse = json!({
        "count": 2,
        "indices": {"bufferView": indices, "componentType": U8},
        "values": {"bufferView": values},
    });
    builder.set("/accessors/0/sparse", sparse);
    let [five, one] = [DVec3::new(5.0, 6.0, 7.0), DVec3::new(-1.0, -2.0, -3.0)];
    assert_eq!(decode(&builder).positions, [CORNERS[0], five, CORNERS[2], one]);
    // Without a view all other elements are zero.
    builder.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(decode(&builder).positions, [DVec3::ZERO, five, DVec3::ZERO, one]);
    builder.json["accessors"][0].as_object_mut().unwrap().remove("sparse");
    assert_eq!(decode(&builder).positions, [DVec3::ZERO; 4]);
}

#[test]
fn normalized_integers_are_fractions() {
    let mut builder = Builder::square();
    let bytes = [0, 255, 51, 255].repeat(4);
    let colours = json!({"componentType": U8, "normalized": true, "type": "VEC4", "count": 4});
    let colours = builder.accessor(&bytes, colours);
    let coordinates = json!({"componentType": U16, "normalized": true, "type": "VEC2", "count": 4});
    let coordinates = builder.accessor(&shorts(&[0, 65_535, 13_107, 0, 0, 0, 0, 0]), coordinates);
    let attributes = json!({"POSITION": 0, "COLOR_0": colours, "TEXCOORD_0": coordinates});
    builder.set("/meshes/0/primitives/0/attributes", attributes);
    let decoded = decode(&builder);
    assert_eq!(decoded.colours, [[0.0, 1.0, 0.2, 1.0]; 4]);
    assert_eq!(decoded.texture_coordinates[0][..2], [DVec2::new(0.0, 1.0), DVec2::new(0.2, 0.0)]);
}

#[test]
fn quantized_geometry_is_read_where_the_file_says_so() {
    let mut builder = Builder::square();
    let positions: Vec<u8> = [[-2_i16, 0, 7, 0], [300, 0, 0, 0], [300, 300, 0, 0], [0, 300, 0, 0]]
        .iter()
        .flatten()
        .flat_map(|number| number.to_le_bytes())
        .collect();
    let accessor = json!({"componentType": 5122, "type": "VEC3", "count": 4});
    let positions = builder.accessor(&positions, accessor);
    builder.set("/bufferViews/2/byteStride", json!(8));
    let normals = json!({"componentType": 5120, "normalized": true, "type": "VEC3", "count": 4});
    let normals = builder.accessor(&[0, 0x81, 127, 0].repeat(4), normals);
    builder.set("/bufferViews/3/byteStride", json!(4));
    builder.set("/meshes/0/primitives/0/attributes", json!({"POSITION": positions, "NORMAL": normals}));
    let error = open(&builder.glb()).err().unwrap().to_string();
    let expected = "accessors[2] is VEC3 of i16, must be VEC3 of f32 unless the file uses KHR_mesh_quantization";
    assert!(error.contains(expected), "{error}");
    builder.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    builder.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let decoded = decode(&builder);
    assert_eq!(decoded.positions[0], DVec3::new(-2.0, 0.0, 7.0));
    assert_eq!(decoded.normals, [DVec3::new(0.0, -1.0, 1.0); 4]);
}

#[test]
fn an_empty_primitive_has_no_triangle() {
    let mut builder = Builder::square();
    builder.set("/accessors/1/count", json!(0));
    assert!(decode(&builder).triangles.is_empty());
    builder.set("/accessors/0/count", json!(0));
    assert!(decode(&builder).triangles.is_empty());
    builder.set("/meshes/0/primitives/0/attributes", json!({}));
    let bytes = builder.glb();
    let file = open(&bytes).unwrap();
    assert_eq!(file.notes(), ["geometry without positions is left out (primitives: 1)"]);
}
