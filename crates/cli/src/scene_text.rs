//! Scene files as people read them.

use std::io::{self, Write};

use clerestory_render_core::document::SceneDescription;
use serde::Serialize;
use serde_json::ser::{CompactFormatter, Formatter, PrettyFormatter};

/// A scene as readable JSON: a line for each member, and arrays of numbers in one line.
pub(crate) fn scene_text(scene: &SceneDescription) -> String {
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, SceneFormatter::default());
    scene.serialize(&mut serializer).expect("a scene has a form in JSON");
    String::from_utf8(bytes).expect("JSON is text")
}

/// Objects have a line for each member, arrays of numbers one line, and arrays of arrays a line for each.
#[derive(Default)]
struct SceneFormatter {
    objects: PrettyFormatter<'static>,
    /// Depth of nested objects.
    depth: usize,
    /// Depth of nested arrays within each object.
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
