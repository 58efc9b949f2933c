//! A room as a glTF file, as a modelling program writes it. Its pictures have two sets of coordinates, wrap modes,
//! transforms and factors.

use image::Rgb;
use serde_json::{Value, json};

use super::mitsuba::Fault;
use super::scenes::{ParityScene, png};
use super::shapes::{camera, ceiling_light};

/// Corners of the walls around [-1, 1] x [0, 2] x [-1, 1], where y points up, each wall with its normal inwards.
const WALLS: [[[f32; 3]; 4]; 6] = [
    [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]],
    [[-1.0, 2.0, -1.0], [1.0, 2.0, -1.0], [1.0, 2.0, 1.0], [-1.0, 2.0, 1.0]],
    [[-1.0, 0.0, 1.0], [-1.0, 0.0, -1.0], [-1.0, 2.0, -1.0], [-1.0, 2.0, 1.0]],
    [[1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [1.0, 2.0, 1.0], [1.0, 2.0, -1.0]],
    [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 2.0, -1.0], [-1.0, 2.0, -1.0]],
    [[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [-1.0, 2.0, 1.0], [1.0, 2.0, 1.0]],
];

/// The scene: its walls are matt, for which the coat of glTF is switched off.
pub(super) fn interior() -> ParityScene {
    let things = json!({"lights": [ceiling_light(1.0)],
        "imports": [{"name": "room", "source": {"gltf": {"file": "room.gltf", "files": ["room.bin", "tiles.png"]}}}]});
    let (document, buffer) = room();
    let tile = |x: u32, y: u32| Rgb([(250 - 40 * x) as u8, (60 * y + 30) as u8, (35 * (x + y)) as u8]);
    let mut scene = ParityScene::new("interior", camera(), &things);
    scene.fault = Some(Fault {
        name: "a picture that is repeated instead of mirrored",
        text: "<string name=\"wrap_mode\" value=\"mirror\"/>",
        fault: "<string name=\"wrap_mode\" value=\"repeat\"/>",
    });
    scene.files = vec![
        ("room.gltf".to_owned(), document.to_string().into_bytes()),
        ("room.bin".to_owned(), buffer),
        ("tiles.png".to_owned(), png(5, 4, tile)),
    ];
    scene
}

/// The document and its buffer.
fn room() -> (Value, Vec<u8>) {
    let coordinates = |scale: f32| [[0.0, 0.0], [scale, 0.0], [scale, scale], [0.0, scale]];
    let mut buffer = Vec::new();
    let mut views = Vec::new();
    let mut accessors = Vec::new();
    let mut accessor = |values: &[f32], kind: &str, bounds: Option<[[f32; 3]; 2]>| {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        views.push(json!({"buffer": 0, "byteOffset": buffer.len(), "byteLength": bytes.len()}));
        buffer.extend(bytes);
        let mut accessor = json!({"bufferView": views.len() - 1, "componentType": 5126, "count": 4, "type": kind});
        if let Some([min, max]) = bounds {
            (accessor["min"], accessor["max"]) = (json!(min), json!(max));
        }
        accessors.push(accessor);
        accessors.len() - 1
    };
    let first = accessor(coordinates(1.0).as_flattened(), "VEC2", None);
    let second = accessor(coordinates(2.3).as_flattened(), "VEC2", None);
    let positions: Vec<usize> = WALLS
        .iter()
        .map(|corners| {
            let fold = |of: fn(f32, f32) -> f32| {
                [0, 1, 2].map(|axis| corners.iter().map(|at| at[axis]).reduce(of).unwrap_or(0.0))
            };
            accessor(corners.as_flattened(), "VEC3", Some([fold(f32::min), fold(f32::max)]))
        })
        .collect();
    let start = buffer.len();
    buffer.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": 12}));
    accessors.push(json!({"bufferView": views.len() - 1, "componentType": 5123, "count": 6, "type": "SCALAR"}));
    let indices = accessors.len() - 1;
    let wall = |(material, position): (usize, &usize)| {
        json!({"primitives": [{"indices": indices, "material": material % 4,
            "attributes": {"POSITION": position, "TEXCOORD_0": first, "TEXCOORD_1": second}}]})
    };
    let meshes: Vec<Value> = positions.iter().enumerate().map(wall).collect();
    let matt = |pbr: Value| {
        let mut pbr = pbr;
        pbr["metallicFactor"] = json!(0);
        json!({"pbrMetallicRoughness": pbr, "extensions": {"KHR_materials_specular": {"specularFactor": 0}}})
    };
    let turned = json!({"offset": [0.1, 0.2], "rotation": 0.4, "scale": [1.5, 0.7]});
    let document = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_specular", "KHR_texture_transform"],
        "scene": 0, "scenes": [{"nodes": (0..6).collect::<Vec<usize>>()}],
        "nodes": (0..6).map(|mesh| json!({"mesh": mesh})).collect::<Vec<Value>>(),
        "meshes": meshes, "accessors": accessors, "bufferViews": views,
        "buffers": [{"uri": "room.bin", "byteLength": buffer.len()}],
        "images": [{"uri": "tiles.png"}],
        "samplers": [{"magFilter": 9728, "minFilter": 9728, "wrapS": 33648, "wrapT": 33648}, {}],
        "textures": [{"source": 0, "sampler": 0}, {"source": 0, "sampler": 1}],
        "materials": [
            matt(json!({"baseColorTexture": {"index": 0, "texCoord": 1}})),
            matt(json!({"baseColorFactor": [0.7, 0.75, 0.8, 1]})),
            matt(json!({"baseColorTexture": {"index": 1, "extensions": {"KHR_texture_transform": turned}}})),
            matt(json!({"baseColorTexture": {"index": 1}, "baseColorFactor": [0.9, 0.6, 0.3, 1]}))
        ]
    });
    (document, buffer)
}
