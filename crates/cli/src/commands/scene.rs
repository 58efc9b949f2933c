//! `clerestory scene`: scenes that are computed.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::{Args, Subcommand};
use clerestory_render_core::scene::SceneDescription;
use clerestory_render_core::scene::nave::{PaneCount, nave};
use serde::Serialize;
use serde_json::ser::{CompactFormatter, Formatter, PrettyFormatter};

use crate::failure::Failure;
use crate::output_file::write;
use crate::terminal::print_line;

/// Options of `clerestory scene`.
#[derive(Debug, Args)]
pub(crate) struct SceneArguments {
    #[command(subcommand)]
    scene: GeneratedScene,
}

/// Which scene.
#[derive(Debug, Subcommand)]
enum GeneratedScene {
    /// A stone nave with panes of old glass in its clerestory, through which the sun shines. The same windows are cut into
    /// more or fewer panes: for measuring what a pane costs.
    Nave(NaveArguments),
}

/// Options of `clerestory scene nave`.
#[derive(Debug, Args)]
struct NaveArguments {
    /// Panes of all four windows together: 4, 16, 64 or 256.
    #[arg(long, value_name = "N")]
    panes: PaneCount,
    /// The scene file to write [default: standard output].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(crate) fn run(arguments: &SceneArguments) -> Result<(), Failure> {
    let GeneratedScene::Nave(NaveArguments { panes, output }) = &arguments.scene;
    let text = scene_text(&nave(*panes));
    match output {
        Some(file) => write(file, format!("{text}\n").as_bytes()),
        None => print_line(&text),
    }
}

/// A scene as JSON, as people would write it: a line for each member, and arrays of numbers in one line.
fn scene_text(scene: &SceneDescription) -> String {
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, SceneFormatter::default());
    scene.serialize(&mut serializer).expect("a scene has a form in JSON");
    String::from_utf8(bytes).expect("JSON is text")
}

/// Objects with a line for each member; numbers of an array in one line, and arrays of arrays with a line for each.
#[derive(Default)]
struct SceneFormatter {
    objects: PrettyFormatter<'static>,
    /// Objects around the place of writing.
    depth: usize,
    /// Arrays around it, since the innermost object began.
    arrays: Vec<u32>,
}

impl SceneFormatter {
    fn arrays(&mut self) -> &mut u32 {
        if self.arrays.len() <= self.depth {
            self.arrays.resize(self.depth + 1, 0);
        }
        &mut self.arrays[self.depth]
    }
}

impl Formatter for SceneFormatter {
    fn begin_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth += 1;
        self.objects.begin_object(writer)
    }

    fn end_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth -= 1;
        self.objects.end_object(writer)
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        self.objects.begin_object_key(writer, first)
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.objects.begin_object_value(writer)
    }

    fn end_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.objects.end_object_value(writer)
    }

    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        *self.arrays() += 1;
        if *self.arrays() > 1 {
            write!(writer, "\n{:width$}", "", width = 2 * (self.depth + 1))?;
        }
        CompactFormatter.begin_array(writer)
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        *self.arrays() -= 1;
        CompactFormatter.end_array(writer)
    }
}
