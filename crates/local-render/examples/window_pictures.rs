//! Renders the pictures of windows in `docs/images`: `cargo run --release -p clerestory-local-render --example
//! window_pictures -- docs/images/windows.json [NAME...]`.
//!
//! The file lists plates. A plate is a table of cells, each a window in one and the same place, seen from inside. Names
//! choose plates; without, all are rendered. Pictures are written beside the file, and files that a window names, such
//! as a mask of paint, are read from there.

use std::error::Error;
use std::path::Path;

use clerestory_film::{Exposure, PreviewSettings, ToneCurve, encode_pixels};
use clerestory_local_render::{Control, LocalFilm, PassPlan, Provenance, image};
use clerestory_render_core::document::{SceneBundle, SceneDescription, asset_names};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::scene::{Asset, Assets};
use serde_json::{Map, Value, json};

/// Width of the gaps between cells, pixels, and their radiance.
const GAP: (usize, f32) = (4, 0.02);

/// Edge of the tiles, pixels.
const TILE: u32 = 32;

/// Samples of a pass.
const PASS: u32 = 16;

type Fault = Box<dyn Error>;

/// One picture.
struct Plate<'a> {
    settings: &'a Value,
    columns: usize,
    size: [u32; 2],
    cells: &'a [Value],
}

fn main() -> Result<(), Fault> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("the first argument must be the file of the plates")?;
    let chosen: Vec<String> = arguments.collect();
    let folder = Path::new(&file).parent().unwrap_or(Path::new("."));
    let plates: Map<String, Value> = serde_json::from_str(&std::fs::read_to_string(&file)?)?;
    for (name, settings) in plates.iter().filter(|(name, _)| chosen.is_empty() || chosen.contains(name)) {
        let picture =
            Plate::read(settings).ok_or_else(|| format!("{name}: no columns, size or cells"))?.render(folder)?;
        let target = folder.join(format!("{name}.png"));
        std::fs::write(&target, &picture)?;
        eprintln!("{}: {} kB", target.display(), picture.len() / 1000);
    }
    Ok(())
}

impl<'a> Plate<'a> {
    fn read(settings: &'a Value) -> Option<Self> {
        let [width, height] = [0, 1].map(|edge| settings["size"][edge].as_u64());
        Some(Self {
            settings,
            columns: settings["columns"].as_u64()? as usize,
            size: [width? as u32, height? as u32],
            cells: settings["cells"].as_array()?,
        })
    }

    /// The PNG of all cells.
    fn render(&self, folder: &Path) -> Result<Vec<u8>, Fault> {
        let [width, height] = self.size.map(|edge| edge as usize);
        let (gap, grey) = GAP;
        let rows = self.cells.len().div_ceil(self.columns);
        let across = self.columns * (width + gap) - gap;
        let down = rows * (height + gap) - gap;
        let mut pixels = vec![[grey; 3]; across * down];
        for (number, cell) in self.cells.iter().enumerate() {
            eprintln!("cell {} of {}", number + 1, self.cells.len());
            let [left, top] = [number % self.columns * (width + gap), number / self.columns * (height + gap)];
            for (row, line) in self.render_cell(cell, folder)?.chunks(width).enumerate() {
                let start = (top + row) * across + left;
                pixels[start..start + width].copy_from_slice(line);
            }
        }
        let stops = self.settings["stops"].as_f64().unwrap_or(0.0);
        let look = PreviewSettings { exposure: Exposure::Stops(stops), curve: ToneCurve::Filmic };
        Ok(encode_pixels(across as u32, down as u32, &pixels, &look)?)
    }

    fn render_cell(&self, cell: &Value, folder: &Path) -> Result<Vec<[f32; 3]>, Fault> {
        let scene = self.scene(cell).to_string();
        let description = SceneDescription::parse(scene.as_bytes())?;
        let mut assets = Assets::new();
        for name in asset_names(&description) {
            assets.insert(name.to_owned(), Asset::new(std::fs::read(folder.join(name))?));
        }
        let scene = PreparedScene::build(&SceneBundle::from_parts(description, assets)?)?;
        let grid = scene.description().grid(TILE);
        let samples = self.settings["samples"].as_u64().unwrap_or(64) as u32;
        let tile_passes = vec![samples.div_ceil(PASS); grid.len() as usize];
        let plan = PassPlan { frame: 0, grid, sampling: scene.sampling(), tile_passes, adaptation: None };
        let (mut film, control) = (LocalFilm::new(&scene, &plan), Control::default());
        for _ in 0..samples.div_ceil(PASS) {
            film.render_pass(&control)?;
        }
        let provenance =
            Provenance { build: env!("CARGO_PKG_VERSION"), counters: film.counters, elapsed: None, assumptions: &[] };
        Ok(image(&scene, &plan, &film.sums()?, &provenance)?.layers().mean.clone())
    }

    /// A wall with the window in it, and trees before the window, whose trunks show what the glass does. The wall is
    /// dark, as it is in photographs that are exposed for glass.
    fn scene(&self, cell: &Value) -> Value {
        let settings = self.settings;
        let mut scene = self.stage(cell);
        merge(&mut scene, &settings["scene"]);
        scene
    }

    fn stage(&self, cell: &Value) -> Value {
        let settings = self.settings;
        let sill = settings["sill"].as_f64().unwrap_or(0.35);
        let mut window = json!({"name": "window", "x_axis": [1, 0, 0], "sill": [0, 0, sill]});
        for part in [&settings["window"], cell] {
            merge(&mut window, part);
        }
        window["design"]["wall"] = json!({
            "left": 3, "right": 3, "below": sill + 0.02, "above": 1.5, "inside": 0.25, "outside": 0.2, "splay": 25,
            "outer_splay": 15
        });
        let mut camera = json!({"up": [0, 0, 1]});
        merge(&mut camera, &settings["camera"]);
        let matt = |colour: [f64; 3]| json!({"diffuse": {"reflectance": {"colour": colour}}});
        let quad = |name: &str, material: &str, corners: [[f64; 3]; 4]| {
            let source = json!({"inline": {"positions": corners, "triangles": [[0, 1, 2], [0, 2, 3]]}});
            json!({"name": name, "material": material, "source": source})
        };
        let level = |name: &str, material: &str, x: f64, [near, far]: [f64; 2], z: f64| {
            quad(name, material, [[-x, near, z], [x, near, z], [x, far, z], [-x, far, z]])
        };
        let mut meshes = vec![
            level("floor", "flagstones", 4.0, [-5.0, 0.2], 0.0),
            level("lawn", "grass", 300.0, [0.6, 600.0], -0.6),
        ];
        meshes.extend((0..70).map(|number: u32| {
            // Spread without a pattern by multiples of irrational numbers.
            let part = |factor: f64| (f64::from(number) * factor).fract();
            let (x, y) = (70.0 * part(0.618_034) - 35.0, 12.0 + 26.0 * part(0.754_878));
            let (half, top) = (0.1 + 0.15 * part(0.569_84), 3.0 + 6.0 * part(0.331));
            let name = format!("trunk {number}");
            let tip = 0.4 * half;
            quad(&name, "bark", [[x - half, y, -0.6], [x + half, y, -0.6], [x + tip, y, top], [x - tip, y, top]])
        }));
        json!({
            "version": 2, "name": "a window", "seed": 1, "film": {"width": self.size[0], "height": self.size[1]},
            "camera": {"perspective": camera}, "integrator": {"fnee": {"max_depth": 4}},
            "sampling": {"samples_per_pass": PASS, "samples_per_block": 4 * PASS},
            "materials": {
                "flagstones": matt([0.24, 0.21, 0.18]), "grass": matt([0.12, 0.2, 0.06]),
                "bark": matt([0.06, 0.07, 0.04]), "limewashed wall": matt([0.2, 0.185, 0.16]),
                "tracery stone": matt([0.2, 0.185, 0.16])
            },
            "meshes": meshes, "windows": [window],
            "lights": [
                {"sun": {
                    "name": "sun", "direction": settings.get("sun").cloned().unwrap_or(json!([0.42, 0.72, 0.55])),
                    "angular_radius": 0.27, "radiance": [41000, 37000, 31000]}},
                {"environment": {"name": "sky", "radiance": {"colour": [0.38, 0.45, 0.56]}}}
            ]
        })
    }
}

/// Objects of which members are set one by one.
const SET_ONE_BY_ONE: [&str; 2] = ["design", "materials"];

/// Sets the members of one object in another.
fn merge(into: &mut Value, from: &Value) {
    for (name, value) in from.as_object().into_iter().flatten() {
        if SET_ONE_BY_ONE.contains(&name.as_str()) {
            merge(&mut into[name], value);
        } else {
            into[name] = value.clone();
        }
    }
}
