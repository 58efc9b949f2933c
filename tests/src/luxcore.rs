//! LuxCore as a peer: it renders scenes that `clerestory export` wrote, in the core time that ours get.
//!
//! A picture's noise is half the squared difference of two of them. So what LuxCore lacks or renders in another way
//! counts for nothing.

use std::fs;
use std::path::Path;
use std::process::Command;

use clerestory_film::metrics::RELATIVE_EPSILON;
use clerestory_local_render::Clocks;
use clerestory_render_core::document::SceneBundle;
use clerestory_render_core::integrator::PreparedScene;
use glam::DVec3;
use tempfile::TempDir;

use crate::farm::{clerestory, succeeded};
use crate::rendering::Rendering;

/// What renders a picture.
const SCRIPT: &str = include_str!("luxcore/render.py");

/// The engines that find light through glass, all with Metropolis sampling. `HYBRID` is `PATHCPU` with light tracing
/// for caustics.
pub const ENGINES: [&str; 4] = ["LIGHTCPU", "BIDIRCPU", "PATHCPU", "HYBRID"];

/// The noise of pictures, over the pixels that count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Mean squared error.
    pub mse: f64,
    /// The same over the square of each pixel.
    pub relative: f64,
}

/// A scene in a folder, exported.
#[derive(Debug)]
pub struct Exported {
    folder: TempDir,
}

impl Exported {
    /// Exports a scene by the command. Faces of panes may be off by `tolerance`, metres.
    ///
    /// # Panics
    ///
    /// When the command fails.
    pub fn new(bundle: &SceneBundle, tolerance: f64) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("scene.json");
        let text = serde_json::to_string(bundle.description()).expect("a scene file");
        fs::write(&file, text).expect("the scene can be written");
        for (name, asset) in bundle.assets() {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("a file in the folder")).expect("its folder");
            fs::write(path, asset.bytes()).expect("its files can be written");
        }
        let exported = folder.path().join("exported");
        let tolerance = tolerance.to_string();
        let mut command = clerestory();
        succeeded(command.args(["export", "--to", "mitsuba", "--tolerance", &tolerance]).arg(&file).arg(&exported));
        Self { folder }
    }

    /// Renders it by an engine, for a time of one core.
    ///
    /// # Panics
    ///
    /// When LuxCore fails.
    pub fn render(&self, python: &Path, engine: &str, seed: u32, core_seconds: f64) -> Vec<DVec3> {
        let exported = self.folder.path().join("exported");
        let [script, output] = ["render.py", "picture"].map(|name| self.folder.path().join(name));
        fs::write(&script, SCRIPT).expect("the script can be written");
        let mut command = Command::new(python);
        command.arg(&script).arg(exported).arg(&output).args([engine, &seed.to_string(), &core_seconds.to_string()]);
        succeeded(&mut command);
        let bytes = fs::read(&output).expect("a picture");
        let values: Vec<f64> = bytes
            .chunks_exact(4)
            .map(|value| f64::from(f32::from_le_bytes([value[0], value[1], value[2], value[3]])))
            .collect();
        values.chunks_exact(3).map(DVec3::from_slice).collect()
    }
}

/// Renders a scene by one of our integrators on one thread, for a time of it.
///
/// # Panics
///
/// When the scene cannot be rendered.
pub fn ours(bundle: &SceneBundle, core_seconds: f64) -> Vec<DVec3> {
    let scene = PreparedScene::build(bundle).expect("the scene can be built");
    let thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    thread.install(|| {
        let clocks = Clocks::of_this_thread();
        let mut rendering = Rendering::new(&scene);
        while rendering.passes() == 0 || clocks.spent(1).core.as_secs_f64() < core_seconds {
            rendering.render_pass().expect("finite samples");
        }
        rendering.image().pixels
    })
}

/// The noise of two pictures by one method, over the pixels that count. Relative errors are those to `mean`.
pub fn noise([a, b]: &[Vec<DVec3>; 2], mean: &[DVec3], counts: &[bool]) -> Noise {
    let pixels = counts.iter().filter(|counts| **counts).count() as f64;
    let level = mean.iter().map(|pixel| pixel.element_sum() / 3.0).sum::<f64>() / mean.len() as f64;
    let mut sums = Noise { mse: 0.0, relative: 0.0 };
    for (index, _) in counts.iter().enumerate().filter(|(_, counts)| **counts) {
        let apart = a[index] - b[index];
        let squares = apart * apart * 0.5;
        let light = mean[index] * mean[index] + DVec3::splat(RELATIVE_EPSILON * level * level);
        sums.mse += squares.element_sum() / (3.0 * pixels);
        sums.relative += (squares / light).element_sum() / (3.0 * pixels);
    }
    sums
}
