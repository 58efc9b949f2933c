//! Whatever arrives, a scene is built or an error is returned: nothing panics.

use std::collections::BTreeMap;

use proptest::prelude::*;
use serde_json::{Value, json};

use super::malformed_scenes::valid_scene;
use super::{SceneBundle, SceneDescription};
use crate::scene::{Asset, Scene, SceneError};
use crate::texture::picture_samples::{encode_exr, encode_png};

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                   property float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\n\
                   end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n";
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 3//1 2 1\n";

const SKY: &[u8] = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n\x02\x02\0\x08\x88\x80\x88\x40\x88\x20\x88\x81\
                     \x80\x40\x20\x81\x01\x01\x01\x07";

/// A scene with an asset of every kind.
fn scene_with_assets() -> (Value, BTreeMap<String, Vec<u8>>) {
    let mut scene = valid_scene();
    scene["materials"]["brick"] = json!({"diffuse": {"reflectance": {"texture": {"file": "brick.png"}}}});
    scene["materials"]["plaster"] = json!({"diffuse": {"reflectance": {"texture": {"file": "plaster.exr"}}}});
    let meshes = scene["meshes"].as_array_mut().unwrap();
    meshes.push(json!({"name": "a", "material": "brick", "source": {"ply": {"file": "a.ply"}}}));
    meshes.push(json!({"name": "b", "material": "stone", "source": {"obj": {"file": "b.obj"}}}));
    scene["panes"][0]["front"] = json!({"height_map": {"file": "front.exr"}});
    scene["panes"][0]["back"] = json!({"height_map": {"file": "back.png", "scale": 1e-4}});
    let sky = json!({"environment": {"name": "sky", "radiance": {"picture": {"file": "sky.hdr"}}}});
    scene["lights"].as_array_mut().unwrap().push(sky);
    // Coarse profiles, so that thousands of scenes are built in seconds.
    scene["panes"][1]["front"]["hammered"]["wavelength"] = json!(0.3);
    scene["panes"][1]["back"]["cylinder"]["wavelength"] = json!(0.3);
    let assets = [
        ("brick.png", encode_png(image::DynamicImage::new_rgb8(5, 3))),
        ("plaster.exr", encode_exr(2, 2, &[("Y", &[0.5; 4])])),
        ("a.ply", PLY.as_bytes().to_vec()),
        ("b.obj", OBJ.as_bytes().to_vec()),
        ("front.exr", encode_exr(4, 3, &[("Y", &[1e-5; 12])])),
        ("sky.hdr", SKY.to_vec()),
        ("back.png", encode_png(image::DynamicImage::new_luma16(3, 4))),
    ];
    (scene, assets.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect())
}

fn build(json: &[u8], assets: &BTreeMap<String, Vec<u8>>) -> Result<Scene, SceneError> {
    let assets = assets.iter().map(|(name, bytes)| (name.clone(), Asset::new(bytes.clone()))).collect();
    SceneBundle::from_parts(SceneDescription::parse(json)?, assets)?.build_scene()
}

/// All places of a JSON value, as JSON pointers.
fn pointers(value: &Value) -> Vec<String> {
    let children: Vec<(String, &Value)> = match value {
        Value::Object(members) => members.iter().map(|(name, member)| (name.clone(), member)).collect(),
        Value::Array(elements) => elements.iter().enumerate().map(|(index, e)| (index.to_string(), e)).collect(),
        _ => Vec::new(),
    };
    let below = children.into_iter().flat_map(|(name, child)| {
        pointers(child).into_iter().map(move |pointer| format!("/{name}{pointer}")).collect::<Vec<_>>()
    });
    std::iter::once(String::new()).chain(below).collect()
}

/// Values that are wrong, extreme, or right somewhere else.
fn any_value() -> impl Strategy<Value = Value> {
    let number = prop_oneof![
        any::<i64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        prop::sample::select(vec![0.0, -0.0, 1e-300, 1e300, 0.5, 1.0, 90.0]).prop_map(Value::from),
    ];
    let (scene, _) = scene_with_assets();
    let parts: Vec<Value> = pointers(&scene).iter().filter_map(|pointer| scene.pointer(pointer).cloned()).collect();
    prop_oneof![
        3 => number,
        1 => prop::sample::select(vec![json!(null), json!(true), json!(""), json!([]), json!({}), json!("flat")]),
        3 => prop::sample::select(parts),
    ]
}

#[test]
fn the_scene_that_the_others_are_made_of_can_be_built() {
    let (scene, assets) = scene_with_assets();
    let built = build(scene.to_string().as_bytes(), &assets).unwrap();
    assert_eq!(built.meshes().iter().map(|mesh| mesh.triangles()).collect::<Vec<_>>(), [2, 1, 2]);
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 400,
        failure_persistence: None,
        rng_seed: prop::test_runner::RngSeed::Fixed(2),
        ..ProptestConfig::default()
    })]

    #[test]
    fn random_bytes_are_no_scene(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(SceneDescription::parse(&bytes).is_err());
    }

    #[test]
    fn scenes_with_flipped_bits_are_built_or_refused(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8_u32), 1..4)
    ) {
        let (scene, assets) = scene_with_assets();
        let mut json = scene.to_string().into_bytes();
        for (place, bit) in flips {
            let index = place.index(json.len());
            json[index] ^= 1 << bit;
        }
        drop(build(&json, &assets));
    }

    #[test]
    fn scenes_with_other_values_are_built_or_refused(
        place in any::<prop::sample::Index>(),
        value in any_value(),
    ) {
        let (mut scene, assets) = scene_with_assets();
        let places = pointers(&scene);
        *scene.pointer_mut(&places[place.index(places.len())]).unwrap() = value;
        drop(build(scene.to_string().as_bytes(), &assets));
    }

    #[test]
    fn scenes_with_deleted_members_are_built_or_refused(
        place in any::<prop::sample::Index>(),
        child in any::<prop::sample::Index>(),
    ) {
        let (mut scene, assets) = scene_with_assets();
        let places = pointers(&scene);
        match scene.pointer_mut(&places[place.index(places.len())]).unwrap() {
            Value::Object(members) if !members.is_empty() => {
                let name = members.keys().nth(child.index(members.len())).unwrap().clone();
                members.remove(&name);
            }
            Value::Array(elements) if !elements.is_empty() => drop(elements.remove(child.index(elements.len()))),
            _ => {}
        }
        drop(build(scene.to_string().as_bytes(), &assets));
    }

    #[test]
    fn assets_with_flipped_bytes_are_built_or_refused(
        asset in any::<prop::sample::Index>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let (scene, mut assets) = scene_with_assets();
        let names: Vec<String> = assets.keys().cloned().collect();
        let bytes = assets.get_mut(&names[asset.index(names.len())]).unwrap();
        for (place, value) in changes {
            let index = place.index(bytes.len());
            bytes[index] = value;
        }
        if let Some(length) = cut {
            bytes.truncate(length.index(bytes.len()));
        }
        drop(build(scene.to_string().as_bytes(), &assets));
    }
}
