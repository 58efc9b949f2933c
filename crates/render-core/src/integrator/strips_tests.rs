//! The light plane in strips.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use clerestory_film::counters::Counters;
use clerestory_film::{NodeAddress, TileGrid};
use serde_json::json;

use super::{PreparedScene, render_node, render_nodes, rendered_together};
use crate::document::{SceneBundle, SceneDescription};

#[test]
fn strips_of_the_light_plane_are_the_same_together_and_alone() {
    // The least that has two strips.
    let [width, height, tile_size] = [2048, 1025, 1024];
    let quad = json!({"inline": {
        "positions": [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], "triangles": [[0, 1, 2], [0, 2, 3]]}});
    let scene = json!({
        "version": 2, "name": "bulb", "film": {"width": width, "height": height},
        "integrator": {"light": {"subpaths": 1}},
        "sampling": {"samples_per_pass": 1, "samples_per_block": 1},
        "camera": {"perspective": {
            "position": [0, 0, 1], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 40}},
        "materials": {"plaster": {"diffuse": {"reflectance": {"colour": [0.7, 0.7, 0.7]}}}},
        "meshes": [{"name": "floor", "material": "plaster", "source": quad}],
        "lights": [{"sphere": {"name": "bulb", "centre": [0, 0, 2], "radius": 0.1, "radiance": [9, 9, 9]}}]
    });
    let description = SceneDescription::parse(scene.to_string().as_bytes()).unwrap();
    let scene = PreparedScene::build(&SceneBundle::from_parts(description, BTreeMap::new()).unwrap()).unwrap();
    let grid = scene.description().grid(tile_size);
    assert_eq!(grid, TileGrid::new(width, height, tile_size).with_light_plane(true));
    let [upper, lower] =
        [0, 1].map(|strip| NodeAddress { frame: 0, tile: grid.camera_tiles() + strip, level: 0, index: 0 });
    let later = NodeAddress { index: 1, ..lower };
    let runs: Vec<usize> = rendered_together(&grid, &[upper, lower, later]).map(<[_]>::len).collect();
    assert_eq!(runs, [2, 1]);

    let never = AtomicBool::new(false);
    let together = render_nodes(&scene, &grid, &[upper, lower], &never).unwrap();
    assert_eq!(together[1], render_node(&scene, &grid, lower, &never).unwrap());
    let light = |strip: usize| together[strip].node.layers().beauty.iter().filter(|pixel| pixel[0] > 0.0).count();
    assert!(light(0) > 10_000 && light(1) > 10, "{} and {} pixels have light", light(0), light(1));
    let mut counters = Counters::default();
    together.iter().for_each(|strip| counters += strip.counters);
    assert_eq!(counters.samples, u64::from(width) * u64::from(height));
    // One ray or more for each subpath.
    assert!(counters.rays >= counters.samples, "{counters:?}");
}
