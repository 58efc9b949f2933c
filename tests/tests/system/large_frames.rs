//! Frames that are larger than the memory of their coordinator: memory does not grow with them, and the bits are those
//! of one process.

#![expect(clippy::unwrap_used, reason = "a test that cannot set itself up has failed")]

use std::fs;
use std::path::Path;

use clerestory_tests::farm::{Farm, succeeded};
use clerestory_tests::large_frame::{self, OPTIONS, PASSES, PIXEL_BYTES};
use clerestory_tests::made_images::{assert_same_bits, metadata, rendered_alone, rendered_by};
use clerestory_tests::peak_memory::PeakMemory;
use tempfile::TempDir;

const MEBIBYTE: u64 = 1 << 20;

/// A coordinator that may keep little, and two workers.
fn farm(folder: &Path, image_bytes: u64) -> Farm {
    let config = folder.join("coordinator.toml");
    let text = format!("node_cache_bytes = {0}\nimage_bytes = {image_bytes}\npreview_bytes = {0}\n", 4 * MEBIBYTE);
    fs::write(&config, text).unwrap();
    // The C library keeps memory apart for each thread, and returns little of it.
    let environment = [("MALLOC_ARENA_MAX".to_owned(), "2".to_owned())];
    let mut farm = Farm::start_in(&environment, None, &["--config", config.to_str().unwrap()]);
    farm.start_worker("first");
    farm.start_worker("second");
    farm
}

/// Renders a frame, checks some of its tiles, and answers the most memory that the coordinator had.
fn rendered(edge: u32) -> PeakMemory {
    let folder = TempDir::new().unwrap();
    let farm = farm(folder.path(), 16 * MEBIBYTE);
    let (scene, image) = (large_frame::scene(folder.path(), edge), folder.path().join("large.exr"));
    let mut submit = farm.command(&["submit", "--wait", "--png"]);
    succeeded(submit.args(OPTIONS).arg(&scene).arg("--output").arg(&image));
    let along = edge / 64;
    let tiles = [0, along - 1, along * along / 2 + along / 2, along * along - 1];
    large_frame::check(&image, &scene, 64, &tiles).unwrap();
    farm.coordinator_memory()
}

#[test]
#[ignore = "takes a minute; `tests/run long` has it"]
fn a_coordinator_has_no_more_memory_for_a_frame_of_sixteen_times_the_size() {
    let [small, large] = [512, 2048].map(rendered);
    let image = 2048 * 2048 * PIXEL_BYTES;
    let grown = large.resident.saturating_sub(small.resident);
    let told = format!("{} MiB and {} MiB", small.resident / MEBIBYTE, large.resident / MEBIBYTE);
    println!("most memory of the coordinator: {told}; the larger image has {} MiB", image / MEBIBYTE);
    assert!(grown < image / 4, "{told}");
}

/// A bulb over a floor, in a frame whose light plane is two strips.
const BULB: &str = r#"{
    "version": 2, "name": "bulb", "film": {"width": 2048, "height": 1025}, "integrator": {"light": {"subpaths": 1}},
    "sampling": {"samples_per_pass": 1, "samples_per_block": 1},
    "camera": {"perspective": {
        "position": [0, 0, 1], "look_at": [0, 0, 0], "up": [0, 1, 0], "vertical_field_of_view": 40}},
    "materials": {"plaster": {"diffuse": {"reflectance": {"colour": [0.7, 0.6, 0.5]}}}},
    "meshes": [{"name": "floor", "material": "plaster", "source": {"inline": {
        "positions": [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], "triangles": [[0, 1, 2], [0, 2, 3]]}}}],
    "lights": [{"sphere": {"name": "bulb", "centre": [0, 0, 2], "radius": 0.1, "radiance": [9, 9, 9]}}]}"#;

#[test]
fn a_light_plane_in_strips_has_the_bits_of_one_process() {
    let folder = TempDir::new().unwrap();
    let scene = folder.path().join("bulb.json");
    fs::write(&scene, BULB).unwrap();
    let alone = rendered_alone(&scene, folder.path(), "alone.exr", &["--spp", "2"]);
    let mut farm = Farm::start(None, &[]);
    farm.start_worker("first");
    farm.start_worker("second");
    farm.submit(&scene, &["--spp", "2", "--tile", "512"]);
    let together = rendered_by(&farm, folder.path());
    assert_same_bits(&together, &alone);
    assert_eq!(metadata(&together).counters, metadata(&alone).counters);
}

/// The bulb over a plate of glass, in a frame of 3840 x 2160 pixels: its light plane is four strips with two layers.
fn bulb_over_glass() -> String {
    let mut scene: serde_json::Value = serde_json::from_str(BULB).unwrap();
    scene["film"] = serde_json::json!({"width": 3840, "height": 2160});
    scene["materials"]["glass"] = serde_json::json!({"dielectric": {"index_of_refraction": 1.5}});
    let plate = serde_json::json!({"name": "plate", "material": "glass", "source": {"inline": {
        "positions": [[-0.1, -0.1, 0.5], [0.1, -0.1, 0.5], [0.1, 0.1, 0.5], [-0.1, 0.1, 0.5]],
        "triangles": [[0, 1, 2], [0, 2, 3]]}}});
    scene["meshes"].as_array_mut().unwrap().push(plate);
    scene.to_string()
}

#[test]
#[ignore = "takes minutes; `tests/run long` has it"]
fn the_light_plane_of_a_large_frame_takes_the_memory_that_is_documented() {
    let folder = TempDir::new().unwrap();
    let scene = folder.path().join("bulb.json");
    fs::write(&scene, bulb_over_glass()).unwrap();
    let farm = farm(folder.path(), 16 * MEBIBYTE);
    let mut submit = farm.command(&["submit", "--wait", "--spp", "4"]);
    succeeded(submit.arg(&scene).arg("--output").arg(folder.path().join("large.exr")));
    let coordinator = farm.coordinator_memory().resident;
    let worker = (0..2).map(|worker| farm.worker_memory(worker).resident).max().unwrap();
    println!("most memory: coordinator {} MiB, worker {} MiB", coordinator / MEBIBYTE, worker / MEBIBYTE);
    assert!(worker < 1_500_000_000, "a worker had {worker} bytes");
    assert!(coordinator < 2_100_000_000, "the coordinator had {coordinator} bytes");
}

#[test]
fn strips_that_cut_tiles_leave_the_bits_as_they_are() {
    // Rows for one block at a time: 16, of tiles of 24.
    let folder = TempDir::new().unwrap();
    let farm = farm(folder.path(), 256 << 10);
    let (scene, image) = (large_frame::scene(folder.path(), 100), folder.path().join("farm.exr"));
    let mut submit = farm.command(&["submit", "--wait", "--tile", "24"]);
    succeeded(submit.args(OPTIONS).arg(&scene).arg("--output").arg(&image));
    let alone = rendered_alone(&scene, folder.path(), "alone.exr", &[&OPTIONS[..], &["--tile", "24"]].concat());
    assert_same_bits(&image, &alone);
    let passes = clerestory_tests::exr_files::metadata(&image).tile_passes;
    assert_eq!(passes, vec![PASSES; 25]);
}
