//! Materials, their textures and pictures.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DVec2;
use serde_json::{Value, json};

use super::*;
use crate::scene::import::gltf::materials::Volume;

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n and so on";
const JPEG: &[u8] = b"\xff\xd8\xff\xe0 and so on";

/// A square with a material and one picture in the buffer.
fn with_material(material: Value) -> Builder {
    let mut builder = Builder::square();
    let view = builder.view(PNG);
    builder.push("images", json!({"bufferView": view, "mimeType": "image/jpeg", "name": "wood"}));
    builder.push("textures", json!({"source": 0}));
    builder.push("materials", material);
    builder.set("/meshes/0/primitives/0/material", json!(0));
    builder
}

fn material(stored: Value) -> Material {
    open(&with_material(stored).glb()).unwrap().materials()[0].clone()
}

#[test]
fn a_material_without_members_is_the_default_one() {
    assert_eq!(material(json!({})), Material::default());
    let default = Material::default();
    assert_eq!((default.metallic, default.roughness, default.ior), (1.0, 1.0, 1.5));
}

#[test]
fn all_factors_are_read() {
    let stored = json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0, "roughnessFactor": 0.5},
        "emissiveFactor": [1, 0.5, 0], "alphaMode": "MASK", "doubleSided": true,
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 40},
            "KHR_materials_ior": {"ior": 1.52},
            "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": {
                "thicknessFactor": 0.002, "attenuationDistance": 0.01, "attenuationColor": [0.9, 0.1, 0.1],
            },
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [2, 1, 1]},
            "KHR_materials_unlit": {},
        },
    });
    let volume = Volume {
        thickness: 0.002,
        thickness_texture: None,
        attenuation_distance: 0.01,
        attenuation_colour: [0.9, 0.1, 0.1],
    };
    let expected = Material {
        base_colour: [0.1, 0.2, 0.3, 0.4],
        metallic: 0.0,
        roughness: 0.5,
        emissive: [1.0, 0.5, 0.0],
        emissive_strength: 40.0,
        alpha: AlphaMode::Mask { cutoff: 0.5 },
        is_double_sided: true,
        is_unlit: true,
        transmission: 1.0,
        ior: 1.52,
        volume: Some(volume),
        specular: 0.5,
        specular_colour: [2.0, 1.0, 1.0],
        ..Material::default()
    };
    assert_eq!(material(stored), expected);
    let mirror = material(json!({"alphaMode": "BLEND", "extensions": {"KHR_materials_ior": {"ior": 0}}}));
    assert_eq!((mirror.ior, mirror.alpha), (0.0, AlphaMode::Blend));
    let endless = material(json!({"extensions": {"KHR_materials_volume": {}}})).volume.unwrap();
    assert_eq!((endless.thickness, endless.attenuation_distance), (0.0, f64::INFINITY));
}

#[test]
fn every_texture_is_read_and_its_picture_found() {
    let texture = json!({"index": 0});
    let stored = json!({
        "pbrMetallicRoughness": {"baseColorTexture": texture, "metallicRoughnessTexture": texture},
        "normalTexture": {"index": 0, "scale": -0.5},
        "emissiveTexture": texture,
        "extensions": {
            "KHR_materials_transmission": {"transmissionTexture": texture},
            "KHR_materials_volume": {"thicknessTexture": texture},
            "KHR_materials_specular": {"specularTexture": texture, "specularColorTexture": texture},
        },
    });
    let bytes = with_material(stored).glb();
    let file = open(&bytes).unwrap();
    let [material] = file.materials() else { panic!("one material") };
    let textures: Vec<&Texture> = material.textures().collect();
    assert!(textures.len() == 8 && textures.iter().all(|texture| texture.image == 0));
    assert_eq!(material.normal_scale, -0.5);
    assert_eq!(file.images().collect::<Vec<_>>(), [0]);
    assert_eq!(file.image(0), Some(Image { name: Some("wood"), source: ImageSource::Embedded(PNG) }));
    assert_eq!(file.image(1), None);
}

#[test]
fn textures_say_how_they_lie() {
    let placed = json!({
        "offset": [0.5, 0.25], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 3], "texCoord": 0,
    });
    let info = json!({"index": 1, "texCoord": 1, "extensions": {"KHR_texture_transform": placed}});
    let mut builder = with_material(json!({
        "normalTexture": {"index": 0, "texCoord": 1},
        "pbrMetallicRoughness": {"baseColorTexture": info},
    }));
    builder.push("samplers", json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}));
    builder.push("textures", json!({"source": 0, "sampler": 0}));
    let bytes = builder.glb();
    let file = open(&bytes).unwrap();
    let normals = file.materials()[0].normal_texture.clone().unwrap();
    assert_eq!((normals.set, normals.wrap, normals.is_nearest), (1, [Wrap::Repeat; 2], false));
    assert_eq!(normals.transform, TextureTransform::default());
    let colour = file.materials()[0].base_colour_texture.clone().unwrap();
    assert_eq!((colour.set, colour.wrap, colour.is_nearest), (0, [Wrap::Clamp, Wrap::Mirror], true));
    // u is scaled by two, turned to -v, and moved.
    let moved = colour.transform.affine().transform_point2(DVec2::new(0.1, 0.0));
    assert!((moved - DVec2::new(0.5, 0.05)).length() < 1e-12, "{moved}");
}

#[test]
fn pictures_are_known_by_their_content_wherever_they_are() {
    let data = |bytes: &[u8]| format!("data:image/png;base64,{}", STANDARD.encode(bytes));
    let textured = || with_material(json!({"emissiveTexture": {"index": 0}}));
    let mut builder = textured();
    builder.set("/images/0", json!({"uri": data(JPEG)}));
    let bytes = builder.glb();
    assert_eq!(open(&bytes).unwrap().image(0).unwrap().source, ImageSource::Embedded(JPEG));
    builder.set("/images/0", json!({"uri": "./stone%20wall/a.png"}));
    let bytes = builder.glb();
    assert_eq!(open(&bytes).unwrap().image(0).unwrap().source, ImageSource::File("stone wall/a.png"));
    builder.set("/images/0", json!({"uri": data(b"\xabKTX 20")}));
    let error = open(&builder.glb()).err().unwrap().to_string();
    assert!(error.contains("images[0]: looks like a KTX picture, must be PNG, JPEG or WebP"), "{error}");
    // WebP comes in an extension; its texture may have another picture for other programs.
    let mut builder = textured();
    let webp = builder.view(b"RIFF\x10\0\0\0WEBPVP8 ");
    builder.push("images", json!({"bufferView": webp}));
    builder.set("/textures/0/extensions", json!({"EXT_texture_webp": {"source": 1}}));
    let bytes = builder.glb();
    assert_eq!(open(&bytes).unwrap().images().collect::<Vec<_>>(), [1]);
}

#[test]
fn what_is_left_out_is_told_and_counted() {
    let mut builder = with_material(json!({
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 2}},
        "emissiveTexture": {"index": 1},
        "extensions": {"KHR_materials_sheen": {}, "KHR_materials_clearcoat": {}},
    }));
    builder.push("textures", json!({"extensions": {"KHR_texture_basisu": {"source": 0}}}));
    builder.push("materials", json!({"extensions": {"KHR_materials_sheen": {}}}));
    builder.json["animations"] = json!([{}, {}]);
    builder.json["skins"] = json!([{"joints": [0]}]);
    builder.json["extensionsUsed"] = json!(["KHR_materials_sheen", "KHR_materials_variants", "KHR_materials_ior"]);
    builder.json["extensionsRequired"] = json!(["KHR_materials_variants", "KHR_materials_volume"]);
    builder.set("/meshes/0/primitives/0/targets", json!([{"POSITION": 0}]));
    let bytes = builder.glb();
    let expected = [
        "animations are left out (2): nodes stand where they are stored",
        "skins are left out (1): meshes have the shape in which they are stored",
        "morph targets are left out (primitives: 1): meshes have their base shape",
        "textures with a third or later set of texture coordinates are left out (1)",
        "textures without a PNG, JPEG or WebP picture are left out (1)",
        "the extension KHR_materials_clearcoat is left out (1)",
        "the extension KHR_materials_sheen is left out (2)",
        "the extension KHR_materials_variants is left out: meshes have their default materials",
        "the extension KHR_texture_basisu is left out (1)",
    ];
    assert_eq!(open(&bytes).unwrap().notes(), expected);
}
