//! `clerestory scene`: computed scenes.

use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use clerestory_render_core::document::chapel::{Chapel, chapel};
use clerestory_render_core::document::nave::{PaneCount, nave, nave_with_diamonds};
use clerestory_render_core::document::water::{TriangleCount, WaterSettings, WaterView, lagoon, pool};

use super::window::WindowArguments;
use crate::failure::Failure;
use crate::output::print_line;
use crate::output_file::{check_outputs, write};
use crate::scene_text::scene_text;

/// Options of `clerestory scene`.
#[derive(Debug, Args)]
pub(crate) struct SceneArguments {
    #[command(subcommand)]
    scene: GeneratedScene,
}

/// Which scene.
#[derive(Debug, Subcommand)]
enum GeneratedScene {
    /// A stone nave whose clerestory windows have old glass, in the sun: diamonds in lead, or more or fewer panes into
    /// which the same windows are cut, to measure the cost of a pane.
    Nave(NaveArguments),
    /// A swimming pool in the sun, with balls afloat, to measure the cost of a triangle of water, and for animations.
    Pool(WaterArguments),
    /// A lagoon with sand and stones in the sun.
    Lagoon(WaterArguments),
    /// A chapel with stained glass to the east, and diamonds behind protective panes to the south.
    Chapel(ChapelArguments),
    /// A leaded window in a room, in the sun; or its drawing.
    Window(Box<WindowArguments>),
}

/// Options of `clerestory scene nave`.
#[derive(Debug, Args)]
struct NaveArguments {
    #[command(flatten)]
    glass: NaveGlass,
    /// The scene file to write [default: standard output].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// What is in the windows of the nave.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct NaveGlass {
    /// Leaded windows of diamonds.
    #[arg(long)]
    diamonds: bool,
    /// Panes of all four windows together: 4, 16, 64 or 256.
    #[arg(long, value_name = "N")]
    panes: Option<PaneCount>,
}

/// Options of `clerestory scene chapel`.
#[derive(Debug, Args)]
struct ChapelArguments {
    /// The scene file to write. The pictures of its stone and wood come beside it.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Options of `clerestory scene pool` and `clerestory scene lagoon`.
#[derive(Debug, Args)]
struct WaterArguments {
    /// Triangles of the water's surface, approximately, 8 to 20000000.
    #[arg(long, value_name = "N", default_value = "100000")]
    triangles: TriangleCount,
    /// The time of the waves, seconds: the frames of an animation are one scene each.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds, allow_negative_numbers = true)]
    time: f64,
    /// The view.
    #[arg(long, value_enum, default_value_t = View::Above)]
    view: View,
    /// The scene file to write [default: standard output].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// The view of the water.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum View {
    /// From above the surface.
    Above,
    /// From below the surface.
    Below,
    /// The floor alone, with the light that reaches it through the surface, to compare methods.
    Floor,
}

impl WaterArguments {
    fn settings(&self) -> WaterSettings {
        let view = match self.view {
            View::Above => WaterView::Above,
            View::Below => WaterView::Below,
            View::Floor => WaterView::Floor,
        };
        WaterSettings { triangles: self.triangles, time: self.time, view }
    }
}

fn seconds(words: &str) -> Result<f64, String> {
    words
        .parse()
        .ok()
        .filter(|time: &f64| time.abs() <= LATEST)
        .ok_or_else(|| format!("found {words}, expected a number of seconds from -{LATEST} to {LATEST}"))
}

/// Largest time in either direction, seconds.
const LATEST: f64 = 1e9;

/// Writes the chapel and the pictures that it names.
pub(crate) fn write_chapel(file: &Path) -> Result<(), Failure> {
    let Chapel { scene, files } =
        chapel().map_err(|error| Failure::Write { file: file.to_owned(), source: io::Error::other(error) })?;
    let pictures: Vec<(PathBuf, Vec<u8>)> =
        files.into_iter().map(|(name, bytes)| (file.with_file_name(name), bytes)).collect();
    let outputs = pictures.iter().map(|(picture, _)| ("--output", Some(picture.as_path())));
    check_outputs(&outputs.chain([("--output", Some(file))]).collect::<Vec<_>>(), &[])?;
    pictures.iter().try_for_each(|(picture, bytes)| write(picture, bytes))?;
    write(file, format!("{}\n", scene_text(&scene)).as_bytes())
}

pub(crate) fn run(arguments: &SceneArguments) -> Result<(), Failure> {
    let (scene, output) = match &arguments.scene {
        GeneratedScene::Nave(NaveArguments { glass, output }) => {
            (glass.panes.map_or_else(nave_with_diamonds, nave), output)
        }
        GeneratedScene::Chapel(ChapelArguments { output }) => return write_chapel(output),
        GeneratedScene::Pool(water) => (pool(&water.settings()), &water.output),
        GeneratedScene::Lagoon(water) => (lagoon(&water.settings()), &water.output),
        GeneratedScene::Window(window) => return window.run(),
    };
    check_outputs(&[("--output", output.as_deref())], &[])?;
    let text = scene_text(&scene);
    match output {
        Some(file) => write(file, format!("{text}\n").as_bytes()),
        None => print_line(&text),
    }
}
