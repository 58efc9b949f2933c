//! The way from Blender to a picture. The script of the chapel that ships makes it again, and two commands make a
//! picture of it with old panes in its windows.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use clap::Parser;
use clerestory_film::{DecodeBudget, FrameImage};
use clerestory_tests::farm::{clerestory, succeeded};
use serde_json::Value;

/// Makes the chapel again, compares it with the one that ships, and renders it.
#[derive(Parser)]
struct Arguments {
    /// A Python with the package bpy.
    #[arg(long)]
    python: PathBuf,
}

/// Panes of the chapel: three windows of eight, two of two, and four in the rose.
const PANES: usize = 32;

fn main() -> ExitCode {
    match run(&Arguments::parse().python) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            println!("WRONG: {problem}");
            ExitCode::FAILURE
        }
    }
}

fn run(python: &Path) -> Result<(), String> {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/chapel");
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let folder = temporary.path();
    let made = folder.join("chapel.glb");
    succeeded(Command::new(python).arg(scenes.join("chapel.py")).arg(&made));
    let [made, shipped] = [contents(&made)?, contents(&scenes.join("chapel.glb"))?];
    if made != shipped {
        return Err(format!("Blender makes another chapel: {made:#?}, and not {shipped:#?}"));
    }
    println!("Blender makes the same {} things", made.len());

    let report = succeeded(clerestory().current_dir(folder).args(["import", "chapel.glb", "--glaze", "Window*=crown"]));
    let report = String::from_utf8_lossy(&report.stdout).into_owned();
    print!("{report}");
    if !report.contains(&format!(" {PANES} panes,")) || report.contains("no pane") {
        return Err("not every window is glazed".to_owned());
    }
    let render = ["render", "chapel.json", "--png", "--size", "160x90", "--spp", "16"];
    succeeded(clerestory().current_dir(folder).args(render));
    let bytes = std::fs::read(folder.join("chapel.exr")).map_err(|error| error.to_string())?;
    let image = FrameImage::decode(&bytes, DecodeBudget { pixel_bytes: 1 << 24 }).map_err(|error| error.to_string())?;
    let lit = image.layers().mean.iter().filter(|pixel| pixel.iter().sum::<f32>() > 0.0).count();
    if lit * 2 < image.layers().mean.len() || !folder.join("chapel.png").exists() {
        return Err(format!("{lit} pixels of {} have light", image.layers().mean.len()));
    }
    println!("{lit} pixels of {} have light", image.layers().mean.len());
    Ok(())
}

/// The things of a GLB file by their names: triangles, material, extras, camera and light.
fn contents(file: &Path) -> Result<BTreeMap<String, String>, String> {
    let bytes = std::fs::read(file).map_err(|error| format!("{}: {error}", file.display()))?;
    let length = bytes.get(12..16).and_then(|length| length.try_into().ok()).map_or(0, u32::from_le_bytes) as usize;
    let text = bytes.get(20..20 + length).ok_or("no JSON in the GLB file")?;
    let file: Value = serde_json::from_slice(text).map_err(|error| error.to_string())?;
    let element = |list: &str, index: &Value| &file[list][index.as_u64().unwrap_or(u64::MAX) as usize];
    let nodes = file["nodes"].as_array().ok_or("no nodes")?;
    let things = nodes.iter().map(|node| {
        let primitives = element("meshes", &node["mesh"])["primitives"].as_array().map_or(&[][..], Vec::as_slice);
        let primitives = primitives.iter().map(|primitive| {
            let corners = element("accessors", &primitive["indices"])["count"].as_u64().unwrap_or(0);
            format!("{} triangles of {}", corners / 3, element("materials", &primitive["material"])["name"])
        });
        let parts: Vec<String> = primitives.collect();
        let [extras, camera, extensions] = ["extras", "camera", "extensions"].map(|member| node[member].to_string());
        (node["name"].to_string(), format!("{parts:?} {extras} {camera} {extensions}"))
    });
    Ok(things.collect())
}
