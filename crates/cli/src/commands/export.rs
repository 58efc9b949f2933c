//! `clerestory export`: a scene as a folder of files that other programs read.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use clerestory_export::{Export, ExportSettings, Source};
use clerestory_render_core::document::SceneDescription;

use crate::activity::Activity;
use crate::failure::Failure;
use crate::output::print_line;
use crate::output_file::{create_folder, write};
use crate::progress::Progress;
use crate::scene_overrides::{LoadedScene, SamplingOverrides, SceneOverrides};
use crate::text::counted;

/// Options of `clerestory export`.
#[derive(Debug, Args)]
pub(crate) struct ExportArguments {
    /// The program for which the folder has a file of its own. Others read scene.json and the meshes.
    #[arg(long, value_enum, value_name = "PROGRAM")]
    to: Program,
    /// The scene file.
    scene: PathBuf,
    /// The folder to write, new or empty.
    folder: PathBuf,
    /// Largest distance of the triangles of a pane from its faces, metres.
    #[arg(long, value_name = "METRES", default_value_t = 1e-6)]
    tolerance: f64,
    #[command(flatten)]
    overrides: SceneOverrides,
}

/// Programs for which scenes are exported.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Program {
    /// Mitsuba 3: scene.xml.
    Mitsuba,
}

pub(crate) fn run(arguments: &ExportArguments) -> Result<(), Failure> {
    let ExportArguments { to: Program::Mitsuba, scene: file, folder, tolerance, overrides } = arguments;
    check_folder(folder)?;
    let activity = Activity::begin("Reading the scene and its files");
    let LoadedScene { bundle, .. } = overrides.load(file, SamplingOverrides::default())?;
    let prepared = activity.build(&bundle).map_err(|source| Failure::scene(file, source))?;
    // With the things of imports among its own.
    let description: &SceneDescription = prepared.description();
    let source = Source {
        name: &description.name,
        parts: description.parts(),
        assets: bundle.assets(),
        scene: prepared.scene(),
        max_depth: description.integrator.max_depth(),
        path_filter: description.path_filter.as_deref(),
    };
    activity.step("Writing the files".to_owned());
    let export = Export::new(&source, &ExportSettings { tolerance: *tolerance });
    let export = export.map_err(|source| Failure::Export { file: file.clone(), source })?;
    create_folder(folder)?;
    let mut files = 0;
    let written = export.write(|name, bytes| {
        let place = folder.join(name);
        place.parent().map_or(Ok(()), create_folder)?;
        files += 1;
        write(&place, bytes)
    })?;
    activity.done("The scene is exported");
    Progress::new().import_notes(prepared.import_notes());
    for note in export.notes() {
        Progress::new().note(&format!("Note: {note}"));
    }
    if written.omitted_triangles > 0 {
        let triangles = counted(written.omitted_triangles, "triangle has", "triangles have");
        Progress::new().note(&format!("Note: {triangles} no area in single precision and are left out"));
    }
    let triangles = counted(written.triangles, "triangle", "triangles");
    print_line(&format!("Wrote {}: {files} files, {triangles}", folder.display()))
}

/// Refuses a folder with files in it, of which a program would read those that are left over.
fn check_folder(folder: &Path) -> Result<(), Failure> {
    let refused = |kind, message: &str| {
        Err(Failure::Write { file: folder.to_owned(), source: io::Error::new(kind, message.to_owned()) })
    };
    match fs::read_dir(folder).map(|mut entries| entries.next().is_some()) {
        Ok(true) => refused(ErrorKind::DirectoryNotEmpty, "there are files in it: expected a new or an empty folder"),
        Ok(false) => Ok(()),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) if error.kind() == ErrorKind::NotADirectory => {
            refused(error.kind(), "is a file, expected the name of a folder")
        }
        Err(source) => Err(Failure::Write { file: folder.to_owned(), source }),
    }
}
