//! `clerestory import`: a scene file around a file of another program.

use std::path::{Path, PathBuf};

use clap::Args;
use clerestory_render_core::document::{ModelScene, is_model, scene_around};
use clerestory_render_core::scene::MeshSurface;
use clerestory_render_core::scene::import::{Expansion, LeadingRule};

use crate::activity::Activity;
use crate::failure::Failure;
use crate::model_options::{FileOptions, Glaze, MaterialChoice};
use crate::output::print_line;
use crate::output_file::{check_outputs, write};
use crate::scene_text::scene_text;

/// Most names in a line of the report.
const MOST_NAMES: usize = 8;

/// Options of `clerestory import`.
#[derive(Debug, Args)]
pub(crate) struct ImportArguments {
    /// The glTF (.glb, .gltf) or OBJ file.
    file: PathBuf,
    /// The scene file to write, in the folder of the file [default: the file's name with .json].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Make windows of what has such a name. Panes are `PATTERN=PROFILE[,thickness=METRES][,colour=#RRGGBB][,seed=N]`,
    /// with the profiles crown, cylinder, hammered and flat. Leaded windows are
    /// `PATTERN=FILLING[,quarry=WxH][,glass=COLOUR+...][,sheet=NAME][,seed=N]`, with the fillings diamonds,
    /// rectangles, roundels, border and plain, and the sheets crown, cylinder, hammered, bullion and flat. `*` in a
    /// pattern stands for any text. Can be given several times.
    #[arg(long, value_name = "PATTERN=GLASS")]
    glaze: Vec<Glaze>,
    /// Give what has such a name another material: a colour such as #d8d0c0, mirror, glass, water, or JSON as in a
    /// scene file. Can be given several times.
    #[arg(long, value_name = "PATTERN=MATERIAL")]
    material: Vec<MaterialChoice>,
    #[command(flatten)]
    options: FileOptions,
}

pub(crate) fn run(arguments: &ImportArguments) -> Result<(), Failure> {
    let file = &arguments.file;
    if !is_model(file) {
        return Err(Failure::Usage(format!(
            "{}: expected a file whose name ends in .glb, .gltf or .obj",
            file.display()
        )));
    }
    let output = arguments.output.clone().unwrap_or_else(|| file.with_extension("json"));
    check_outputs(&[("--output", Some(&output))], &[("the file", Some(file))])?;
    check_folder(file, &output)?;
    let mut options = arguments.options.model();
    for glaze in &arguments.glaze {
        match glaze {
            Glaze::Panes(rule) => options.glaze.push(rule.clone()),
            Glaze::Lead(rule) => options.lead.push(LeadingRule::clone(rule)),
        }
    }
    options.materials =
        arguments.material.iter().map(|MaterialChoice(rule, material)| (rule.clone(), material.clone())).collect();
    let activity = Activity::begin("Reading the file");
    let model = scene_around(file, &options).map_err(|source| Failure::scene(file, source))?;
    // What is built now needs no second command to show that it cannot be.
    let scene = activity.build(&model.bundle).map_err(|source| Failure::scene(file, source))?;
    activity.done("The scene is ready");
    write(&output, format!("{}\n", scene_text(model.bundle.description())).as_bytes())?;
    let count = |mesh: &MeshSurface| u64::from(mesh.triangles()) + u64::from(mesh.omitted_triangles());
    let triangles = scene.scene().meshes().iter().map(count).sum();
    let size = scene.scene().bounds().map(|[min, max]| (max - min).to_array());
    report(&model, triangles, size, &output)
}

/// A scene file names files of its own folder alone.
fn check_folder(file: &Path, output: &Path) -> Result<(), Failure> {
    let folder = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::canonicalize(folder).map_err(|source| Failure::Read { file: folder.to_owned(), source })
    };
    if folder(file)? == folder(output)? {
        return Ok(());
    }
    Err(Failure::Usage(format!(
        "--output {}: a scene file stands in the folder of the files that it names; expected {}",
        output.display(),
        file.with_file_name(output.file_name().unwrap_or_default()).display()
    )))
}

fn report(model: &ModelScene, triangles: u64, size: Option<[f64; 3]>, output: &Path) -> Result<(), Failure> {
    let Expansion { meshes, materials, panes, leaded, leaded_windows, lights, cameras, windows, .. } = &model.expansion;
    print_line(&format!(
        "{}: {} meshes of {triangles} triangles, {} materials, {} panes, {} lights and {} cameras of the file",
        output.display(),
        meshes.len(),
        materials.len(),
        panes.len(),
        lights.len(),
        cameras.len()
    ))?;
    if *leaded_windows > 0 {
        print_line(&format!("- {leaded_windows} leaded windows of {} pieces of glass", leaded.panes.len()))?;
    }
    if let Some([x, y, z]) = size {
        print_line(&format!("- It is {x:.2} x {y:.2} m wide and {z:.2} m high, unless --unit or --up say otherwise"))?;
    }
    for line in model.expansion.remarks().chain(model.assumptions.iter().cloned()) {
        print_line(&format!("- {line}"))?;
    }
    if !windows.is_empty() {
        print_line("Names worth glazing, with --glaze 'NAME=crown':")?;
        for window in windows.iter().take(MOST_NAMES) {
            print_line(&format!("- {}: {} that can become panes", window.name, window.panes))?;
        }
        if windows.len() > MOST_NAMES {
            print_line(&format!("- and {} more", windows.len() - MOST_NAMES))?;
        }
    }
    Ok(())
}
