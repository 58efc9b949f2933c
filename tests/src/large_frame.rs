//! Frames that are far larger than what a coordinator may have in memory: a scene for them, and whether what comes out
//! is right.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clerestory_film::{FilmTile, ImageRows, LayerChoice, NodeAddress, Sampling, TileGrid, TileSum};
use clerestory_render_core::document;
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::integrator::render_node;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::exr_files::{metadata, rows};

/// Passes of every tile: the fewest with which an image has a standard error, and so all layers.
pub const PASSES: u32 = 2;

/// The options that ask for them.
pub const OPTIONS: [&str; 4] = ["--spp", "2", "--integrator", "path"];

/// Bytes of a pixel of such an image: all layers, uncompressed.
pub const PIXEL_BYTES: u64 = 68;

/// A shipped scene with an image of this size, with one sample in a pass and a block.
///
/// # Panics
///
/// When it cannot be written into the folder.
pub fn scene(folder: &Path, edge: u32) -> PathBuf {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/four-panes.json");
    let text = std::fs::read_to_string(shipped).expect("the scene is shipped");
    let mut description: Value = serde_json::from_str(&text).expect("JSON");
    description["film"] = json!({"width": edge, "height": edge});
    // Obliquely and askew, so that no two tiles are the same distance away.
    description["camera"] = json!({"perspective": {
        "position": [0.1, -0.6, -0.3], "look_at": [0.05, 0, -1], "up": [0.3, 0, 1], "vertical_field_of_view": 35
    }});
    // So large that tiles have lit samples, of which `path` must find the lamp by chance.
    description["lights"][0]["sphere"]["radius"] = json!(0.6);
    description["integrator"] = json!({"path": {}});
    description["sampling"] = json!({"samples_per_pass": 1, "samples_per_block": 1});
    let file = folder.join(format!("four-panes-{edge}.json"));
    std::fs::write(&file, description.to_string()).expect("a writable folder");
    file
}

/// Compares an image of such a scene, rendered in tiles of this edge, with a render in this process. Size and passes
/// must agree, and in some tiles all layers, bit for bit.
///
/// # Errors
///
/// The first difference.
///
/// # Panics
///
/// When the file is no image, or the scene cannot be rendered.
pub fn check(image: &Path, scene_file: &Path, tile_size: u32, tiles: &[u32]) -> Result<(), String> {
    let scene = PreparedScene::build(&document::load(scene_file).expect("a scene")).expect("a scene that can be built");
    let grid = scene.description().grid(tile_size);
    let found = metadata(image);
    if (found.tile_size, found.tile_passes.len()) != (tile_size, grid.len() as usize) {
        return Err(format!("{} tiles of {} pixels", found.tile_passes.len(), found.tile_size));
    }
    if let Some((tile, passes)) = (0..).zip(&found.tile_passes).find(|(_, passes)| **passes != PASSES) {
        return Err(format!("tile {tile}: {passes} passes"));
    }
    let samples = u64::from(grid.width) * u64::from(grid.height) * u64::from(PASSES);
    if found.counters.samples != samples {
        return Err(format!("{} samples are counted and not {samples}", found.counters.samples));
    }
    let sums: Vec<TileSum> = tiles.par_iter().map(|tile| tile_sum(&scene, &grid, *tile)).collect();
    for sum in sums {
        let area = sum.tile;
        let mut strip = ImageRows::new(grid, area.y..area.y + area.height, LayerChoice::all(true));
        strip.fill(&sum).expect("a tile of the image");
        let (expected, found) = (channels(&strip), rows(image, area.y as usize..(area.y + area.height) as usize));
        if !expected.keys().eq(found.keys()) {
            return Err(format!("channels {:?} and not {:?}", found.keys(), expected.keys()));
        }
        for (name, expected) in expected {
            for (line, (expected, found)) in
                expected.chunks(grid.width as usize).zip(found[&name].chunks(grid.width as usize)).enumerate()
            {
                let columns = area.x as usize..(area.x + area.width) as usize;
                if expected[columns.clone()] != found[columns] {
                    return Err(format!("tile {}, channel {name}, line {line}: other bits", sum.tile_index));
                }
            }
        }
    }
    Ok(())
}

/// What this process renders of a tile.
fn tile_sum(scene: &PreparedScene, grid: &TileGrid, tile: u32) -> TileSum {
    let sampling: Sampling = scene.sampling();
    let mut film = FilmTile::new(0, tile, grid.tile(tile).expect("a tile of the image"), sampling);
    for index in 0..PASSES {
        let address = NodeAddress { frame: 0, tile, level: 0, index };
        let rendered = render_node(scene, grid, address, &AtomicBool::new(false)).expect("a tile that can be rendered");
        film.insert(rendered.node).expect("a pass that is not there yet");
    }
    film.sum(PASSES).expect("all passes")
}

/// The bits of rows by channel, as a file has them.
fn channels(strip: &ImageRows) -> BTreeMap<String, Vec<u32>> {
    let layers = strip.layers();
    let mut channels = BTreeMap::new();
    let mut triples = |prefix: &str, names: [&str; 3], values: &[[f32; 3]]| {
        for (index, name) in names.into_iter().enumerate() {
            let bits = values.iter().map(|value| value[index].to_bits()).collect();
            channels.insert(format!("{prefix}{name}"), bits);
        }
    };
    let (rgb, xyz) = (["R", "G", "B"], ["X", "Y", "Z"]);
    triples("", rgb, &layers.mean);
    layers.standard_error.iter().for_each(|errors| triples("stderr.", rgb, errors));
    layers.caustic.iter().for_each(|caustic| triples("caustic.", rgb, caustic));
    layers.albedo.iter().for_each(|albedo| triples("albedo.", rgb, albedo));
    layers.normal.iter().for_each(|normal| triples("normal.", xyz, normal));
    if let Some(depth) = &layers.depth {
        channels.insert("depth.Z".to_owned(), depth.iter().map(|depth| depth.to_bits()).collect());
    }
    if let Some(samples) = &layers.samples {
        channels.insert("samples".to_owned(), samples.clone());
    }
    channels
}
